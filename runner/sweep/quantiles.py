"""Quantiles of a column that is too long for the memory: exact, in two passes over its parts.

A sample of the column tells about where a quantile lies. The first pass counts the numbers below some edges around
there; the second gathers those between the two edges that enclose it, a few in ten thousand. A sample that misleads
costs memory, never a digit.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_DEVIATIONS = 4.0  # of a quantile's place in the sample, to both sides of it
_EDGES = 65  # for each quantile


class Quantiles:
    """Quantiles of one column by the nearest rank; NaN stands for no number.

    Every part goes through `count`, then every part through `gather`, in any order.
    """

    def __init__(self, wanted: Sequence[float], sample: Floats) -> None:
        """`wanted`: shares of the numbers, 0 .. 1;  `sample`: some numbers of the column."""
        self._wanted = wanted
        near = _near(wanted, _sorted(sample))
        # Beside each edge stands the next double: where one number occurs often, nothing need be gathered.
        with np.errstate(over="ignore"):  # beside the largest double stands infinity
            beside = np.nextafter(near, np.inf)
        self._edges = np.unique(np.concatenate([[-np.inf], near, beside, [np.nan]]))
        self._below = np.zeros(len(self._edges), dtype=np.int64)

    @property
    def known(self) -> int:
        """How many numbers were counted."""
        return int(self._below[-1])  # NaN is above all

    def count(self, values: Floats) -> None:
        """First pass: a part of the column."""
        self._below += np.searchsorted(_sorted(values), self._edges)

    def gather(self, values: Floats) -> None:
        """Second pass: a part of the column."""
        known = _sorted(values)
        for edge, gathered in self._gathered.items():
            first, last = np.searchsorted(known, self._edges[edge : edge + 2])
            gathered.frombytes(known[first:last].tobytes())

    def values(self) -> tuple[float, ...]:
        """The quantiles, NaN if there are no numbers."""
        if self.known == 0:
            return (float("nan"),) * len(self._wanted)
        return tuple(self._value(rank) for rank in self._ranks)

    def _value(self, rank: int) -> float:
        edge = self._edge_below(rank)
        if edge not in self._gathered:
            return float(self._edges[edge])
        return float(np.sort(self._gathered[edge])[rank - self._below[edge]])

    @property
    def _ranks(self) -> list[int]:
        """Places of the quantiles among the sorted numbers."""
        return [round(share * (self.known - 1)) for share in self._wanted] if self.known else []

    def _edge_below(self, rank: int) -> int:
        """Index of the edge above which, and below the next, the number of a rank lies."""
        return int(np.searchsorted(self._below, rank, side="right")) - 1

    @cached_property
    def _gathered(self) -> dict[int, array[float]]:
        """For each edge, by index, above which a quantile lies that is not the edge itself: the numbers up to the next.

        Known once all is counted.
        """
        edges = {self._edge_below(rank) for rank in self._ranks}
        return {i: array("d") for i in edges if math.nextafter(self._edges[i], math.inf) != self._edges[i + 1]}


def _sorted(values: Floats) -> Floats:
    """The numbers among `values`."""
    return np.sort(values[~np.isnan(values)])


def _near(wanted: Sequence[float], sample: Floats) -> Floats:
    """Numbers of a sorted sample about its quantiles, as far to both sides as those of the column may lie."""
    last = len(sample) - 1
    if last < 0:
        return sample
    places = [
        np.linspace(share * last - reach, share * last + reach, _EDGES)
        for share in wanted
        for reach in (1.0 + _DEVIATIONS * np.sqrt(len(sample) * share * (1.0 - share)),)
    ]
    return sample[np.clip(np.rint(places), 0, last).astype(np.int64).ravel()]
