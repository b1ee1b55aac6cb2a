"""From a sweep to its runs: groups that share a kernel, chunks of them, and the numbers of each run.

Run i, its chunk and every number of it follow from the sweep alone. Runs are ordered so that those of a group are
neighbours; a chunk never reaches beyond its group, for lanes of one kernel must not differ in structure or timing.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from springline.model.parameters import Joint
from springline.runner.files import InputError, Problem, arrow_array, unknown, value_text
from springline.runner.run import field, metrics_schema, metrics_table, trajectory_schema
from springline.runner.scenario import (
    CHOOSERS,
    DOOR_KEYS,
    TIMING_UNITS,
    NumericKey,
    Record,
    Scenario,
    UserClass,
    absent_at,
    canonical_reference,
    given_text,
    names_file,
    portable_text,
    records,
    table_chosen,
    table_in,
    weighs,
)
from springline.runner.scenario import FOLDER as TABLES
from springline.runner.sweep import sampling
from springline.runner.sweep.axis_checks import AxisChecks
from springline.runner.sweep.drawing import Columns, Drawing, grid_values
from springline.runner.sweep.sweep import Axis, Sweep, is_number
from springline.runner.sweep.work import TRAJECTORY_BYTES, Inputs, Outcome, Work, work_for

MOST_GROUPS = 512
_MOST_PANELS = 3
MOST_PARTS = 1_000_000
"""As many as the six digits of their names tell apart; a folder of more is slow everywhere."""

FORMAT = 3
"""Of datasets: what is described, how parts are sealed. 1 said nothing of a format, 2 nothing of code."""

# A chunk is what a kill loses and what a thread takes at a time. Of a large sweep it is some seconds of work, but no
# more runs than keep memory flat; of a small one it is enough to make the milliseconds of drawing and storing it not
# matter, but little enough to occupy several threads. Whole packs for every vector width in use.
_PACKS = 32
_MOST_STEPS = 4e7
_FEWEST_STEPS = 4e6
_LARGEST_CHUNK = 2048
_CHUNKS = 32
_FEWEST_CHUNKS = 8
_DRAWN_AT_ONCE = 8192
_MOST_STEPS_IN_ALL = 2**63 - 1  # the counter of the loop's progress


@dataclass(frozen=True, eq=False)
class Group:
    """Neighbouring runs with one structure and timing.

    constants    what the keys that do not vary inside the group are, by key, in the order of the sweep; None for one
                 of a table [control.<name>] that the group's scenario does not have
    first, runs  its runs are first .. first+runs-1;  row  of the sample that its first run takes
    """

    number: int
    constants: dict[str, Any]
    scenario: Scenario
    work: Work
    first: int
    runs: int
    row: int


@dataclass(frozen=True, eq=False, slots=True)
class Chunk:
    """Runs first .. first+runs-1, all of one group: one task, one part of the dataset."""

    number: int
    group: Group
    first: int
    runs: int


@dataclass(frozen=True, slots=True)
class Kept:
    """A CSV file that a dataset keeps, and the values of a key such as "base_motion.path" that mean it."""

    record: Record
    paths: tuple[str, ...]


class Plan:
    """All runs of a sweep.

    Raises InputError, when made, for keys and values that the scenario does not admit, and for too many groups.
    """

    def __init__(self, sweep: Sweep, chunk: int = 0) -> None:
        """`chunk`: runs per chunk, 0 for what the sweep says or what fits it."""
        self.sweep = sweep
        self.runs = sweep.samples * math.prod(len(axis.values) for axis in sweep.axes if axis.kind == "each")
        grouping = {axis.key for axis in sweep.axes if _switches(axis.key, axis.reach(sweep.axes))}
        grouping |= {axis.key for axis in sweep.axes if _takes_out_a_mount(axis, sweep)}
        self._scenarios: dict[str, Scenario] = {}
        self._switched = self._switched_tables()
        numeric = self._switched_numbers() | sweep.scenario.numeric_keys()
        self._numeric = {k: v for k, v in numeric.items() if k not in grouping}
        self._free = [axis for axis in sweep.axes if axis.kind != "tie"]
        self._outer = [axis for axis in self._free if self._groups_runs(axis)]
        self._inner = [axis for axis in self._free if axis not in self._outer]
        self._read: dict[int, list[Record]] = {}
        self._drawing = Drawing(sweep, self._inner)
        AxisChecks(sweep, self._numeric, self._drawing).expect_sound()
        self.groups = self._make_groups()
        self.chunk_size = chunk or sweep.chunk or self._fitting_chunk()
        counts = [-(-group.runs // self.chunk_size) for group in self.groups]
        self._first_chunks = [0, *itertools.accumulate(counts)]
        self._refuse_endless()
        assert self._metrics  # or it refuses arms that do not go into one table

    # Chunks

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return self._first_chunks[-1]

    def chunk(self, number: int) -> Chunk:
        """Chunk `number`, 0 .. chunks-1."""
        index = next(i for i, first in enumerate(self._first_chunks[1:]) if number < first)
        group = self.groups[index]
        start = (number - self._first_chunks[index]) * self.chunk_size
        return Chunk(number, group, group.first + start, min(self.chunk_size, group.runs - start))

    def chunk_of(self, run: int) -> Chunk:
        """The chunk that holds a run. Raises IndexError if there is no such run."""
        if not 0 <= run < self.runs:
            raise IndexError(run)
        group = next(group for group in reversed(self.groups) if group.first <= run)
        return self.chunk(self._first_chunks[group.number] + (run - group.first) // self.chunk_size)

    def _fitting_chunk(self) -> int:
        steps = max(group.work.settings.steps for group in self.groups)
        size = max(self.runs / _CHUNKS, min(_FEWEST_STEPS / steps, self.runs / _FEWEST_CHUNKS))
        size = min(size, _MOST_STEPS / steps, _LARGEST_CHUNK)
        if self.sweep.keep:
            system, rows = self.groups[0].work.system, max(group.work.settings.rows for group in self.groups)
            kept = 8 * rows * len(trajectory_schema(system)) / self.sweep.keep
            size = min(size, TRAJECTORY_BYTES / kept)
        size = max(size, self.runs / (MOST_PARTS - len(self.groups)))
        return max(1, math.ceil(size / _PACKS)) * _PACKS

    def _refuse_endless(self) -> None:
        """Raise InputError for what no folder or counter has numbers for."""
        source, steps = self.sweep.source, sum(group.runs * group.work.settings.steps for group in self.groups)
        if self.chunks > MOST_PARTS:
            fewest = math.ceil(self.runs / (MOST_PARTS - len(self.groups)))
            text = f"expected at least {fewest}: {self.chunks:,} parts are more than {MOST_PARTS:,}"
            raise InputError(Problem(source, "chunk", text, str(self.chunk_size)))
        if steps > _MOST_STEPS_IN_ALL:
            text = f"expected fewer or shorter runs: {steps:,} steps are more than {_MOST_STEPS_IN_ALL:,}"
            raise InputError(Problem(source, "samples", text))

    def kept(self, chunk: Chunk) -> list[int]:
        """The runs of a chunk whose trajectory is stored, as indices into the chunk."""
        every = self.sweep.keep
        return [] if every == 0 else list(range(-chunk.first % every, chunk.runs, every))

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """The joints that the runs have, each name once."""
        found: dict[str, Joint] = {}
        for group in self.groups:
            for joint in group.work.system.joints:
                found.setdefault(joint.name, joint)
        return tuple(found.values())

    def expect_plausible(self) -> None:
        """Raise InputError for the first run with masses and inertias that no arm has; before one is started, that is.

        Making a Plan does not tell, for it draws no run, and who replays one needs to know nothing of the others.
        """
        axes = [axis for axis in self.sweep.axes if axis.key in self._numeric and weighs(axis.key)]
        for group in self.groups if axes else ():
            for first in range(0, group.runs, _DRAWN_AT_ONCE):
                runs = min(_DRAWN_AT_ONCE, group.runs - first)
                columns = self.columns(Chunk(-1, group, group.first + first, runs))
                found = group.scenario.implausible_run(self._numbers(group, columns))
                if found is None:
                    continue
                run, text = found
                key = f"vary.{axes[0].key}" if len(axes) == 1 else "vary"
                remedy = "leave such values out of what varies, or bounds in the class refuse them by name"
                raise InputError(Problem(self.sweep.source, key, f"run {group.first + first + run}: {text} ({remedy})"))

    # Numbers

    def columns(self, chunk: Chunk) -> Columns:
        """What each key of the sweep is in each run of a chunk, in the order of the sweep."""
        row = chunk.group.row + chunk.first - chunk.group.first
        drawn = self._drawing.columns(row, chunk.runs)
        return {
            axis.key: drawn[axis.key] if axis.key in drawn else self._repeated(axis, chunk) for axis in self.sweep.axes
        }

    def _numbers(self, group: Group, columns: Columns) -> Columns:
        """Those of the columns that are numbers of the runs of a group."""
        return {k: v for k, v in columns.items() if k in self._numeric and self._counts(k, group.scenario)}

    def _repeated(self, axis: Axis, chunk: Chunk) -> NDArray[Any]:
        value = chunk.group.constants[axis.key]
        if axis.key not in self._numeric and value is not None:
            value = _cell(value, self._structural_type(axis))
        return np.full(chunk.runs, value, dtype=np.float64 if isinstance(value, float) else object)

    def _structural_type(self, axis: Axis) -> pa.DataType:
        """The type of the column of a key that is no number: what all its values have in common."""
        source = next((other for other in self.sweep.axes if other.key == axis.tie), axis)
        kinds = {type(value) for value in axis.values or source.values}
        if kinds == {bool}:
            return pa.bool_()
        if kinds == {int}:
            return pa.int64()
        return pa.float64() if kinds <= {int, float} else pa.string()

    def inputs(self, chunk: Chunk, columns: Columns) -> Inputs:
        """What the runs of a chunk with the given columns take."""
        runs = range(chunk.first, chunk.first + chunk.runs)
        return chunk.group.work.inputs(chunk.group.scenario, self._numbers(chunk.group, columns), runs)

    def scenario_of(self, run: int) -> Scenario:
        """The scenario of one run. Raises IndexError if there is no such run."""
        chunk = self.chunk_of(run)
        columns = self._numbers(chunk.group, self.columns(chunk))
        numbers = {key: float(column[run - chunk.first]) for key, column in columns.items()}
        scenario = chunk.group.scenario
        return scenario.with_overrides(numbers | ({"sensor.run": run} if scenario.noisy else {}))

    def table(self, chunk: Chunk, columns: Columns, outcome: Outcome) -> pa.Table:
        """One row a run of a chunk with the given columns: run, every key of the sweep, every metric, status, t_end.

        A key of a table [control.<name>] that the runs do not have is null.
        """
        runs, scenario = np.arange(chunk.first, chunk.first + chunk.runs), chunk.group.scenario
        keys = [
            arrow_array(columns[item.name], item.type)
            if self._counts(item.name, scenario)
            else pa.nulls(len(runs), item.type)
            for item in self.key_fields
        ]
        found = metrics_table(chunk.group.work.system, outcome.runs)
        metrics = [
            found[item.name] if item.name in found.column_names else pa.nulls(len(runs), item.type)
            for item in self._metrics
        ]
        return pa.Table.from_arrays([arrow_array(runs, pa.int64()), *keys, *metrics], schema=self.schema)

    @cached_property
    def schema(self) -> pa.Schema:
        """Columns of the dataset's table."""
        return pa.schema([field("run", "", pa.int64()), *self.key_fields, *self._metrics])

    @cached_property
    def _metrics(self) -> pa.Schema:
        """The columns of metrics: of every joint that a group has; it is null where another has none of that name."""
        try:
            return metrics_schema(*{id(group.work.system): group.work.system for group in self.groups}.values())
        except ValueError as error:
            text = f"{error}: joints of one name in one sweep are expected to have one unit"
            raise InputError(Problem(self.sweep.source, "vary", text)) from error

    @cached_property
    def key_fields(self) -> list[pa.Field]:
        """The columns of the sweep's keys, with their units."""
        units = TIMING_UNITS | {key: number.unit for key, number in self.sweep.scenario.numeric_keys().items()}
        return [
            field(axis.key, self._numeric[axis.key].unit)
            if axis.key in self._numeric
            else field(axis.key, units.get(axis.key, ""), self._structural_type(axis))
            for axis in self.sweep.axes
        ]

    def numeric_axes(self) -> list[Axis]:
        """The axes along which numbers vary by themselves, in the order of the sweep.

        Those inside a group, and those of many groups, such as a dozen delays: fewer are told apart by name.
        """
        inner = [axis for axis in self._inner if len(axis.values) != 1]
        return [axis for axis in self._free if axis in inner or self._runs_along(axis)]

    def told_apart(self, group: Group) -> dict[str, Any]:
        """The constants of a group by which people tell it from others, without those that are None.

        Groups along a numeric axis have the same.
        """
        told = [axis.key for axis in self._outer if not self._runs_along(axis)]
        return {key: value for key, value in group.constants.items() if key in told and value is not None}

    def _runs_along(self, axis: Axis) -> bool:
        """Whether the groups of an outer axis are points along it."""
        numbers = all(is_number(value) for value in axis.values)
        return axis in self._outer and axis.kind == "values" and numbers and len(axis.values) > _MOST_PANELS

    # Description

    def as_json(self) -> dict[str, Any]:
        """All that decides the dataset, as plain data: two plans with the same description give the same tables."""
        names = {kept.record: name for name, kept in self.tables.items()}
        classes = {user.reference: name for name, (user, _) in self.code.items()}
        paths = {r.section: f"{TABLES}/{names[r]}" for r in self._records(self.sweep.scenario)}
        return {
            "format": FORMAT,
            "sampler": sampling.VERSION,
            "sweep": self.sweep.as_json(),
            "scenario": portable_text(self.sweep.scenario, paths, classes),
            "tables": {name: {"sha256": k.record.sha256, "paths": list(k.paths)} for name, k in self.tables.items()},
            "code": {name: {"sha256": user.hash, "names": given} for name, (user, given) in self.code.items()},
            "groups": [
                {
                    "constants": group.constants,
                    "first": group.first,
                    "runs": group.runs,
                    "kernel": group.work.identity,
                    "splines": _splines_hash(group.scenario),
                }
                for group in self.groups
            ],
            "runs": self.runs,
            "chunk": self.chunk_size,
            "chunks": self.chunks,
        }

    @cached_property
    def tables(self) -> dict[str, Kept]:
        """The CSV files that the runs read, by the name that each gets in the dataset."""
        found: dict[Record, tuple[str, list[str]]] = {}
        for scenario, constants in ((self.sweep.scenario, {}), *((g.scenario, g.constants) for g in self.groups)):
            for record in self._records(scenario):
                earlier = sum(other.section == record.section for other in found)
                name = f"{record.section}{f'-{earlier + 1}' if earlier else ''}.csv"
                _, paths = found.setdefault(record, (name, []))
                paths += [str(constants[key]) for key in (f"{record.section}.path",) if key in constants]
        return {name: Kept(record, tuple(dict.fromkeys(paths))) for record, (name, paths) in found.items()}

    @cached_property
    def code(self) -> dict[str, tuple[UserClass, list[str]]]:
        """The classes of users' files that the runs need, by the name that each gets in the dataset: "my_arm.py:MyArm".

        Beside it what names it in the values of a key that varies.
        """
        found: dict[str, tuple[UserClass, list[str]]] = {}
        for scenario, constants in ((self.sweep.scenario, {}), *((g.scenario, g.constants) for g in self.groups)):
            for user in scenario.code:
                stem, earlier = Path(user.path).stem, 1
                name = f"{stem}.py:{user.name}"
                while name in found and found[name][0].key != user.key:
                    earlier += 1
                    name = f"{stem}-{earlier}.py:{user.name}"
                _, given = found.setdefault(name, (user, []))
                named = [str(constants[key]) for key in DOOR_KEYS if constants.get(key) is not None]
                given += [
                    text
                    for text in named
                    if names_file(text)
                    and text not in given
                    and canonical_reference(text, scenario.folder, scenario.source, "") == user.reference
                ]
        return found

    def _records(self, scenario: Scenario) -> list[Record]:
        """The files of a scenario; groups share scenarios, and each is read once."""
        if id(scenario) not in self._read:
            self._read[id(scenario)] = records(scenario)
        return self._read[id(scenario)]

    # Tables [control.<name>] of what the sweep chooses

    def _switched_tables(self) -> dict[str, dict[str, Any]]:
        """Tables that some runs have and some may not -> the overrides of the scenario that make it have them."""
        scenario = self.sweep.scenario
        axes = [axis for axis in self.sweep.axes if axis.key in CHOOSERS]
        found: dict[str, dict[str, Any]] = {table: {} for table in scenario.control_tables if axes}
        for axis in axes:
            for value in axis.values:
                table = table_chosen(axis.key, value, scenario.folder, f"{self.sweep.source}: vary")
                found.setdefault(table, {axis.key: value})
        found.pop("", None)
        return found

    def _switched_numbers(self) -> dict[str, NumericKey]:
        """The numeric keys of those tables."""
        varied = {table_in(axis.key) for axis in self.sweep.axes}
        return {
            key: number
            for table, choice in self._switched.items()
            if table in varied
            for key, number in self._structured(choice).numeric_keys().items()
            if table_in(key) == table
        }

    def _counts(self, key: str, scenario: Scenario) -> bool:
        """Whether a key of the sweep is one of a scenario of its runs."""
        return table_in(key) not in self._switched or table_in(key) in scenario.control_tables

    # Making groups

    def _groups_runs(self, axis: Axis) -> bool:
        moved = [axis, *(other for other in self.sweep.axes if other.tie == axis.key)]
        return axis.kind == "each" or any(item.key not in self._numeric for item in moved)

    def _make_groups(self) -> list[Group]:
        grid = self.sweep.method == "grid"
        crossed = [axis for axis in self._outer if grid or axis.kind == "each"]
        shared = [axis for axis in self._outer if axis not in crossed]
        combinations = math.prod(len(axis.values) for axis in self._outer)
        if combinations > MOST_GROUPS:
            keys = ", ".join(axis.key for axis in self._outer)
            raise InputError(
                Problem(
                    self.sweep.source,
                    "vary",
                    f"expected at most {MOST_GROUPS} groups of structural, timing and 'each' keys ({keys})",
                    str(combinations),
                )
            )
        shares = list(itertools.product(*(range(len(axis.values)) for axis in shared)))
        rows = self.runs // math.prod(len(axis.values) for axis in crossed)
        edges = [rows * i // len(shares) for i in range(len(shares) + 1)]
        groups: list[Group] = []
        works: dict[int, Work] = {}
        first = 0
        for fixed in itertools.product(*(range(len(axis.values)) for axis in crossed)):
            for share, low, high in zip(shares, edges[:-1], edges[1:], strict=True):
                if low == high:
                    continue
                chosen = {axis.key: i for axis, i in zip([*crossed, *shared], [*fixed, *share], strict=True)}
                constants = self._constants(chosen)
                scenario = self._structured({k: v for k, v in constants.items() if k not in self._numeric})
                if id(scenario) not in works:
                    works[id(scenario)] = self._work(scenario)
                constants = {k: v if self._counts(k, scenario) else None for k, v in constants.items()}
                groups.append(Group(len(groups), constants, scenario, works[id(scenario)], first, high - low, low))
                first += high - low
        return groups

    def _constants(self, chosen: Mapping[str, int]) -> dict[str, Any]:
        """The outer keys and what is tied to them."""
        constants = {}
        for axis in self.sweep.axes:
            if axis.key in chosen:
                constants[axis.key] = axis.values[chosen[axis.key]]
            elif axis.tie in chosen:
                place = chosen[axis.tie]
                other = next(item for item in self._outer if item.key == axis.tie)
                constants[axis.key] = _tied_value(axis, other.values[place], place)
        return {key: float(value) if key in self._numeric else value for key, value in constants.items()}

    def _structured(self, structural: Mapping[str, Any]) -> Scenario:
        """The scenario with what is held back and these overrides, as far as they are of tables that it then has."""
        base, held = self.sweep.scenario, self.sweep.held
        chosen = {key: structural.get(key, base.document["control"][key.partition(".")[2]]) for key in CHOOSERS}
        where = f"{self.sweep.source}: vary"
        tables = {table_chosen(key, value, base.folder, where) for key, value in chosen.items()}
        idle = self._switched.keys() - tables
        wanted = {key: value for key, value in {**held, **structural}.items() if table_in(key) not in idle}
        if not wanted:
            return base
        name = given_text(wanted)
        if name not in self._scenarios:
            try:
                self._scenarios[name] = base.with_overrides(wanted)
            except InputError as error:
                raise InputError(
                    *(
                        replace(problem, where=self.sweep.source, key=f"{self._said(problem.key)}.{problem.key}")
                        for problem in error.problems
                    )
                ) from error
        return self._scenarios[name]

    def _said(self, key: str) -> str:
        """Which table of the sweep a key stands in."""
        stem = key
        while stem and stem not in self.sweep.held:
            stem = stem.rpartition(".")[0]
        return "set" if stem else "vary"

    def _work(self, scenario: Scenario) -> Work:
        """The Work of a group: which slots its keys move is seen by moving them, one axis at a time."""
        valid = scenario.numeric_keys()
        numeric = [
            axis.key for axis in self.sweep.axes if axis.key in self._numeric and self._counts(axis.key, scenario)
        ]
        missing = [key for key in numeric if key not in valid]
        if missing:
            kind, source = "numeric key of a group", self.sweep.source
            raise InputError(*(unknown(source, f"vary.{key}", kind, key, valid) for key in missing))
        probes: list[dict[str, float]] = []
        start = {axis.key: self._extremes(axis)[0] for axis in self._free}
        for axis in self._free:
            probes += [self._probe(start | {axis.key: extreme}) for extreme in self._extremes(axis)]
        columns = {key: np.array([probe[key] for probe in probes]) for key in numeric} if probes else {}
        return work_for(scenario, columns)

    def _extremes(self, axis: Axis) -> list[tuple[float, int]]:
        """Values that an axis takes, with their place in `values`: the ends, or all there are."""
        if axis.values:
            return [(value, place) for place, value in enumerate(axis.values)]
        low, high = axis.span
        return [(low, 0), (high if axis.kind != "normal" else low + high, 1)]

    def _probe(self, at: Mapping[str, tuple[Any, int]]) -> dict[str, float]:
        """The numeric keys of a run whose free axes stand at the given values."""
        probe = {}
        for axis in self.sweep.axes:
            if axis.key in self._numeric:
                value, place = at[axis.tie or axis.key]
                probe[axis.key] = float(_tied_value(axis, value, place) if axis.kind == "tie" else value)
        return probe


def _switches(key: str, numbers: tuple[float, ...]) -> bool:
    """Whether a key takes something out of the structure in some runs and not in others.

    A limit at infinity stays in, for then it changes no bit.
    """
    return absent_at(key) == 0.0 and 0.0 in numbers and any(numbers)


def _takes_out_a_mount(axis: Axis, sweep: Sweep) -> bool:
    """Whether a key makes the arm stand as the base does in some runs and not in others: the first have no mount.

    That is so where all of `mount`, or of `mount_rpy`, is exactly zero. Equations without it round otherwise, so a
    run by itself, which has none, would not have the bits of one that shares a kernel with others.
    """
    table, _, rest = axis.key.partition(".")
    name, _, place = rest.partition(".")
    given = sweep.scenario.document["base_motion"].get(name)
    if table != "base_motion" or name not in ("mount", "mount_rpy") or not place.isdecimal() or given is None:
        return False
    reached = {other.key: _taken(other, sweep) for other in sweep.axes}
    own = reached[axis.key]
    others = [reached.get(f"base_motion.{name}.{k}", (value,)) for k, value in enumerate(given) if str(k) != place]
    return 0.0 in own and any(own) and all(0.0 in numbers for numbers in others)


def _taken(axis: Axis, sweep: Sweep) -> tuple[float, ...]:
    """Numbers that an axis takes, as far as they are zero or not: in a grid, also those of a range."""
    source = next((other for other in sweep.axes if other.key == axis.tie), axis)
    if source.points and not axis.values:
        return tuple(float(value) for value in axis.factor * grid_values(source))
    return axis.reach(sweep.axes)


def _tied_value(axis: Axis, value: Any, place: int) -> Any:
    """What a tied key is where the other stands at `value`, which need be no number, in its place of its values."""
    if axis.values:
        return axis.values[place]
    return value if axis.factor == 1.0 else axis.factor * value


def _cell(value: Any, kind: pa.DataType) -> Any:
    """A value as a cell of a column of this type: in a column of texts, lists and tables stand as TOML."""
    if not pa.types.is_string(kind):
        return float(value) if pa.types.is_floating(kind) else value
    return value if isinstance(value, str) else value_text(value)


def _splines_hash(scenario: Scenario) -> str:
    """Hash of what the kernel reads of the signal tables; "" if there are none."""
    if not scenario.signal_tables:
        return ""
    digest = sha256()
    for table in scenario.signal_tables:
        digest.update(repr((table.t0, table.dt, table.ends, table.coefficients.shape)).encode())
        for numbers in (table.coefficients, table.bounds):
            digest.update(np.ascontiguousarray(numbers, "<f8").tobytes())
    return digest.hexdigest()
