"""Dotted keys of a document of plain data: "control.mu.0", "reference.lift.terms.0.omega"."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from springline.codegen.numbers import doubles
from springline.model.base import ALIASES
from springline.runner.files import shortened

_LONGEST_PATH = 16  # no document has keys of ten parts, and each part is a call


def expect_keys(given: object, example: str) -> None:
    """Raise TypeError for what is no mapping of dotted keys to something, as `example` is one."""
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise TypeError(f"expected {example}, got {shortened(repr(given))}")


BY_COORDINATE = ("columns", "units", "scale")
"""Tables in [base_motion] whose keys are its coordinates."""


def canonical_key(key: str) -> str:
    """A key by the names that things have in a resolved scenario: "base_motion.shake" -> "base_motion.heave"."""
    for name, other in respellings([key]).items():
        return name + key[len(other) :]
    return key


def respellings(keys: Iterable[str]) -> dict[str, str]:
    """Which keys, or beginnings of keys, are given by another name: "base_motion.heave" -> "base_motion.shake"."""
    found = {}
    for key in keys:
        table, *parts = key.split(".")
        head = [table, *parts[:1]] if parts[:1] and parts[0] in BY_COORDINATE else [table]
        rest = key.split(".")[len(head) :]
        if table == "base_motion" and rest and rest[0] in ALIASES:
            found[".".join([*head, ALIASES[rest[0]]])] = ".".join([*head, rest[0]])
    return found


def respelled(key: str, given: Mapping[str, str]) -> str:
    """A canonical key as it was given, by what `respellings` found."""
    for name, other in given.items():
        if key == name or key.startswith(f"{name}."):
            return other + key[len(name) :]
    return key


def other_spellings(key: str) -> list[str]:
    """What else a canonical key may be called."""
    aliases = {f"base_motion.{name}": f"base_motion.{alias}" for alias, name in ALIASES.items()}
    return [spelled for spelled in [respelled(key, aliases)] if spelled != key]


def scale_key(key: str) -> str:
    """The key of the factor that stands for a value of the plant: "plant.m3" -> "plant.m3.scale"."""
    table, name, *index = key.split(".")
    return ".".join([table, name, "scale", *index])


def flat(node: object, key: str = "") -> Iterator[tuple[str, object]]:
    """Every value of nested tables and lists by dotted key."""
    if isinstance(node, dict | list):
        items = node.items() if isinstance(node, dict) else enumerate(node)
        for name, item in items:
            yield from flat(item, f"{key}.{name}" if key else str(name))
    else:
        yield key, node


def replaced(node: Any, path: Sequence[str], value: object, joints: int) -> Any:
    """A copy of `node` with `value` at `path`. LookupError if a list on the way has no such place."""
    if not path:
        return value
    if len(path) > _LONGEST_PATH:
        raise LookupError(f"expected a key of at most {_LONGEST_PATH} parts, not {len(path)}")
    head, rest = path[0], path[1:]
    if head.isdecimal() and isinstance(node, int | float) and not isinstance(node, bool):
        node = [node] * joints  # a number for all joints, of which one is to differ
    if isinstance(node, list):
        if not head.isdecimal() or int(head) >= len(node):
            places = f"0 to {len(node) - 1}" if node else "none, the list is empty"
            raise LookupError(f"expected a place in a list ({places}) instead of {head!r}")
        place = int(head)
        return [*node[:place], replaced(node[place], rest, value, joints), *node[place + 1 :]]
    table = dict(node) if isinstance(node, dict) else {}
    return table | {head: replaced(table.get(head), rest, value, joints)}


def plain(value: object, deep: int = _LONGEST_PATH) -> object:
    """Python, NumPy, Arrow and pandas values as TOML would give them, nested no deeper than `deep`.

    Raises TypeError or ValueError for what has no equal there.
    """
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.kind in "mM":  # which NumPy gives as whole numbers of nanoseconds
            raise TypeError(f"{value.dtype} is no kind of number")
        value = (doubles(value) if value.dtype.kind == "f" else value).tolist()
    else:
        converts = (getattr(value, name, None) for name in ("to_pylist", "as_py", "tolist"))
        value = next((convert() for convert in converts if convert), value)
    if isinstance(value, Path):
        return str(value)
    if not isinstance(value, Mapping | list | tuple):
        return value
    if deep == 0:
        raise ValueError(f"it is nested more than {_LONGEST_PATH} deep")
    if isinstance(value, Mapping):
        return {str(key): plain(item, deep - 1) for key, item in value.items()}
    return [plain(item, deep - 1) for item in value]
