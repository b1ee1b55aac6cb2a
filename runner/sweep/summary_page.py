"""A summary as people read it: tables of texts, and summary.md with figures beside the parts of a dataset."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from springline.codegen.files import render
from springline.codegen.kernel import CHATTERING
from springline.runner.files import value_text
from springline.runner.sweep.dataset import Dataset
from springline.runner.sweep.plan import Plan
from springline.runner.sweep.summary import CHATTERED, OUTCOMES, QUANTILES, Summary, short

Rows = tuple[list[str], list[list[str]]]
"""Header and rows of a table of texts."""


def summary_tables(summary: Summary, keys: Sequence[str]) -> tuple[Rows, Rows, Rows]:
    """How the runs of each group ended; quantiles of the metrics; the worst runs with these keys."""
    return _outcome_rows(summary), _metric_rows(summary), _worst_rows(summary, keys)


def _outcome_rows(summary: Summary) -> Rows:
    """How many runs of each group ended how."""
    header = [
        "group",
        "runs",
        "ok",
        "of these chattering",
        "diverged",
        "out of bounds",
        "out of limits",
        "stopped early",
    ]
    rows = []
    for name, counts in summary.outcomes.items():
        total = sum(counts[outcome] for outcome in OUTCOMES)
        share = (total - counts["ok"]) / total if total else 0.0
        shown = ("ok", CHATTERED, *OUTCOMES[1:])
        rows.append([name, str(total), *(str(counts[outcome]) for outcome in shown), f"{share:.2%}"])
    return header, rows


def _metric_rows(summary: Summary) -> Rows:
    """Quantiles of every metric, over the runs that have it."""
    names = {0.0: "least", 0.5: "median", 1.0: "largest"}
    header = ["metric", "unit", *(names.get(q, f"{q:.0%}") for q in QUANTILES), "none"]
    rows = [
        [
            column,
            summary.units[column],
            *("–" if np.isnan(value) else f"{value:.4g}" for value in item.quantiles),
            f"{item.missing:.2%}",
        ]
        for column, item in summary.metrics.items()
    ]
    return header, rows


def _worst_rows(summary: Summary, keys: Sequence[str]) -> Rows:
    """The worst runs with what varied and what came of it."""
    results = [name for name in summary.units if name.startswith(("settling_time_", "steady_state_error_"))]
    header = ["run", "status", "t_end", *keys, *results]
    return header, [[_cell(row[name]) for name in header] for row in summary.worst]


def _cell(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else short(value)


def _markdown(plan: Plan, summary: Summary, figures: Sequence[str], name: str) -> str:
    """summary.md: the tables, and the figures by file name."""
    axes = plan.sweep.axes
    outcomes, metrics, worst = summary_tables(summary, [axis.key for axis in axes])
    return render(
        "springline.runner.sweep",
        "summary.md.j2",
        name=name,
        plan=plan,
        runs=summary.runs,
        varied=[(axis.key, value_text(axis.as_toml())) for axis in axes],
        outcomes=outcomes,
        chattering=f"{CHATTERING:g}",
        figures=figures,
        metrics=metrics,
        worst=worst,
    )


def write_summary(plan: Plan, dataset: Dataset, summary: Summary, *, plot: bool = True) -> None:
    """summary.md and its figures beside the parts."""
    names = _write_figures(plan, dataset, summary) if plot else []
    title = Path(plan.sweep.source).stem
    dataset.place.write("summary.md", _markdown(plan, summary, names, title).encode())


def _write_figures(plan: Plan, dataset: Dataset, summary: Summary) -> list[str]:
    """The figures of a dataset; their names in summary.md."""
    from springline.runner.report import figure_files  # noqa: PLC0415 - Matplotlib, which a sweep without figures spares
    from springline.runner.sweep.figures import summary_figures  # noqa: PLC0415 - likewise

    names = []
    for name, figure in summary_figures(plan, summary).items():
        for file, content in figure_files(name, figure).items():
            dataset.place.write(file, content)
        names.append(f"{name}.png")
    return names
