"""The figures of a single run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from springline.model.base import BaseCoordinate
from springline.model.parameters import Joint
from springline.model.quantities import DISTURBANCE, Q1, Q2, SIGMA, TIP, U_CMD, E, Quantity, U
from springline.runner.files import numpy_array, units
from springline.runner.report import (
    LINES,
    PAGE,
    REFERENCE,
    TIME,
    draw,
    house_style,
    legend_above,
    name_axis,
    panels,
    quantity_text,
    symbol,
)
from springline.runner.run.simulated import Simulated
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]


_POINTS = 2000  # of a path in the phase plane
_DOTS = 600  # of a scatter plot
_CHECKED = 200  # rows at which the sliding surface is held against the run
_GRID = 121  # points along each side of the plane in which the surface is sought
_MOST_COLUMNS = 3  # side by side on a page, so that their numbers can be read
_MOVES = 1e-12  # a base coordinate that stays below this stands still
_HEIGHT = 1.35  # of a row of panels, inches
_FEWEST = 20  # rows that make a part of a run of its own
_SWALLOWED = 100.0  # a run that stops this far above its usual size is drawn on a scale that is logarithmic there
_IN_SIGHT = 3.0  # a limit is drawn up to so many times the largest value
_LIMIT: dict[str, Any] = {"color": "#D55E00", "linestyle": (0, (2, 1.5)), "linewidth": 0.9}


# --- the figures of a run --------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Drawn:
    """A figure, and what is seen in it."""

    figure: Figure
    caption: str


def run_figures(scenario: Scenario, result: Simulated) -> dict[str, Figure]:
    """The overview of one run, by name: tracking, error, force; sliding and phase_plane if there is a sliding variable,
    springs if there are springs, base_motion if the base moves, disturbance of the links on which forces act, measured
    if sensors show something else than the state, controller_states if there are some, tip if the arm has one. If the
    run came to its end also error_over_base and error_against_base if the base follows a record.
    """
    return {name: drawn.figure for name, drawn in drawn_figures(scenario, result).items()}


def drawn_figures(scenario: Scenario, result: Simulated) -> dict[str, Drawn]:
    """The figures of `run_figures` with their captions."""
    run = _Run(scenario, result)
    figures: dict[str, Callable[[_Run], Drawn]] = {"tracking": _tracking, "error": _error}
    shown = scenario.system().columns
    if SIGMA in shown:
        figures["phase_plane"] = _phase_plane
        figures["sliding"] = _sliding
    figures["force"] = _force
    if Q2 in shown:
        figures["springs"] = _springs
    if run.moving:
        figures["base_motion"] = _base_motion
    if run.pushed:
        figures["disturbance"] = _disturbance
    if scenario.system().measured:
        figures["measured"] = _measured
    if scenario.system().controller_states:
        figures["controller_states"] = _controller_states
    if TIP[0] in shown:
        figures["tip"] = _tip
    if run.status == "ok" and run.moving and scenario.structure().base_motion.kind == "table":
        figures |= {"error_over_base": _error_over_base, "error_against_base": _error_against_base}
    with house_style():
        return {name: make(run) for name, make in figures.items()}


@dataclass(frozen=True, slots=True)
class _Part:
    """A piece of a run that has a column of panels, and a scale, of its own."""

    title: str
    rows: NDArray[np.bool_]


class _Run:
    """A run as the figures want it: columns as arrays, with their units."""

    def __init__(self, scenario: Scenario, result: Simulated) -> None:
        self.scenario = scenario
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
        return numpy_array(self._table[column])

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

    @property
    def parts(self) -> list[_Part]:
        """The start and what is left after it, each to be drawn by its own scale; the whole run if it stopped."""
        whole = _Part("the whole run", np.ones(len(self.t), dtype=np.bool_))
        if self.status != "ok":
            return [whole]
        times = [self.metric("settling_time", joint) for joint in self.joints]
        quarter = self.t[-1] - (self.t[-1] - self.t[0]) / 4
        if all(time is not None for time in times):
            settled = 3.0 * max(time for time in times if time is not None)
            late = self.t >= min(settled, quarter)
            early = self.t <= self.t[np.argmax(late)]
            if min(early.sum(), late.sum()) < _FEWEST:
                return [whole]
            first = self.t[np.argmax(late)]
            return [_Part(f"the first {first:.3g} s", early), _Part(f"after {first:.3g} s, on its own scale", late)]
        late = self.t >= quarter
        return [whole] if late.sum() < _FEWEST else [whole, _Part("the last quarter, on its own scale", late)]

    def metric(self, name: str, joint: Joint) -> float | None:
        value: float | None = self._metrics[f"{name}_{joint.name}"]
        return value

    def unit(self, column: str) -> str:
        return self._units[column]


Drawing = Callable[[Axes, Joint, _Part], None]


def _joint_panels(
    run: _Run,
    text: str,
    quantity: Quantity,
    drawing: Drawing,
    *,
    joints: Sequence[Joint] = (),
    parts: Sequence[_Part] = (),
) -> Figure:
    """One row of panels a joint (of `joints`, or of all) over time, one column a part of the run.

    drawing  what draws a panel; its axes are then labelled with the joint, the text and the quantity's unit
    """
    joints, parts = joints or run.joints, parts or run.parts
    figure, grid = panels(len(joints), len(parts), width=PAGE, height=_HEIGHT, share_x="col")
    for row, joint in zip(grid, joints, strict=True):
        unit = run.unit(f"{quantity.name}_{joint.name}")
        for axes, part in zip(row, parts, strict=True):
            drawing(axes, joint, part)
            _expect_sight(run, axes)
            name_axis(axes.yaxis, f"{joint.name}\n{text}" if axes is row[0] else text, unit)
    if len(parts) > 1:
        for axes, part in zip(grid[0], parts, strict=True):
            axes.set_title(part.title)
    figure.align_ylabels()
    _time_axis(run, figure, grid[-1])
    legend_above(figure, columns=4)
    return figure


def _expect_sight(run: _Run, axes: Axes) -> None:
    """Give a run that stopped far from where it was a scale on which both are seen."""
    if run.status == "ok":
        return
    sizes = np.abs(np.concatenate([np.asarray(line.get_ydata(), dtype=np.float64) for line in axes.lines]))
    usual, largest = float(np.nanmedian(sizes)), float(np.nanmax(sizes))
    if usual > 0.0 and largest > _SWALLOWED * usual:
        axes.set_yscale("symlog", linthresh=10.0 ** np.ceil(np.log10(usual)))


def _time_axis(run: _Run, figure: Figure, bottom: Sequence[Axes]) -> None:
    for axes in bottom:
        axes.set_xlabel(TIME)
    if run.status != "ok":
        for axes in figure.axes:
            axes.axvline(run.t[-1], color="#D55E00", linestyle=":", label=_stopped(run))


def _stopped(run: _Run) -> str:
    """How and when a run stopped, for a legend."""
    return f"{run.status.replace('_', ' ')} at {run.t[-1]:g} s"


def _tracking(run: _Run) -> Drawn:
    whole = _Part("the whole run", np.ones(len(run.t), dtype=np.bool_))
    parts = run.parts if len(run.parts) == 1 or run.parts[0].title == whole.title else [run.parts[0], whole]

    def drawing(axes: Axes, joint: Joint, part: _Part) -> None:
        draw(axes, run.t[part.rows], run[f"q1_{joint.name}"][part.rows], f"link {symbol(Q1)}", **LINES[0])
        draw(axes, run.t[part.rows], run[f"q1d_{joint.name}"][part.rows], "reference", **REFERENCE)

    figure = _joint_panels(run, "coordinate", Q1, drawing, parts=parts[:2])
    return Drawn(figure, "Where the links are, and where they should be.")


def _error(run: _Run) -> Drawn:
    """The error with the bands that define response and settling time, and these times; then what is left of it."""
    response, settling = run.bands
    parts = run.parts

    def drawing(axes: Axes, joint: Joint, part: _Part) -> None:
        e, t = run[f"e_{joint.name}"], run.t
        if part is not parts[0]:
            draw(axes, t[part.rows], e[part.rows], "error", **LINES[0])
            worst = run.metric("steady_state_error", joint)
            for limit in () if worst is None else (-worst, worst):
                axes.axhline(limit, label="± steady-state error", **REFERENCE)
            return
        start = abs(float(e[0]))
        for (band, limit), shade in ((response, "0.90"), (settling, "0.78")):
            half = band * start + limit
            if half:
                share = f"±{100 * band:.4g} % of |{symbol(E)}(0)|"
                name = share if band else f"±{quantity_text(limit, joint.unit)}"
                axes.axhspan(-half, half, color=shade, linewidth=0, label=name)
        draw(axes, t[part.rows], e[part.rows], "error", **LINES[0])
        for metric, name, mark in (("response_time", "response time", "o"), ("settling_time", "settling time", "s")):
            at = run.metric(metric, joint)
            if at is not None:
                axes.plot(
                    at,
                    np.interp(at, t, e),
                    mark,
                    markersize=3.5,
                    color="#D55E00",
                    label=name,
                    markerfacecolor="white" if mark == "o" else None,
                    zorder=3,
                )

    figure = _joint_panels(run, f"error {symbol(E)}", E, drawing, parts=parts)
    return Drawn(figure, f"Tracking error.{_steady_words(run)}")


def _steady_words(run: _Run) -> str:
    """How large the error stays, for a caption; "" for a run that stopped, or shows it in no panel of its own."""
    if len(run.parts) < 2:
        return ""
    known = [(joint, run.metric("steady_state_error", joint)) for joint in run.joints]
    sizes = ", ".join(f"{joint.name} {quantity_text(value, joint.unit, 3)}" for joint, value in known)
    return f" The steady-state error is the largest of the last quarter: {sizes}."


def _sliding(run: _Run) -> Drawn:
    def drawing(axes: Axes, joint: Joint, part: _Part) -> None:
        draw(axes, run.t[part.rows], run[f"{SIGMA.name}_{joint.name}"][part.rows], **LINES[0])

    figure = _joint_panels(run, f"sliding {symbol(SIGMA)}", SIGMA, drawing)
    return Drawn(figure, "Sliding variable, zero on the surface.")


def _phase_plane(run: _Run) -> Drawn:
    """Each joint's error against its rate, with the surface σ = 0 where σ follows from these two alone."""
    columns = min(len(run.joints), _MOST_COLUMNS)
    rows = -(-len(run.joints) // columns)
    figure, grid = panels(rows, columns, width=PAGE, height=2.3, share_x=False)
    for axes in grid.flat[len(run.joints) :]:
        axes.remove()
    plane = _Plane(run)
    for k, (axes, joint) in enumerate(zip(grid.flat, run.joints, strict=False)):
        e, de = plane.error[k], plane.rate[k]
        axes.plot(e, de, label="run", **LINES[0])
        axes.plot(e[0], de[0], "o", markersize=3.5, color="#D55E00", label="start", zorder=3)
        if run.status != "ok":
            axes.plot(e[-1], de[-1], "x", markersize=5, color="#D55E00", label=_stopped(run), zorder=3)
        axes.margins(x=0.05)
        if plane.surface:
            box = (*axes.get_xlim(), *axes.get_ylim())
            x, y = np.meshgrid(np.linspace(box[0], box[1], _GRID), np.linspace(box[2], box[3], _GRID))
            axes.contour(x, y, plane.sigma(k, x, y), levels=[0.0], colors="black", linestyles="dashed", linewidths=0.8)
            axes.add_line(Line2D([], [], label=f"{symbol(SIGMA)} = 0", **REFERENCE))
            axes.set_xlim(*box[:2])
            axes.set_ylim(*box[2:])
        axes.xaxis.set_major_locator(MaxNLocator(5))
        name_axis(axes.xaxis, f"{joint.name} error {symbol(E)}", joint.unit)
        name_axis(axes.yaxis, "its rate", f"{joint.unit}/s")
    legend_above(figure, columns=4)
    text = f" Dashed: the surface {symbol(SIGMA)} = 0, along which the error goes to zero." if plane.surface else ""
    return Drawn(figure, f"Error against its rate.{text}")


class _Plane:
    """Errors and their rates at the rows of a run, (joints, points), and the sliding variable over them."""

    def __init__(self, run: _Run) -> None:
        scenario = run.scenario
        self._joints = [joint.name for joint in run.joints]
        self._n = n = len(run.joints)
        self._values = scenario.values()
        self._state = len(scenario.system().drive.state) * n
        self._z = np.array(scenario.system().z_start)
        self._loop_error = scenario.system().function("loop_error")
        rows = self._picked(run)
        tables = scenario.tables()
        d = np.array([np.concatenate([np.zeros(0), *(table.row(t) for table in tables)]) for t in run.t[rows]]).T
        w = np.asarray(scenario.system().function("signals")(run.t[rows][None, :], d, self._values))
        self._w = w[:, :1]
        self.error = np.array([run[f"e_{name}"][rows] for name in self._joints])
        dq1 = np.array([run[f"dq1_{name}"][rows] for name in self._joints])
        self.rate = w[n : 2 * n] - dq1
        known = np.array([run[f"{SIGMA.name}_{name}"][rows] for name in self._joints])
        self.surface = self._follows(known)

    def _picked(self, run: _Run) -> NDArray[np.int64]:
        """Rows that show the path: of the start and of what follows, evenly each."""
        found = [np.flatnonzero(part.rows) for part in run.parts]
        return np.unique(np.concatenate([part[:: max(1, len(part) // _POINTS)] for part in found]))

    def _follows(self, known: Floats) -> bool:
        """Whether the sliding variable of the run is that of error and rate alone."""
        some = slice(None, None, max(1, known.shape[1] // _CHECKED))
        found = self._evaluated(self.error[:, some], self.rate[:, some])
        return bool(np.max(np.abs(found - known[:, some])) <= 1e-6 * np.max(np.abs(known)))

    def sigma(self, joint: int, error: Floats, rate: Floats) -> Floats:
        """The sliding variable of one joint at errors and rates of one shape, the others being on the reference."""
        e, de = np.zeros((self._n, error.size)), np.zeros((self._n, error.size))
        e[joint], de[joint] = error.ravel(), rate.ravel()
        found: Floats = self._evaluated(e, de)[joint].reshape(error.shape)
        return found

    def _evaluated(self, error: Floats, rate: Floats) -> Floats:
        n = self._n
        x = np.zeros((self._state, error.shape[1]))
        x[:n], x[n : 2 * n] = self._w[:n] - error, self._w[n : 2 * n] - rate
        memory = [self._z] if self._z.size else []
        return np.asarray(self._loop_error(self._w, x, *memory, self._values)[1])


def _force(run: _Run) -> Drawn:
    """What acts on the arm, the command where that is another, and the limits of the motors where they are near."""
    both = U_CMD in run.scenario.system().columns
    limits = dict(zip(run.joints, run.scenario.document["control"]["U_max"], strict=True))
    beyond = []

    def drawing(axes: Axes, joint: Joint, part: _Part) -> None:
        t, u = run.t[part.rows], run[f"{U.name}_{joint.name}"]
        if both:
            draw(axes, t, run[f"{U_CMD.name}_{joint.name}"][part.rows], "command", **LINES[1])
        draw(axes, t, u[part.rows], "what acts" if both else "", **LINES[0])
        largest = float(np.max(np.abs(u[part.rows])))
        if np.isfinite(limits[joint]) and limits[joint] <= _IN_SIGHT * largest:
            for limit in (-limits[joint], limits[joint]):
                axes.axhline(limit, label="limit ± U_max", **_LIMIT)

    figure = _joint_panels(run, f"force {symbol(U)}", U, drawing)
    for joint, limit in limits.items():
        if np.isinf(limit):
            beyond.append(f"{joint.name} has none")
        elif limit > _IN_SIGHT * float(np.max(np.abs(run[f"{U.name}_{joint.name}"]))):
            beyond.append(f"{joint.name}'s is {quantity_text(limit, joint.force)}, beyond the axis")
    of_limits = f" Of limits: {'; '.join(beyond)}." if beyond else ""
    return Drawn(figure, f"What the motors do.{of_limits}")


def _springs(run: _Run) -> Drawn:
    def drawing(axes: Axes, joint: Joint, part: _Part) -> None:
        deflection = run[f"q2_{joint.name}"] - run[f"q1_{joint.name}"]
        draw(axes, run.t[part.rows], deflection[part.rows], **LINES[0])

    figure = _joint_panels(run, f"spring {symbol(Q2)} − {symbol(Q1)}", Q2, drawing)
    return Drawn(figure, "Deflection of the springs between motor and link.")


def _disturbance(run: _Run) -> Drawn:
    """The forces on the links that any acts on. Zero is in sight, for a force is told by its size and its sign."""
    whole = [_Part("the whole run", np.ones(len(run.t), dtype=np.bool_))]

    def drawing(axes: Axes, joint: Joint, part: _Part) -> None:
        axes.axhline(0.0, label="no force", **REFERENCE)
        column = f"{DISTURBANCE.name}_{joint.name}"
        draw(axes, run.t[part.rows], run[column][part.rows], "force, positive along +q₁", **LINES[0])

    text = f"disturbance {symbol(DISTURBANCE)}"
    figure = _joint_panels(run, text, DISTURBANCE, drawing, joints=run.pushed, parts=whole)
    return Drawn(figure, "Forces that act on the links from outside.")


def _measured(run: _Run) -> Drawn:
    """What sensors show less what is, of each quantity that they show, a row of panels a joint."""
    measured = run.scenario.system().measured
    figure, grid = panels(len(run.joints), len(measured), width=PAGE, height=_HEIGHT, share_x="col")
    late = run.parts[-1]
    for row, joint in zip(grid, run.joints, strict=True):
        for axes, quantity in zip(row, measured, strict=True):
            shown = f"{quantity.name}_{joint.name}"
            true = shown.replace("_measured", "")
            draw(axes, run.t[late.rows], (run[shown] - run[true])[late.rows], **LINES[0])
            _expect_sight(run, axes)
            name_axis(axes.yaxis, joint.name if axes is row[0] else "", run.unit(shown))
    for axes, quantity in zip(grid[0], measured, strict=True):
        axes.set_title(f"{symbol(quantity)}: measured − true")
    _time_axis(run, figure, grid[-1])
    legend_above(figure)
    when = "" if len(run.parts) == 1 else f", {late.title}"
    text = "What the controller is shown less what is; between two samples it keeps what the last one showed"
    return Drawn(figure, f"{text}{when}.")


def _controller_states(run: _Run) -> Drawn:
    """The states of the controller: a column of panels a joint, a row a state."""
    states = run.scenario.system().controller_states
    columns = min(len(run.joints), _MOST_COLUMNS)
    shown = [entry for state in states for entry in state.entries(run.joints)]
    figure, grid = panels(-(-len(shown) // columns), columns, width=PAGE, height=1.15)
    for axes in grid.flat[len(shown) :]:
        axes.set_visible(False)
    for axes, entry in zip(grid.flat, shown, strict=False):
        draw(axes, run.t, run[entry.name], **LINES[0])
        _expect_sight(run, axes)
        name_axis(axes.yaxis, entry.name.removeprefix("z_").replace("_", " "), entry.unit)
    _time_axis(run, figure, grid[-1])
    legend_above(figure)
    return Drawn(figure, "What the controller remembers.")


def _base_motion(run: _Run) -> Drawn:
    figure, grid = panels(len(run.moving), width=PAGE, height=1.0)
    for axes, coordinate in zip(grid[:, 0], run.moving, strict=True):
        draw(axes, run.t, run[coordinate.symbol], **LINES[0])
        name_axis(axes.yaxis, coordinate.key, coordinate.unit)
    figure.align_ylabels()
    _time_axis(run, figure, grid[-1])
    legend_above(figure)
    positive = ", ".join(f"{c.key} {c.positive}" for c in run.moving)
    return Drawn(figure, f"How the base moves; positive are {positive}.")


def _tip(run: _Run) -> Drawn:
    """Where the tip is, as seen from the ship and from the earth."""
    figure, grid = panels(len(TIP) // 2, width=PAGE, height=1.0)
    for axes, ship, earth in zip(grid[:, 0], TIP[: len(TIP) // 2], TIP[len(TIP) // 2 :], strict=True):
        draw(axes, run.t, run[earth.name], "from the earth", **LINES[1])
        draw(axes, run.t, run[ship.name], "from the ship", **LINES[0])
        name_axis(axes.yaxis, f"tip {ship.name.split('_')[1]}", ship.unit)
    figure.align_ylabels()
    _time_axis(run, figure, grid[-1])
    legend_above(figure, columns=3)
    return Drawn(figure, "Where the tip is: x forward, y up, z to starboard.")


def _error_over_base(run: _Run) -> Drawn:
    """Tracking error below the base motion that disturbs it, on one time axis, once the start is over."""
    rows = [(c.key, c.unit, c.symbol, LINES[0]) for c in run.moving]
    rows += [
        (f"{j.name}\nerror", run.unit(f"e_{j.name}"), f"e_{j.name}", {**LINES[1], "linestyle": "-"}) for j in run.joints
    ]
    figure, grid = panels(len(rows), width=PAGE, height=0.85)
    late = run.settled
    for axes, (text, unit, column, line) in zip(grid[:, 0], rows, strict=True):
        draw(axes, run.t[late], run[column][late], **line)
        name_axis(axes.yaxis, text, unit)
    _time_axis(run, figure, grid[-1])
    figure.align_ylabels()
    legend_above(figure)
    return Drawn(figure, "Base motion and the error that it leaves, once the start is over.")


def _error_against_base(run: _Run) -> Drawn:
    """Each joint's error against each moving coordinate of the base, once the start is over, with their correlation."""
    columns = min(len(run.moving), _MOST_COLUMNS)
    blocks = -(-len(run.moving) // columns)
    figure, grid = panels(len(run.joints) * blocks, columns, width=PAGE, height=1.7, share_x=False)
    late = np.flatnonzero(run.settled)
    late = late[:: max(1, len(late) // _DOTS)]
    for j, joint in enumerate(run.joints):
        own = grid[j * blocks : (j + 1) * blocks]
        e = run[f"e_{joint.name}"][late]
        for axes in own.flat[len(run.moving) :]:
            axes.remove()
        for axes, coordinate in zip(own.flat, run.moving, strict=False):
            b = run[coordinate.symbol][late]
            axes.plot(b, e, ".", markersize=2, color=LINES[0]["color"], alpha=0.4, markeredgewidth=0)
            axes.set_title(f"correlation {np.corrcoef(b, e)[0, 1]:+.2f}".replace("-", "−"), loc="right", fontsize=7)
            axes.margins(x=0.03)
            axes.xaxis.set_major_locator(MaxNLocator(4))
            name_axis(axes.xaxis, coordinate.key, coordinate.unit)
            name_axis(axes.yaxis, f"{joint.name} error" if axes in own[:, 0] else "", run.unit(f"e_{joint.name}"))
    return Drawn(figure, "Error against each coordinate of the base, once the start is over, and their correlation.")
