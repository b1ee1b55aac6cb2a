"""The door for numbers: whatever a caller holds, as contiguous native float64, or refused where that would lose some.

Behind it a number is a C double. A column that was only checked and then passed on as given is read as other numbers
(big-endian, unaligned), rounded without a word (long double, integers beyond 2^53), or taken for what it is not (what
lies under a mask, truth values).
"""

from __future__ import annotations

import math
import operator

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_EXACT = 2**53
"""Up to here every integer is a double."""

_SHOWN = 40


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


def double(value: object) -> float:
    """One number as a float.

    Raises TypeError for what is no real number (a truth value, a text, a missing value), ValueError for a number that
    lies between two doubles or beyond the largest.
    """
    if isinstance(value, float):
        return float(value)
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer | np.floating):
        raise TypeError(f"{_kind(value)} is no number")
    given = value if isinstance(value, np.floating) else int(value)
    try:
        with np.errstate(over="ignore"):
            result = float(given)
    except OverflowError:
        result = np.inf
    if result != given and not np.isnan(result):
        raise ValueError(f"no 64-bit float is {shown(given)}")
    return result


def doubles(values: object) -> Floats:
    """An array, an Arrow or pandas column, or nested lists of numbers, as an array of the same shape.

    It is contiguous, aligned and in the machine's byte order; values that are already so are not copied.
    Raises TypeError and ValueError as `double` does, for masked and missing entries and ragged lists too.
    """
    parts = values if isinstance(values, list | tuple) else [values]
    if any(isinstance(part, np.ma.MaskedArray) and np.ma.is_masked(part) for part in parts):
        raise ValueError("some entries are masked")
    if getattr(values, "null_count", 0):  # of Arrow, whose conversion makes NaN of them
        raise ValueError("some entries are missing")
    if isinstance(values, list | tuple):  # NumPy would round integers and take truth values for numbers beside others
        return _each(np.array(values, dtype=object))
    array = np.asarray(values)
    if array.dtype.kind == "O":
        return _each(array)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{array.dtype} is no kind of number")
    with np.errstate(over="ignore"):
        result = np.require(array, np.float64, ["C", "A"])
    if array.dtype.kind == "f" and array.dtype.itemsize > result.dtype.itemsize:
        suspect = (result != array) & ~np.isnan(array)
    elif array.dtype.kind in "iu" and array.dtype.itemsize >= result.dtype.itemsize:
        suspect = (array > _EXACT) | (array < -_EXACT)
    else:
        return result
    for value in array[suspect]:
        double(value)  # raises for those that were rounded
    return result


def _each(array: NDArray[np.object_]) -> Floats:
    """The entries of an array of anything, one by one."""
    return np.array([double(value) for value in array.flat], dtype=np.float64).reshape(array.shape)


def _kind(value: object) -> str:
    if isinstance(value, bool | np.bool_):
        return "a truth value"
    return "a missing value" if value is None else f"{type(value).__name__} {str(value)[:_SHOWN]!r}"


def shown(value: object) -> str:
    """A value for a message; an integer that Python would refuse to print, by its size."""
    if isinstance(value, int) and abs(value) >= 10**_SHOWN:
        return f"an integer of {value.bit_length()} bits"
    return str(value) if isinstance(value, np.floating) else repr(value)
