"""The picture of README.md: the arm on its ship, what it does at sea, and where its controller is stable.

    python -m benchmarks.first_picture [--write]

Simulates a recorded vessel motion and a grid of controllers; --write (`make docs-first`) puts the picture into
docs/images/first.png, which takes about a minute.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle, Polygon
from matplotlib.transforms import Affine2D, Transform
from numpy.typing import NDArray

from springline.runner import batch, load_scenario, simulate
from springline.runner.analysis import delta_critical
from springline.runner.report import asked_to_write, house_style

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "first.png"

_INK, _QUIET, _HULL, _SEA = "#1c2024", "#5b646c", "#d5e6f5", "#7fb2dd"
_LIFT, _ROTATION, _SPRING = "#0072B2", "#D55E00", "#009E73"

Floats = NDArray[np.float64]


def figure() -> Figure:
    """Three panes beside each other."""
    with house_style():
        whole = Figure(figsize=(11.0, 3.7), layout="constrained")
        parts = np.asarray(whole.subfigures(1, 3, width_ratios=(3.1, 3.9, 4.0)))
        left, middle, right = parts
        _ship(left.subplots())
        _voyage(middle)
        _stability(right.subplots())
        return whole


def _ship(axes: Axes) -> None:
    """From starboard: lift and rotation, each with the spring between its motor and its link; meters."""
    axes.axis("off")
    axes.set(xlim=(-2.7, 3.1), ylim=(-1.55, 3.55), aspect="equal")
    axes.set_title("an elastic arm on a ship", fontsize=9)
    x = np.linspace(-2.7, 3.1, 300)
    water = -0.62 + 0.13 * np.sin(2.6 * x + 0.6)
    tilted = Affine2D().rotate_deg(4.0) + axes.transData
    _filled(axes, [(-2.3, 0.0), (2.3, 0.0), (2.85, 0.3), (2.15, -1.0), (-2.0, -1.0)], tilted)
    _filled(axes, [(-1.95, 0.0), (-1.95, 0.95), (-1.2, 0.95), (-1.05, 0.0)], tilted)
    axes.fill_between(x, water, -1.55, color=_SEA, alpha=0.55, linewidth=0, zorder=3)
    axes.plot(x, water, color=_SEA, linewidth=1.2, zorder=4)
    mast, motor, link, angle = 0.0, 0.75, 1.75, 0.85
    axes.plot([mast, mast], [0.0, 3.0], color=_QUIET, linewidth=3.0, transform=tilted, solid_capstyle="round")
    _filled(axes, _box(mast, motor, 0.34, 0.2), tilted, "#ffffff", _LIFT)
    _filled(axes, _box(mast, link, 0.34, 0.2), tilted, _LIFT, _LIFT)
    ends = np.linspace(motor + 0.1, link - 0.1, 200)
    axes.plot(
        mast + 0.11 * _triangle(7 * np.linspace(0, 1, 200)),
        ends,
        color=_SPRING,
        linewidth=1.6,
        transform=tilted,
        zorder=6,
    )
    pivot = np.array([0.5, link])
    axes.plot([mast, pivot[0]], [link, link], color=_LIFT, linewidth=4.0, transform=tilted, solid_capstyle="butt")
    for phase, strength in ((0.1, 0.18), (0.45, 0.3), (angle, 1.0)):
        tip = pivot + 1.48 * np.array([np.cos(phase), np.sin(phase)])
        axes.plot(*zip(pivot, tip, strict=True), color=_ROTATION, linewidth=4.5, alpha=strength, transform=tilted,
                  solid_capstyle="round", zorder=5)  # fmt: skip
    turns = np.linspace(0, 5 * np.pi, 250)
    radius = 0.06 + 0.2 * turns / turns[-1]
    axes.add_patch(
        Circle(
            (float(pivot[0]), float(pivot[1])),
            0.29,
            facecolor="white",
            edgecolor=_ROTATION,
            linewidth=1.2,
            transform=tilted,
            zorder=7,
        )
    )
    axes.plot(
        pivot[0] + radius * np.cos(turns),
        pivot[1] + radius * np.sin(turns),
        color=_SPRING,
        linewidth=1.3,
        transform=tilted,
        zorder=8,
    )
    for text, place, colour in (
        ("motor", (-0.32, motor), _LIFT),
        ("spring", (-0.32, (motor + link) / 2), _SPRING),
        ("lift", (-0.32, link), _LIFT),
    ):
        axes.text(*place, text, fontsize=7.5, color=colour, ha="right", va="center", transform=tilted)
    axes.text(1.35, 3.0, "rotation", fontsize=7.5, color=_ROTATION, ha="left", transform=tilted)
    axes.text(0.92, 1.5, "spring inside", fontsize=7.5, color=_SPRING, ha="left", va="center", transform=tilted)


def _triangle(phase: Floats) -> Floats:
    return np.asarray(2 * np.abs(2 * (phase % 1.0) - 1) - 1)


def _box(x: float, y: float, width: float, height: float) -> list[tuple[float, float]]:
    return [(x + a * width / 2, y + b * height / 2) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def _filled(
    axes: Axes, outline: Sequence[tuple[float, float]], where: Transform, fill: str = _HULL, edge: str = _QUIET
) -> None:
    axes.add_patch(
        Polygon(
            list(outline),
            facecolor=fill,
            edgecolor=edge,
            linewidth=1.0,
            transform=where,
            zorder=2 if fill == _HULL else 6,
        )
    )


def _voyage(part: SubFigure) -> None:
    """Heave, the rotation and its reference, and what is left of the error, along a recorded voyage."""
    found = simulate(load_scenario("ship/vessel_10hz", {"simulation.duration": 20.0})).trajectory
    data = {name: found[name].to_numpy() for name in found.column_names}
    t, late = data["t"], data["t"] >= 1.0
    above, middle, below = part.subplots(3, 1, sharex=True)
    above.set_title("tracking on a recorded sea", fontsize=9)
    above.plot(t, data["y_r1"], color=_QUIET)
    above.set_ylabel("heave\n[m]", fontsize=8)
    middle.plot(t, data["q1_rotation"], color=_ROTATION, linewidth=2.4, alpha=0.55, label="arm")
    middle.plot(t, data["q1d_rotation"], color=_INK, linewidth=0.9, linestyle=(0, (3, 2)), label="reference")
    middle.set_ylim(-0.3, 3.1)
    middle.legend(loc="upper right", ncols=2, fontsize=7, frameon=False)
    middle.set_ylabel("rotation\n[rad]", fontsize=8)
    below.plot(t[late], 1e3 * data["e_lift"][late], color=_LIFT, linewidth=1.0, label="lift [mm]")
    below.plot(t[late], 1e3 * data["e_rotation"][late], color=_ROTATION, linewidth=1.0, label="rotation [mrad]")
    below.set_ylim(-0.16, 0.3)
    below.legend(loc="upper right", ncols=2, fontsize=7, frameon=False)
    below.set_ylabel("error\nafter 1 s", fontsize=8)
    below.set_xlabel("t [s]", fontsize=8)
    for axes in (above, middle, below):
        axes.tick_params(labelsize=7)
        axes.set_xlim(0.0, 20.0)


def _stability(axes: Axes) -> None:
    """How soon the rotation settles and where it chatters, over δ and a_max; and what the analysis said before."""
    scenario = load_scenario("paper/nominal")
    delta, limit = np.geomspace(0.005, 0.2, 49), np.geomspace(20.0, 1000.0, 41)
    grid = np.array(np.meshgrid(delta, limit)).reshape(2, -1)
    columns = {"control.delta": grid[0], "control.a_max.0": grid[1], "control.a_max.1": grid[1]}
    found = batch(scenario, columns)
    shape = (limit.size, delta.size)
    settled = np.array(found["settling_time_rotation"].to_pylist(), float).reshape(shape)
    chatters = np.array(found["chatter_rotation"].to_pylist(), float).reshape(shape) > 20.0
    settled[chatters] = np.nan
    shown = axes.pcolormesh(
        delta, limit, settled, norm=LogNorm(0.15, 0.6), cmap="viridis", shading="nearest", rasterized=True
    )
    axes.contourf(delta, limit, chatters, levels=[0.5, 1.5], colors=["#ececec"], hatches=["////"])
    (critical,) = delta_critical(scenario)
    assert critical.value is not None
    axes.axvline(critical.value, color=_ROTATION, linewidth=1.8)
    axes.text(
        critical.value * 1.06,
        24.0,
        f"analyze, before any run:\n$\\delta > {critical.value:.3f}$",
        fontsize=7.5,
        color="white",
        va="bottom",
    )
    axes.text(
        0.0107,
        150.0,
        "chatters",
        fontsize=9,
        color=_INK,
        ha="center",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 2},
    )
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel("boundary layer $\\delta$ [m, rad]", fontsize=8)
    axes.set_ylabel("limit $a_\\mathrm{max}$ [m/s², rad/s²]", fontsize=8)
    axes.set_title(f"{grid.shape[1]:,} controllers, simulated", fontsize=9)
    axes.tick_params(labelsize=7)
    bar = axes.figure.colorbar(shown, ax=axes, ticks=[0.15, 0.3, 0.6], format="%g", pad=0.02)
    bar.ax.minorticks_off()
    bar.ax.tick_params(labelsize=7)
    bar.set_label("rotation settles after [s]", fontsize=8)


def main() -> int:
    """Command line; the exit code is 2 where there is no folder for pictures."""
    write = asked_to_write(__doc__, "the picture", PICTURE.parent)
    file = io.BytesIO()
    figure().savefig(file, format="png", dpi=150, metadata={"Software": None})
    sys.stdout.write(f"{PICTURE.name}: {len(file.getvalue())} bytes\n")
    if write:
        PICTURE.write_bytes(file.getvalue())
    return 0


if __name__ == "__main__":
    sys.exit(main())
