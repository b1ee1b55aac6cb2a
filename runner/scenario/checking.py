"""A scenario file checked as a whole: every table, then what the tables have to do with each other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import numpy as np

from springline.codegen.kernel import MOST_STEPS
from springline.model.base import ALIASES, COORDINATES
from springline.model.base_motion import MOTIONS
from springline.model.corners import corners
from springline.model.drive import DRIVES, DriveKind
from springline.model.hardware import ACTUATORS, LONGEST_DELAY, SENSORS
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import POSITIVE
from springline.runner.files import InputError, Problem, unknown
from springline.runner.scenario import schema
from springline.runner.scenario.dotted import BY_COORDINATE, respelled, respellings
from springline.runner.scenario.locate import canonical_path, read_signal_file
from springline.runner.scenario.signal_csv import HALF_TURN, UNITS, Column
from springline.runner.scenario.signal_tables import TableRead, excess_notes, read_table
from springline.runner.scenario.splines import Ends, Spline
from springline.runner.scenario.user_code import UserClass, canonical_reference, load_class, read_class

Document = dict[str, dict[str, Any]]

# A time is a whole multiple of the step if it is off by no more than this of itself.
_WHOLE = 1e-9


def resolve(
    raw: Mapping[str, object], where: str, folder: Path, *, read: bool = True
) -> tuple[Document, tuple[Spline, ...], tuple[str, ...], tuple[UserClass, ...]]:
    """A document with every default filled in, its signal tables, notes on what was made of them, and users' classes.

    where   what the document came from, for messages
    folder  what relative paths refer to
    read    whether its signal files are read; a document that is going to be changed is not judged by them
    Raises InputError with all problems.
    """
    problems = [unknown(where, key, "table", key, schema.TABLES) for key in raw if key not in schema.TABLES]
    given: dict[str, dict[str, Any]] = {}
    for name in schema.TABLES:
        table = raw.get(name, {})
        if isinstance(table, dict):
            given[name] = table
        else:
            problems.append(Problem(where, name, "expected a table", schema.given_text(table)))
            given[name] = {}
    given["base_motion"], given_names = _by_its_names(given["base_motion"], where, problems)
    code, names = _opened_doors(given, folder, where, problems)
    mechanism = names["mechanism.name"]
    # Which keys are valid depends on all that was chosen, and on the drive, whose kind decides what it can be told.
    drive = given["drive"].get("kind", schema.DEFAULT_KINDS["drive"])
    drive = cast(DriveKind, drive if drive in DRIVES else schema.DEFAULT_KINDS["drive"])
    size = size_given(mechanism, given["mechanism"])
    joints = MECHANISMS[mechanism].of_size(size).joints
    motion = names["base_motion.kind"] if schema.names_file(given["base_motion"].get("kind")) else ""
    try:
        controller, law, observer = (names[f"control.{key}"] for key in ("controller", "law", "observer"))
        shape = schema.schema(mechanism, drive, controller, law, size, motion, observer)
    except ValueError as error:
        raise InputError(*problems, Problem(where, "control", str(error))) from error

    # Tables and keys that are wrong are left out of the document; the checks below skip what is not there.
    document: Document = {}
    with_table: list[str] = []
    for name in schema.TABLES:
        section = shape.sections.get(name)
        if section is None:
            kinds = dict(shape.kinds[name])
            if name == "base_motion" and motion:
                kinds[given[name]["kind"]] = kinds.pop(motion)
            chosen = _section_of_kind(kinds, schema.DEFAULT_KINDS[name], given[name], name, where)
            if isinstance(chosen, list):
                problems += chosen
                document[name] = {}
                continue
            section, given[name] = chosen
        document[name], wrong = schema.check(section, given[name], name, where)
        problems += wrong
        if not wrong and document[name].get("kind") == "table":
            with_table.append(name)

    problems += schema.excluded_bands([f"simulation.{key}" for key in given["simulation"]], where)
    for band, other in schema.BANDS:
        if other not in given["simulation"]:
            document["simulation"].setdefault(band, schema.DEFAULT_BANDS[band])
    problems += _start_problems(document["initial"], given["initial"], where)
    problems += _limit_problems(document, where)
    problems += _via_point_problems(document["reference"], where)
    problems += _exponent_problems(document["control"], where)
    problems += _sampling_problems(document, given["control"], where)
    problems += _velocity_problems(document["sensor"], given["sensor"], where)
    problems += _hardware_problems(document, where)
    problems += _delay_problems(document, where)
    problems += _whole_problems(document, "simulation.duration", where)
    duration = document["simulation"].get("duration")
    units = {
        "reference": {joint.name: joint.unit for joint in joints},
        "base_motion": {c.key: c.unit for c in COORDINATES},
        "disturbance": {joint.name: joint.force for joint in MECHANISMS[mechanism].joints},
    }
    tables: list[Spline] = []
    notes: list[str] = []
    for name in with_table:
        try:
            time, *channels = _columns(document[name], name, units[name], folder, where)
            if not read:
                continue
            table = _load_table(document[name], name, time, channels, where)
            tables.append(table.spline)
            if duration is not None:
                span = _expect_overlap(table.spline, document[name], name, channels, duration, where)
                notes += [*table.notes, span, *_acceleration_notes(table, document[name], name, channels, units[name])]
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(*(replace(problem, key=respelled(problem.key, given_names)) for problem in problems))
    if motion and read:
        notes += _corner_notes(motion, document["base_motion"], document["simulation"]["duration"])
    return document, tuple(tables), tuple(notes), code


def size_given(mechanism: str, table: Mapping[str, object]) -> int:
    """How many joints a [mechanism] table asks for; 0 for as many as there are, or where it asks for what is none."""
    size = table.get(schema.SIZE)
    return size if isinstance(size, int) and size in MECHANISMS[mechanism].sizes else 0


def _by_its_names(table: dict[str, Any], where: str, problems: list[Problem]) -> tuple[dict[str, Any], dict[str, str]]:
    """[base_motion] with each coordinate by its own name, and which keys were given by another (`respellings`)."""
    keys: list[str] = []

    def renamed(given: dict[str, Any], key: str) -> dict[str, Any]:
        keys.extend(f"{key}.{item}" for item in given)
        for alias, name in ALIASES.items():
            if alias in given and name in given:
                text = f"is another name of {key}.{name}: give one of them"
                problems.append(Problem(where, f"{key}.{alias}", text))
        return {ALIASES.get(item, item): value for item, value in given.items()}

    table = renamed(table, "base_motion")
    for inner in BY_COORDINATE:
        if isinstance(table.get(inner), dict):
            table[inner] = renamed(table[inner], f"base_motion.{inner}")
    return table, respellings(keys)


def _opened_doors(
    given: dict[str, dict[str, Any]], folder: Path, where: str, problems: list[Problem]
) -> tuple[tuple[UserClass, ...], dict[str, str]]:
    """The classes of users' files that a document names, and what each door's key is registered as.

    `given` gets canonical references. A name that is none gets into `problems`, and the default stands for it.
    Raises InputError for a mechanism or a file that cannot be had, for which keys are valid depends on it.
    """
    code: list[UserClass] = []
    names: dict[str, str] = {}
    for (table, name), (registry, default) in schema.DOORS.items():
        key, value = f"{table}.{name}", given[table].get(name, default)
        if schema.names_file(value):
            reference = canonical_reference(value, folder, where, key)
            user = read_class(reference, where, key)
            load_class(user, registry, where, key)
            given[table] = {**given[table], name: reference}
            code.append(user)
            names[key] = user.key
        elif isinstance(value, str) and registry.is_packaged(value):
            names[key] = value
        elif table == "mechanism":
            given_name = value if isinstance(value, str) else ""
            text = schema.given_text(value)
            raise InputError(*problems, Problem(where, key, "unknown mechanism", text, given_name, tuple(registry)))
        else:
            names[key] = default  # the table's own check says what is wrong
    return tuple(code), names


def _section_of_kind(
    kinds: Mapping[str, type[schema.Section]], default: str, table: dict[str, Any], name: str, where: str
) -> tuple[type[schema.Section], dict[str, Any]] | list[Problem]:
    """The section for the table's kind, and the table with its kind."""
    key = f"{name}.kind"
    kind = table.get("kind", default)
    if not isinstance(kind, str) or kind not in kinds:
        text = kind if isinstance(kind, str) else ""
        return [Problem(where, key, "unknown kind", schema.given_text(kind), text, tuple(kinds))]
    foreign = {
        item: [other for other, section in kinds.items() if item in section.model_fields]
        for item in table
        if item not in kinds[kind].model_fields
    }
    misplaced = [
        Problem(
            where,
            f"{name}.{item}",
            f"only goes with kind = {' or '.join(map(repr, of))}",
            f"kind = {kind!r}" + ("" if "kind" in table else " (the default)"),
        )
        for item, of in foreign.items()
        if of
    ]
    return misplaced or (kinds[kind], table | {"kind": kind})


_STARTS = ("q", "dq", "q_motor")


def _start_problems(initial: dict[str, Any], given: Mapping[str, object], where: str) -> list[Problem]:
    """A run starts on the reference or where it is told; `initial` keeps what counts."""
    if not initial.pop("on_reference", False):
        return []
    problems = [
        Problem(
            where, f"initial.{name}", "does not go with initial.on_reference = true", schema.given_text(given[name])
        )
        for name in _STARTS
        if name in given
    ]
    for name in _STARTS:
        initial.pop(name, None)
    initial["on_reference"] = True
    return problems


def _limit_problems(document: Document, where: str) -> list[Problem]:
    """No joint is told to start beyond its limits; whether the reference does, the run tells."""
    limits, start = document["mechanism"].get("limits"), document["initial"].get("q")
    pairs = zip(limits, start, strict=True) if limits and start else ()
    return [
        Problem(where, f"initial.q.{i}", f"expected a start within mechanism.limits.{i}, {low!r} to {high!r}", repr(q))
        for i, ((low, high), q) in enumerate(pairs)
        if not low <= q <= high
    ]


def _via_point_problems(reference: Mapping[str, Any], where: str) -> list[Problem]:
    """A polynomial reference has as many times as values, and its times ascend."""
    problems = []
    for name, points in reference.items() if reference.get("kind") == "polynomial" else ():
        if name == "kind":
            continue
        key, t, q = f"reference.{name}", points["t"], points["q"]
        if len(t) != len(q):
            problems.append(Problem(where, key, "expected as many values q as times t", f"{len(q)} and {len(t)}"))
        problems += [
            Problem(where, f"{key}.t.{i + 1}", f"expected a time later than the one before, {early!r} s", f"{late!r} s")
            for i, (early, late) in enumerate(pairwise(t))
            if late <= early
        ]
    return problems


def _exponent_problems(control: Mapping[str, Any], where: str) -> list[Problem]:
    """l > m and r > p (docs/paper.md section 4)."""
    return [
        Problem(
            where,
            f"control.{high}",
            f"expected {high} > {low}",
            f"{high} = {control[high]}, {low} = {control[low]}",
        )
        for high, low in (("l", "m"), ("r", "p"))
        if high in control and low in control and control[high] <= control[low]
    ]


def _sampling_problems(document: Document, given: Mapping[str, object], where: str) -> list[Problem]:
    """A sampled control has a period, a whole multiple of the step."""
    control, key = document["control"], "control.period"
    if "period" not in given:
        if control.get("mode") != "sampled":
            return []
        text = f"is missing: expected {schema.number_text(POSITIVE, 's')}, for the control is sampled"
        return [Problem(where, key, text)]
    if control.get("mode") != "sampled":  # else a forgotten mode would go unnoticed
        return [Problem(where, key, 'only goes with control.mode = "sampled"', 'mode = "continuous"')]
    return _whole_problems(document, key, where)


def _velocity_problems(sensor: dict[str, Any], given: Mapping[str, object], where: str) -> list[Problem]:
    """Rates of a sensor may have noise, differences a cutoff; `sensor` keeps what counts."""
    velocity = sensor.get("velocity")
    if velocity not in schema.NOT_WITH_VELOCITY:
        return []
    name = schema.NOT_WITH_VELOCITY[velocity]
    sensor.pop(name, None)
    if name not in given:
        return []
    [other] = (item for item in schema.NOT_WITH_VELOCITY if item != velocity)
    text = f'only goes with sensor.velocity = "{other}"'
    return [Problem(where, f"sensor.{name}", text, f'velocity = "{velocity}"')]


def _hardware_problems(document: Document, where: str) -> list[Problem]:
    """What sensors show, and when commands arrive, is of samples, which a continuous control has none of."""
    control = document["control"]
    if "mode" not in control or control["mode"] == "sampled":
        return []
    there = [
        f"{effect.table}.{effect.name}"
        for effect in (*SENSORS, *ACTUATORS)
        if any(value != effect.absent for value in document[effect.table].get(effect.name, ()))
    ]
    there += ["actuator.delay"] if document["actuator"].get("delay") else []
    there += ["sensor.velocity"] if document["sensor"].get("velocity") == "differenced" else []
    text = 'only goes with control.mode = "sampled"'
    return [Problem(where, key, text, 'mode = "continuous"') for key in there]


def _delay_problems(document: Document, where: str) -> list[Problem]:
    """A delay is so many steps, which all are remembered."""
    delay, step = document["actuator"].get("delay"), document["simulation"].get("step")
    if not delay or step is None:
        return []
    if delay / step > LONGEST_DELAY:
        text = f"expected at most {LONGEST_DELAY * step:.6g} s, {LONGEST_DELAY} times simulation.step = {step!r} s"
        return [Problem(where, "actuator.delay", text, f"{delay!r} s")]
    return _whole_problems(document, "actuator.delay", where)


def _whole_problems(document: Document, key: str, where: str) -> list[Problem]:
    """The time at `key` must be a whole multiple of the step."""
    table, _, name = key.partition(".")
    if name not in document[table] or "step" not in document["simulation"]:
        return []
    time, step = document[table][name], document["simulation"]["step"]
    ratio = time / step
    if ratio > MOST_STEPS:
        text = f"expected at most {MOST_STEPS * step:.6g} s, {MOST_STEPS} times simulation.step = {step!r} s"
        return [Problem(where, key, text, f"{time!r} s")]
    if round(ratio) >= 1 and abs(ratio - round(ratio)) <= _WHOLE * ratio:
        return []
    nearest = max(round(ratio), 1) * step
    text = f"expected a whole multiple of simulation.step = {step!r} s (the nearest is {nearest:.12g} s)"
    return [Problem(where, key, text, f"{time!r} s")]


def _columns(table: dict[str, Any], name: str, units: Mapping[str, str], folder: Path, where: str) -> list[Column]:
    """What [reference] or [base_motion] reads of its file, the time first.

    Makes path and units in `table` explicit, and drops a scale that says nothing.
    """
    columns, chosen, scale = table["columns"], table["units"], table["scale"]
    si = {"t": "s", **units}
    problems = [
        Problem(where, f"{name}.units.{key}", f"there is no columns.{key} that has this unit")
        for key in chosen
        if key not in columns
    ]
    problems += [
        Problem(where, f"{name}.scale.{key}", f"there is no columns.{key} that it could be a factor on")
        for key in scale
        if key not in columns
    ]
    if len(columns) == 1:
        key = f"{name}.columns"
        problems.append(Problem(where, key, f"expected a column for at least one of {', '.join(units)}"))
    if problems:
        raise InputError(*problems)
    if not scale:
        del table["scale"]
    table["units"] = chosen = {key: chosen.get(key, si[key]) for key in si if key in columns}
    key = f"{name}.path"
    table["path"] = canonical_path(table["path"], folder, where, key)
    return [
        Column(
            columns[item],
            f"{name}.columns.{item}",
            UNITS.get(si[item], {}).get(unit, 1.0) * scale.get(item, 1.0),
            HALF_TURN.get(unit, math.inf),
            unit,
        )
        for item, unit in chosen.items()
    ]


def _load_table(table: Mapping[str, Any], name: str, time: Column, channels: Sequence[Column], where: str) -> TableRead:
    """The signal table that [reference] or [base_motion] asks for."""
    path, key = table["path"], f"{name}.path"
    data = read_signal_file(path, where, key)
    ends = cast(Ends, table["ends"])
    max_gap = table.get("max_gap")
    return read_table(data, path, time, channels, ends, t0=table["t0"], max_gap=max_gap, where=where, key=key)


def _corner_notes(motion: str, table: Mapping[str, Any], duration: float) -> list[str]:
    """A warning for each coordinate that a user's motion lets jump."""
    units = {c.key: c.unit for c in COORDINATES}
    notes = []
    for corner in corners(MOTIONS[motion], table, duration):
        what, unit = corner.key, units[corner.key]
        if corner.of == "rate":
            what, unit = f"the rate of {corner.key}", f"{unit}/s"
        more = f" (and at {corner.count - 1} more times)" if corner.count > 1 else ""
        notes.append(
            f"base_motion.kind: {table['kind']}: {what} jumps by {corner.size:.3g} {unit} at {corner.t:.6g} s{more}: "
            "the arm feels accelerations, which follow by differentiation and have nothing of a jump, so that it feels "
            "another motion than the one that is shown (let one value pass into the other smoothly, by a tanh or a "
            "quintic)"
        )
    return notes


def _acceleration_notes(
    read: TableRead, table: Mapping[str, Any], name: str, channels: Sequence[Column], units: Mapping[str, str]
) -> list[str]:
    """A note on the largest accelerations of a record, and warnings of those that it does not show itself."""
    names = [column.key.rpartition(".")[2] for column in channels]
    of = [f"{units[item]}/s^2" for item in names]
    largest = np.abs(read.spline.accelerations()).max(axis=0)
    told = (
        f"{item} {found:.3g} {unit} ({shown:.3g})"
        for item, found, shown, unit in zip(names, largest, read.shown, of, strict=True)
    )
    note = f"{name}: the largest accelerations (and second differences of the rows) of {table['path']} are "
    return [note + ", ".join(told), *excess_notes(read, channels, of, table["path"], table["t0"])]


def _expect_overlap(
    read: Spline, table: Mapping[str, Any], name: str, channels: Sequence[Column], duration: float, where: str
) -> str:
    """A note on the span of the record that a run of `duration` s uses. Raises InputError if there is none."""
    t0, path = table["t0"], table["path"]
    lasts = f"{path} lasts from {read.t0 + t0:.15g} to {read.end + t0:.15g} s"
    wanted = f"{t0:.15g} to {t0 + duration:.15g} s"
    if read.ends == "periodic":
        return f"{name}: {path} repeats every {read.end - read.t0:.15g} s, and the run begins at its {t0:.15g} s"
    if not read.touches(duration):
        text = (
            f"{lasts} and the run takes {wanted} of it, which is outside: expected the record's time at run time 0 "
            f"(t0 = {read.t0 + t0:.15g} starts the run with the record; units.t says what its times are in)"
        )
        raise InputError(Problem(where, f"{name}.t0", text, f"{t0!r} s"))
    if not read.covers(duration):
        raise InputError(Problem(where, f"{name}.ends", f'{lasts}: expected all of {wanted} with ends = "error"'))
    note = f"{name}: {lasts}, and the run takes {wanted} of it"
    early, late = read.t0 > read.dt * _WHOLE, read.end < duration - read.dt * _WHOLE
    if early or late:
        before, after = (read.dt * (len(intervals) - 1) for intervals in read.rests())
        if early:
            note += f"; before the record the motion starts from rest at its first value, {before:.4g} s earlier"
        if late:
            note += f"; after the record the motion comes to rest at its last value, {after:.4g} s later"
        names = (column.key.rpartition(".")[2] for column in channels)
        astray = [
            f"{name} {value / column.factor:.4g} {table['units'][name]}"
            for name, column, value in zip(names, channels, read.astray(duration), strict=True)
            if not math.isnan(value)
        ]
        if astray:
            note += f", for which its accelerations are so small that it goes as far as {', '.join(astray)}"
    if duration < read.dt:
        note += f": less than one of its sample intervals of {read.dt:.15g} s (is units.t right?)"
    return note
