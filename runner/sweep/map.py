"""The map of a sweep over two keys."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from springline.runner.report import PAGE, label, legend_above, panels
from springline.runner.sweep.shown import MOST_GROUPS, STOPPED, Floats, Runs, plain_decades, short

_BINS = 40
_NEVER = "0.75"
_HATCH: Mapping[str, Any] = {"facecolor": "none", "edgecolor": "white", "hatch": "//////", "linewidth": 0.0}


def settling_map(runs: Runs) -> Figure:
    """Settling time over two keys, a row a group and a column a joint; where a run stopped, that is shown instead.

    Cells in which most runs that ended well chatter are hatched: their settling time is nothing to choose them by.
    """
    shown = min(len(runs.names), MOST_GROUPS)
    figure, grid = panels(shown, len(runs.joints), width=PAGE, height=2.5, share_x=False)
    columns = [f"settling_time_{joint.name}" for joint in runs.joints]
    x_key, y_key = runs.keys
    edges = [_edges(runs, key) for key in runs.keys]
    finite = np.concatenate([runs[column][runs.ok] for column in columns])
    finite = finite[np.isfinite(finite)]
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.1, 1.0)
    norm = LogNorm(low, max(high, low * 1.01)) if low > 0 else Normalize(low, high)
    mesh = None
    for g in range(shown):
        for axes, column, joint in zip(grid[g], columns, runs.joints, strict=True):
            chosen = (runs.group == g) & np.isfinite([runs[key] for key in runs.keys]).all(axis=0)
            where = [_cells(runs[key][chosen], e) for key, e in zip(runs.keys, edges, strict=True)]
            stopped = _binned(where, (~runs.ok[chosen]).astype(float), edges)
            settled = _binned(where, np.where(runs.ok[chosen], runs[column][chosen], np.nan), edges)
            ok = _binned(where, runs.ok[chosen].astype(float), edges)
            _shade(axes, edges, np.where(ok > 0, 1.0, np.nan), _NEVER)
            mesh = axes.pcolormesh(*edges, settled.T, norm=norm, cmap="viridis", rasterized=True)
            _shade(axes, edges, np.where(stopped > 0.5, 1.0, np.nan), STOPPED)
            chatters = _binned(where, np.where(runs.ok[chosen], runs.chattering[chosen], np.nan), edges)
            _hatch(axes, edges, (chatters > 0.5) & ~(stopped > 0.5))
            axes.grid(visible=False)
            axes.set_xscale("log" if runs.logarithmic[x_key] else "linear")
            axes.set_yscale("log" if runs.logarithmic[y_key] else "linear")
            axes.set_title(joint.name if len(runs.names) == 1 else f"{joint.name}, {runs.names[g]}", fontsize=8)
            axes.set_xlabel(runs.title(x_key))
        grid[g, 0].set_ylabel(runs.title(y_key))
    if finite.size and mesh is not None:
        bar = figure.colorbar(
            mesh, ax=grid.ravel().tolist(), label=label(short("settling_time"), runs.units[columns[0]]), shrink=0.8
        )
        if low > 0:
            plain_decades(bar.ax.yaxis)
    for name, color in (("never settled", _NEVER), ("stopped early", STOPPED)):
        grid[0, 0].plot([], [], "s", color=color, label=name)
    if runs.chattering.any():
        style = {**_HATCH, "facecolor": "0.3"}
        grid[0, 0].add_patch(Rectangle((np.nan, np.nan), 1, 1, label="chattering", **style))
    legend_above(figure)
    return figure


def _edges(runs: Runs, key: str) -> Floats:
    """Edges of the cells along a key: around the points of a grid, or forty of equal width."""
    values = np.unique(runs[key][np.isfinite(runs[key])])
    logarithmic = runs.logarithmic[key] or (values[0] > 0 and len(values) > 2 and _is_geometric(values))
    runs.logarithmic[key] = logarithmic
    values = np.log(values) if logarithmic else values
    if runs.gridded:
        middle = (values[1:] + values[:-1]) / 2
        edges = np.concatenate([[2 * values[0] - middle[0]], middle, [2 * values[-1] - middle[-1]]])
    else:
        edges = np.linspace(values[0], values[-1], _BINS + 1)
    return np.asarray(np.exp(edges) if logarithmic else edges, dtype=np.float64)


def _cells(values: Floats, edges: Floats) -> NDArray[np.int64]:
    """In which cell each value lies; those on the outer edges count to the cells inside."""
    return np.clip(np.digitize(values, edges) - 1, 0, len(edges) - 2)


def _is_geometric(values: Floats) -> bool:
    ratios = values[1:] / values[:-1]
    return bool(ratios.max() / ratios.min() < 1.01)


def _binned(where: Sequence[NDArray[np.int64]], values: Floats, edges: Sequence[Floats]) -> Floats:
    """Mean of the finite values in each cell, NaN where there are none."""
    shape = tuple(len(e) - 1 for e in edges)
    known = np.isfinite(values)
    cells = np.ravel_multi_index([axis[known] for axis in where], shape)
    count = np.bincount(cells, minlength=shape[0] * shape[1])
    total = np.bincount(cells, values[known], minlength=shape[0] * shape[1])
    mean = np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0)
    return np.asarray(mean.reshape(shape), dtype=np.float64)


def _shade(axes: Axes, edges: Sequence[Floats], where: Floats, color: str) -> None:
    axes.pcolormesh(*edges, where.T, cmap=ListedColormap([color]), rasterized=True)


def _hatch(axes: Axes, edges: Sequence[Floats], where: NDArray[np.bool_]) -> None:
    """Hatch these cells, each run of neighbours along y as one, for the lines to go through."""
    for i, column in enumerate(where):
        borders = np.flatnonzero(np.diff(np.concatenate([[0], column, [0]])))
        for low, high in borders.reshape(-1, 2):
            left, right, bottom, top = edges[0][i], edges[0][i + 1], edges[1][low], edges[1][high]
            axes.add_patch(Rectangle((left, bottom), right - left, top - bottom, **_HATCH))
