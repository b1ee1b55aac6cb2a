"""Numbers as C constants."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

Real = Literal["double", "float"]
"""Number type of the C."""


def literal(value: float, real: Real = "double") -> str:
    """The C constant: the same double, or the float nearest to it.

    Raises ValueError for a number other than zero that a float cannot hold.
    """
    f = "F" if real == "float" else ""
    if math.isnan(value):
        return f"SL{f}_NAN"
    if math.isinf(value):
        return f"SL{f}_INF" if value > 0 else f"-SL{f}_INF"
    if real == "double":
        return _with_point(repr(float(value)))
    with np.errstate(over="ignore", under="ignore"):
        single = np.float32(value)
    if value != 0.0 and (single == 0.0 or not np.isfinite(single)):
        raise ValueError(f"{value!r} cannot be a float: export with real = 'double'")
    return _with_point(np.format_float_scientific(single, trim="-") if _extreme(value) else str(single)) + "f"


def constant_expression(value: float, real: Real = "double") -> str:
    """As `literal`, for initialisers of static data, where C wants a constant expression."""
    if math.isinf(value):
        return f"{literal(math.copysign(1.0, value), real)} / {literal(0.0, real)}"
    return literal(value, real)


def _extreme(value: float) -> bool:
    return value != 0.0 and not 1e-4 <= abs(value) < 1e7


def _with_point(text: str) -> str:
    return text if any(c in text for c in ".e") else text + ".0"
