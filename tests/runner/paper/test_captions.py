"""What is said below a figure is true of the runs that it shows: told of made-up ones."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from springline.runner.paper.captions import SEEN, sea
from springline.runner.paper.measured import Measured
from springline.runner.paper.runs import Study

T = 1e-3 * np.arange(1001)


def run(
    *, error: float = 1e-3, late: float = 2e-3, settling: float = 0.204, gap: float = 0.0, end: int = 1001
) -> Measured:
    """Errors that are `error` until the last quarter and `late` in it, and a distance that grows at 20 1/s."""
    t = T[:end]
    e = np.where(t > 0.76, late, error)
    away = gap * np.exp(20 * t) * np.sin(2 * np.pi * 100 * t)
    columns = {"t": t}
    for joint in ("lift", "rotation"):
        columns |= {f"e_{joint}": e, f"velocity_error_{joint}": 10 * e, f"q1_{joint}": away, f"dq1_{joint}": away}
        columns |= {f"sigma_{joint}": e}
    metrics = {f"{name}_{joint}": settling for name in ("settling_time",) for joint in ("lift", "rotation")}
    return Measured(columns, metrics, "ok" if end == 1001 else "out_of_bounds")


def study(runs: dict[str, Measured], heave: float = 2.0) -> Study:
    terms = [{"amplitude": heave / 4, "omega": 2.0, "phase": 0.0}]
    shake = SimpleNamespace(document={"base_motion": {"heave": terms}})
    evidence = SimpleNamespace(runs=runs, law=lambda law: runs[f"paper/group2_{law}"])
    return cast(Study, SimpleNamespace(evidence=evidence, scenarios={"paper/group1_shake": shake}))


def test_a_time_within_which_all_settle_is_no_shorter_than_any() -> None:
    runs = {f"paper/group1_{name}": run() for name in ("shake", "pitch", "roll")}
    assert SEEN["figure_09"](study(runs)) == (
        "All settle within 0.21 s; in the last quarter of the run the errors reach 2.0 (shake), 2.0 (pitch) and 2.0 "
        "mrad (roll)."
    )
    runs["paper/group1_roll"] = run(error=5e-3, settling=math.nan)
    assert SEEN["figure_10"](study(runs)).startswith("Not all settle; in the second half of the run")
    assert "20 (pitch) and 50 mm/s (roll)" in SEEN["figure_10"](study(runs))


def test_a_burst_is_told_of_only_where_there_is_one() -> None:
    runs = {f"paper/group2_{law}": run() for law in ("variable_power_log", "double_power", "power")}
    assert "burst" not in SEEN["figure_15"](study(runs))
    power = runs["paper/group2_power"]
    buzz = 0.01 * np.exp(-(((T - 0.7) / 0.02) ** 2)) * np.sin(2 * np.pi * 200 * T)
    columns = {"velocity_error_rotation": buzz, "sigma_rotation": np.where(np.abs(T - 0.7) < 0.06, 1e-4, 1e-2)}
    runs["paper/group2_power"] = replace(power, columns={**power.columns, **columns})
    assert "burst of the traditional laws around 0.7 s (200 Hz)" in SEEN["figure_15"](study(runs))
    assert "(up to 0.00010 rad/s, elsewhere 0.010 rad/s)" in SEEN["figure_15"](study(runs))


def test_how_far_a_run_without_fast_control_leaves_the_other() -> None:
    runs = {"paper/group4_fast_on": run(), "paper/group4_fast_off": run(gap=1e-3, end=401)}
    position, velocity = (SEEN[f"figure_{number}"](study(runs)) for number in (22, 25))
    assert position == (
        "The run without fast control leaves its bound at 0.40 s; its distance to the other is 0.002 m at most in the "
        "first tenth of that time, 3 m in the last."
    )
    assert velocity.endswith("3 rad/s in the last. Over the second half it grows at 20 1/s, with 100 Hz.")


@pytest.mark.parametrize(("heave", "worst"), [(2.0, True), (0.5, False)])
def test_our_sea_is_a_worst_case_where_it_is_one(heave: float, worst: bool) -> None:
    said = sea(study({}, heave))
    assert ("a worst case beyond sea state 6" in said) is worst
    assert f"by {heave / math.sqrt(2):.2g} m/s² RMS" in said
