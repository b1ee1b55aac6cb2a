"""Figures 4, 5 and 7 to 25 of the paper, from our runs, and three of our own on what the paper leaves open.

A figure of a group has three parts: the quantity over the whole run as the paper shows it, its first moments, and what
is left once it has settled, which the paper's scale hides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from springline.model.base import PAPER_COORDINATES
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import Joint
from springline.model.quantities import DQ1, DQ1D, Q1, Q1D, SIGMA, E, Quantity
from springline.runner.paper.block_diagram import block_diagram
from springline.runner.paper.cases import CASES, LAWS
from springline.runner.paper.measured import Measured
from springline.runner.paper.numbers import number as told
from springline.runner.paper.runs import LAYERS, LIMITS, LINEAR_GAIN, Study
from springline.runner.paper.symbols import typeset
from springline.runner.report import LINES, PAGE, REFERENCE, TIME, Line, draw, house_style, label, legend_above

Curves = Sequence[tuple[str, Measured, Line]]


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """A figure: its file name without extension, its number and title, and how it is drawn from a study.

    group   the group of Table 2 that it shows, None for a figure that only the whole reproduction has
    remark  what to know besides, a sentence below the figure; "" for nothing
    """

    name: str
    number: str
    title: str
    group: int | None
    draw: Callable[[Study], Figure]
    remark: str = ""

    @property
    def caption(self) -> str:
        """Number, title and remark, for below the figure."""
        return f"**Figure {self.number}.** {self.title}. {self.remark}".rstrip()

    def possible(self, study: Study) -> bool:
        """Whether the study holds what is shown."""
        return study.whole if self.group is None else self.group in study.groups

    def make(self, study: Study) -> Figure:
        """The figure in the house style, with its number and title inside, so that its file can be shown alone."""
        with house_style():
            figure = self.draw(study)
            _entitle(figure, f"Figure {self.number}. {self.title}")
            return figure


_TITLE = 0.24
"""Height of a title inside a figure, inches."""


def _entitle(figure: Figure, title: str) -> None:
    """Put a title above axes and legend: the figure grows, and nothing in it changes its size."""
    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + _TITLE)
    top = height / (height + _TITLE)
    engine = figure.get_layout_engine()
    assert isinstance(engine, ConstrainedLayoutEngine)  # of the house style
    room = 0.0
    for legend in figure.legends:  # one that is told where to stand is left out of the layout
        room = legend.get_window_extent().height / figure.dpi + 2 * engine.get()["h_pad"]
        legend.set_bbox_to_anchor((0, 0, 1, top), figure.transFigure)
    engine.set(rect=(0, 0, 1, top - room / (height + _TITLE)))
    figure.text(0.08 / width, 1 - 0.08 / (height + _TITLE), typeset(title), fontsize=8.5, weight="bold", va="top")


@dataclass(frozen=True, slots=True)
class Shown:
    """What a group's figure shows of a joint: a quantity with its wished course, or (without one) its error.

    title, error_title  axis labels of what is shown and of the error
    quantity            Q1 or DQ1
    error               name of the error's column, before "_<joint>"
    wished              None where the error itself is shown
    """

    title: str
    error_title: str
    joint: Joint
    quantity: Quantity
    error: str
    wished: Quantity | None = None

    @property
    def column(self) -> str:
        """What is drawn."""
        return f"{self.quantity.name}_{self.joint.name}" if self.wished else self.error_column

    @property
    def desired(self) -> str:
        """The wished course, "" where there is none."""
        return f"{self.wished.name}_{self.joint.name}" if self.wished else ""

    @property
    def error_column(self) -> str:
        """The error."""
        return f"{self.error}_{self.joint.name}"

    @property
    def unit(self) -> str:
        """Of all three."""
        return unit_of(self.quantity, self.joint)


def unit_of(quantity: Quantity, joint: Joint) -> str:
    """Unit of a quantity of this joint."""
    return quantity.entries([joint])[0].unit


JOINTS = LIFT, ROTATION = MECHANISMS["transfer_manipulator"].joints

POSITION = Shown("lift position", "position error", LIFT, Q1, E.name, Q1D)
ANGLE = Shown("rotation angle", "angle error", ROTATION, Q1, E.name, Q1D)
VELOCITY = Shown("lift velocity", "velocity error", LIFT, DQ1, "velocity_error", DQ1D)
SPIN = Shown("angular velocity", "angular vel. error", ROTATION, DQ1, "velocity_error", DQ1D)
VELOCITY_ERROR = Shown("lift velocity error", "velocity error", LIFT, DQ1, "velocity_error")
SPIN_ERROR = Shown("angular velocity error", "angular vel. error", ROTATION, DQ1, "velocity_error")

START = {1: 0.4, 2: 2.0, 3: 0.4}
"""What the middle part of a group's figures shows, s."""

SETTLED = {1: 0.5, 2: 2.0, 3: 0.5}
"""From when on its right part shows errors, s."""

_WIDE = (PAGE, 2.35)


def _curves(study: Study, group: int) -> Curves:
    chosen = [case for case in CASES if case.group == group]
    return [(case.name, study.evidence.runs[case.scenario], line) for case, line in zip(chosen, LINES, strict=False)]


def _parts(ratios: Sequence[float], height: float = _WIDE[1]) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(PAGE, height))
    return figure, list(figure.subplots(1, len(ratios), width_ratios=list(ratios), squeeze=False)[0])


def _group(group: int, shown: Shown) -> Callable[[Study], Figure]:
    def drawn(study: Study) -> Figure:
        curves = _curves(study, group)
        figure, (whole, start, rest) = _parts((1.3, 1, 1.3))
        for axes in (whole, start):
            for name, run, line in curves:
                draw(axes, run["t"], run[shown.column], name, **line)
            if shown.desired:
                draw(axes, curves[0][1]["t"], curves[0][1][shown.desired], "desired", **REFERENCE)
            axes.set_xlabel(TIME)
        whole.set_ylabel(label(shown.title, shown.unit))
        start.set_xlim(0, START[group])
        start.set_title(f"first {START[group]:g} s")
        for name, run, line in curves:
            late = run["t"] >= SETTLED[group]
            draw(rest, run["t"][late], 1e3 * run[shown.error_column][late], name, **line)
        rest.set(xlabel=TIME, ylabel=label(shown.error_title, f"m{shown.unit}"))
        rest.set_title(f"after {SETTLED[group]:g} s")
        legend_above(figure, columns=len(curves) + 1)
        return figure

    return drawn


def _flutter(shown: Shown) -> Callable[[Study], Figure]:
    """Group 4: the run without fast control as far as the axes go, and how its distance to the other run grows."""

    def drawn(study: Study) -> Figure:
        (on_name, on, on_line), (off_name, off, off_line) = _curves(study, 4)
        figure, (whole, start, growth) = _parts((1.3, 1.3, 1))
        low, high = float(np.min(on[shown.column])), float(np.max(on[shown.column]))
        room = 0.6 * (high - low)
        for axes in (whole, start):
            draw(axes, off["t"], off[shown.column], off_name, **_solid(off_line, 0.6))
            draw(axes, on["t"], on[shown.column], on_name, **on_line)
            draw(axes, on["t"], on[shown.desired], "desired", **REFERENCE)
            axes.axvline(
                off.end, color="0.4", linewidth=0.8, linestyle=":", label=f"left its bound, {told(off.end, 2)} s"
            )
            axes.set(xlabel=TIME, ylim=(low - room, high + room))
        whole.set(ylabel=label(shown.title, shown.unit), xlim=(0, on.end))
        start.set_xlim(0, off.end * 1.1)
        start.set_title("until it leaves its bound")
        rows = min(len(off["t"]), len(on["t"]))
        gap = np.abs(off[shown.column][:rows] - on[shown.column][:rows])
        gap = np.where(gap > 0, gap, math.nan)
        draw(growth, off["t"][:rows], gap, **_solid(off_line, 0.6))
        growth.set(yscale="log", xlabel=TIME, ylabel=label("|off − on|", shown.unit))
        growth.set_ylim(bottom=float(np.nanmax(gap)) * 1e-8)
        growth.set_title("distance between the runs")
        legend_above(figure, columns=4)
        return figure

    return drawn


def _reaching_laws(study: Study) -> Figure:
    figure, (near, far) = _parts((1, 1), 2.7)
    for (law, rate), line in zip(study.evidence.laws.items(), LINES, strict=False):
        sigma = np.linspace(-1.5, 1.5, 1201)
        near.plot(sigma, rate(sigma), label=LAWS[law], **line)
        sigma = np.geomspace(1e-4, 8, 600)
        far.plot(sigma, np.abs(rate(sigma)), label=LAWS[law], **line)
    near.axhline(0, color="0.5", linewidth=0.6)
    near.axvline(0, color="0.5", linewidth=0.6)
    sigma_unit, rate_unit = unit_of(SIGMA, LIFT), f"{LIFT.unit}/s^2"
    near.set(xlabel=label(f"${SIGMA.symbol}$", sigma_unit), ylabel=label(rf"$\dot{SIGMA.symbol}$", rate_unit))
    near.set_title("phase plane")
    far.set(xscale="log", yscale="log", xlabel=label(f"$|{SIGMA.symbol}|$", sigma_unit))
    far.set_ylabel(label(rf"$|\dot{SIGMA.symbol}|$", rate_unit))
    far.set_title("the same on logarithmic scales")
    legend_above(figure, columns=3)
    return figure


def _linear_surface(study: Study) -> Figure:
    figure, panes = _parts((1, 1), 2.5)
    for axes, joint in zip(panes, JOINTS, strict=True):
        for (law, run), line in zip(study.evidence.linear.items(), LINES, strict=False):
            early = run["t"] <= 1.5
            draw(axes, run["t"][early], run[f"{SIGMA.name}_{joint.name}"][early], LAWS[law], **line)
        axes.set(xlabel=TIME, ylabel=label(f"${SIGMA.symbol}$", unit_of(SIGMA, joint)))
        axes.set_title(joint.name)
    legend_above(figure, columns=3)
    return figure


def _base_oscillations(study: Study) -> Figure:
    figure = Figure(figsize=(PAGE, 3.3))
    rows = figure.subplots(3, 1, sharex=True)
    for axes, (name, run, line), coordinate in zip(rows, _curves(study, 1), PAPER_COORDINATES, strict=True):
        unit, scale = ("°", 180 / math.pi) if coordinate.unit == "rad" else (coordinate.unit, 1.0)
        draw(axes, run["t"], scale * run[coordinate.symbol], name, **_solid(line))
        axes.set_ylabel(label(name, unit))
        axes.margins(y=0.12)
    rows[-1].set_xlabel(TIME)
    figure.align_ylabels()
    return figure


def _literal(study: Study) -> Figure:
    """E3, E4: the printed law with a limit only on its acceleration, beside the packaged boundary layer."""
    figure, panes = _parts((1, 1), 2.4)
    for axes, joint in zip(panes, JOINTS, strict=True):
        for name, (run, _), line in (
            (typeset("δ = 0"), study.literal["limited"], _solid(LINES[1], 0.6)),
            (typeset("δ = 0.05"), study.layers["0.05"], _solid(LINES[0])),
        ):
            draw(axes, run["t"], run[f"{E.name}_{joint.name}"], name, **line)
        axes.set(xlabel=TIME, ylabel=label(f"{joint.name} error", unit_of(E, joint)))
    legend_above(figure)
    return figure


def _readings(study: Study) -> Figure:
    """E8: the two readings of the logarithms, over the run and in a tenth of a second."""
    figure, (whole, detail) = _parts((1.2, 1), 2.4)
    for name, key, line in (
        ("logarithms to a base", "base", _solid(LINES[1], 0.6)),
        ("logarithms to a power", "power", _solid(LINES[0])),
    ):
        run, _ = study.readings[key]
        draw(whole, run["t"], run["sigma_lift"], name, **line)
        part = (run["t"] >= 3.5) & (run["t"] <= 3.55)
        draw(detail, run["t"][part], run["sigma_lift"][part], name, **_solid(line))
    largest = 1.15 * study.readings["base"][0].largest("sigma_lift")
    whole.set(
        xlabel=TIME, ylabel=label(f"${SIGMA.symbol}$ of the lift", unit_of(SIGMA, LIFT)), ylim=(-largest, largest)
    )
    detail.set(xlabel=TIME)
    detail.set_title("0.05 s of it")
    legend_above(figure)
    return figure


def _decisions(study: Study) -> Figure:
    """Steady-state error of the lift against the two numbers that are ours: delta and a_max."""
    figure, (left, right) = _parts((1, 1), 2.4)
    first = next(iter(study.scenarios.values()))
    bound = first.document["simulation"]["settling_band"] * abs(float(study.layers["0.05"][0]["e_lift"][0]))
    for axes, runs, table, key in (
        (left, study.layers, LAYERS, "control.delta"),
        (right, study.limits, LIMITS, "control.a_max"),
    ):
        values = np.array([table[name].overrides[key] for name in runs])
        errors = np.array([run.metric("steady_state_error", "lift") for run, _ in runs.values()])
        good = np.isfinite(values) & np.isfinite(errors)
        axes.plot(values[good], errors[good], marker="o", markersize=4, **_solid(LINES[0]))
        axes.axhline(bound, label=f"settling band, {1e3 * bound:.3g} mm", **REFERENCE)
        axes.set(xscale="log", yscale="log")
        axes.margins(x=0.05)
    left.set(xlabel=typeset("δ [m or rad]"), ylabel=label("steady-state error, lift", unit_of(E, LIFT)))
    right.set(xlabel=typeset("a_max [m/s² or rad/s²]"))
    legend_above(figure)
    return figure


def _solid(line: Line, width: float = 1.1) -> Line:
    """The line without its dashes, which fast oscillations would break up."""
    return {**line, "linestyle": "-", "linewidth": width}


def _group_figures(
    first: int,
    group: int,
    shows: str,
    shown_by_name: Mapping[str, Shown],
    how: Callable[[Shown], Callable[[Study], Figure]],
) -> tuple[PaperFigure, ...]:
    return tuple(
        PaperFigure(f"figure_{number:02d}", str(number), f"{name}, {shows} (group {group})", group, how(shown))
        for number, (name, shown) in enumerate(shown_by_name.items(), first)
    )


_FOUR = {"Lift position": POSITION, "Rotation angle": ANGLE, "Lift velocity": VELOCITY, "Angular velocity": SPIN}
_SIX: dict[str, Any] = {**_FOUR, "Lift velocity error": VELOCITY_ERROR, "Angular velocity error": SPIN_ERROR}

FIGURES: tuple[PaperFigure, ...] = (
    PaperFigure("figure_04", "4", "The three reaching laws (18) to (21) with Table 3's numbers", None, _reaching_laws),
    PaperFigure(
        "figure_05",
        "5",
        r"σ under the three laws with a linear surface $\sigma = \dot{e} + c\, e$, base at rest",
        None,
        _linear_surface,
        f"$c$ = {LINEAR_GAIN:g} 1/s is ours; the paper's is not published.",
    ),
    PaperFigure("figure_06", "6", "Block diagram of the composite control", None, lambda study: block_diagram()),
    PaperFigure(
        "figure_07", "7", "The three base oscillations (ours: the paper's are not published)", 1, _base_oscillations
    ),
    *_group_figures(8, 1, "variable power log law under each oscillation", _FOUR, partial(_group, 1)),
    *_group_figures(12, 2, "the three laws under shake", _FOUR, partial(_group, 2)),
    *_group_figures(16, 3, "payload of the plant alone changed, under shake", _SIX, partial(_group, 3)),
    *_group_figures(22, 4, "fast control on and off, under shake", _FOUR, _flutter),
)

OPEN_FIGURES: tuple[PaperFigure, ...] = (
    PaperFigure(
        "literal_law",
        "A1",
        "The printed law (δ = 0) and the boundary layer, both with a_max, base at rest",
        None,
        _literal,
    ),
    PaperFigure(
        "log_readings",
        "A2",
        "The two readings of the logarithms in (18), under a shake of 0.07 sin 11$t$ m",
        None,
        _readings,
    ),
    PaperFigure(
        "our_numbers", "A3", "Steady-state error of the lift against δ and a_max, base at rest", None, _decisions
    ),
)
"""Figures that the paper does not have."""
