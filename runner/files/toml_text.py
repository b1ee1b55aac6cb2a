"""TOML text as plain data and back: `tomllib` with a bound on depth, and the writer that the standard library lacks."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any

_DEEPEST = 32  # tables and lists in each other: no file of ours needs ten, and whatever walks a document recurses

_MOST_BITS = 2048
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def read_toml(text: str) -> dict[str, Any]:
    """The document of a TOML text, shallow enough to be walked recursively.

    Raises ValueError for what is no TOML, or nested more deeply than anything here.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as error:  # the one that Python has for integers
        raise ValueError("an integer has thousands of digits") from error
    except RecursionError as error:
        raise ValueError(_too_deep()) from error
    layer: list[Any] = [document]
    for _ in range(_DEEPEST):
        layer = [item for node in layer for item in (node.values() if isinstance(node, dict) else node)]
        layer = [item for item in layer if isinstance(item, dict | list)]
    if layer:
        raise ValueError(_too_deep())
    return document


def _too_deep() -> str:
    return f"tables and lists stand in each other more than {_DEEPEST} deep"


def value_text(value: object) -> str:
    """One TOML value on one line; floats with the shortest digits that give the same double.

    Raises TypeError for what TOML cannot hold, None among it.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        # Python prints no integer of more digits than it likes to read, but for those of base 16.
        return repr(value) if value.bit_length() <= _MOST_BITS else hex(value)
    if isinstance(value, float):
        return repr(value)  # Python's inf and nan are TOML's
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(value_text(item) for item in value)}]"
    if isinstance(value, Mapping):
        pairs = ", ".join(f"{_key(key)} = {value_text(item)}" for key, item in value.items())
        return f"{{ {pairs} }}" if pairs else "{}"
    raise TypeError(f"no TOML value: {value!r}")


def document_text(document: Mapping[str, Mapping[str, object]]) -> str:
    """A document of tables, one level of [headers], everything deeper inline."""
    tables = (
        "\n".join([f"[{_key(name)}]", *(f"{_key(key)} = {value_text(value)}" for key, value in table.items())])
        for name, table in document.items()
    )
    return "\n\n".join(tables) + "\n"


def _key(name: str) -> str:
    return name if _BARE_KEY.fullmatch(name) else value_text(name)
