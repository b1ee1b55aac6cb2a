"""The numbers of the runs: what a sweep's method draws for each of its axes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springline.runner.sweep import sampling
from springline.runner.sweep.sweep import Axis, Sweep

Floats = NDArray[np.float64]
Columns = dict[str, NDArray[Any]]


class Drawing:
    """The sample of a sweep, from which any row can be taken at any time.

    axes  those along which runs of one group differ
    """

    def __init__(self, sweep: Sweep, axes: Sequence[Axis]) -> None:
        self.sweep = sweep
        self.axes = axes
        self._sobol: sampling.Sobol | None = None

    def columns(self, row: int, count: int) -> Columns:
        """The inner keys of sample rows row .. row+count-1, and what is tied to them."""
        places: dict[str, NDArray[np.int64]] = {}
        drawn: Columns = {}
        if self.sweep.method == "grid":
            index = np.arange(row, row + count)
            for axis in reversed(self.axes):
                index, places[axis.key] = np.divmod(index, axis.points or len(axis.values))
            for axis in self.axes:
                drawn[axis.key] = grid_values(axis)[places[axis.key]]
        else:
            for axis, u in zip(self.axes, self.unit_columns(row, count), strict=True):
                if axis.values:
                    places[axis.key] = sampling.chosen(u, len(axis.values))
                    drawn[axis.key] = np.array(axis.values, dtype=np.float64)[places[axis.key]]
                else:
                    drawn[axis.key] = spread(axis, u)
        for axis in self.sweep.axes:
            if axis.tie in drawn:
                own = np.array(axis.values, dtype=np.float64)
                drawn[axis.key] = own[places[axis.tie]] if axis.values else axis.factor * drawn[axis.tie]
        return drawn

    def unit_columns(self, row: int, count: int) -> Iterator[Floats]:
        """Numbers in (0, 1) for each inner axis."""
        seed, names = self.sweep.seed, tuple(axis.key for axis in self.axes)
        if self.sweep.method == "sobol" and names:
            self._sobol = self._sobol or sampling.Sobol(seed, names)
            yield from self._sobol.rows(row, count).T
        elif self.sweep.method == "latin_hypercube":
            yield from (sampling.latin_hypercube(seed, name, row, count, self.sweep.samples) for name in names)
        else:
            yield from (sampling.random(seed, name, row, count) for name in names)


def grid_values(axis: Axis) -> Floats:
    """The values that an axis takes in a grid, in their order."""
    if axis.values:
        return np.array(axis.values, dtype=np.float64)
    values = spread(axis, np.linspace(0.0, 1.0, axis.points))
    values[0], values[-1] = axis.span
    return values


def spread(axis: Axis, u: Floats) -> Floats:
    """Numbers u from (0, 1) as the values of an axis that is drawn."""
    draw = {"uniform": sampling.uniform, "log_uniform": sampling.log_uniform, "normal": sampling.normal}[axis.kind]
    return draw(u, *axis.span)
