"""Numbers on their way into C: checked there, where nothing can be cut off or wrapped without a word."""

from __future__ import annotations

import math
import operator


def whole(name: str, value: object, low: int, high: int) -> int:
    """`value` as an int. Raises ValueError if it is none, or not in low .. high."""
    try:
        number = operator.index(value)  # type: ignore[arg-type] # refuses what is no integer
    except TypeError:
        number = None
    if number is None or isinstance(value, bool) or not low <= number <= high:
        raise ValueError(f"{name} is {shown(value)}, expected a whole number from {low} to {high}")
    return number


def real(name: str, value: object, *, positive: bool = False, infinite: bool = False) -> float:
    """`value` as a float. Raises ValueError if it is none, not finite (unless `infinite`), or not positive if asked."""
    try:
        number = float(value)  # type: ignore[arg-type] # refuses what is no number
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (math.isfinite(number) or (infinite and number == math.inf)) or (positive and number <= 0.0):
        expected = f"a {'positive' if positive else 'finite'} number" + (" or inf" if infinite else "")
        raise ValueError(f"{name} is {shown(value)}, expected {expected}")
    return number


def shown(value: object) -> str:
    """A value for a message; an integer that Python would refuse to print, by its size."""
    if isinstance(value, int) and abs(value) >= 10**40:
        return f"an integer of {value.bit_length()} bits"
    return repr(value)
