"""One run of a dataset again: its scenario from sweep.json, and whether its metrics come out the same."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import pyarrow as pa

from springline.codegen.files import canonical_json
from springline.runner.files import InputError, Problem, read_toml
from springline.runner.scenario import (
    DOOR_KEYS,
    DOORS,
    Scenario,
    UserClass,
    names_file,
    path_keys,
    portable_text,
    read_class,
    records,
    resolve,
)
from springline.runner.scenario import FOLDER as TABLES
from springline.runner.sweep import sampling
from springline.runner.sweep.dataset import Dataset
from springline.runner.sweep.plan import Plan
from springline.runner.sweep.sweep import Axis
from springline.runner.sweep.sweep_file import sweep_from_json


def stored_plan(dataset: Dataset, code: Sequence[Path] = ()) -> Plan:
    """The plan that a dataset was made by, from its sweep.json and the signal tables that it keeps.

    code  the users' files that it needs: a dataset only names them, with their hashes
    Raises InputError if it cannot be read any more, was made by another version's rules, or a table is damaged; for a
    file that it needs and was not given, and one that is not the one that it needs.
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
        classes = _classes(name, stored["code"], code)
        scenario = _scenario(dataset, stored["scenario"], {key: user.reference for key, (user, _) in classes.items()})
        sweep = sweep_from_json(stored["sweep"], stored["chunk"], scenario, f"{name}/sweep.json")
        kept = {path: f"{TABLES}/{file}" for file, entry in stored["tables"].items() for path in entry["paths"]}
        kept |= {text: user.reference for user, given in classes.values() for text in given}
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


def _classes(
    dataset: str, needed: Mapping[str, Mapping[str, Any]], code: Sequence[Path]
) -> dict[str, tuple[UserClass, list[str]]]:
    """The classes that a dataset's runs need, out of the files that were given, as Plan.code has them."""
    found, problems = {}, []
    given = {Path(os.path.realpath(file)): file for file in code}
    used: set[Path] = set()
    for reference, entry in needed.items():
        file, _, name = reference.rpartition(":")
        hashes: dict[Path, str] = {}
        for path, written in given.items():
            user = read_class(f"{path}:{name}", f"--code {written}", "")
            hashes[path] = user.hash
            if user.hash == entry["sha256"]:
                found[reference] = user, list(entry["names"])
                used.add(path)
                break
        else:
            other = next((hashes[path] for path in given if path.name == file), "")
            text = f"its runs need {file} with the SHA-256 {entry['sha256']}"
            remedy = f", and the one given has {other}" if other else ": give it with --code FILE"
            problems.append(Problem(dataset, "", text + remedy))
    idle = [] if problems else [given[path] for path in given if path not in used]
    problems += [Problem(f"--code {file}", "", f"{dataset} needs no such file") for file in idle]
    if problems:
        raise InputError(*problems)
    return found


def _scenario(dataset: Dataset, text: str, classes: Mapping[str, str]) -> Scenario:
    """The scenario of a text, whose tables the dataset keeps, and whose classes are those given, by reference."""
    folder, name = dataset.place.local(), dataset.place.name
    document = read_toml(text)
    for table, key in DOORS:
        if names_file(document[table][key]):  # never a file that the dataset itself asks for
            document[table][key] = classes[document[table][key]]
    return Scenario(name, folder, *resolve(document, name, folder))


def _found(axis: Axis, kept: dict[str, str]) -> Axis:
    """An axis whose values are where the files are that they name: CSV files in the dataset, users' where they lie."""
    if axis.key in path_keys():
        return replace(axis, values=tuple(kept[value] for value in axis.values))
    if axis.key in DOOR_KEYS:
        return replace(axis, values=tuple(kept[value] if names_file(value) else value for value in axis.values))
    return axis


@dataclass(frozen=True)
class RecordedRun:
    """A run as its dataset has it.

    row   of the dataset;  flaw  what is wrong with the part that holds it, "" if nothing is
    """

    scenario: Scenario
    row: dict[str, Any]
    flaw: str

    def files(self, folder: Path) -> dict[str, bytes]:
        """scenario.toml for `folder`, and the CSV files that it reads beside it; users' classes stay where they are."""
        read = {record.section: record.content for record in records(self.scenario)}
        paths = {section: f"{TABLES}/{section}.csv" for section in read}
        tables = {paths[section]: content for section, content in read.items()}
        names = {user.reference: user.reference_from(folder) for user in self.scenario.code}
        return {"scenario.toml": portable_text(self.scenario, paths, names).encode(), **tables}

    def differences(self, metrics: pa.Table) -> list[str]:
        """Where the metrics of a run are not those of the dataset's row, bit for bit; a line each."""
        again = metrics.to_pylist()[0]
        return [
            f"{name}: {_exact(self.row.get(name))} in the dataset, {_exact(value)} now"
            for name, value in again.items()
            if _exact(self.row.get(name)) != _exact(value)
        ]


def recorded_run(dataset: Dataset, plan: Plan, run: int) -> RecordedRun:
    """One run of a dataset.

    Raises InputError if there is no such run, the dataset does not have it (yet), or its part cannot be read.
    """
    try:
        scenario = plan.scenario_of(run)
    except IndexError:
        text = f"expected the number of a run, 0 to {plan.runs - 1}"
        raise InputError(Problem(plan.sweep.source, "", text, str(run))) from None
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
    return RecordedRun(scenario, row, f"{name} {part.flaw}: {again}" if part.flaw else "")


def _exact(value: object) -> str:
    return value.hex() if isinstance(value, float) else repr(value)
