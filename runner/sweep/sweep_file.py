"""Sweep files: which keys of a scenario vary, over what, and how often.

    scenario = "paper/group1_shake"             a packaged name, or a path from the sweep file
    method = "sobol"                            "grid" | "random" | "sobol" | "latin_hypercube"
    samples = 4096                              all but a grid, whose size is the product of its axes
    seed = 1
    chunk = 1024                                runs per part of the dataset; chosen if left out

    [set]                                       overrides of the scenario for all runs, by dotted key
    simulation.duration = 2.0                   (a table [control.<name>]: for those whose controller, … it is)

    [vary]
    control.delta = { log_uniform = [0.01, 0.1] }
    control.a_max.0 = { uniform = [50, 500] }   in a grid also: points = 41
    control.a_max.1 = { tie = "control.a_max.0", factor = 2 }
    plant.m3.scale = { normal = [1.0, 0.05] }
    control.law = { each = ["variable_power_log", "power"] }

    [keep]
    trajectories = 100                          the trajectory of every 100th run

`values` shares the samples out among its values, `each` runs all samples with each of its values (in a grid both are an
axis). A tied key moves with another: the same number, `factor` times it, or the entry of its own `values` that stands
where the other's stands.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Any, cast, get_args

from springline.codegen.nearest import nearest
from springline.runner.files import InputError, Problem, read_toml, unknown
from springline.runner.scenario import (
    CHOOSERS,
    Scenario,
    absent_at,
    draft_scenario,
    given_text,
    load_scenario,
    read_sweep,
    table_chosen,
    table_in,
)
from springline.runner.sweep.sweep import Axis, Kind, Method, Sweep, is_number

MOST_RUNS = 10**9
"""More are no sweep but a mistake: they would take years."""

_KINDS: tuple[Kind, ...] = get_args(Kind)
_OPTIONS = ("points", "factor")
_KEYS = ("scenario", "method", "samples", "seed", "chunk", "set", "vary", "keep")
_LARGEST_CHUNK = 65536


def load_sweep(source: str | Path, overrides: Mapping[str, object] | None = None) -> Sweep:
    """Load a sweep: a TOML file, or a packaged one by name ("stability_map").

    overrides  values of the scenario for all runs, by dotted key, that take the place of the file's
    Raises InputError that names all mistakes of the file: key, what was expected, the nearest valid name.
    """
    name = str(source)
    text, folder = read_sweep(source)
    try:
        document = read_toml(text)
    except ValueError as error:
        raise InputError(Problem(name, "", f"is no valid TOML: {error}")) from error
    return _Reader(name, folder, overrides or {}).sweep(document)


def _covers(varied: str, key: str) -> bool:
    """Whether a key that varies decides all that another would set; a value and a factor of the plant are one."""
    outer, inner = ([part for part in name.split(".") if part != "scale"] for name in (varied, key))
    return inner[: len(outer)] == outer


def sweep_from_json(entry: Mapping[str, Any], chunk: int, scenario: Scenario, source: str) -> Sweep:
    """The Sweep of an entry that `Sweep.as_json` made: what it holds is checked like a file.

    source  what it came from, for messages
    Raises InputError, or KeyError, TypeError, AttributeError or ValueError where it has not even the shape.
    """
    vary = {item["key"]: read_toml(f"axis = {item['axis']}")["axis"] for item in entry["vary"]}
    held = {item["key"]: read_toml(f"value = {item['value']}")["value"] for item in entry.get("set", ())}
    document = {**entry, "set": held, "vary": vary, "chunk": chunk}
    if entry["method"] == "grid":
        del document["samples"]
    sweep = _Reader(source, Path()).sweep(document, scenario)
    if sweep.samples != entry["samples"]:
        raise ValueError(f"samples = {entry['samples']}, but its axes have {sweep.samples} points")
    return sweep


class _Reader:
    """Checks one sweep file, gathering its problems."""

    def __init__(self, name: str, folder: Path, overrides: Mapping[str, object] | None = None) -> None:
        self._name = name
        self._folder = folder
        self._overrides = overrides or {}
        self._problems: list[Problem] = []

    def sweep(self, document: Mapping[str, Any], scenario: Scenario | None = None) -> Sweep:
        """The Sweep; of `scenario`, or of the one that the document names. Raises InputError."""
        self._problems += [unknown(self._name, key, "key", key, _KEYS) for key in document if key not in _KEYS]
        method = document.get("method", "random")
        if method not in get_args(Method):
            name = method if isinstance(method, str) else ""
            self._problems.append(
                Problem(self._name, "method", "unknown method", given_text(method), name, get_args(Method))
            )
            raise InputError(*self._problems)  # what an axis may say depends on it
        seed = self._whole(document, "seed", 0, 0, 2**64 - 1)
        chunk = self._whole(document, "chunk", 0, 1, _LARGEST_CHUNK)
        keep = self._keep(document.get("keep", {}))
        axes = self._axes(document.get("vary", {}), method)
        self._expect_effect(axes)
        held: Mapping[str, object] = document.get("set", {})
        if scenario is None:
            scenario, held = self._scenario(document, axes)
        samples = self._samples(document, cast(Method, method), axes)
        if self._problems or scenario is None:
            raise InputError(*self._problems)
        reached = {axis.key: axis.reach(axes) for axis in axes if absent_at(axis.key) is not None}
        scenario = scenario.including({key: numbers for key, numbers in reached.items() if 0.0 not in numbers})
        return Sweep(self._name, scenario, cast(Method, method), samples, seed, chunk, keep, tuple(axes), held)

    def _expect_effect(self, axes: Sequence[Axis]) -> None:
        """An override of a key that varies would have none."""
        self._problems += [
            Problem(
                f"override of {self._name}",
                key,
                f"it varies in this sweep (vary.{axis.key}): an override has no effect",
            )
            for key in self._overrides
            for axis in axes
            if _covers(axis.key, key)
        ]

    def _wrong(self, key: str, expected: str, given: object) -> None:
        self._problems.append(Problem(self._name, key, expected, given_text(given)))

    def _whole(self, table: Mapping[str, Any], key: str, default: int, low: int, high: int, label: str = "") -> int:
        value = table.get(key, default)
        if key in table and not (_is_whole(value) and low <= value <= high):
            self._wrong(label or key, f"expected a whole number in [{low}, {high}]", value)
            return default
        return int(value)

    def _keep(self, table: object) -> int:
        if not isinstance(table, dict):
            self._wrong("keep", "expected a table with { trajectories }", table)
            return 0
        wrong = [key for key in table if key != "trajectories"]
        self._problems += [unknown(self._name, f"keep.{key}", "key", key, ["trajectories"]) for key in wrong]
        return self._whole(table, "trajectories", 0, 1, MOST_RUNS, "keep.trajectories")

    def _scenario(self, document: Mapping[str, Any], axes: Sequence[Axis]) -> tuple[Scenario | None, dict[str, object]]:
        """The scenario with its overrides, and those that are held back: of tables that only runs of the sweep have."""
        source = document.get("scenario", "paper/nominal")
        overrides = document.get("set", {})
        if not isinstance(source, str):
            self._wrong("scenario", "expected the name or path of a scenario", source)
            return None, {}
        if not isinstance(overrides, dict):
            self._wrong("set", "expected a table of dotted keys", overrides)
            return None, {}
        path, key = self._folder / source, "scenario"
        changes = [("set", dict(_flattened(overrides)), self._folder), ("", self._overrides, Path())]
        try:
            offered = {
                table_chosen(axis.key, value, self._folder, f"{self._name}: vary")
                for axis in axes
                if axis.key in CHOOSERS
                for value in axis.values
            } - {""}  # of a law or an observer without a table of its own
            held: dict[str, object] = {
                name: value for _, change, _ in changes for name, value in change.items() if table_in(name) in offered
            }
            # Whose tables the scenario has itself is known when all else is set.
            draft = draft_scenario(path if path.is_file() else source)
            for label, change, folder in changes if held else ():
                key = label
                rest = {name: value for name, value in change.items() if name not in held}
                draft = replace(draft, folder=folder).with_overrides(rest, read=False)
            held = {name: value for name, value in held.items() if table_in(name) not in draft.control_tables}
            changes = [(k, {n: v for n, v in c.items() if n not in held}, folder) for k, c, folder in changes]
            changes = [change for change in changes if change[1]]
            key = "scenario"
            load = draft_scenario if changes else load_scenario
            scenario = load(path if path.is_file() else source)
            for k, (label, change, folder) in enumerate(changes):  # files are read when all changes are made
                key = label
                scenario = replace(scenario, folder=folder).with_overrides(change, read=k + 1 == len(changes))
            return replace(scenario, folder=self._folder), held
        except InputError as error:
            there = f"{self._name}: {key}: " if key else ""
            self._problems += [replace(problem, where=f"{there}{problem.where}") for problem in error.problems]
            return None, {}

    def _samples(self, document: Mapping[str, Any], method: Method, axes: Sequence[Axis]) -> int:
        each = math.prod(len(axis.values) for axis in axes if axis.kind == "each")
        if method == "grid":
            if "samples" in document:
                self._wrong("samples", "a grid takes none: its size is the product of its axes", document["samples"])
            samples = math.prod(_grid_points(axis) for axis in axes if axis.kind != "tie") // each
        elif "samples" in document:
            samples = self._whole(document, "samples", 1, 1, MOST_RUNS)
        else:
            self._problems.append(
                Problem(self._name, "samples", f"is missing: expected a whole number in [1, {MOST_RUNS}]")
            )
            samples = 1
        if samples * each > MOST_RUNS:
            self._problems.append(
                Problem(
                    self._name,
                    "vary" if method == "grid" else "samples",
                    f"expected at most {MOST_RUNS:,} runs (a random sample of a grid tells as much)",
                    f"{_count_text(samples * each)} runs",
                )
            )
        return samples

    def _axes(self, table: object, method: str) -> list[Axis]:
        if not isinstance(table, dict) or not table:
            self._wrong("vary", "expected a table with at least one key and how it varies", table)
            return []
        axes = []
        for key, entry in _entries(table):
            axis = self._axis(key, entry, method)
            if axis is not None:
                axes.append(axis)
        return self._tied(axes)

    def _axis(self, key: str, entry: object, method: str) -> Axis | None:
        label = f"vary.{key}"
        if not isinstance(entry, dict):
            wanted = "expected a table such as { uniform = [low, high] } or { values = [...] }"
            self._wrong(label, wanted, entry)
            return None
        kinds = [name for name in ("tie", *_KINDS) if name in entry]
        strange = [name for name in entry if name not in (*_KINDS, *_OPTIONS)]
        if strange:
            self._problems += [
                unknown(self._name, f"{label}.{name}", "word", name, (*_KINDS, *_OPTIONS)) for name in strange
            ]
            return None
        kind: Kind = "tie" if "tie" in kinds else kinds[0] if kinds else "values"
        if len(set(kinds) - ({"values"} if kind == "tie" else set())) != 1:
            self._wrong(label, f"expected exactly one of {', '.join(_KINDS)}", entry)
            return None
        for option in _OPTIONS:
            if option in entry and not self._option_fits(label, option, kind, method, entry):
                return None
        if kind == "tie":
            return self._tie(key, entry)
        if kind in ("values", "each"):
            values = self._values(label, entry[kind])
            return Axis(key, kind, values=values) if values else None
        return self._spread(key, kind, entry, method)

    def _option_fits(self, label: str, option: str, kind: Kind, method: str, entry: Mapping[str, Any]) -> bool:
        """Whether `points` or `factor` may stand here and is a number of its kind."""
        if option == "points":
            if method != "grid" or kind not in ("uniform", "log_uniform"):
                self._wrong(f"{label}.points", 'only goes with uniform or log_uniform and method = "grid"', kind)
                return False
            if not (_is_whole(entry["points"]) and entry["points"] >= 2):
                self._wrong(f"{label}.points", "expected a whole number >= 2", entry["points"])
                return False
            return True
        if kind != "tie" or "values" in entry:
            self._wrong(f"{label}.factor", "only goes with a tie that has no values of its own", kind)
            return False
        if not is_number(entry["factor"]) or entry["factor"] == 0:
            self._wrong(f"{label}.factor", "expected a number other than 0", entry["factor"])
            return False
        return True

    def _values(self, label: str, values: object) -> tuple[Any, ...]:
        if not isinstance(values, list) or not values:
            self._wrong(label, "expected a list of values", values)
            return ()
        if any(isinstance(value, float) and math.isnan(value) for value in values):
            self._wrong(label, "expected values that are no NaN", values)
            return ()
        return tuple(values)

    def _tie(self, key: str, entry: Mapping[str, Any]) -> Axis | None:
        label = f"vary.{key}"
        if not isinstance(entry["tie"], str):
            self._wrong(f"{label}.tie", "expected the key that this one moves with", entry["tie"])
            return None
        values = self._values(label, entry["values"]) if "values" in entry else ()
        if "values" in entry and not values:
            return None
        return Axis(key, "tie", values=values, tie=entry["tie"], factor=float(entry.get("factor", 1.0)))

    def _spread(self, key: str, kind: Kind, entry: Mapping[str, Any], method: str) -> Axis | None:
        label, pair = f"vary.{key}", entry[kind]
        names = "[mean, standard deviation]" if kind == "normal" else "[low, high]"
        if not isinstance(pair, list) or len(pair) != 2 or not all(map(is_number, pair)):
            self._wrong(f"{label}.{kind}", f"expected {names}, two finite numbers", pair)
            return None
        low, high = map(float, pair)
        if kind == "normal":
            if method == "grid":
                self._wrong(label, "a grid has no normal axis: expected uniform, log_uniform or values", entry)
                return None
            if high <= 0:
                self._wrong(f"{label}.normal", "expected a standard deviation > 0", pair)
                return None
        elif low >= high:
            self._wrong(f"{label}.{kind}", "the range is empty: expected low < high", pair)
            return None
        if kind == "log_uniform" and low <= 0:
            self._wrong(f"{label}.log_uniform", "expected 0 < low: a logarithmic range cannot reach zero", pair)
            return None
        if method == "grid" and "points" not in entry:
            self._wrong(label, "expected the number of points on this axis of the grid: { …, points = 21 }", entry)
            return None
        return Axis(key, kind, (low, high), points=int(entry.get("points", 0)))

    def _tied(self, axes: list[Axis]) -> list[Axis]:
        by_key = {axis.key: axis for axis in axes}
        for axis in axes:
            if axis.kind != "tie":
                continue
            label, other = f"vary.{axis.key}.tie", by_key.get(axis.tie)
            if other is None or other.kind == "tie":
                free = [each.key for each in axes if each.kind != "tie"]
                self._problems.append(unknown(self._name, label, "key that varies by itself", axis.tie, free))
            elif axis.values and len(axis.values) != len(other.values):
                expected = f"expected as many values as {other.key} has ({len(other.values)})"
                self._wrong(f"vary.{axis.key}.values", expected, list(axis.values))
        return axes


def _grid_points(axis: Axis) -> int:
    return axis.points or len(axis.values)


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _count_text(count: int) -> str:
    """A whole number of any length for people, three digits of it: "1e+12", "1.00e+400"."""
    return f"{count:.3g}" if count < 10**300 else f"{Decimal(count):.3g}"


def _entries(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, object]]:
    """The keys that vary, however the file nests them."""
    for name, entry in table.items():
        key = f"{prefix}{name}"
        if isinstance(entry, dict) and entry and not _says_how(entry):
            yield from _entries(entry, f"{key}.")
        else:
            yield key, entry


def _says_how(table: Mapping[str, Any]) -> bool:
    """Whether a table is how a key varies, and not one of further keys; a misspelt word is still a word."""
    words = (*_KINDS, *_OPTIONS)
    return any(
        name in words or (not isinstance(content, dict) and nearest(name, words, 0.7))
        for name, content in table.items()
    )


def _flattened(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, object]]:
    """Overrides by dotted key, however the file nests them; what stands in braces stays a table in a list only."""
    for name, value in table.items():
        if isinstance(value, dict):
            yield from _flattened(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
