"""Figure 6: the composite control as a block diagram. Lengths are in units of half an inch, from the lower left."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch

from springline.runner.report import PAGE, house_style

Point = tuple[float, float]

_INK, _QUIET = "#1c2024", "#5b646c"
_SLOW, _FAST, _PLANT, _SOURCE = "#d5e6f5", "#fbe0cd", "#d6eedf", "#ececec"
_RADIUS = 0.15


def block_diagram() -> Figure:
    """Reference, slow and fast control, limit, motor, spring, arm and base motion, with the signals between them."""
    with house_style():
        figure = Figure(figsize=(PAGE, 3.3))
        axes = figure.subplots()
        axes.set(xlim=(0, 14), ylim=(0, 6.6), aspect="equal")
        axes.axis("off")
        _frame(axes, (2.85, 3.3), (8.82, 6.0), "slow control", _SLOW)
        _frame(axes, (8.15, 1.65), (13.15, 3.15), "plant", _PLANT)
        _blocks(axes)
        _signals(axes)
        return figure


def _blocks(axes: Axes) -> None:
    _block(axes, (0.75, 4.9), (1.15, 1.0), "reference", _SOURCE)
    _block(axes, (3.75, 4.9), (1.15, 0.95), "surface\n$\\sigma(e,\\ \\dot{e})$", _SLOW)
    _block(axes, (5.45, 4.9), (1.4, 0.95), "reaching law\nwithin $\\pm a_\\mathrm{max}$", _SLOW)
    _block(axes, (7.9, 4.9), (1.5, 0.95), "computed\ntorque $H, C, G$", _SLOW)
    _block(axes, (10.65, 3.75), (1.6, 0.82), "fast control\n$K_f\\,(\\dot{q}_1 - \\dot{q}_2)$", _FAST)
    _block(axes, (11.75, 4.9), (1.0, 0.8), "limit\n$\\pm U_\\mathrm{max}$", _SOURCE)
    _block(axes, (12.3, 2.35), (1.2, 0.8), "motor\n$M_2$", _PLANT)
    _block(axes, (10.65, 2.35), (1.0, 0.8), "spring\n$K$", _PLANT)
    _block(axes, (9.05, 2.35), (1.2, 0.8), "arm\n$M_1, C, G$", _PLANT)
    _block(axes, (9.05, 0.6), (2.2, 0.75), "base motion\nsix coordinates", _SOURCE)
    for centre in ((2.4, 4.9), (6.65, 4.9), (9.4, 4.9)):
        axes.add_patch(Circle(centre, _RADIUS, facecolor="white", edgecolor=_INK, linewidth=0.9, zorder=3))


def _signals(axes: Axes) -> None:
    _arrow(axes, [(1.32, 4.9), (2.25, 4.9)], "$q_{1d},\\ \\dot{q}_{1d}$", (1.77, 5.14))
    _arrow(axes, [(2.55, 4.9), (3.17, 4.9)], "$e,\\ \\dot{e}$", (2.76, 5.12))
    _arrow(axes, [(4.33, 4.9), (4.75, 4.9)], "$\\sigma$", (4.53, 5.08))
    _arrow(axes, [(6.15, 4.9), (6.5, 4.9)], "$\\dot{\\sigma}^*$", (6.34, 5.15))
    _arrow(axes, [(6.8, 4.9), (7.15, 4.9)], "$u_e$", (6.98, 5.1))
    _arrow(axes, [(3.75, 4.42), (3.75, 3.75), (6.65, 3.75), (6.65, 4.75)], "the surface's own derivative", (5.2, 3.56))
    _sign(axes, "−", (6.83, 4.62))
    _arrow(axes, [(0.75, 5.4), (0.75, 6.3), (7.9, 6.3), (7.9, 5.38)], "$\\ddot{q}_{1d}$", (1.05, 6.08))
    _arrow(axes, [(8.65, 4.9), (9.25, 4.9)], "$U_s$", (9.07, 5.1))
    _arrow(axes, [(9.55, 4.9), (11.25, 4.9)])
    _arrow(axes, [(10.65, 4.16), (10.65, 4.5), (9.4, 4.5), (9.4, 4.75)], "$U_f$", (10.0, 4.66))
    _arrow(axes, [(12.25, 4.9), (13.55, 4.9), (13.55, 2.35), (12.9, 2.35)], "$U$", (12.75, 5.08))
    _arrow(axes, [(11.7, 2.35), (11.15, 2.35)], "$q_2$", (11.43, 2.53), both=True)
    _arrow(axes, [(10.15, 2.35), (9.65, 2.35)], "$z$", (9.9, 2.53), both=True)
    _arrow(axes, [(9.05, 0.98), (9.05, 1.95)], "$S$", (9.25, 1.38))
    _arrow(axes, [(9.05, 2.75), (9.05, 3.75), (9.85, 3.75)], "$\\dot{q}_1$", (9.4, 3.97))
    _arrow(axes, [(12.3, 2.75), (12.3, 3.75), (11.45, 3.75)], "$\\dot{q}_2$", (11.9, 3.97))
    _arrow(axes, [(8.45, 2.35), (2.4, 2.35), (2.4, 4.75)], "$q_1,\\ \\dot{q}_1$", (4.6, 2.56))
    _sign(axes, "−", (2.58, 4.62))
    _arrow(axes, [(7.55, 2.35), (7.55, 4.42)])
    axes.add_patch(Circle((7.55, 2.35), 0.045, color=_INK, zorder=4))


def _frame(axes: Axes, low: Point, high: Point, title: str, colour: str) -> None:
    axes.add_patch(
        FancyBboxPatch(
            low,
            high[0] - low[0],
            high[1] - low[1],
            boxstyle="round,pad=0,rounding_size=0.12",
            facecolor=colour,
            alpha=0.35,
            edgecolor=_QUIET,
            linewidth=0.7,
            linestyle=(0, (4, 3)),
            zorder=0,
        )
    )
    axes.text(low[0] + 0.12, high[1] - 0.1, title, fontsize=7, color=_QUIET, va="top", style="italic")


def _block(axes: Axes, centre: Point, size: Point, text: str, colour: str) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (centre[0] - size[0] / 2, centre[1] - size[1] / 2),
            *size,
            facecolor=colour,
            edgecolor=_INK,
            boxstyle="round,pad=0,rounding_size=0.07",
            linewidth=0.9,
            zorder=2,
        )
    )
    axes.text(*centre, text, fontsize=7, ha="center", va="center", linespacing=1.35, zorder=3)


def _arrow(axes: Axes, path: Sequence[Point], text: str = "", at: Point = (0, 0), *, both: bool = False) -> None:
    """A signal along corners to an arrow head, with its name centred at a point; `both` for an exchange of forces."""
    if len(path) > 2:
        axes.plot(*zip(*path[:-1], strict=True), color=_INK, linewidth=0.9, solid_joinstyle="miter", zorder=1)
    axes.add_patch(
        FancyArrowPatch(
            path[-2],
            path[-1],
            arrowstyle="<|-|>" if both else "-|>",
            mutation_scale=7,
            shrinkA=0,
            shrinkB=0,
            color=_INK,
            linewidth=0.9,
            zorder=1,
        )
    )
    if text:
        axes.text(*at, text, fontsize=7, ha="center", va="center", color=_INK, zorder=4)


def _sign(axes: Axes, text: str, at: Point) -> None:
    axes.text(*at, text, fontsize=8, ha="center", va="center")
