"""Another arm, another drive, another reference and start: scenarios, runs, sweeps and replays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from springline.codegen.kernel import source
from springline.runner import batch, load_scenario, simulate
from springline.runner.cli import app
from springline.runner.files import InputError

pytestmark = pytest.mark.usefixtures("other_arms")

SHORT = {"simulation.duration": 0.5, "simulation.step": 2e-4}


SHIP = {
    "kind": "sine",
    "mount": [3.0, 2.0, 1.0],
    **{
        name: [{"amplitude": amplitude, "omega": 5.0}]
        for names, amplitude in ((("surge", "sway", "heave"), 0.2), (("roll", "pitch", "yaw"), 0.05))
        for name in names
    },
}
# Seven joints, in a plane and in space, on a base in six coordinates.
SEVEN = {
    name: {"base_motion": SHIP, "simulation.duration": 0.04, **size}
    for name, size in (("planar_arm", {"mechanism.n": 7}), ("spatial_arm", {}))
}


@pytest.fixture(autouse=True)
def _kernels_that_are_compiled_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of seven joints would take a minute."""
    monkeypatch.setattr(source, "best_flags", lambda compiler: ("-O0",))


def scenario_of(name: str, **changes: object):
    return load_scenario("paper/nominal", {"mechanism.name": name, **SHORT, **SEVEN.get(name, {}), **changes})


def test_a_scenario_of_another_arm_has_that_arms_names_and_defaults(other_arm: str) -> None:
    scenario = scenario_of(other_arm)
    joints = [joint.name for joint in scenario.system().joints]
    text = scenario.to_toml()
    assert "lift" not in text and "rotation" not in text
    result = simulate(scenario)
    assert result.status == "ok", result.message
    assert {f"q2_{joint}" for joint in joints} <= set(result.trajectory.column_names)
    assert result.metrics.column_names[: len(joints)] == [f"response_time_{joint}" for joint in joints]


def test_three_links_settle_on_their_reference() -> None:
    row = simulate(scenario_of("three_links", **{"simulation.duration": 3.0})).metrics.to_pylist()[0]
    for joint in ("shoulder", "elbow", "wrist"):
        assert row[f"settling_time_{joint}"] < 1.0
        assert row[f"steady_state_error_{joint}"] < 2e-3
        assert row[f"chatter_{joint}"] < 5.0


@pytest.mark.parametrize(
    ("arm", "drives"),
    [
        ("one_link", ("elastic", "rigid")),
        ("three_links", ("elastic", "rigid")),
        ("planar_arm", ("elastic",)),
    ],
)
def test_runs_of_a_batch_are_single_runs_of_either_engine(arm: str, drives: tuple[str, ...]) -> None:
    """Of numbers that are baked and tunable, and of a rigid drive; for seven joints in space see test_one_loop.py."""
    for drive in drives:
        scenario = scenario_of(arm, **{"drive.kind": drive})
        masses = np.array([0.8, 1.0, 1.3])
        table = batch(scenario, {"plant.mass": masses}, jobs=1).to_pylist()
        for mass, row in zip(masses, table, strict=True):
            for engine in ("lanes", "casadi"):
                alone = simulate(
                    scenario.with_overrides({"plant.mass": float(mass)}), engine=engine
                ).metrics.to_pylist()[0]
                assert alone["status"] == "ok"
                assert {name: row[name] for name in alone} == alone


SWEEP = """
scenario = "arm.toml"
samples = 6
seed = 4
chunk = 2
[vary]
"control.delta" = { uniform = [0.04, 0.08] }
"drive.kind" = { values = DRIVES }
[keep]
trajectories = 2
"""


@pytest.mark.parametrize(
    ("arm", "drives"),
    [
        ("three_links", '["elastic", "rigid"]'),
        ("planar_arm", '["elastic"]'),
        pytest.param("spatial_arm", '["elastic"]', marks=pytest.mark.full),
    ],
)
def test_sweep_and_replay_of_another_arm(
    arm: str, drives: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Grouped by the kind of drive; a replayed run has the metrics of its row."""
    monkeypatch.chdir(tmp_path)
    Path("arm.toml").write_text(scenario_of(arm).to_toml())
    Path("sweep.toml").write_text(SWEEP.replace("DRIVES", drives))
    for command in (["batch", "sweep.toml", "-o", "data", "--no-plot"], ["replay", "data", "3", "--no-plot"]):
        done = CliRunner().invoke(app, command, prog_name="springline")
        assert done.exit_code == 0, done.output
    assert "bit for bit" in done.output


def test_a_rigid_drive_has_no_motor_of_its_own() -> None:
    result = simulate(scenario_of("one_link", **{"drive.kind": "rigid"}))
    assert not [name for name in result.trajectory.column_names if "q2" in name]
    assert "stiffness" not in scenario_of("one_link", **{"drive.kind": "rigid"}).to_toml()
    nominal = load_scenario("paper/nominal", {"drive.kind": "rigid", **SHORT})
    with pytest.raises(InputError, match="k_s2"):
        nominal.with_overrides({"drive.k_s2": 1e6})
    with pytest.raises(InputError, match="K_f"):
        nominal.with_overrides({"control.K_f": 1.0})
    assert nominal.with_overrides({"drive.kind": "elastic"}).document["drive"]["k_s2"] == 2e6


def test_a_run_on_its_reference_stays_there() -> None:
    """The arm starts where its reference is, carried by its motors: what remains is far below a start beside it."""
    beside = load_scenario("paper/nominal", SHORT)
    on = beside.with_overrides({"initial.on_reference": True, "simulation.settling_error": 1e-3})
    assert set(on.document["initial"]) == {"on_reference"}
    result = simulate(on)
    first = result.trajectory.slice(0, 1).to_pylist()[0]
    assert first["e_lift"] == first["e_rotation"] == 0.0
    row = result.metrics.to_pylist()[0]
    assert row["settling_time_lift"] == 0.0
    assert row["steady_state_error_lift"] < 1e-3
    assert row["overshoot_lift"] is None and row["response_time_lift"] is None
    back = on.with_overrides({"initial.q": [0.8, 0.5]})
    assert "on_reference" not in back.document["initial"]
    with pytest.raises(InputError, match=r"initial\.q: does not go with initial\.on_reference"):
        on.with_overrides({"initial.on_reference": True, "initial.q": [0.0, 0.0]})


def test_a_polynomial_reference_is_followed(tmp_path: Path) -> None:
    path = tmp_path / "reach.toml"
    path.write_text(
        "[reference]\nkind = 'polynomial'\nlift = { t = [0.0, 0.5, 1.0], q = [0.8, 0.9, 0.7] }\n"
        "[initial]\non_reference = true\n[simulation]\nduration = 1.5\n"
    )
    scenario = load_scenario(path)
    assert scenario.document["reference"]["rotation"] == {"t": [0.0], "q": [0.5]}, "where the arm starts"
    table = simulate(scenario).trajectory
    t, q1d, q1 = (table[name].to_numpy() for name in ("t", "q1d_lift", "q1_lift"))
    np.testing.assert_allclose(np.interp([0.0, 0.5, 1.0, 1.5], t, q1d), [0.8, 0.9, 0.7, 0.7], atol=1e-12)
    assert np.abs(q1 - q1d).max() < 1e-3
    moved = scenario.with_overrides({"reference.lift.q.1": 1.1})
    assert np.interp(0.5, t, simulate(moved).trajectory["q1d_lift"].to_numpy()) == pytest.approx(1.1, abs=1e-12)
    for text, message in (
        ("t = [0.0, 1.0], q = [0.8]", "reference.lift: expected as many values q as times t"),
        ("t = [0.0, 1.0, 1.0], q = [0.8, 0.9, 1.0]", "reference.lift.t.2: expected a time later than the one before"),
        ("t = [], q = []", "reference.lift.t: expected a list, not empty"),
    ):
        path.write_text(f"[reference]\nkind = 'polynomial'\nlift = {{ {text} }}\n")
        with pytest.raises(InputError) as error:
            load_scenario(path)
        assert message in str(error.value)


def test_bands_are_fractions_or_errors() -> None:
    nominal = load_scenario("paper/nominal")
    absolute = nominal.with_overrides({"simulation.settling_error": 0.005})
    assert "settling_band" not in absolute.document["simulation"]
    assert absolute.with_overrides({"simulation.settling_band": 0.05}) == nominal
    with pytest.raises(InputError, match=r"simulation\.settling_error: does not go with simulation\.settling_band"):
        nominal.with_overrides({"simulation.settling_error": 0.005, "simulation.settling_band": 0.05})


@pytest.mark.parametrize("integrator", ["euler", "midpoint", "dopri5", "dop853"])
def test_an_integrator_is_chosen_by_name(integrator: str) -> None:
    """All come to the same motion; Euler needs a small step for springs that swing a thousand times a second."""
    step = 2e-6 if integrator == "euler" else 1e-4
    fine = {"simulation.duration": 0.05, "simulation.step": step, "simulation.output_every": round(0.05 / step)}
    reference = simulate(load_scenario("paper/nominal", fine)).trajectory["q1_lift"].to_numpy()[-1]
    chosen = simulate(load_scenario("paper/nominal", {**fine, "simulation.integrator": integrator}))
    assert chosen.trajectory["q1_lift"].to_numpy()[-1] == pytest.approx(reference, abs=2e-3)
    with pytest.raises(InputError, match="euler, midpoint, rk4, dopri5, dop853"):
        load_scenario("paper/nominal", {"simulation.integrator": "rk5"})
