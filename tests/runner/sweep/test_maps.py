"""Maps of a sweep: axes in the prefix that suits, and marks on the cells that they are of, each once."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch

from springline.model.mechanisms import MECHANISMS
from springline.runner.report import house_style
from springline.runner.sweep.map import metric_map, outcome_map
from springline.runner.sweep.shown import STOPPED, Runs

JOINTS = MECHANISMS["transfer_manipulator"].joints
PERIODS, DELAYS = np.array([1e-4, 1e-3, 2e-3]), np.array([0.0, 5e-4, 1e-3])


def runs(stopped: tuple[tuple[int, int], ...] = ()) -> Runs:
    """A grid of periods and delays, in which the runs at these places stopped."""
    places = [(i, j) for i in range(len(PERIODS)) for j in range(len(DELAYS))]
    columns: dict[str, list[object]] = {
        "control.period": [PERIODS[i] for i, _ in places],
        "actuator.delay": [DELAYS[j] for _, j in places],
        "status": ["diverged" if place in stopped else "ok" for place in places],
        "t_end": [4.0 for _ in places],
    }
    units = {"control.period": "s", "actuator.delay": "s"}
    for joint in JOINTS:
        for metric, unit in (("chatter", "1/s"), ("settling_time", "s"), ("steady_state_error", joint.unit)):
            columns[f"{metric}_{joint.name}"] = [None if place in stopped else 2e-3 for place in places]
            units[f"{metric}_{joint.name}"] = unit
    keys = ["control.period", "actuator.delay"]
    group = np.zeros(len(places), dtype=np.int64)
    return Runs(pa.table(columns), units, JOINTS, keys, dict.fromkeys(keys, False), group, ["all"], gridded=True)


def drawn(figure: Figure) -> Figure:
    figure.draw_without_rendering()
    return figure


def test_axes_and_their_ticks_are_in_the_prefix_that_suits() -> None:
    with house_style():
        for figure in map(drawn, (outcome_map(runs()), metric_map(runs(), "steady_state_error"))):
            axes = figure.axes[0]
            assert (axes.get_xlabel(), axes.get_ylabel()) == ("period [ms]", "delay [ms]")
            shown = {text.get_text() for text in axes.get_xticklabels() if text.get_visible()}
            assert {"0.0", "1.0", "2.0"} <= shown


def test_what_stopped_is_covered_and_nothing_else() -> None:
    stopped = ((1, 2), (2, 0), (2, 1))
    with house_style():
        axes = outcome_map(runs(stopped)).axes[0]
    (cover,) = (patch for patch in axes.patches if isinstance(patch, PathPatch))
    assert cover.get_facecolor()[:3] == tuple(int(STOPPED[at : at + 2], 16) / 255 for at in (1, 3, 5))
    covered = {
        (i, j) for i, x in enumerate(PERIODS) for j, y in enumerate(DELAYS) if cover.get_path().contains_point((x, y))
    }
    assert covered == set(stopped)
