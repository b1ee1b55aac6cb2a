"""What a dataset says: shares of what became of the runs, quantiles of each metric, the worst runs.

Tables of a million rows are read one column, or one part, at a time, so that memory stays flat.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import compute

from springline.codegen.kernel import METRICS, STATUS, chatters
from springline.model.parameters import Joint
from springline.runner.files import arrow_array, arrow_scalar, numpy_array, units
from springline.runner.sweep import sampling
from springline.runner.sweep.dataset import Dataset
from springline.runner.sweep.plan import Chunk, Plan
from springline.runner.sweep.quantiles import Quantiles

Floats = NDArray[np.float64]

QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
WORST, BEST = 10, 5

OUTCOMES = tuple(status for status in STATUS if status != "stopped")
CHATTERED = "chattering"
_SHOWN = 20_000  # rows that figures are drawn from


@dataclass(frozen=True, slots=True)
class Distribution:
    """A metric over the runs that have it: its QUANTILES, and the share of all runs that do not."""

    quantiles: tuple[float, ...]
    missing: float


@dataclass(frozen=True)
class Summary:
    """What the runs of a dataset have in common, and which are the worst.

    outcomes  per group of the sweep ("all" if there is one only), the number of runs by status; "chattering" counts
              those of the "ok" runs that chatter
    metrics   by column
    worst     rows of the dataset: runs that stopped, the earliest first, then those with the largest steady-state error
    best      rows of the dataset: runs that neither stopped nor chatter, the least steady-state error first
    shown     rows for figures: all, or a random subset of a large dataset
    """

    runs: int
    outcomes: dict[str, dict[str, int]]
    metrics: dict[str, Distribution]
    units: dict[str, str]
    worst: list[dict[str, Any]]
    best: list[dict[str, Any]]
    shown: pa.Table

    @property
    def stopped(self) -> int:
        """Runs that diverged or left their bounds or limits."""
        return sum(group[status] for group in self.outcomes.values() for status in OUTCOMES if status != "ok")


def summarize(plan: Plan, dataset: Dataset, done: Collection[int] | None = None) -> Summary:
    """The Summary of the parts that are there and whole. Raises ValueError if there are none.

    done  numbers of their chunks, if they are known
    """
    chunks = [plan.chunk(number) for number in sorted(dataset.done(plan) if done is None else done)]
    if not chunks:
        raise ValueError("no runs to summarize")
    runs = sum(chunk.runs for chunk in chunks)
    parts = [dataset.part_name(chunk.number) for chunk in chunks]
    names = group_names(plan)
    joints = plan.joints
    outcomes = {name: dict.fromkeys((*OUTCOMES, CHATTERED), 0) for name in names}
    # Gathered as arrays of their final length: small tables would be many, and each a hole in the memory.
    rows = sum(np.count_nonzero(_picked(chunk, runs)) for chunk in chunks)
    gathered = {field.name: np.empty(rows, field.type.to_pandas_dtype()) for field in plan.schema}
    row = 0
    for chunk, part in zip(chunks, parts, strict=True):
        table = dataset.read_part(part)
        for outcome in OUTCOMES:
            outcomes[names[chunk.group.number]][outcome] += int(np.count_nonzero(_ended(table, outcome)))
        outcomes[names[chunk.group.number]][CHATTERED] += int(np.count_nonzero(chattering(table, joints)))
        picked = table.filter(arrow_array(_picked(chunk, runs), pa.bool_()))
        for name, column in gathered.items():
            given = picked[name]
            column[row : row + len(picked)] = given.to_pylist() if column.dtype == object else numpy_array(given)
        row += len(picked)
    shown = pa.table([arrow_array(gathered.pop(f.name), f.type, null=True) for f in plan.schema], plan.schema)
    metrics = _distributions(dataset, parts, shown, joints)
    worst, best = _extremes(dataset, parts, metrics, joints)
    return Summary(runs, outcomes, metrics, units(shown), worst, best, shown)


def _distributions(
    dataset: Dataset, parts: Sequence[str], sample: pa.Table, joints: Sequence[Joint]
) -> dict[str, Distribution]:
    """What is to be said of each metric."""
    columns = [f"{metric}_{joint.name}" for metric in METRICS for joint in joints]
    quantiles = {column: Quantiles(QUANTILES, _numbers(sample, column)) for column in columns}
    runs = 0
    for part in parts:
        table = dataset.read_part(part, columns)
        runs += len(table)
        for column in columns:
            quantiles[column].count(_numbers(table, column))
    for part in parts:
        table = dataset.read_part(part, columns)
        for column in columns:
            quantiles[column].gather(_numbers(table, column))
    return {column: Distribution(item.values(), 1.0 - item.known / runs) for column, item in quantiles.items()}


def _extremes(
    dataset: Dataset, parts: Sequence[str], metrics: Mapping[str, Distribution], joints: Sequence[Joint]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The worst rows of the dataset, and the best.

    Steady-state errors of several joints compare as shares of their medians.
    """
    errors = {column: item for column, item in metrics.items() if column.startswith("steady_state_error_")}
    scales = {column: item.quantiles[QUANTILES.index(0.5)] or 1.0 for column, item in errors.items()}
    worst: list[tuple[float, int, dict[str, Any]]] = []
    best: list[tuple[float, int, dict[str, Any]]] = []
    for part in parts:
        table = dataset.read_part(part)
        badness = _badness(table, scales)
        worst = heapq.nlargest(WORST, chain(worst, _scored(table, -badness)), key=lambda item: item[:2])
        good = np.where(_ended(table, "ok") & ~chattering(table, joints), badness, np.nan)
        best = heapq.nlargest(BEST, chain(best, _scored(table, good, BEST)), key=lambda item: item[:2])
    return [row for _, _, row in worst], [row for _, _, row in best]


def _numbers(table: pa.Table, column: str) -> Floats:
    """A column of numbers, NaN for null."""
    return np.asarray(numpy_array(table[column]), dtype=np.float64)


def chattering(table: pa.Table, joints: Sequence[Joint]) -> NDArray[np.bool_]:
    """Which runs chatter, on any joint; a run that stopped does not."""
    end = _numbers(table, "t_end")
    columns = [chatters(_numbers(table, f"chatter_{joint.name}"), end) for joint in joints]
    return np.asarray(np.any(columns, axis=0), dtype=np.bool_)


def _ended(table: pa.Table, outcome: str) -> NDArray[np.bool_]:
    """Which runs ended so."""
    return numpy_array(compute.equal(table["status"], arrow_scalar(outcome, pa.string())))


def _badness(table: pa.Table, scales: Mapping[str, float]) -> Floats:
    """How bad each run of a part is, by its steady-state error. One that stopped is worse than any that did not."""
    error = np.zeros(len(table))
    for column, scale in scales.items():
        error = np.fmax(error, _numbers(table, column) / scale)
    end = _numbers(table, "t_end")
    return np.where(_ended(table, "ok"), np.arctan(error), 10.0 + 1.0 / (1.0 + end))


def _scored(table: pa.Table, order: Floats, most: int = WORST) -> Iterator[tuple[float, int, dict[str, Any]]]:
    """The rows of a part with the least `order`, without those where it is NaN: (-order, -run, row)."""
    for row in np.argsort(order, kind="stable")[: min(most, int(np.isfinite(order).sum()))]:
        content = table.slice(int(row), 1).to_pylist()[0]
        yield -float(order[row]), -int(content["run"]), content


def _picked(chunk: Chunk, runs: int) -> NDArray[np.bool_]:
    """Which runs of a chunk figures show: all, or a random choice that does not depend on how runs are cut."""
    if runs <= _SHOWN:
        return np.ones(chunk.runs, dtype=np.bool_)
    return np.asarray(sampling.random(0, "figures", chunk.first, chunk.runs) < _SHOWN / runs)


def group_names(plan: Plan) -> list[str]:
    """What tells the groups of a sweep apart: "fast = false", "all" if nothing does."""
    told = [plan.told_apart(group).items() for group in plan.groups]
    names = [", ".join(f"{key.rpartition('.')[2]} = {short(value)}" for key, value in items) for items in told]
    return names if len(set(names)) > 1 else ["all"] * len(names)


def short(value: object) -> str:
    """A value as a few characters for people."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    text = str(value)
    return text if len(text) <= 30 else f"{text[:29]}…"
