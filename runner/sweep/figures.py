"""Figures of a dataset: curves over one key, a map over two, rank correlations and a scatter matrix over more; groups
of a sweep side by side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from numpy.typing import NDArray

from springline.model.parameters import Joint
from springline.runner.report import LINES, PAGE, house_style, label, legend_above, panels
from springline.runner.sweep import sampling
from springline.runner.sweep.plan import Plan
from springline.runner.sweep.summary import Summary, chattering, group_names

Floats = NDArray[np.float64]

_MOST_GROUPS = 6
_MOST_KEYS = 5
_MOST_BARS = 12
_BINS = 40
_POINTS = 800
_STOPPED = "#D55E00"
_NEVER = "0.75"
_HATCH: Mapping[str, Any] = {"facecolor": "none", "edgecolor": "white", "hatch": "//////", "linewidth": 0.0}
_RING: Mapping[str, Any] = {"markersize": 6, "markerfacecolor": "none", "markeredgewidth": 0.7}


@dataclass(frozen=True)
class _Runs:
    """The rows that figures show, as arrays."""

    table: pa.Table
    units: dict[str, str]
    joints: tuple[Joint, ...]
    keys: list[str]
    logarithmic: dict[str, bool]
    group: NDArray[np.int64]
    names: list[str]
    gridded: bool

    def __getitem__(self, column: str) -> Floats:
        return np.asarray(self.table[column].cast(pa.float64()).to_numpy(), dtype=np.float64)

    @property
    def ok(self) -> NDArray[np.bool_]:
        return np.asarray(np.array(self.table["status"].to_pylist()) == "ok", dtype=np.bool_)

    @property
    def chattering(self) -> NDArray[np.bool_]:
        return chattering(self.table, self.joints)

    def title(self, column: str) -> str:
        """Axis label of a column."""
        unit = self.units[column]
        return f"{_short(column)} [{unit}]" if " or " in unit else label(_short(column), unit)


def _short(column: str) -> str:
    """A key without its table, as the sweep has it; a metric in words."""
    _, dot, name = column.partition(".")
    return name if dot else column.replace("steady_state_error", "steady-state error").replace("_", " ")


def summary_figures(plan: Plan, summary: Summary) -> dict[str, Figure]:
    """The figures of a dataset, by name; what there is to see decides which."""
    axes = plan.numeric_axes()
    runs = _Runs(
        summary.shown,
        summary.units,
        plan.groups[0].work.system.joints,
        [axis.key for axis in axes],
        {axis.key: axis.kind == "log_uniform" for axis in axes},
        np.searchsorted([group.first for group in plan.groups], summary.shown["run"].to_numpy(), side="right") - 1,
        group_names(plan),
        plan.sweep.method == "grid" and len(summary.shown) == summary.runs,
    )
    figures: dict[str, Figure] = {}
    with house_style():
        if len(axes) == 1:
            figures["curve"] = _curve(runs)
        elif len(axes) == 2:
            figures["map"] = _map(runs)
        elif axes:
            figures["correlation"] = _correlation(runs)
            figures["scatter"] = _scatter_matrix(runs)
        if 1 < len(runs.names) <= _MOST_GROUPS:
            figures["groups"] = _groups(runs)
    return figures


# --- two keys --------------------------------------------------------------------------------------------


def _map(runs: _Runs) -> Figure:
    """Settling time over two keys, a row a group and a column a joint; where a run stopped, that is shown instead.

    Cells in which most runs that ended well chatter are hatched: their settling time is nothing to choose them by.
    """
    shown = min(len(runs.names), _MOST_GROUPS)
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
            chosen = runs.group == g
            where = [_cells(runs[key][chosen], e) for key, e in zip(runs.keys, edges, strict=True)]
            stopped = _binned(where, (~runs.ok[chosen]).astype(float), edges)
            settled = _binned(where, np.where(runs.ok[chosen], runs[column][chosen], np.nan), edges)
            ok = _binned(where, runs.ok[chosen].astype(float), edges)
            _shade(axes, edges, np.where(ok > 0, 1.0, np.nan), _NEVER)
            mesh = axes.pcolormesh(*edges, settled.T, norm=norm, cmap="viridis", rasterized=True)
            _shade(axes, edges, np.where(stopped > 0.5, 1.0, np.nan), _STOPPED)
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
            mesh, ax=grid.ravel().tolist(), label=label(_short("settling_time"), runs.units[columns[0]]), shrink=0.8
        )
        if low > 0:
            _plain_decades(bar.ax.yaxis)
    for name, color in (("never settled", _NEVER), ("diverged", _STOPPED)):
        grid[0, 0].plot([], [], "s", color=color, label=name)
    if runs.chattering.any():
        style = {**_HATCH, "facecolor": "0.3"}
        grid[0, 0].add_patch(Rectangle((np.nan, np.nan), 1, 1, label="chattering", **style))
    legend_above(figure)
    return figure


def _edges(runs: _Runs, key: str) -> Floats:
    """Edges of the cells along a key: around the points of a grid, or forty of equal width."""
    values = np.unique(runs[key])
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


# --- one key ---------------------------------------------------------------------------------------------


def _curve(runs: _Runs) -> Figure:
    """Settling time and steady-state error over one key; runs that chatter are ringed."""
    metrics = ("settling_time", "steady_state_error")
    figure, grid = panels(len(metrics), len(runs.joints), width=PAGE, height=1.7)
    key = runs.keys[0]
    for row, metric in zip(grid, metrics, strict=True):
        for axes, joint in zip(row, runs.joints, strict=True):
            column = f"{metric}_{joint.name}"
            for g, name in enumerate(runs.names[:_MOST_GROUPS]):
                chosen = (runs.group == g) & runs.ok
                order = np.argsort(runs[key][chosen])
                line = {**LINES[g], "marker": ".", "markersize": 3}
                axes.plot(runs[key][chosen][order], runs[column][chosen][order], label=name, **line)
            if np.any(rings := runs.chattering):
                axes.plot(runs[key][rings], runs[column][rings], "o", color="black", label="chattering", **_RING)
            axes.set_ylabel(runs.title(column))
            axes.set_xscale("log" if runs.logarithmic[key] else "linear")
    for axes in grid[-1]:
        axes.set_xlabel(runs.title(key))
    if len(runs.names) > 1 or runs.chattering.any():
        legend_above(figure)
    return figure


# --- more keys -------------------------------------------------------------------------------------------


def rank_correlation(x: Floats, y: Floats, group: NDArray[np.int64]) -> float:
    """Spearman's coefficient of the rows where both are known, ranks within each group; NaN if one stands still."""
    known = np.isfinite(x) & np.isfinite(y)
    ranks: list[list[Floats]] = [[], []]
    for g in np.unique(group[known]):
        rows = known & (group == g)
        for values, found in zip((x, y), ranks, strict=True):
            found.append(_ranks(values[rows]))
    if not ranks[0]:
        return float("nan")
    a, b = (np.concatenate(found) for found in ranks)
    spread = float(np.std(a) * np.std(b))
    return float(np.mean(a * b)) / spread if spread > 0 else float("nan")


def _ranks(values: Floats) -> Floats:
    """Ranks about zero, ties shared, scaled to the size of the sample."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(counts)
    mean = last - (counts - 1) / 2.0
    return np.asarray((mean[inverse] - (len(values) + 1) / 2.0) / len(values), dtype=np.float64)


_CORRELATED = ("settling_time", "steady_state_error", "overshoot", "U_max")


def _correlations(runs: _Runs) -> dict[str, dict[str, float]]:
    """Rank correlation of each key with each metric of each joint."""
    columns = [f"{metric}_{joint.name}" for metric in _CORRELATED for joint in runs.joints]
    ok = runs.ok
    group = runs.group[ok]
    values = {column: runs[column][ok] for column in columns}
    return {key: {c: rank_correlation(runs[key][ok], values[c], group) for c in columns} for key in runs.keys}


def _influence(correlations: dict[str, dict[str, float]]) -> list[str]:
    """Keys, the most influential first."""
    return sorted(correlations, key=lambda key: -max(np.nan_to_num(np.abs(list(correlations[key].values())))))


def _correlation(runs: _Runs) -> Figure:
    """Which key moves which metric: bars from -1 to 1."""
    correlations = _correlations(runs)
    keys = _influence(correlations)[:_MOST_BARS]
    figure, grid = panels(1, len(runs.joints), width=PAGE, height=0.35 + 0.34 * len(keys))
    thickness = 0.8 / len(_CORRELATED)
    for axes, joint in zip(grid[0], runs.joints, strict=True):
        for m, metric in enumerate(_CORRELATED):
            at = np.arange(len(keys)) + (m - (len(_CORRELATED) - 1) / 2) * thickness
            bars = [correlations[key][f"{metric}_{joint.name}"] for key in keys]
            axes.barh(at, np.nan_to_num(bars), thickness, color=LINES[m]["color"], label=_short(metric))
        axes.set_yticks(range(len(keys)), [_short(key) for key in keys])
        axes.set_ylim(len(keys) - 0.5, -0.5)
        axes.set_xlim(-1, 1)
        axes.set_xticks([-1, -0.5, 0, 0.5, 1])
        axes.axvline(0, color="black", linewidth=0.6)
        axes.set_title(joint.name)
        axes.set_xlabel("rank correlation")
    legend_above(figure, columns=4)
    return figure


def _scatter_matrix(runs: _Runs) -> Figure:
    """Every pair of the most influential keys and of settling time and steady-state error, runs that stopped in red."""
    keys = _influence(_correlations(runs))[:_MOST_KEYS]
    columns = [*keys, *(f"{m}_{joint.name}" for m in ("settling_time", "steady_state_error") for joint in runs.joints)]
    figure, grid = panels(len(columns), len(columns), width=PAGE, height=PAGE / len(columns) - 0.06, share_x=False)
    # A random choice: every k-th point of a Sobol sequence leaves holes that the sequence does not have.
    points = sampling.random(0, "points", 0, len(runs.table)) < _POINTS / max(len(runs.table), 1)
    colors = np.array([line["color"] for line in LINES])[runs.group % len(LINES)]
    for i, row in enumerate(columns):
        for j, column in enumerate(columns):
            axes = grid[i, j]
            if j > i:
                axes.set_visible(False)
                continue
            _scatter_panel(runs, axes, column, row, points, colors)
            axes.tick_params(labelsize=4, length=1.5, pad=1)
            if i < len(columns) - 1:
                axes.tick_params(labelbottom=False)
            else:
                axes.set_xlabel(_folded(runs.title(column)), fontsize=5)
            if j > 0 or i == 0:
                axes.tick_params(labelleft=False)
            if j == 0:
                axes.set_ylabel(_folded(runs.title(row)), fontsize=5)
    for g, name in enumerate(runs.names[:_MOST_GROUPS] if len(runs.names) > 1 else []):
        grid[0, 0].plot([], [], ".", color=LINES[g]["color"], label=name)
    if not runs.ok.all():
        grid[0, 0].plot([], [], "x", color=_STOPPED, label="diverged")
    legend_above(figure, columns=4)
    return figure


def _scatter_panel(
    runs: _Runs, axes: Axes, column: str, row: str, points: NDArray[np.bool_], colors: NDArray[Any]
) -> None:
    """One pair of columns, or on the diagonal the distribution of one."""
    ok = runs.ok
    x, y = runs[column], runs[row]
    if column == row:
        known = x[ok & np.isfinite(x)]
        if known.size:
            space = np.geomspace if _is_log(runs, column, known) else np.linspace
            axes.hist(known, bins=list(space(known.min(), known.max(), 25)), color="0.6")
    else:
        shown, stopped = ok & points, ~ok & points
        axes.scatter(x[shown], y[shown], s=1.2, c=colors[shown], linewidths=0, rasterized=True)
        axes.plot(x[stopped], y[stopped], "x", color=_STOPPED, markersize=1.5, rasterized=True)
        known = y[ok & np.isfinite(y)]
        if known.size and _is_log(runs, row, known):
            axes.set_yscale("log")
    known = x[ok & np.isfinite(x)]
    if known.size and _is_log(runs, column, known):
        axes.set_xscale("log")
    for axis, logarithmic in ((axes.xaxis, axes.get_xscale() == "log"), (axes.yaxis, axes.get_yscale() == "log")):
        axis.set_major_locator(LogLocator(numticks=3) if logarithmic else MaxNLocator(3))
        axis.set_major_formatter(_PLAIN)
    axes.minorticks_off()
    if column == row:
        axes.set_yticks([])


def _is_log(runs: _Runs, column: str, known: Floats) -> bool:
    """Keys as they were drawn; a metric that spans more than two decades too."""
    if column in runs.logarithmic:
        return runs.logarithmic[column]
    return bool(known.min() > 0 and known.max() / known.min() > 100)


def _folded(text: str) -> str:
    """A long label on several lines."""
    return text.replace(" [", "\n[").replace("steady-state error", "steady-state\nerror")


_PLAIN = FuncFormatter(lambda value, place: f"{value:g}")


def _plain_decades(axis: Axis) -> None:
    """Marks at 1, 2 and 5 of each decade (of many decades at 1 only), written out."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 100 * low else (1,)))
    axis.set_major_formatter(_PLAIN)
    axis.set_minor_formatter(NullFormatter())


# --- groups ----------------------------------------------------------------------------------------------


def _groups(runs: _Runs) -> Figure:
    """Share of each group's runs that settle within a time, and that end with at most an error."""
    metrics = ("settling_time", "steady_state_error")
    figure, grid = panels(len(metrics), len(runs.joints), width=PAGE, height=1.8, share_x=False)
    for row, metric in zip(grid, metrics, strict=True):
        for axes, joint in zip(row, runs.joints, strict=True):
            column = f"{metric}_{joint.name}"
            everything = runs[column][np.isfinite(runs[column])]
            for g, name in enumerate(runs.names):
                chosen = runs.group == g
                values = np.sort(runs[column][chosen & np.isfinite(runs[column])])
                share = np.arange(1, len(values) + 1) / max(int(chosen.sum()), 1)
                axes.step(values, 100 * share, where="post", label=name, **LINES[g])
            if everything.size and everything.min() > 0:
                axes.set_xscale("log")
                _plain_decades(axes.xaxis)
            axes.set_ylim(0, 102)
            axes.margins(x=0.04)
            axes.set_xlabel(runs.title(column))
            axes.set_ylabel("share of runs [%]")
    legend_above(figure)
    return figure
