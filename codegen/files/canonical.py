"""JSON whose bytes follow from the content alone."""

import json
import math
from collections.abc import Mapping
from typing import Any


def canonical_json(value: object) -> bytes:
    """UTF-8 JSON with sorted keys, shortest floats that read back exactly, and infinity as ``"inf"``.

    Raises ValueError for NaN, which no manifest has a use for, and TypeError for what JSON cannot hold.
    """
    text = json.dumps(_plain(value), indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False)
    return (text + "\n").encode()


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return value
