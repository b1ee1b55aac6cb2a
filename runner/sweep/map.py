"""Maps of a sweep over two keys: of a metric, and of what became of the runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path
from matplotlib.patheffects import Normal, Stroke
from numpy.typing import NDArray

from springline.codegen.kernel import CHATTERING
from springline.runner.report import PAGE, legend_above, name_axis, panels
from springline.runner.sweep.shown import MOST_GROUPS, PLAIN, STOPPED, Floats, Runs, plain_decades, short

_BINS = 40
_SPAN = 1e3  # of a logarithmic scale at most: one perfect run must not take the colours from all others
_ROOMY = 2  # rows of maps that leave room for a label below each
_NEVER = "0.75"
_HATCH: Mapping[str, Any] = {"facecolor": "none", "edgecolor": "white", "hatch": "//////"}


def metric_map(runs: Runs, metric: str) -> Figure:
    """A metric over two keys, a row a group and a column a joint; where a run stopped, that is shown instead.

    Cells in which most runs that ended well chatter are hatched: their metric is nothing to choose them by.
    """
    shown = min(len(runs.names), MOST_GROUPS)
    height = 2.5 if shown <= _ROOMY else 1.85
    figure, grid = panels(shown, len(runs.joints), width=PAGE, height=height, share_x=False)
    columns = [f"{metric}_{joint.name}" for joint in runs.joints]
    edges = [_edges(runs, key) for key in runs.keys]
    one_scale = len({runs.units[column] for column in columns}) == 1
    scales = [_norm(runs, columns if one_scale else [column]) for column in columns]
    below = [
        bool(np.any(runs[c][runs.ok] < float(scale.vmin or 0.0))) for c, scale in zip(columns, scales, strict=True)
    ]
    meshes: list[Any] = [None] * len(columns)
    for g in range(shown):
        for j, (axes, column, joint) in enumerate(zip(grid[g], columns, runs.joints, strict=True)):
            chosen = _of_group(runs, g)
            where = _places(runs, chosen, edges)
            ended = _binned(where, (~runs.ok[chosen]).astype(float), edges)
            known = _binned(where, np.where(runs.ok[chosen], runs[column][chosen], np.nan), edges)
            ok = _binned(where, runs.ok[chosen].astype(float), edges)
            _cover(axes, edges, ok > 0, facecolor=_NEVER)
            meshes[j] = axes.pcolormesh(*edges, known.T, norm=scales[j], cmap="viridis", rasterized=True)
            _cover(axes, edges, ended > 0.5, facecolor=STOPPED)
            chatters = _binned(where, np.where(runs.ok[chosen], runs.chattering[chosen], np.nan), edges)
            _cover(axes, edges, (chatters > 0.5) & ~(ended > 0.5), **_HATCH)
            _scale_axes(runs, axes)
            axes.set_title(joint.name if len(runs.names) == 1 else f"{joint.name}, {runs.names[g]}", fontsize=8)
            _name_axes(runs, axes, below=g == shown - 1 or shown <= _ROOMY, beside=j == 0)
    for j, column in enumerate(columns[:1] if one_scale else columns):
        if np.any(np.isfinite(runs[column][runs.ok])):
            beside = grid if one_scale else grid[:, j]
            title = short(metric if one_scale else column)
            bar = figure.colorbar(
                meshes[j],
                ax=beside.ravel().tolist(),
                extend="min" if any(below) else "neither",
                **({"shrink": 0.8} if one_scale else {"location": "bottom", "shrink": 0.9}),
            )
            long = bar.ax.yaxis if one_scale else bar.ax.xaxis
            if isinstance(scales[j], LogNorm):
                plain_decades(long)
            name_axis(long, title, runs.units[column])
    never = [("never settled", _NEVER)] if metric == "settling_time" else []
    stopped = [("stopped early", STOPPED)] if not runs.ok.all() else []
    for name, color in (*never, *stopped):
        grid[0, 0].plot([], [], "s", color=color, label=name)
    if runs.chattering.any():
        style = {**_HATCH, "facecolor": "0.3", "linewidth": 0.0}
        grid[0, 0].add_patch(Rectangle((np.nan, np.nan), 1, 1, label="chattering", **style))
    legend_above(figure)
    return figure


def outcome_map(runs: Runs) -> Figure:
    """What becomes of runs over two keys, a panel a group: how much they chatter, and where they stop.

    Lines go around the cells in which most runs stopped, and around those in which most chatter or stopped.
    """
    shown = min(len(runs.names), MOST_GROUPS)
    width = min(shown, 2)
    figure, grid = panels(-(-shown // width), width, width=PAGE, height=2.5, share_x=False)
    edges = [_edges(runs, key) for key in runs.keys]
    worst = np.max([runs[f"chatter_{joint.name}"] for joint in runs.joints], axis=0)
    norm = LogNorm(1.0, 1000.0)
    mesh = None
    for g, axes in enumerate(grid.flat):
        if g >= shown:
            axes.set_visible(False)
            continue
        chosen = _of_group(runs, g)
        where = _places(runs, chosen, edges)
        stopped = _binned(where, (~runs.ok[chosen]).astype(float), edges) > 0.5
        uneasy = _binned(where, (~runs.ok[chosen] | runs.chattering[chosen]).astype(float), edges) > 0.5
        chatter = _binned(where, np.where(runs.ok[chosen], np.maximum(worst[chosen], 1.0), np.nan), edges)
        mesh = axes.pcolormesh(*edges, chatter.T, norm=norm, cmap="cividis_r", rasterized=True)
        _cover(axes, edges, stopped, facecolor=STOPPED)
        _boundary(axes, edges, uneasy, "chatters beyond", "black", "white", linewidth=2.2)
        _boundary(axes, edges, stopped, "stops beyond", "white", "black", linewidth=1.0, linestyle=(0, (3, 2)))
        _scale_axes(runs, axes)
        axes.set_title("" if len(runs.names) == 1 else runs.names[g], fontsize=8)
        _name_axes(runs, axes, below=g + width >= shown, beside=g % width == 0)
    assert mesh is not None
    bar = figure.colorbar(
        mesh, ax=grid.ravel().tolist(), label=f"chatter [1/s]; chattering above {CHATTERING:g}", shrink=0.8
    )
    plain_decades(bar.ax.yaxis)
    bar.ax.axhline(CHATTERING, color="black", linewidth=1.6)
    grid[0, 0].plot([], [], "s", color=STOPPED, label="stopped early")
    legend_above(figure, columns=4)
    return figure


def _norm(runs: Runs, columns: Sequence[str]) -> Normalize:
    """From the least to the largest number of the runs that ended well, logarithmic where none is zero."""
    known = np.concatenate([runs[column][runs.ok] for column in columns])
    known = known[np.isfinite(known)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.1, 1.0)
    if low <= 0:
        return Normalize(low, high)
    return LogNorm(max(low, high / _SPAN), max(high, low * 1.01))


def _scale_axes(runs: Runs, axes: Axes) -> None:
    axes.grid(visible=False)
    for key, axis, scale in zip(runs.keys, (axes.xaxis, axes.yaxis), (axes.set_xscale, axes.set_yscale), strict=True):
        scale("log" if runs.logarithmic[key] else "linear")
        if not runs.logarithmic[key]:
            axis.set_major_formatter(PLAIN)


def _name_axes(runs: Runs, axes: Axes, *, below: bool, beside: bool) -> None:
    """Say what the axes are, where there is room; their ticks have the prefix of those that say it."""
    for key, axis, shown in zip(runs.keys, (axes.xaxis, axes.yaxis), (below, beside), strict=True):
        runs.name(axis, key)
        axis.label.set_visible(shown)


def _of_group(runs: Runs, g: int) -> NDArray[np.bool_]:
    """The runs of a group that have both keys: a table of a controller that a group lacks has none."""
    chosen: NDArray[np.bool_] = (runs.group == g) & np.isfinite([runs[key] for key in runs.keys]).all(axis=0)
    return chosen


def _places(runs: Runs, chosen: NDArray[np.bool_], edges: Sequence[Floats]) -> list[NDArray[np.int64]]:
    """In which cell of each key the chosen runs lie."""
    return [_cells(runs[key][chosen], e) for key, e in zip(runs.keys, edges, strict=True)]


def _boundary(
    axes: Axes, edges: Sequence[Floats], inside: NDArray[np.bool_], name: str, color: str, rim: str, **style: Any
) -> None:
    """Draw the line between the cells that are inside and those that are not."""
    x, y = edges
    upright = [[(x[i + 1], y[j]), (x[i + 1], y[j + 1])] for i, j in np.argwhere(inside[1:] != inside[:-1])]
    level = [[(x[i], y[j + 1]), (x[i + 1], y[j + 1])] for i, j in np.argwhere(inside[:, 1:] != inside[:, :-1])]
    if upright or level:
        halo = [Stroke(linewidth=style["linewidth"] + 1.2, foreground=rim), Normal()]
        axes.add_collection(LineCollection(upright + level, colors=color, path_effects=halo, **style))
        axes.plot([], [], color=color, label=name, path_effects=halo, **style)


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


def _cover(axes: Axes, edges: Sequence[Floats], where: NDArray[np.bool_], **style: Any) -> None:
    """Cover these cells with one patch, in which no seams are seen and hatches go through."""
    boxes = []
    for i, column in enumerate(where):
        borders = np.flatnonzero(np.diff(np.concatenate([[0], column, [0]])))
        for low, high in borders.reshape(-1, 2):
            (left, right), (bottom, top) = edges[0][i : i + 2], edges[1][[low, high]]
            boxes.append(
                Path([(left, bottom), (right, bottom), (right, top), (left, top), (left, bottom)], closed=True)
            )
    if boxes:
        axes.add_patch(PathPatch(Path.make_compound_path(*boxes), linewidth=0.0, **style))
