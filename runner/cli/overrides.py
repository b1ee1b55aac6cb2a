"""What --set says: KEY=VALUE, the value as in TOML."""

from __future__ import annotations

import re
from collections.abc import Sequence

from springline.runner.files import InputError, Problem

_BARE_WORD = re.compile(r"([^\W\d]|\.{0,2}/)[\w.:/+-]*")


def overrides(changes: Sequence[str] | None, source: str) -> dict[str, object]:
    """What --set asks for, by dotted key; of two for the same key the later one counts.

    source  the scenario that it is to override, for messages
    Raises InputError for what is not of the form KEY=VALUE.
    """
    return dict(parse_set(change, source) for change in changes or ())


def parse_set(text: str, source: str) -> tuple[str, object]:
    """KEY=TOMLVALUE as a key and a value: "control.delta=0.02", "control.law=power", "plant.m3={ scale = 1.2 }".

    What is no TOML value but a bare word, or a path, is text: quotes inside a shell's quotes are a nuisance.
    source  the scenario that it is to override, for messages
    Raises InputError if it is not of that form.
    """
    import tomllib

    from springline.runner.files import read_toml
    from springline.runner.scenario import given_text

    where = f"override of {source}"
    key, equals, value = text.partition("=")
    key = key.strip()
    if not equals or not key:
        raise InputError(Problem(where, "", "expected --set KEY=VALUE", given_text(text)))
    try:
        parsed = read_toml(f"value = {value}")
    except ValueError as error:
        if isinstance(error, tomllib.TOMLDecodeError) and _BARE_WORD.fullmatch(value.strip()):
            return key, value.strip()
        hint = f"expected a TOML value ({error}); a text of several words needs quotes: --set '{key}=\"…\"'"
        raise InputError(Problem(where, key, hint, value.strip())) from error
    if set(parsed) != {"value"}:
        raise InputError(Problem(where, key, "expected one TOML value", given_text(value)))
    return key, parsed["value"]
