"""One run of a dataset again: its scenario from sweep.json, and whether its metrics come out the same."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from typing import Any

import pyarrow as pa

from springline.codegen.manifest import canonical_json
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
    if repr(stored.get("sampler")) != repr(sampling.VERSION):
        text = f"was drawn by another version of the sampler: expected {sampling.VERSION}"
        raise InputError(Problem(f"{name}/sweep.json", "sampler", text, str(stored.get("sampler"))[:20]))
    try:
        for file, entry in stored["tables"].items():
            _expect_table(dataset, file, entry["sha256"])
        scenario = _scenario(dataset, stored["scenario"])
        sweep = sweep_from_json(stored["sweep"], stored["chunk"], scenario, f"{name}/sweep.json")
        kept = {path: f"{TABLES}/{file}" for file, entry in stored["tables"].items() for path in entry["paths"]}
        plan = Plan(replace(sweep, source=name, axes=tuple(_found(axis, kept) for axis in sweep.axes)))
        told = [stored["runs"], stored["chunks"], [[group["first"], group["runs"]] for group in stored["groups"]]]
        if canonical_json(told) != canonical_json([plan.runs, plan.chunks, [[g.first, g.runs] for g in plan.groups]]):
            raise ValueError("its numbers of runs, chunks and groups do not fit each other")
    except InputError:  # a ValueError too, but one that says already what is wrong
        raise
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise dataset.damaged(error) from error
    return plan


def _expect_table(dataset: Dataset, file: str, digest: str) -> None:
    """Raise InputError unless a table that the dataset keeps is what its runs have read."""
    try:
        content = dataset.place.read(f"{TABLES}/{file}")
    except FileNotFoundError:
        content = b""
    if sha256(content).hexdigest() != digest:
        text = "is not what the runs have read: springline batch --resume, with the sweep's own, brings it back"
        raise InputError(Problem(f"{dataset.place.name}/{TABLES}/{file}", "", text))


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
