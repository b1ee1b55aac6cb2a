"""One run of a dataset again: its scenario from sweep.json, and whether its metrics come out the same."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa

from springline.runner.dataset import Dataset
from springline.runner.errors import InputError, Problem
from springline.runner.plan import Plan, tables_hash
from springline.runner.scenario import Scenario, load_scenario
from springline.runner.sweep import Sweep, axis_from_json


def stored_plan(dataset: Dataset) -> Plan:
    """The plan that a dataset was made by, from its sweep.json alone.

    Raises InputError if it cannot be read any more, or a signal table is not what it was.
    """
    stored = dataset.description()
    name = dataset.place.name
    try:
        sweep = stored["sweep"]
        scenario = _scenario(stored["scenario"], name)
        plan = Plan(
            Sweep(
                name,
                scenario,
                sweep["method"],
                sweep["samples"],
                sweep["seed"],
                stored["chunk"],
                sweep["keep"].get("trajectories", 0),
                tuple(axis_from_json(entry) for entry in sweep["vary"]),
            )
        )
    except InputError:  # a ValueError too, but one that says already what is wrong
        raise
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise InputError(Problem(f"{name}/sweep.json", "", f"is damaged ({error!r})")) from error
    if tables_hash(scenario) != stored.get("tables"):
        raise InputError(Problem(name, "", "a signal table that the scenario reads has changed since"))
    return plan


def _scenario(text: str, name: str) -> Scenario:
    """The scenario of a text, which a loader of files has to see as a file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "scenario.toml")
        file.write_text(text, encoding="utf-8")
        return replace(load_scenario(file), source=name)


def replayed(dataset: Dataset, run: int) -> Scenario:
    """The scenario of one run. Raises InputError if there is no such run."""
    plan = stored_plan(dataset)
    try:
        return plan.scenario_of(run)
    except IndexError:
        text = f"expected the number of a run, 0 to {plan.runs - 1}"
        raise InputError(Problem(dataset.place.name, "", text, str(run))) from None


def recorded(dataset: Dataset, run: int) -> dict[str, Any]:
    """The row of one run. Raises InputError if the dataset does not have it (yet)."""
    plan = stored_plan(dataset)
    chunk = plan.chunk_of(run)
    try:
        table = dataset.read_part(dataset.part_name(chunk.number))
    except FileNotFoundError as error:
        text = f"run {run} is not done yet: springline batch --resume does the rest"
        raise InputError(Problem(dataset.place.name, "", text)) from error
    row: dict[str, Any] = table.slice(run - chunk.first, 1).to_pylist()[0]
    return row


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
