"""Figures of a dataset: curves over one key, maps over two, rank correlations and metrics over each key where there are
more; groups of a sweep side by side.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from springline.codegen.kernel import CHATTERING
from springline.runner.files import numpy_array
from springline.runner.report import LINES, PAGE, house_style, legend_above, panels
from springline.runner.sweep.influence import correlation, effects, most_influential
from springline.runner.sweep.map import metric_map, outcome_map
from springline.runner.sweep.plan import Plan
from springline.runner.sweep.shown import MOST_GROUPS, STOPPED, Runs, plain_decades, short
from springline.runner.sweep.summary import Summary, group_names
from springline.runner.sweep.summary import short as _text

_MOST_COLUMNS = 4
_RING: Mapping[str, Any] = {"markersize": 6, "markerfacecolor": "none", "markeredgewidth": 0.7}


def summary_figures(plan: Plan, summary: Summary) -> dict[str, Figure]:
    """The figures of a dataset, by name; what there is to see decides which."""
    runs = _shown(plan, summary)
    figures: dict[str, Figure] = {}
    with house_style():
        if len(runs.keys) == 1:
            many = len(runs.names) > MOST_GROUPS
            figures["curve"] = _columns_of_curves(runs, _split(plan)) if many else _curve(runs)
        elif len(runs.keys) == 2:
            figures["map"] = metric_map(runs, "settling_time")
            figures["error_map"] = metric_map(runs, "steady_state_error")
            if not runs.ok.all() or runs.chattering.any():
                figures["outcomes"] = outcome_map(runs)
        elif runs.keys:
            figures["correlation"] = correlation(runs)
            figures["scatter"] = effects(runs)
        if 1 < len(runs.names) <= MOST_GROUPS:
            figures["groups"] = _groups(runs)
    return figures


_CAPTIONS: Mapping[str, str] = {
    "curve": "What each group's runs come to over the key that varies.",
    "map": "Settling time over the two keys.",
    "error_map": "Steady-state error over the two keys.",
    "outcomes": "Where commands chatter, and where runs stop.",
    "correlation": "Which key moves what: rank correlations of each key with each metric, from −1 to 1, over the runs "
    "that came to their end.",
    "groups": "Share of each group's runs that settle within a time, and that end with at most an error.",
}


def captions(plan: Plan, summary: Summary) -> dict[str, str]:
    """What is seen in each figure that there may be, by name."""
    runs = _shown(plan, summary)
    drawn = most_influential(runs) if len(runs.keys) > 2 else []
    left = [f"`{key}`" for key in runs.keys if key not in drawn]
    rest = f" Not drawn, for they move less: {', '.join(left)}." if drawn and left else ""
    part = f" Of {summary.runs:,} runs {len(summary.shown):,} are drawn."
    sample = "" if len(summary.shown) == summary.runs else part
    said = {name: text + sample for name, text in _CAPTIONS.items()}
    scatter = (
        "Metrics over the keys, that which moves them most on the left; the line is the median of the runs near a "
        "value, the band is from 10 % to 90 % of them."
    )
    return said | {"scatter": scatter + rest + sample}


def _shown(plan: Plan, summary: Summary) -> Runs:
    """The rows that figures show."""
    axes = plan.numeric_axes()
    of_groups = group_names(plan)
    names = list(dict.fromkeys(of_groups))
    group = np.searchsorted([group.first for group in plan.groups], numpy_array(summary.shown["run"]), side="right") - 1
    return Runs(
        summary.shown,
        summary.units,
        plan.joints,
        [axis.key for axis in axes],
        {axis.key: axis.kind == "log_uniform" for axis in axes},
        np.array([names.index(name) for name in of_groups])[group],
        names,
        plan.sweep.method == "grid" and len(summary.shown) == summary.runs,
    )


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
            axes.set_xscale("log" if runs.logarithmic[key] else "linear")
            runs.name(axes.yaxis, column)
    for axes in grid[-1]:
        runs.name(axes.xaxis, key)
    if len(runs.names) > 1 or runs.chattering.any():
        legend_above(figure)
    return figure


def _split(plan: Plan) -> list[tuple[str, str]]:
    """Of each name of a group, what its first key is, and the others."""
    told = dict(zip(group_names(plan), (plan.told_apart(group) for group in plan.groups), strict=True))
    words = [[f"{key.rpartition('.')[2]} = {_text(value)}" for key, value in each.items()] for each in told.values()]
    return [(first, ", ".join(rest)) for first, *rest in words]


def _columns_of_curves(runs: Runs, split: list[tuple[str, str]]) -> Figure:
    """Chatter and steady-state error over one key: a column for each value of the first that groups, lines for others.

    Where a run stopped stands a cross at the top.
    """
    columns = list(dict.fromkeys(first for first, _ in split))[:_MOST_COLUMNS]
    lines = list(dict.fromkeys(rest for _, rest in split))[:MOST_GROUPS]
    shown = [f"{metric}_{joint.name}" for metric in ("chatter", "steady_state_error") for joint in runs.joints]
    figure, grid = panels(len(shown), len(columns), width=PAGE, height=1.25)
    key = runs.keys[0]
    for row, column in zip(grid, shown, strict=True):
        for other in row[1:]:
            other.sharey(row[0])
            other.tick_params(labelleft=False, which="both")
        for g, (first, rest) in enumerate(split):
            if first not in columns or rest not in lines:
                continue
            axes = row[columns.index(first)]
            style = LINES[lines.index(rest)]
            chosen = runs.group == g
            ends, stops = chosen & runs.ok, chosen & ~runs.ok
            order = np.argsort(runs[key][ends])
            axes.plot(runs[key][ends][order], runs[column][ends][order], label=rest or None, **style)
            top = axes.get_xaxis_transform()
            axes.plot(
                runs[key][stops], np.full(stops.sum(), 0.96), "x", color=style["color"], transform=top, markersize=4
            )
        known = runs[column][runs.ok & np.isfinite(runs[column])]
        if known.size and known.min() > 0 and known.max() > 5 * known.min():
            row[0].set_yscale("log")
            plain_decades(row[0].yaxis)
        runs.name(row[0].yaxis, column, short(column).replace(" error", "\nerror"))
        if column.startswith("chatter"):
            for axes in row:
                axes.axhline(CHATTERING, color="black", linewidth=0.6, label=f"chattering above {CHATTERING:g} 1/s")
    for axes, first in zip(grid[0], columns, strict=True):
        axes.set_title(first.partition(" = ")[2], fontsize=8)
    for axes in grid[-1]:
        axes.set_xscale("log" if runs.logarithmic[key] else "linear")
        runs.name(axes.xaxis, key)
        axes.xaxis.label.set_visible(False)
    figure.supxlabel(grid[-1, 0].get_xlabel(), fontsize=8)
    if not runs.ok.all():
        grid[0, 0].plot([], [], "x", color=STOPPED, label="stopped early")
    legend_above(figure, columns=4)
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
            runs.name(axes.xaxis, column)
            axes.set_ylabel("share of runs [%]")
    legend_above(figure)
    return figure
