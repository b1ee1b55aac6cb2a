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
        inner, at_inner = np.sort([middle, new], axis=0), np.where(middle <= new, [at_middle, at_new], [at_new, at_middle])
        for place in range(2):
            before = np.signbit(at_inner[place]) == np.signbit(at_low)
            inside = (inner[place] >= low) & (inner[place] <= high)
            low, at_low = np.where(before & inside, inner[place], low), np.where(before & inside, at_inner[place], at_low)
        for place in (1, 0):
            beyond = np.signbit(at_inner[place]) != np.signbit(at_low)
            inside = (inner[place] >= low) & (inner[place] <= high)
            high = np.where(beyond & inside, inner[place], high)
            at_high = np.where(beyond & inside, at_inner[place], at_high)
        if np.all((moved <= tolerance * np.abs(found)) | (high - low <= tolerance * np.abs(found)) | (at_new == 0.0)):
            break
    return found


def root(f: Callable[[float], float], ends: Floats, tolerance: float) -> float:
    """The root of a function of one number between two ends."""
    return float(roots(lambda at: np.array([f(float(at[0]))]), ends[:1], ends[1:], tolerance)[0])
