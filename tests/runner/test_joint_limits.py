"""Joint limits: a run that passes one ends there, with status, quantity and time, and disturbs no other."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from springline.codegen.kernel import LoopSettings
from springline.model.drive import friction_parameters
from springline.model.mechanisms import TAKEN
from springline.runner import batch, load_scenario, simulate
from springline.runner.cli import app
from springline.runner.files import InputError

INF = math.inf
SHORT = {"simulation.duration": 0.6, "simulation.output_every": 1}
# The lift goes from 0.8 m to 1 m; zero, where ended lanes go on, is beyond the limits too.
LIMITS = [[0.2, 0.95], [-INF, INF]]


def limited(limits: Any = LIMITS, **changes: Any) -> Any:
    return load_scenario("paper/nominal", SHORT | {"mechanism.limits": limits} | changes)


@pytest.mark.parametrize(
    "mode", [{}, {"control.mode": "sampled", "control.period": 1e-3}], ids=["continuous", "sampled"]
)
@pytest.mark.parametrize("engine", ["lanes", "casadi"])
def test_a_run_ends_before_the_first_state_beyond_a_limit(engine: Any, mode: dict[str, Any]) -> None:
    free = simulate(load_scenario("paper/nominal", SHORT | mode), engine=engine).trajectory
    t, lift = (free[name].to_numpy() for name in ("t", "q1_lift"))
    beyond = int(np.argmax(lift > 0.95))
    result = simulate(limited(**mode), engine=engine)
    assert result.status == "out_of_limits"
    assert result.metrics["t_end"][0].as_py() == t[beyond - 1]
    assert result.trajectory == free.slice(0, beyond)
    assert result.message == (
        f"out_of_limits: q1_lift left its limits (0.2 <= q1_lift <= 0.95) at t = {t[beyond]:g} s; "
        f"results end at t = {t[beyond - 1]:g} s"
    )
    row = result.metrics.to_pylist()[0]
    assert row["settling_time_lift"] is None and row["chatter_lift"] is None and row["iae_lift"] > 0


def test_the_least_position_and_the_other_joint_are_looked_at_too() -> None:
    turned = simulate(limited([[-INF, INF], [0.2, INF]], **{"reference.rotation.offset": -1.0}))
    assert turned.message.startswith("out_of_limits: q1_rotation left its limits (0.2 <= q1_rotation <= inf)")
    assert turned.trajectory["q1_rotation"].to_numpy().min() >= 0.2


def test_limits_that_are_not_reached_change_nothing() -> None:
    free, wide = simulate(load_scenario("paper/nominal", SHORT)), simulate(limited([[-5.0, 5.0], [-5.0, 5.0]]))
    assert wide.trajectory == free.trajectory and wide.status == "ok"
    assert limited([[-INF, INF], [-INF, INF]]).limits == ()


def test_runs_that_end_at_a_limit_disturb_no_other() -> None:
    """Of packs in which some runs end, at different times, and some do not."""
    amplitudes = np.linspace(0.05, 1.0, 37)
    table = batch(limited(), {"reference.lift.terms.0.amplitude": amplitudes}, jobs=1).to_pylist()
    ends = [row["status"] for row in table]
    assert 5 < ends.count("out_of_limits") < 32 and ends.count("ok") == 37 - ends.count("out_of_limits")
    for number in (0, 9, 17, 18, 26, 36):
        alone = simulate(limited(**{"reference.lift.terms.0.amplitude": float(amplitudes[number])})).metrics
        assert {name: table[number][name] for name in alone.column_names} == alone.to_pylist()[0]


@pytest.mark.parametrize(
    ("limits", "place", "text"),
    [
        ([[0.2, 0.95]], "mechanism.limits", "expected a pair [low, high] with low < high for each joint"),
        ([[0.2, 0.95], [1.0, 1.0]], "mechanism.limits.1", "expected [low, high] with low < high [rad]"),
        ([[0.95, 0.2], [0.0, 1.0]], "mechanism.limits.0", "got [0.95, 0.2]"),
        ([[math.nan, 0.2], [0.0, 1.0]], "mechanism.limits.0", "expected [low, high] with low < high [m]"),
        ([[0.2, "far"], [0.0, 1.0]], "mechanism.limits.0", "expected [low, high] with low < high [m]"),
        ([[0.2, 0.5], [0.0, 1.0]], "initial.q.0", "expected a start within mechanism.limits.0, 0.2 to 0.5, got 0.8"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(limits: Any, place: str, text: str) -> None:
    with pytest.raises(InputError) as error:
        limited(limits)
    assert place in str(error.value) and text in str(error.value)


def test_the_loop_refuses_limits_that_it_cannot_take() -> None:
    for wrong in (((1.0, 0.0),), ((0.0,),), ((0.0, math.nan),)):
        with pytest.raises(ValueError, match="expected a pair low < high"):
            LoopSettings(10, 1e-3, limits=wrong)  # type: ignore[arg-type]


def test_a_start_on_the_reference_beyond_a_limit_ends_at_once() -> None:
    on = load_scenario("paper/nominal", SHORT | {"mechanism.limits": LIMITS, "initial.on_reference": True})
    result = simulate(on)
    assert (result.status, result.metrics["t_end"][0].as_py()) == ("out_of_limits", 0.0)


SWEEP = """
scenario = "paper/nominal"
samples = 6
seed = 4
[set]
simulation.duration = 0.5
mechanism.limits = [[0.2, 0.95], [-inf, inf]]
[vary]
"mechanism.limits.0.1" = { each = [0.95, 2.0] }
"control.delta" = { uniform = [0.04, 0.08] }
[keep]
trajectories = 2
"""


def test_a_sweep_groups_by_limits_counts_what_ended_and_replays_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sweep.toml").write_text(SWEEP)
    done = CliRunner().invoke(app, ["batch", "sweep.toml", "-o", "data", "--no-plot", "--json"], prog_name="springline")
    assert done.exit_code == 0, done.output
    counts = {row["group"]: (row["ok"], row["out_of_limits"]) for row in json.loads(done.stdout)["rows"]}
    assert sorted(counts.values()) == [(0, 6), (6, 0)]
    replayed = CliRunner().invoke(app, ["replay", "data", "1", "--no-plot"], prog_name="springline")
    assert replayed.exit_code == 0 and "bit for bit" in replayed.output
    assert "out_of_limits: q1_lift left its limits" in replayed.output
    Path("sweep.toml").write_text(SWEEP.replace("each = [0.95, 2.0]", "uniform = [0.95, 2.0]"))
    refused = CliRunner().invoke(app, ["batch", "sweep.toml", "-o", "other"], prog_name="springline")
    assert refused.exit_code == 2 and "vary.mechanism.limits.0.1" in refused.output


def test_no_mechanism_may_call_a_number_as_a_key_that_all_have() -> None:
    assert {item.name for item in friction_parameters("elastic")} <= TAKEN
