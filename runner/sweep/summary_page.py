"""A summary as people read it: tables of texts for the terminal, and a report with figures beside a dataset's parts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from springline.codegen.kernel import CHATTERING, chatters
from springline.runner.files import value_text
from springline.runner.report import (
    Block,
    Document,
    Heading,
    Picture,
    Table,
    Text,
    described,
    figure_text,
    prefixed,
    provenance,
    quantity_text,
    shown_name,
    to_html,
    to_markdown,
    unit_text,
)
from springline.runner.sweep.dataset import Dataset
from springline.runner.sweep.plan import Plan
from springline.runner.sweep.summary import CHATTERED, OUTCOMES, QUANTILES, Summary, short
from springline.runner.sweep.sweep import Axis
from springline.runner.version import __version__

Rows = tuple[list[str], list[list[str]]]
"""Header and rows of a table of texts."""

REPORT = "report.html"


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
    header = ["run", "status", "t_end", *keys, *_results(summary)]
    return header, [[_cell(row[name]) for name in header] for row in summary.worst]


def _results(summary: Summary) -> list[str]:
    """Columns that say what came of a run."""
    return [name for name in summary.units if name.startswith(("settling_time_", "steady_state_error_"))]


def _cell(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else short(value)


def write_summary(plan: Plan, dataset: Dataset, summary: Summary, *, plot: bool = True) -> None:
    """report.html, report.md and their figures beside the parts."""
    pictures = _write_figures(plan, dataset, summary) if plot else []
    document = _document(plan, summary, pictures)
    dataset.place.write("report.md", to_markdown(document).encode())
    dataset.place.write(REPORT, to_html(document).encode())


def _write_figures(plan: Plan, dataset: Dataset, summary: Summary) -> list[Picture]:
    """The figures of a dataset, beside its parts."""
    from springline.runner.report import figure_files  # noqa: PLC0415 - Matplotlib, which a sweep without figures spares
    from springline.runner.sweep.figures import captions, summary_figures  # noqa: PLC0415 - likewise

    pictures, said = [], captions(plan, summary)
    for name, figure in summary_figures(plan, summary).items():
        files = figure_files(name, figure)
        for file, content in files.items():
            dataset.place.write(file, content)
        pictures.append(Picture(name, files[f"{name}.svg"], said[name]))
    return pictures


def _document(plan: Plan, summary: Summary, pictures: Sequence[Picture]) -> Document:
    sweep = plan.sweep
    name = Path(sweep.source).stem
    counts = f"{summary.runs:,} of {plan.runs:,} runs of {shown_name(sweep.scenario)}"
    subtitle = f"{counts}. Simulated by springline {__version__}."
    outcomes, rows = _outcome_rows(summary)
    blocks: list[Block] = [
        Heading("What was varied"),
        _varied(plan),
        Heading("What became of the runs"),
        Text(_headline(summary)),
        Table(outcomes, rows),
        Text(
            f"A run chatters where a joint's `chatter` is above {CHATTERING:g} 1/s: its command swings so often that "
            "its other metrics say little."
        ),
        Heading("Best and worst runs"),
        Text(
            f"`springline replay DIR {(summary.best or summary.worst)[0]['run']}` simulates a run again, to the bit, "
            "with its trajectory and a report; DIR is the folder of this page."
        ),
        *_ranked(_BEST, plan, summary, summary.best),
        *_ranked(_WORST, plan, summary, summary.worst),
    ]
    blocks += [Heading("Figures"), *pictures] if pictures else []
    blocks += [Heading("Metrics"), _numbers(summary), Heading("The scenario that is varied"), described(sweep.scenario)]
    kernels = ", ".join(dict.fromkeys(f"`{group.work.identity[:16]}`" for group in plan.groups[:_MOST_KERNELS]))
    more = f" and {len(plan.groups) - _MOST_KERNELS} more groups'" if len(plan.groups) > _MOST_KERNELS else ""
    blocks += provenance(
        sweep.scenario,
        [
            ("how the runs were drawn", f"{sweep.method.replace('_', ' ')}, seed {sweep.seed}"),
            ("kernel, the first digits of its SHA-256", f"{kernels}{more}"),
        ],
    )
    return Document(f"Sweep {name}", subtitle, blocks)


_MOST_KERNELS = 4
_BEST = "The best: of the runs that neither stopped nor chatter, those with the least steady-state error."
_WORST = "The worst: those that stopped, the earliest first; then those with the largest steady-state error."


def _headline(summary: Summary) -> str:
    """What became of the runs, in a sentence."""
    total = {key: sum(group[key] for group in summary.outcomes.values()) for key in (*OUTCOMES, CHATTERED)}
    ok = total["ok"]
    parts = [f"**{_share(ok, summary.runs)} came to their end**"]
    parts += [f"{total[CHATTERED]:,} of these chatter" if total[CHATTERED] else "none of these chatters"] if ok else []
    stopped = [f"{total[key]:,} {_STOPPED[key]}" for key in OUTCOMES if key != "ok" and total[key]]
    return f"{', '.join(parts)}. {('Of the others ' + ', '.join(stopped) + '.') if stopped else 'None stopped early.'}"


_STOPPED: Mapping[str, str] = {
    "diverged": "diverged",
    "out_of_bounds": "left their bounds",
    "out_of_limits": "left the limits of their joints",
}


def _share(count: int, of: int) -> str:
    if count == of:
        return f"All {of:,} runs"
    return f"{count:,} of {of:,} runs ({figure_text(100 * count / of, 3)} %)" if count else f"None of {of:,} runs"


def _varied(plan: Plan) -> Table:
    """The keys that vary: how, within what, and in which unit."""
    units = {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in plan.schema}
    rows = [(f"`{axis.key}`", *_range(axis), unit_text(units.get(axis.key, ""))) for axis in plan.sweep.axes]
    return Table(("key", "how", "values", "unit"), rows, labels=4)


def _range(axis: Axis) -> tuple[str, str]:
    """How an axis varies, and within what."""
    kind = axis.kind.replace("_", " ")
    count = f", {axis.points} points" if axis.points else ""
    if axis.kind == "tie":
        factor = f"{figure_text(axis.factor)} times " if axis.factor != 1.0 and not axis.values else ""
        listed = f"{_listed(axis.values)} with those of " if axis.values else factor
        return "tied", f"{listed}`{axis.tie}`"
    if axis.kind in ("values", "each"):
        return kind, _listed(axis.values)
    low, high = (figure_text(value, 6) for value in axis.span)
    if axis.kind == "normal":
        return kind, f"mean {low}, standard deviation {high}"
    return f"{kind}{count}", f"{low} to {high}"


_MOST_LISTED = 8


def _listed(values: Sequence[Any]) -> str:
    """Values as a sweep file has them; of many, the first and the last."""
    texts = [value_text(value) for value in values]
    if len(texts) > _MOST_LISTED:
        texts = [*texts[: _MOST_LISTED - 2], "…", texts[-1]]
    return ", ".join(texts)


def _ended(row: Mapping[str, Any], plan: Plan) -> str:
    """How a run ended, in a word."""
    found = [row[f"chatter_{joint.name}"] for joint in plan.joints]
    chatter = np.array([np.nan if value is None else value for value in found])
    return "chatters" if np.any(chatters(chatter, row["t_end"])) else str(row["status"]).replace("_", " ")


def _numbers(summary: Summary) -> Table:
    """Quantiles of every metric, each row with the prefix that suits its median."""
    header, _ = _metric_rows(summary)
    rows = []
    for column, item in summary.metrics.items():
        factor, unit = prefixed(summary.units[column], abs(item.quantiles[QUANTILES.index(0.5)]))
        values = (figure_text(value * factor) for value in item.quantiles)
        rows.append((f"`{column}`", unit_text(unit), *values, f"{100 * item.missing:.3g} %"))
    caption = "Quantiles over the runs that have the metric; “none”: the share that has not."
    return Table(header, rows, caption, words=(1,))


def _ranked(title: str, plan: Plan, summary: Summary, found: Sequence[Mapping[str, Any]]) -> list[Block]:
    """Runs with what varied and what came of them; nothing where there are none."""
    if not found:
        return []
    keys = [axis.key for axis in plan.sweep.axes if axis.kind != "tie"]  # "What was varied" tells the others
    results = _results(summary)
    rows = [
        (
            str(row["run"]),
            f"[[{_ended(row, plan)}]]",
            quantity_text(row["t_end"], "s"),
            *(quantity_text(row[name], summary.units[name]) for name in results),
            *(figure_text(row[key], 6) if isinstance(row[key], float) else _cell(row[key]) for key in keys),
        )
        for row in found
    ]
    names = [name.replace("steady_state", "steady-state").replace("_", " ") for name in results]
    words = [
        1,
        *(3 + len(results) + k for k, key in enumerate(keys) if any(isinstance(row[key], str) for row in found)),
    ]
    heads = ("run", "status", "end", *names, *(f"`{key}`" for key in keys))
    return [Table(heads, rows, title, labels=0, words=words)]
