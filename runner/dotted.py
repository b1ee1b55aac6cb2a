"""Dotted keys of a document of plain data: "control.mu.0", "reference.lift.terms.0.omega"."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from springline.runner.errors import shortened


def expect_keys(given: object, example: str) -> None:
    """Raise TypeError for what is no mapping of dotted keys to something, as `example` is one."""
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise TypeError(f"expected {example}, got {shortened(repr(given))}")


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


def plain(value: object) -> object:
    """Python and NumPy values as TOML would give them."""
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value
