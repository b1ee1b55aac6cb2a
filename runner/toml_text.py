"""Plain data as TOML text: what `tomllib` reads, the standard library does not write."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def value_text(value: object) -> str:
    """One TOML value on one line; floats with the shortest digits that give the same double.

    Raises TypeError for what TOML cannot hold, None among it.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
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
