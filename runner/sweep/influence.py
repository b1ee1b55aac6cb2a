"""Which keys move which metrics: rank correlations, and pairs of the most influential ones."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MaxNLocator
from numpy.typing import NDArray

from springline.runner.report import LINES, PAGE, legend_above, panels
from springline.runner.sweep import sampling
from springline.runner.sweep.shown import MOST_GROUPS, PLAIN, STOPPED, Floats, Runs, short

_MOST_KEYS = 5
_MOST_BARS = 12
_POINTS = 800


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


def _correlations(runs: Runs) -> dict[str, dict[str, float]]:
    """Rank correlation of each key with each metric of each joint."""
    columns = [f"{metric}_{joint.name}" for metric in _CORRELATED for joint in runs.joints]
    ok = runs.ok
    group = runs.group[ok]
    values = {column: runs[column][ok] for column in columns}
    return {key: {c: rank_correlation(runs[key][ok], values[c], group) for c in columns} for key in runs.keys}


def _influence(correlations: dict[str, dict[str, float]]) -> list[str]:
    """Keys, the most influential first."""
    return sorted(correlations, key=lambda key: -max(np.nan_to_num(np.abs(list(correlations[key].values())))))


def correlation(runs: Runs) -> Figure:
    """Which key moves which metric: bars from -1 to 1."""
    correlations = _correlations(runs)
    keys = _influence(correlations)[:_MOST_BARS]
    figure, grid = panels(1, len(runs.joints), width=PAGE, height=0.35 + 0.34 * len(keys))
    thickness = 0.8 / len(_CORRELATED)
    for axes, joint in zip(grid[0], runs.joints, strict=True):
        for m, metric in enumerate(_CORRELATED):
            at = np.arange(len(keys)) + (m - (len(_CORRELATED) - 1) / 2) * thickness
            bars = [correlations[key][f"{metric}_{joint.name}"] for key in keys]
            axes.barh(at, np.nan_to_num(bars), thickness, color=LINES[m]["color"], label=short(metric))
        axes.set_yticks(range(len(keys)), [short(key) for key in keys])
        axes.set_ylim(len(keys) - 0.5, -0.5)
        axes.set_xlim(-1, 1)
        axes.set_xticks([-1, -0.5, 0, 0.5, 1])
        axes.axvline(0, color="black", linewidth=0.6)
        axes.set_title(joint.name)
        axes.set_xlabel("rank correlation")
    legend_above(figure, columns=4)
    return figure


def scatter_matrix(runs: Runs) -> Figure:
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
    for g, name in enumerate(runs.names[:MOST_GROUPS] if len(runs.names) > 1 else []):
        grid[0, 0].plot([], [], ".", color=LINES[g]["color"], label=name)
    if not runs.ok.all():
        grid[0, 0].plot([], [], "x", color=STOPPED, label="stopped early")
    legend_above(figure, columns=4)
    return figure


def _scatter_panel(
    runs: Runs, axes: Axes, column: str, row: str, points: NDArray[np.bool_], colors: NDArray[Any]
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
        axes.plot(x[stopped], y[stopped], "x", color=STOPPED, markersize=1.5, rasterized=True)
        known = y[ok & np.isfinite(y)]
        if known.size and _is_log(runs, row, known):
            axes.set_yscale("log")
    known = x[ok & np.isfinite(x)]
    if known.size and _is_log(runs, column, known):
        axes.set_xscale("log")
    for axis, logarithmic in ((axes.xaxis, axes.get_xscale() == "log"), (axes.yaxis, axes.get_yscale() == "log")):
        axis.set_major_locator(LogLocator(numticks=3) if logarithmic else MaxNLocator(3))
        axis.set_major_formatter(PLAIN)
    axes.minorticks_off()
    if column == row:
        axes.set_yticks([])


def _is_log(runs: Runs, column: str, known: Floats) -> bool:
    """Keys as they were drawn; a metric that spans more than two decades too."""
    if column in runs.logarithmic:
        return runs.logarithmic[column]
    return bool(known.min() > 0 and known.max() / known.min() > 100)


def _folded(text: str) -> str:
    """A long label on several lines."""
    return text.replace(" [", "\n[").replace("steady-state error", "steady-state\nerror")
