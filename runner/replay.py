"""One run of a dataset again: its scenario from sweep.json, and whether its metrics come out the same."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pyarrow as pa

from springline.runner import sampling
from springline.runner.checking import resolve
from springline.runner.dataset import Dataset
from springline.runner.errors import InputError, Problem
from springline.runner.plan import Plan
from springline.runner.records import FOLDER as TABLES
from springline.runner.records import path_keys, portable_text, records
from springline.runner.scenario import Scenario
from springline.runner.sweep import Axis, sweep_from_json
from springline.runner.toml_text import read_toml


def stored_plan(dataset: Dataset) -> Plan:
    """The plan that a dataset was made by, from its sweep.json and the signal tables that it keeps.

    Raises InputError if it cannot be read any more, was made by another version's rules, or a table is damaged.
    """
    stored = dataset.description()
    dataset.expect_format(stored)
    name = dataset.place.name
    if stored.get("sampler") != sampling.VERSION:
        text = f"was drawn by another version of the sampler: expected {sampling.VERSION}"
        raise InputError(Problem(f"{name}/sweep.json", "sampler", text, str(stored.get("sampler"))[:20]))
    try:
        scenario = _scenario(dataset, stored["scenario"])
        sweep = sweep_from_json(stored["sweep"], stored["chunk"], scenario, f"{name}/sweep.json")
        kept = {path: f"{TABLES}/{file}" for file, entry in stored["tables"].items() for path in entry["paths"]}
        plan = Plan(replace(sweep, source=name, axes=tuple(_found(axis, kept) for axis in sweep.axes)))
        groups = [(group["first"], group["runs"]) for group in stored["groups"]]
        told = (stored["runs"], stored["chunks"], groups, {f: entry["sha256"] for f, entry in stored["tables"].items()})
    except InputError:  # a ValueError too, but one that says already what is wrong
        raise
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise dataset.damaged(repr(error)) from error
    tables = {file: kept.record.sha256 for file, kept in plan.tables.items()}
    if tables != told[3]:
        text = "is not what the runs have read: they cannot be replayed, but batch --resume brings it back"
        wrong = next(file for file in sorted({*tables, *told[3]}) if tables.get(file) != told[3].get(file))
        raise InputError(Problem(f"{name}/{TABLES}/{wrong}", "", text))
    if told[:3] != (plan.runs, plan.chunks, [(group.first, group.runs) for group in plan.groups]):
        raise dataset.damaged("its numbers of runs, chunks and groups do not fit each other")
    return plan


def _scenario(dataset: Dataset, text: str) -> Scenario:
    """The scenario of a text, whose tables the dataset keeps."""
    folder, name = dataset.place.local(), dataset.place.name
    return Scenario(name, folder, *resolve(read_toml(text), name, folder))


def _found(axis: Axis, kept: dict[str, str]) -> Axis:
    """An axis whose values are the paths under which the dataset keeps the files that they name."""
    return replace(axis, values=tuple(kept[value] for value in axis.values)) if axis.key in path_keys() else axis


def replayed(plan: Plan, run: int) -> Scenario:
    """The scenario of one run. Raises InputError if there is no such run."""
    try:
        return plan.scenario_of(run)
    except IndexError:
        text = f"expected the number of a run, 0 to {plan.runs - 1}"
        raise InputError(Problem(plan.sweep.source, "", text, str(run))) from None


def files_of(scenario: Scenario) -> dict[str, bytes]:
    """scenario.toml, and the CSV files that it reads beside it."""
    read = {record.section: record.content for record in records(scenario)}
    paths = {section: f"{TABLES}/{section}.csv" for section in read}
    tables = {paths[section]: content for section, content in read.items()}
    return {"scenario.toml": portable_text(scenario, paths).encode(), **tables}


def recorded(dataset: Dataset, plan: Plan, run: int) -> tuple[dict[str, Any], str]:
    """The row of one run, and what is wrong with the part that holds it, "" if nothing is.

    Raises InputError if the dataset does not have it (yet), or the part cannot be read.
    """
    chunk = plan.chunk_of(run)
    name = f"{dataset.place.name}/{dataset.part_name(chunk.number)}"
    try:
        part = dataset.read_sealed(plan, chunk)
    except FileNotFoundError as error:
        text = f"run {run} is not done yet: springline batch --resume does the rest"
        raise InputError(Problem(dataset.place.name, "", text)) from error
    again = "springline batch --resume makes it again"
    if part.table is None:
        raise InputError(Problem(name, "", f"{part.flaw}: {again}"))
    row: dict[str, Any] = part.table.slice(run - chunk.first, 1).to_pylist()[0]
    return row, f"{name} {part.flaw}: {again}" if part.flaw else ""


def differences(row: dict[str, Any], metrics: pa.Table) -> list[str]:
    """Where the metrics of a run are not those of the dataset's row, bit for bit; a line each."""
    again = metrics.to_pylist()[0]
    return [
        f"{name}: {_exact(row.get(name))} in the dataset, {_exact(value)} now"
        for name, value in again.items()
        if _exact(row.get(name)) != _exact(value)
    ]


def _exact(value: object) -> str:
    return value.hex() if isinstance(value, float) else repr(value)
