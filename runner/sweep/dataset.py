"""A dataset: sweep.json, which says what the runs are, and part-*.parquet, one for each chunk of them.

A part is there if its chunk is done, so a kill at any moment loses no more than the chunks in flight. Parts come into
being whole, and their content follows from sweep.json alone: two processes that write the same part, or a write that
is repeated, do no harm. The lock saves double work; it is not what keeps a dataset sound. What happens to parts later
is seen by their seals: one that is damaged, or of other runs, is made again.

tables/ holds the CSV files that the runs read, so that a dataset can be replayed wherever it lies.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Container, Mapping, Sequence
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from springline.codegen.files import TEMPORARY, canonical_json
from springline.runner.files import InputError, Problem, numpy_array, read_toml, unknown
from springline.runner.run import trajectory_schema
from springline.runner.scenario import FOLDER as TABLES
from springline.runner.sweep.changes import changes
from springline.runner.sweep.places import LOCK_FILE, Place, place
from springline.runner.sweep.plan import FORMAT, Chunk, Plan
from springline.runner.sweep.seal import Opened, Seal

DESCRIPTION = "sweep.json"
TRAJECTORIES = "trajectories"

_PART = "part-{:06d}.parquet"
_PART_NAME = re.compile(r"part-\d{6}\.parquet")
_TRAJECTORY = "run-{:09d}.parquet"
# What may differ between the process that began a dataset and the one that resumes it.
_FREE = ("springline", "versions")


Tell = Callable[[str], None]
Tick = Callable[[int, int], None]


class Dataset:
    """The runs of a sweep at a Place."""

    def __init__(self, where: Place) -> None:
        self.place = where

    # Beginning

    def is_begun(self, *, resume: bool) -> bool:
        """Whether the place holds a dataset. Raises InputError if it holds something that may not be continued."""
        there = [name for name in self.place.names() if name != LOCK_FILE and not name.startswith(TEMPORARY)]
        if DESCRIPTION not in there and there:
            raise InputError(Problem(self.place.name, "", "is not empty and holds no dataset", there[0]))
        if there and not resume:
            text = "holds a dataset already: --resume continues it, another -o begins a new one"
            raise InputError(Problem(self.place.name, "", text))
        return bool(there)

    def begin(self, plan: Plan, versions: Mapping[str, Any], *, resume: bool) -> Plan:
        """Make the place ready for the runs of `plan`, or of its rest, and return the plan that holds there.

        A resumed dataset keeps its chunk size. Raises InputError if it holds anything that `plan` would not continue.
        """
        if not self.is_begun(resume=resume):
            self._keep_tables(plan)
            self.place.write(DESCRIPTION, canonical_json({**versions, **plan.as_json()}))
            return plan
        stored = self.description()
        self.expect_format(stored)
        chunk = stored.get("chunk")
        if isinstance(chunk, int) and chunk > 0 and plan.sweep.chunk in (0, chunk):
            plan = Plan(plan.sweep, chunk)
        new = json.loads(canonical_json(plan.as_json()))
        try:
            changed = list(changes(_as_written(stored), _as_written(new)))
        except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
            raise self.damaged(error) from error
        if changed:
            shown = "\n  ".join(changed[:20])
            text = f"cannot be resumed, for what it holds is not what the sweep asks for now:\n  {shown}"
            raise InputError(Problem(self.place.name, "", text))
        for folder in ("", TRAJECTORIES, TABLES):
            for name in self.place.names(folder):
                if name.startswith(TEMPORARY):
                    self.place.remove(f"{folder}/{name}" if folder else name)
        self._keep_tables(plan)
        return plan

    def _keep_tables(self, plan: Plan) -> None:
        """Copy the CSV files that the runs read, those that are not there as they should be."""
        there = self.place.names(TABLES)
        for name, kept in plan.tables.items():
            path = f"{TABLES}/{name}"
            if name not in there or self.place.read(path) != kept.record.content:
                self.place.write(path, kept.record.content)

    def description(self) -> dict[str, Any]:
        """Content of sweep.json. Raises InputError if there is none, or it is none."""
        try:
            content = json.loads(self.place.read(DESCRIPTION))
        except (FileNotFoundError, NotADirectoryError) as error:
            raise InputError(Problem(self.place.name, "", f"holds no dataset: there is no {DESCRIPTION}")) from error
        except (ValueError, OSError, RecursionError) as error:
            raise self.damaged(error) from error
        if not isinstance(content, dict):
            raise self.damaged(TypeError())
        return content

    @cached_property
    def identity(self) -> str:
        """Hash of what sweep.json says of the runs: all that decides them, and not what made them."""
        told = {key: value for key, value in self.description().items() if key not in _FREE}
        return sha256(canonical_json(told)).hexdigest()

    def damaged(self, error: Exception) -> InputError:
        """The error of a description that cannot be what was written, as reading it has shown."""
        match error:
            case KeyError():
                how = f"there is no {error.args[0]!r}"
            case RecursionError():
                how = "brackets in brackets without end"
            case json.JSONDecodeError() | tomllib.TOMLDecodeError() | OSError():
                how = str(error)
            case _:
                how = "an entry is not what is written there"
        remedy = "bring it back from a copy, or begin the dataset anew with another -o"
        return InputError(Problem(f"{self.place.name}/{DESCRIPTION}", "", f"is damaged ({how}): {remedy}"))

    def expect_format(self, stored: Mapping[str, Any]) -> None:
        """Raise InputError unless the dataset was begun by a version that describes and seals it as this one does."""
        given = stored.get("format", 1)
        if given != FORMAT:
            text = (
                f"was begun by {'an earlier' if given == 1 else 'another'} version of springline "
                f"({str(stored.get('springline', 'unknown'))[:20]}), whose parts this one cannot check: it can be read "
                "(read_dataset), but neither continued nor replayed; begin a new one with another -o"
            )
            raise InputError(Problem(self.place.name, "", text))

    # Parts

    def done(self, plan: Plan, tell: Tell = lambda line: None, checked: Tick = lambda done, of: None) -> set[int]:
        """Numbers of the chunks that are stored: part and kept trajectories are there and whole.

        Each file is read once. One that is whole but not written as this version would is written anew.

        tell     called with a line about each part that is there and not whole
        checked  called with the number of parts that were checked, and how many there are
        Raises InputError if a folder is in the way of a part.
        """
        blocked = [name for name in self.place.folders() if _PART_NAME.fullmatch(name)]
        blocked += [f"{TRAJECTORIES}/{name}" for name in self.place.folders(TRAJECTORIES)]
        if blocked:
            text = "is a folder where a file of the dataset belongs: move it away"
            raise InputError(Problem(f"{self.place.name}/{blocked[0]}", "", text))
        there = set(self.place.names())
        trajectories = set(self.place.names(TRAJECTORIES)) if plan.sweep.keep else set()
        numbers = [number for number in range(plan.chunks) if _PART.format(number) in there]
        whole = set()
        for count, number in enumerate(numbers):
            checked(count, len(numbers))
            flaw = self._flaw(plan, number, trajectories)
            if flaw:
                tell(f"{flaw}: its runs are simulated again")
            else:
                whole.add(number)
        return whole

    def _flaw(self, plan: Plan, number: int, trajectories: Container[str]) -> str:
        """What is wrong with a chunk's files, "" if nothing is."""
        chunk = plan.chunk(number)
        name = _PART.format(number)
        part = self.read_sealed(plan, chunk)
        flaw = part.flaw
        if not flaw and part.better:
            self.place.write(name, part.better)
        for index in plan.kept(chunk) if not flaw else ():
            run = chunk.first + index
            name = f"{TRAJECTORIES}/{_TRAJECTORY.format(run)}"
            if _TRAJECTORY.format(run) not in trajectories:
                return f"{name} is missing"
            opened = self._opened(name, Seal(self.identity, (run, run)), trajectory_schema(chunk.group.work.system))
            if opened.flaw:
                flaw = opened.flaw
                break
            if opened.better:
                self.place.write(name, opened.better)
        return f"{name} {flaw}" if flaw else ""

    def read_sealed(self, plan: Plan, chunk: Chunk) -> Opened:
        """The part of a chunk, with what is wrong with it. Raises FileNotFoundError if it is not there."""
        name, last = _PART.format(chunk.number), chunk.first + chunk.runs - 1
        opened = self._opened(name, Seal(self.identity, (chunk.first, last)), plan.schema, chunk.runs)
        if opened.table is not None and not np.array_equal(
            numpy_array(opened.table["run"]), np.arange(chunk.first, last + 1)
        ):
            return Opened(None, "holds other runs")
        return opened

    def _opened(self, name: str, seal: Seal, schema: pa.Schema, rows: int | None = None) -> Opened:
        try:
            with self.place.open(name) as file:
                return seal.open(file, schema, rows)
        except FileNotFoundError:
            raise
        except OSError as error:
            return Opened(None, f"cannot be read ({error.strerror or error})")

    def write_part(self, chunk: Chunk, table: pa.Table, trajectories: Mapping[int, pa.Table]) -> None:
        """Store the runs of a chunk, and kept trajectories by run. Raises OSError if the place refuses."""
        for run, trajectory in trajectories.items():
            seal = Seal(self.identity, (run, run))
            self.place.write(f"{TRAJECTORIES}/{_TRAJECTORY.format(run)}", seal.close(trajectory))
        seal = Seal(self.identity, (chunk.first, chunk.first + chunk.runs - 1))
        self.place.write(_PART.format(chunk.number), seal.close(table))

    def part_name(self, number: int) -> str:
        """File name of a chunk's part."""
        return _PART.format(number)

    def parts(self) -> list[str]:
        """Names of the parts, in the order of the runs."""
        return [name for name in self.place.names() if _PART_NAME.fullmatch(name)]

    def read_part(self, name: str, columns: Sequence[str] | None = None) -> pa.Table:
        """The table of one part, or some columns of it; its seal is not looked at.

        Raises InputError if it is no table with these columns.
        """
        where = f"{self.place.name}/{name}"
        try:
            with self.place.open(name) as file:
                stored = parquet.ParquetFile(file)  # read_table imports pandas where that is installed
                there = stored.schema_arrow.names
                missing = [column for column in columns or () if column not in there]
                if missing:
                    raise InputError(*(unknown(where, "", "column", column, there) for column in missing))
                # One thread: a column of a part is too little for more, and each would keep memory of its own.
                table = stored.read(columns, use_threads=False)
                if columns is not None:
                    table = table.select(columns)  # in this order
        except InputError:
            raise
        except (pa.ArrowException, ValueError) as error:
            text = f"is damaged ({str(error).splitlines()[0]}): springline batch --resume makes it again"
            raise InputError(Problem(where, "", text)) from error
        return table.replace_schema_metadata(None)


def read_dataset(destination: str | Path, columns: Sequence[str] | None = None) -> pa.Table:
    """All runs of a dataset, or some columns of them, as one table with units, in the order of the runs.

    destination  the folder or URL that `springline batch` wrote
    Raises InputError if it holds no dataset, no runs yet, a part that is none of its own, and for unknown columns.
    """
    dataset = Dataset(place(destination))
    dataset.description()
    tables = [dataset.read_part(name, columns) for name in dataset.parts()]
    if not tables:
        raise InputError(Problem(dataset.place.name, "", "holds no runs yet: springline batch --resume does them"))
    for name, table in zip(dataset.parts(), tables, strict=True):
        if table.schema != tables[0].schema:
            text = "has other columns than the first part: springline batch --resume makes what is not whole again"
            raise InputError(Problem(f"{dataset.place.name}/{name}", "", text))
    if columns is None or "run" in columns:
        _expect_each_run_once(dataset, tables)
    return pa.concat_tables(tables)


def _expect_each_run_once(dataset: Dataset, tables: Sequence[pa.Table]) -> None:
    """Raise InputError for a part that holds runs that an earlier one has: a copy in another's place, or a surplus."""
    last = -1
    for name, table in zip(dataset.parts(), tables, strict=True):
        runs = numpy_array(table["run"])
        if len(runs) and (runs[0] <= last or np.any(np.diff(runs) <= 0)):
            text = (
                "holds runs that an earlier part has: springline batch --resume makes a part of the sweep again; one "
                "that is none of its parts is to be removed"
            )
            raise InputError(Problem(f"{dataset.place.name}/{name}", "", text))
        last = int(runs[-1]) if len(runs) else last


def _as_written(description: Mapping[str, Any]) -> dict[str, Any]:
    """What sweep.json says, by the keys of a sweep and a scenario file; what follows from them last.

    Raises KeyError, TypeError, AttributeError or ValueError if that cannot be told.
    """
    sweep = dict(description["sweep"])
    vary = [{"key": axis["key"], **read_toml(f"axis = {axis['axis']}")["axis"]} for axis in sweep.pop("vary")]
    scenario = read_toml(description["scenario"])
    rest = {key: value for key, value in description.items() if key not in ("sweep", "scenario", *_FREE)}
    return {**sweep, "vary": vary, **scenario, **rest}
