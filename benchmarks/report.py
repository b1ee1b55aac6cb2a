"""What `springline bench` shows: a table for people, rows for programs, a bar chart."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from springline.benchmarks.aims import Judgement, judge
from springline.benchmarks.harness import UNITS, Report, Row
from springline.benchmarks.problem import MODES, STAGES, STEPS
from springline.runner.report import PAGE, figure_files, house_style

OUTPUTS = ("bench.json", "bench.md", "bench.png", "bench.svg")
"""What a benchmark leaves in its folder."""

COLUMNS = ("contender", "variant", "ns", "ratio", "ms a run", "difference", "compile", "cached", "noise")

AIM_COLUMNS = ("aim, longer over shorter time", "wanted", "measured", "verdict")

_OURS, _THEIRS = "#0072B2", "#999999"


def table(rows: Sequence[Row]) -> list[list[str]]:
    """The rows as text, in the order of COLUMNS: ns per evaluation, ratio to springline's default, ms of a 4 s run."""
    return [
        [
            row.contender,
            row.variant,
            _text(row.ns_per_eval),
            _text(row.ratio),
            _text(row.ns_per_eval * STEPS * STAGES * 1e-6),
            f"{row.difference:.0e}" if math.isfinite(row.difference) else "–",
            _text(row.compile_cold, "s"),
            _text(row.compile_cached, "s"),
            row.note or _text(row.noise),
        ]
        for row in rows
    ]


def aim_table(judgements: Sequence[Judgement]) -> list[list[str]]:
    """The aims as text, in the order of AIM_COLUMNS."""
    return [
        [
            one.aim,
            f"{one.bound} {_text(one.wanted)}" if math.isfinite(one.wanted) else "–",
            _text(one.measured),
            one.verdict,
        ]
        for one in judgements
    ]


def machine_lines(report: Report) -> list[str]:
    """What the numbers belong to, for people."""
    machine = report.machine
    width = machine["vector_width"]
    lines = [
        f"{machine['processor']}, {machine['cores']} cores, {machine['instruction_set']}, "
        f"vectors of {width} doubles (W = {width}), at most {machine['peak_gflops']:.3g} GFLOP/s a core",
        ", ".join(f"{name} {number}" for name, number in machine["versions"].items()),
    ]
    lines += [
        f"springline with continuous control: {row.flops_per_eval:.0f} operations per evaluation, "
        f"{100.0 * row.roofline_share:.0f} % of that at most"
        for row in report.rows
        if math.isfinite(row.roofline_share)
    ]
    return lines


def files(report: Report) -> dict[str, bytes]:
    """bench.json (machine, rows, aims, units), the tables in Markdown, and the bar chart, by file name."""
    content = {
        "machine": report.machine,
        "rows": [plain(row) for row in report.rows],
        "aims": [plain(one) for one in judge(report)],
        "units": UNITS,
    }
    text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    return {
        "bench.json": text.encode(),
        "bench.md": markdown(report).encode(),
        **figure_files("bench", chart(report.rows)),
    }


def markdown(report: Report) -> str:
    """Machine, table and aims as Markdown."""
    tables = (
        [COLUMNS, ["---"] * 2 + ["---:"] * (len(COLUMNS) - 2), *table(report.rows)],
        [AIM_COLUMNS, ["---", "---:", "---:", "---"], *aim_table(judge(report))],
    )
    shown = ["\n".join("| " + " | ".join(line) + " |" for line in lines) for lines in tables]
    return "\n\n".join([*machine_lines(report), *shown]) + "\n"


def plain(row: Row | Judgement) -> dict[str, Any]:
    """A row for JSON, NaN as null."""
    return {
        key: None if isinstance(value, float) and math.isnan(value) else value for key, value in asdict(row).items()
    }


def chart(rows: Sequence[Row]) -> Figure:
    """A bar for every row that has a time, shortest first, one panel for each control mode; logarithmic."""
    groups = [
        sorted(
            (row for row in rows if row.variant.startswith(mode) and math.isfinite(row.ns_per_eval)),
            key=lambda row: row.ns_per_eval,
        )
        for mode in MODES
    ]
    groups = [group for group in groups if group]
    with house_style():
        height = 0.8 + 0.16 * sum(map(len, groups)) + 0.5 * len(groups)
        figure = Figure(figsize=(PAGE, height))
        panels = figure.subplots(
            len(groups), 1, sharex=True, squeeze=False, height_ratios=[len(group) + 1 for group in groups]
        )
        times = [row.ns_per_eval for group in groups for row in group]
        panels[0, 0].set(xscale="log", xlim=(min(times) / 2.0, max(times) * 5.0))
        for axes, group in zip(panels[:, 0], groups, strict=True):
            _bars(axes, group)
        panels[-1, 0].set_xlabel("time per evaluation of control and plant, one core unless threads are named [ns]")
    return figure


def _bars(axes: Axes, group: Sequence[Row]) -> None:
    names = [_name(row) for row in group]
    values = [row.ns_per_eval for row in group]
    colors = [_OURS if row.contender == "springline" else _THEIRS for row in group]
    axes.barh(names, values, color=colors, height=0.7)
    for position, row in enumerate(group):
        axes.annotate(
            f"{_text(row.ns_per_eval)}   ({_text(row.ratio)}×)",
            (row.ns_per_eval, position),
            xytext=(3, 0),
            textcoords="offset points",
            va="center",
            fontsize=6.5,
        )
    axes.invert_yaxis()
    axes.grid(visible=False, axis="y")
    axes.set_title(f"{group[0].variant.partition(',')[0]} control")


def _name(row: Row) -> str:
    detail = row.variant.partition(", ")[2]
    return f"{row.contender}, {detail}" if detail else row.contender


def _text(value: float, unit: str = "") -> str:
    """Three digits, large numbers in full with separators; "–" for none."""
    if not math.isfinite(value):
        return "–"
    return (f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}") + (f" {unit}" if unit else "")
