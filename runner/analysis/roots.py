"""Where functions change their sign: many brackets side by side, by Ridders' method."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_ROUNDS = 60


def roots(f: Callable[[Floats], Floats], low: Floats, high: Floats, tolerance: float) -> Floats:
    """Roots of f, one in each bracket, to a relative tolerance; f takes and gives an array, a number a bracket.

    C. J. F. Ridders, IEEE Trans. Circuits Syst. 26 (1979) 979-980: a bracket at least halves with every two values, and
    at a simple root the digits double.
    """
    low, high = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    if not low.size:
        return low
    at_low, at_high = f(low), f(high)
    found = np.where(at_low == 0.0, low, high)
    for _ in range(_ROUNDS):
        middle = (low + high) / 2
        at_middle = f(middle)
        scale = np.sqrt(np.maximum(at_middle**2 - at_low * at_high, 0.0))
        share = np.divide(at_middle, scale, out=np.zeros_like(scale), where=scale > 0.0)
        new = middle + (middle - low) * np.where(at_low >= at_high, share, -share)
        at_new = f(new)
        moved = np.abs(new - found)
        found = new
        # Of the four points, the two neighbours that enclose the root.
        first, second = np.minimum(middle, new), np.maximum(middle, new)
        swapped = new < middle
        at_first, at_second = np.where(swapped, at_new, at_middle), np.where(swapped, at_middle, at_new)
        below = np.signbit(at_low)
        one, two = np.signbit(at_first) == below, np.signbit(at_second) == below
        # The change is beyond the second point, between the two, or before the first.
        high, at_high = (
            np.where(two, high, np.where(one, second, first)),
            np.where(two, at_high, np.where(one, at_second, at_first)),
        )
        low, at_low = (
            np.where(two, second, np.where(one, first, low)),
            np.where(two, at_second, np.where(one, at_first, at_low)),
        )
        if np.all((moved <= tolerance * np.abs(found)) | (high - low <= tolerance * np.abs(found)) | (at_new == 0.0)):
            break
    return found


def root(f: Callable[[float], float], ends: Floats, tolerance: float) -> float:
    """The root of a function of one number between two ends."""
    return float(roots(lambda at: np.array([f(float(at[0]))]), ends[:1], ends[1:], tolerance)[0])
