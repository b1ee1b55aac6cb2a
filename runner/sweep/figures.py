"""Figures of a dataset: curves over one key, a map over two, rank correlations and a scatter matrix over more; groups
of a sweep side by side.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from springline.runner.report import LINES, PAGE, house_style, legend_above, panels
from springline.runner.sweep.influence import correlation, scatter_matrix
from springline.runner.sweep.map import settling_map
from springline.runner.sweep.plan import Plan
from springline.runner.sweep.shown import MOST_GROUPS, Runs, plain_decades
from springline.runner.sweep.summary import Summary, group_names

_RING: Mapping[str, Any] = {"markersize": 6, "markerfacecolor": "none", "markeredgewidth": 0.7}


def summary_figures(plan: Plan, summary: Summary) -> dict[str, Figure]:
    """The figures of a dataset, by name; what there is to see decides which."""
    axes = plan.numeric_axes()
    runs = Runs(
        summary.shown,
        summary.units,
        plan.joints,
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
            figures["map"] = settling_map(runs)
        elif axes:
            figures["correlation"] = correlation(runs)
            figures["scatter"] = scatter_matrix(runs)
        if 1 < len(runs.names) <= MOST_GROUPS:
            figures["groups"] = _groups(runs)
    return figures


def _curve(runs: Runs) -> Figure:
    """Settling time and steady-state error over one key; runs that chatter are ringed."""
    metrics = ("settling_time", "steady_state_error")
    figure, grid = panels(len(metrics), len(runs.joints), width=PAGE, height=1.7)
    key = runs.keys[0]
    for row, metric in zip(grid, metrics, strict=True):
        for axes, joint in zip(row, runs.joints, strict=True):
            column = f"{metric}_{joint.name}"
            for g, name in enumerate(runs.names[:MOST_GROUPS]):
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


def _groups(runs: Runs) -> Figure:
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
                plain_decades(axes.xaxis)
            axes.set_ylim(0, 102)
            axes.margins(x=0.04)
            axes.set_xlabel(runs.title(column))
            axes.set_ylabel("share of runs [%]")
    legend_above(figure)
    return figure
