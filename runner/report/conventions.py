"""The picture in docs/conventions.md: axes, signs and mount of a ship, seen from starboard, from astern and from above.

Which way an arrow turns is asked of the model. ``make docs-pictures`` draws it anew.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import casadi as ca
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Polygon
from numpy.typing import NDArray

from springline.codegen.files import canonical_json
from springline.model.base import COORDINATES, BaseCoordinate, turned
from springline.runner.report.docs_picture import command, stamped
from springline.runner.report.style import PAGE, house_style

PICTURE = Path("docs/images/conventions.svg")

_INK, _QUIET, _HULL, _ARM = "#1c2024", "#5b646c", "#d5e6f5", "#D55E00"
_AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
_ALONG = {"x": "surge", "y": "heave", "z": "sway"}
_MOUNT = np.array([1.15, 0.38, 0.22])  # of the arm's foot

Point = tuple[float, float]


@dataclass(frozen=True)
class View:
    """What one looks at: the axes that point to the right and up on the page, downwards with a minus, and what turns.

    hull  outlines in these two directions
    """

    title: str
    right: str
    up: str
    turns: str
    hull: Sequence[Sequence[Point]]

    def on_page(self, vector: Sequence[float] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Right and up parts of a vector in base axes."""
        return np.array([_direction(axis) @ np.asarray(vector, float) for axis in (self.right, self.up)])


def _direction(axis: str) -> NDArray[np.float64]:
    return (-1.0 if axis.startswith("-") else 1.0) * np.array(_AXES[axis[-1]], float)


VIEWS = (
    View(
        "from starboard", "x", "y", "pitch",
        [[(-1.9, 0.28), (1.75, 0.28), (2.15, 0.45), (1.6, -0.42), (-1.65, -0.42)],
         [(-1.45, 0.28), (-1.45, 0.85), (-0.85, 0.85), (-0.75, 0.28)]],
    ),
    View(
        "from astern", "z", "y", "roll",
        [[(-0.75, 0.28), (0.75, 0.28), (0.68, -0.2), (0.4, -0.42), (-0.4, -0.42), (-0.68, -0.2)],
         [(-0.5, 0.28), (-0.5, 0.85), (0.5, 0.85), (0.5, 0.28)]],
    ),
    View(
        "from above", "x", "-z", "yaw",
        [[(-1.9, -0.5), (-1.9, 0.5), (-1.75, 0.65), (0.9, 0.65), (1.6, 0.42), (2.15, 0.0), (1.6, -0.42), (0.9, -0.65),
          (-1.75, -0.65)],
         [(-1.45, -0.45), (-1.45, 0.45), (-0.75, 0.45), (-0.75, -0.45)]],
    ),
)  # fmt: skip


def sense(view: View) -> int:
    """1 where what turns in a view turns counterclockwise on the page as it grows, -1 where it turns clockwise."""
    angles = {"roll": 0.0, "pitch": 0.0, "yaw": 0.0, view.turns: 0.01}
    rotation = np.array(ca.DM(ca.evalf(turned(*(ca.SX(angles[key]) for key in ("roll", "pitch", "yaw"))))))
    return int(np.sign(view.on_page(rotation @ _direction(view.right))[1]))


def _coordinate(key: str) -> BaseCoordinate:
    return next(item for item in COORDINATES if item.key == key)


def picture() -> Figure:
    """Three views beside each other, in one scale."""
    with house_style():
        figure = Figure(figsize=(PAGE, 1.9))
        widths = [5.1, 3.4, 5.1]
        panes = figure.subplots(1, 3, width_ratios=widths)
        for axes, view, width in zip(panes, VIEWS, widths, strict=True):
            axes.axis("off")
            middle = 0.52 if width > 4 else 0.4
            axes.set(xlim=(middle - width / 2, middle + width / 2), ylim=(-1.7, 1.6), aspect="equal")
            axes.set_title(view.title, fontsize=8, color=_QUIET)
            _view(axes, view)
        return figure


def _view(axes: Axes, view: View) -> None:
    for outline in view.hull:
        axes.add_patch(Polygon(list(outline), facecolor=_HULL, edgecolor=_QUIET, linewidth=0.8, joinstyle="round"))
    length = {"x": 2.95, "y": 1.4, "z": 1.65}
    for axis in (view.right, view.up):
        name = axis[-1]
        x, y = view.on_page(length[name] * np.array(_AXES[name]))
        _arrow(axes, (0, 0), (x, y), _INK)
        text = f"{name}  {_ALONG[name]}"
        if axis == view.up:
            axes.text(x + 0.1, y, text, fontsize=7, color=_INK, va="center")
        else:
            axes.text(x, y - 0.1, text, fontsize=7, color=_INK, va="top", ha="right")
    # The third axis points to the reader or away.
    depth = np.cross(_direction(view.right), _direction(view.up))
    third = next(name for name, vector in _AXES.items() if abs(depth @ np.array(vector, float)) > 0.5)
    towards = bool(depth @ np.array(_AXES[third], float) > 0)
    axes.add_patch(Circle((0, 0), 0.09, facecolor="white", edgecolor=_INK, linewidth=0.9, zorder=4))
    axes.text(-0.15, -0.12, third, fontsize=7, ha="right", va="center", color=_INK, zorder=4)
    if towards:
        axes.add_patch(Circle((0, 0), 0.03, color=_INK, zorder=5))
    else:
        for down in (-0.063, 0.063):
            axes.plot([-0.063, 0.063], [down, -down], color=_INK, linewidth=0.9, zorder=5)
    _turn(axes, view)
    foot: Point = (float(view.on_page(_MOUNT)[0]), float(view.on_page(_MOUNT)[1]))
    _arrow(axes, (0, 0), foot, _ARM, width=0.8, dashed=True)
    axes.plot(*foot, "s", markersize=3.5, color=_ARM, zorder=6)
    if view.turns == "pitch":
        axes.text(foot[0] + 0.1, foot[1] + 0.06, "mount: the arm's foot", fontsize=6.5, color=_ARM, va="bottom")


def _turn(axes: Axes, view: View) -> None:
    """An arc about the third axis, below the hull, with the name of what turns and where it goes as it grows."""
    item = _coordinate(view.turns)
    radius = 0.62
    angles = np.radians(np.linspace(215, 325, 40))[:: sense(view)]
    arc = radius * np.stack([np.cos(angles), np.sin(angles)])
    axes.plot(*arc[:, :-2], color=_INK, linewidth=1.1, zorder=5)
    _arrow(axes, (arc[0, -3], arc[1, -3]), (arc[0, -1], arc[1, -1]), _INK, width=1.1)
    x, side = (0.12, "left") if view.up.startswith("-") else (0.0, "center")  # beside an axis that points down
    axes.text(x, -0.9, f"{item.key}: {item.positive}", fontsize=7, ha=side, va="center", color=_INK)


def _arrow(axes: Axes, begin: Point, end: Point, colour: str, *, width: float = 0.9, dashed: bool = False) -> None:
    axes.add_patch(
        FancyArrowPatch(
            begin, end, arrowstyle="-|>", mutation_scale=7, shrinkA=0, shrinkB=2 if dashed else 0, color=colour,
            linewidth=width, linestyle=(0, (3, 2)) if dashed else "-", zorder=3,
        )
    )  # fmt: skip


def shown() -> str:
    """Hash of what the picture says, whatever draws it."""
    said = [[view.title, view.turns, sense(view), _coordinate(view.turns).positive] for view in VIEWS]
    return sha256(canonical_json([said, _ALONG])).hexdigest()


def drawn() -> bytes:
    """The picture as SVG, with the hash of what it says."""
    return stamped(PICTURE, picture(), shown())


if __name__ == "__main__":
    sys.exit(command(PICTURE, drawn, __doc__))
