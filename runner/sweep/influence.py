"""Which keys move which metrics: rank correlations, and the metrics over the most influential keys."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from springline.runner.report import LINES, PAGE, legend_above, panels
from springline.runner.sweep import sampling
from springline.runner.sweep.shown import MOST_GROUPS, STOPPED, Floats, Runs, plain_decades, short

_MOST_KEYS = 4
_MOST_BARS = 12
_POINTS = 800
_BINS = 16  # parts of a key's values that each have a median
_BAND = (0.1, 0.5, 0.9)


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


def most_influential(runs: Runs) -> list[str]:
    """The keys that `effects` shows, the most influential first."""
    return _influence(_correlations(runs))[:_MOST_KEYS]


def effects(runs: Runs) -> Figure:
    """Settling time and steady-state error over the most influential keys, runs that stopped in red at the top.

    Over the points stand the median and the band from 10 % to 90 % of the runs near a value, of one group at a time.
    """
    keys = most_influential(runs)
    metrics = [f"{m}_{joint.name}" for m in ("settling_time", "steady_state_error") for joint in runs.joints]
    figure, grid = panels(len(metrics), len(keys), width=PAGE, height=1.35, share_x="col")
    # A random choice: every k-th point of a Sobol sequence leaves holes that the sequence does not have.
    points = sampling.random(0, "points", 0, len(runs.table)) < _POINTS / max(len(runs.table), 1)
    for row, metric in zip(grid, metrics, strict=True):
        known = runs[metric][runs.ok & np.isfinite(runs[metric])]
        for axes, key in zip(row, keys, strict=True):
            _effect(runs, axes, key, metric, points)
            if axes is not row[0]:
                axes.sharey(row[0])
                axes.tick_params(labelleft=False, which="both")
        if known.size and _is_log(runs, metric, known):
            row[0].set_yscale("log")
            plain_decades(row[0].yaxis)
        runs.name(row[0].yaxis, metric, _folded(short(metric)))
    for axes, key in zip(grid[-1], keys, strict=True):
        values = runs[key][np.isfinite(runs[key])]
        if values.size and _is_log(runs, key, values):
            axes.set_xscale("log")
            plain_decades(axes.xaxis)
        else:
            axes.xaxis.set_major_locator(MaxNLocator(4))
        axes.margins(x=0.03)
        runs.name(axes.xaxis, key)
    figure.align_ylabels()
    legend_above(figure, columns=4)
    return figure


def _effect(runs: Runs, axes: Axes, key: str, metric: str, points: NDArray[np.bool_]) -> None:
    """One metric over one key: points of runs that ended well, a cross at the top for each that did not, medians."""
    x, y, ok = runs[key], runs[metric], runs.ok
    several = len(runs.names) > 1
    for g, name in enumerate(runs.names[:MOST_GROUPS]):
        chosen = (runs.group == g) & ok & np.isfinite(x) & np.isfinite(y)
        color = LINES[g]["color"]
        shown = chosen & points
        axes.plot(x[shown], y[shown], ".", color=color, markersize=2.2, alpha=0.5, markeredgewidth=0)
        at, bands = _running(x[chosen], y[chosen])
        if len(at) > 1:
            band = None if several else f"middle {100 * (_BAND[-1] - _BAND[0]):.0f} % of runs"
            axes.fill_between(at, bands[0], bands[2], color=color, alpha=0.15, linewidth=0, label=band)
            line = LINES[g] if several else {"color": "black"}
            axes.plot(at, bands[1], label=name if several else "median", **line)
    stopped = ~ok & points & np.isfinite(x)
    if stopped.any():
        top = axes.get_xaxis_transform()
        style: dict[str, Any] = {"color": STOPPED, "markersize": 2.5, "transform": top, "clip_on": False}
        axes.plot(x[stopped], np.full(stopped.sum(), 1.0), "x", label="stopped early", **style)


def _running(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Places along x, with 10 %, 50 % and 90 % of y near each, (3, places): bins of equal numbers of runs."""
    distinct = np.unique(x)
    if len(distinct) <= _BINS:
        parts = [x == value for value in distinct]
        order = [np.flatnonzero(part) for part in parts]
    else:
        order = [part for part in np.array_split(np.argsort(x, kind="stable"), _BINS) if part.size]
    at = np.array([np.median(x[part]) for part in order])
    bands = np.array([np.quantile(y[part], _BAND) for part in order]).reshape(-1, len(_BAND)).T
    return at, bands


def _is_log(runs: Runs, column: str, known: Floats) -> bool:
    """Keys as they were drawn; a metric that spans more than two decades too."""
    if column in runs.logarithmic:
        return runs.logarithmic[column]
    return bool(known.min() > 0 and known.max() / known.min() > 100)


def _folded(text: str) -> str:
    """A long label on two lines."""
    return text.replace("settling time ", "settling time\n").replace("steady-state error ", "steady-state error\n")
