"""What differs between two descriptions of a sweep, key by key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from springline.runner.files import value_text


def changes(old: Any, new: Any, where: str = "") -> Iterator[str]:
    """How plain data differ, a line for each place, values in TOML: "vary.control.delta.uniform: [0, 1] -> [0, 2]"."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys([*old, *new]):
            yield from changes(old.get(key, _MISSING), new.get(key, _MISSING), f"{where}.{key}" if where else key)
    elif _is_keyed(old) and _is_keyed(new):
        yield from changes(_by_key(old), _by_key(new), where)
        before, now = ([item["key"] for item in items] for items in (old, new))
        if before != now and set(before) == set(now):
            yield f"{where}, order: {_shown(before)} -> {_shown(now)}"
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new) and any(map(_is_table, old)):
        for i, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from changes(a, b, f"{where}.{i}")
    elif old != new or type(old) is not type(new):  # true is no 1
        yield f"{where}: {_shown(old)} -> {_shown(new)}"


_MISSING = object()  # stands for what is not there


def _is_table(value: object) -> bool:
    return isinstance(value, dict)


def _is_keyed(value: object) -> bool:
    """Whether a value is a list of tables that name themselves."""
    return isinstance(value, list) and bool(value) and all(isinstance(item, dict) and "key" in item for item in value)


def _by_key(items: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    return {item["key"]: {name: value for name, value in item.items() if name != "key"} for item in items}


def _shown(value: object) -> str:
    text = "nothing" if value is _MISSING or value is None else value_text(value)
    return text if len(text) <= 100 else f"{text[:97]}..."
