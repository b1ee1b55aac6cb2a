"""The figures of a single run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from springline.model.base import BaseCoordinate
from springline.model.parameters import Joint
from springline.model.quantities import DISTURBANCE, Q1, Q2, SIGMA, TIP, E, Quantity, U
from springline.runner.files import units
from springline.runner.report import (
    LINES,
    PAGE,
    REFERENCE,
    TIME,
    draw,
    house_style,
    label,
    legend_above,
    panels,
    symbol,
)
from springline.runner.run.simulation import Result
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]


_POINTS = 2000  # of a scatter plot
_MOST_COLUMNS = 3  # side by side on a page, so that their numbers can be read
_MOVES = 1e-12  # a base coordinate that stays below this stands still


# --- the figures of a run --------------------------------------------------------------------------------


def run_figures(scenario: Scenario, result: Result) -> dict[str, Figure]:
    """The overview of one run, by name: tracking, error, force; sliding if there is a sliding variable, springs if
    there are springs, base_motion if the base moves, disturbance of the links on which forces act, tip if the arm has
    one. If the run came to its end also steady_state, and error_over_base and error_against_base if the base follows a
    record.
    """
    run = _Run(scenario, result)
    figures: dict[str, Callable[[_Run], Figure]] = {
        "tracking": _tracking,
        "error": _error,
        "force": _lines("force", U),
    }
    shown = scenario.system().columns
    if SIGMA in shown:
        figures["sliding"] = _lines("sliding", SIGMA)
    if Q2 in shown:
        figures["springs"] = _lines("spring", Q2, less=Q1)
    if run.moving:
        figures["base_motion"] = _base_motion
    if run.pushed:
        figures["disturbance"] = _disturbance
    if TIP[0] in shown:
        figures["tip"] = _tip
    if run.status == "ok":
        figures["steady_state"] = _steady_state
        if run.moving and scenario.structure().base_motion.kind == "table":
            figures |= {"error_over_base": _error_over_base, "error_against_base": _error_against_base}
    with house_style():
        return {name: make(run) for name, make in figures.items()}


class _Run:
    """A run as the figures want it: columns as arrays, with their units."""

    def __init__(self, scenario: Scenario, result: Result) -> None:
        self.joints: tuple[Joint, ...] = scenario.system().joints
        self.bands = (
            (scenario.response_band, scenario.response_error),
            (scenario.settling_band, scenario.settling_error),
        )
        self.status, self.message = result.status, result.message
        self._table: pa.Table = result.trajectory
        self._metrics: dict[str, Any] = result.metrics.to_pylist()[0]
        self._units = units(result.trajectory)
        self.t = self["t"]
        self.moving: tuple[BaseCoordinate, ...] = tuple(
            c for c in scenario.structure().base_coordinates if np.max(np.abs(self[c.symbol])) > _MOVES
        )

        columns = set(result.trajectory.column_names)
        self.pushed: tuple[Joint, ...] = tuple(
            j for j in self.joints if (name := f"{DISTURBANCE.name}_{j.name}") in columns and self[name].any()
        )

    def __getitem__(self, column: str) -> Floats:
        values: Floats = self._table[column].to_numpy()
        return values

    @property
    def settled(self) -> NDArray[np.bool_]:
        """The rows after three settling times, when nothing is left of the start, but at the least the last quarter;
        the last three quarters where a run does not settle.
        """
        times = [self.metric("settling_time", joint) for joint in self.joints]
        known = [time for time in times if time is not None]
        quarter = (self.t[-1] - self.t[0]) / 4
        start = min(3.0 * max(known), self.t[-1] - quarter) if known else self.t[0] + quarter
        late: NDArray[np.bool_] = self.t >= start
        return late

    def metric(self, name: str, joint: Joint) -> float | None:
        value: float | None = self._metrics[f"{name}_{joint.name}"]
        return value

    def unit(self, column: str) -> str:
        return self._units[column]


def _joint_panels(
    run: _Run, text: str, quantity: Quantity, joints: tuple[Joint, ...] = ()
) -> tuple[Figure, list[tuple[Axes, Joint]]]:
    """One panel a joint (of `joints`, or of all) over time, labelled with it, the text and the quantity's unit."""
    joints = joints or run.joints
    figure, grid = panels(len(joints))
    pairs = list(zip(grid[:, 0], joints, strict=True))
    for axes, joint in pairs:
        axes.set_ylabel(label(f"{joint.name}\n{text}", run.unit(f"{quantity.name}_{joint.name}")))
    figure.align_ylabels()
    _time_axis(run, figure)
    return figure, pairs


def _time_axis(run: _Run, figure: Figure) -> None:
    figure.axes[-1].set_xlabel(TIME)
    if run.status != "ok":
        stopped = f"{run.status.replace('_', ' ')} at {run.t[-1]:g} s"
        for axes in figure.axes:
            axes.axvline(run.t[-1], color="#D55E00", linestyle=":", label=stopped)


def _tracking(run: _Run) -> Figure:
    figure, pairs = _joint_panels(run, "coordinate", Q1)
    for axes, joint in pairs:
        draw(axes, run.t, run[f"q1_{joint.name}"], f"link {symbol(Q1)}", **LINES[0])
        draw(axes, run.t, run[f"q1d_{joint.name}"], "reference", **REFERENCE)
    legend_above(figure)
    return figure


def _error(run: _Run) -> Figure:
    """The error with the bands that define response and settling time, and these times."""
    figure, pairs = _joint_panels(run, f"error {symbol(E)}", E)
    response, settling = run.bands
    for axes, joint in pairs:
        e = run[f"e_{joint.name}"]
        start = abs(float(e[0]))
        for (band, limit), shade in ((response, "0.90"), (settling, "0.78")):
            half = band * start + limit
            if half:
                label = f"±{100 * band:g} % of |{symbol(E)}(0)|" if band else f"±{limit:g} {joint.unit}"
                axes.axhspan(-half, half, color=shade, linewidth=0, label=label)
        draw(axes, run.t, e, "error", **LINES[0])
        for metric, name, mark in (("response_time", "response time", "o"), ("settling_time", "settling time", "s")):
            at = run.metric(metric, joint)
            if at is not None:
                axes.plot(
                    at,
                    np.interp(at, run.t, e),
                    mark,
                    markersize=3.5,
                    color="#D55E00",
                    label=name,
                    markerfacecolor="white" if mark == "o" else None,
                    zorder=3,
                )
    legend_above(figure)
    return figure


def _steady_state(run: _Run) -> Figure:
    """The error in the last quarter of the run, where a scale of its own shows it."""
    figure, pairs = _joint_panels(run, f"error {symbol(E)}", E)
    late = run.t >= run.t[0] + 0.75 * (run.t[-1] - run.t[0])
    for axes, joint in pairs:
        draw(axes, run.t[late], run[f"e_{joint.name}"][late], "error", **LINES[0])
        worst = run.metric("steady_state_error", joint)
        for limit in () if worst is None else (-worst, worst):
            axes.axhline(limit, label="± steady-state error", **REFERENCE)
    legend_above(figure)
    return figure


def _lines(word: str, quantity: Quantity, less: Quantity | None = None) -> Callable[[_Run], Figure]:
    """A figure of a quantity of each joint, or of the difference `quantity` - `less`."""

    def make(run: _Run) -> Figure:
        text = f"{word} {symbol(quantity)}" + (f" − {symbol(less)}" if less else "")
        figure, pairs = _joint_panels(run, text, quantity)
        for axes, joint in pairs:
            y = run[f"{quantity.name}_{joint.name}"]
            draw(axes, run.t, y - run[f"{less.name}_{joint.name}"] if less else y, **LINES[0])
        legend_above(figure)
        return figure

    return make


def _disturbance(run: _Run) -> Figure:
    """The forces on the links that any acts on. Zero is in sight, for a force is told by its size and its sign."""
    figure, pairs = _joint_panels(run, f"disturbance {symbol(DISTURBANCE)}", DISTURBANCE, run.pushed)
    for axes, joint in pairs:
        axes.axhline(0.0, label="no force", **REFERENCE)
        draw(axes, run.t, run[f"{DISTURBANCE.name}_{joint.name}"], "force, positive along +q₁", **LINES[0])
    legend_above(figure)
    return figure


def _base_motion(run: _Run) -> Figure:
    figure, grid = panels(len(run.moving), height=1.1)
    for axes, coordinate in zip(grid[:, 0], run.moving, strict=True):
        draw(axes, run.t, run[coordinate.symbol], **LINES[0])
        axes.set_ylabel(label(coordinate.key, coordinate.unit))
    _time_axis(run, figure)
    legend_above(figure)
    return figure


def _tip(run: _Run) -> Figure:
    """Where the tip is, as seen from the ship and from the earth."""
    figure, grid = panels(len(TIP) // 2, height=1.1)
    for axes, ship, earth in zip(grid[:, 0], TIP[: len(TIP) // 2], TIP[len(TIP) // 2 :], strict=True):
        draw(axes, run.t, run[earth.name], "from the earth", **LINES[1])
        draw(axes, run.t, run[ship.name], "from the ship", **LINES[0])
        axes.set_ylabel(label(f"tip {ship.name.split('_')[1]}", ship.unit))
    _time_axis(run, figure)
    legend_above(figure)
    return figure


def _error_over_base(run: _Run) -> Figure:
    """Tracking error below the base motion that disturbs it, on one time axis, once the start is over."""
    rows = [(label(c.key, c.unit), c.symbol, LINES[0]) for c in run.moving]
    rows += [
        (label(f"{j.name}\nerror", run.unit(f"e_{j.name}")), f"e_{j.name}", {**LINES[1], "linestyle": "-"})
        for j in run.joints
    ]
    figure, grid = panels(len(rows), height=0.85)
    late = run.settled
    for axes, (text, column, line) in zip(grid[:, 0], rows, strict=True):
        draw(axes, run.t[late], run[column][late], **line)
        axes.set_ylabel(text)
    _time_axis(run, figure)
    figure.align_ylabels()
    legend_above(figure)
    return figure


def _error_against_base(run: _Run) -> Figure:
    """Each joint's error against each moving coordinate of the base, once the start is over, with their correlation."""
    columns = min(len(run.moving), _MOST_COLUMNS)
    blocks = -(-len(run.moving) // columns)
    figure, grid = panels(len(run.joints) * blocks, columns, width=PAGE, height=1.7, share_x=False)
    late = np.flatnonzero(run.settled)
    late = late[:: max(1, len(late) // _POINTS)]
    for j, joint in enumerate(run.joints):
        own = grid[j * blocks : (j + 1) * blocks]
        e = run[f"e_{joint.name}"][late]
        for axes in own.flat[len(run.moving) :]:
            axes.remove()
        for axes, coordinate in zip(own.flat, run.moving, strict=False):
            b = run[coordinate.symbol][late]
            axes.plot(b, e, ".", markersize=2, color=LINES[0]["color"], alpha=0.4, markeredgewidth=0, rasterized=True)
            axes.set_title(f"correlation {np.corrcoef(b, e)[0, 1]:+.2f}".replace("-", "−"), loc="right", fontsize=7)
            axes.set_xlabel(label(coordinate.key, coordinate.unit))
            axes.margins(x=0.03)
            axes.xaxis.set_major_locator(MaxNLocator(4))
        for axes in own[:, 0]:
            axes.set_ylabel(label(f"{joint.name} error", run.unit(f"e_{joint.name}")))
    return figure
