"""SignalTable signals as the C reads them: cubics on uniform knots (runtime/sl_tables.h)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from springline.codegen.numbers import real
from springline.codegen.program.literals import literal

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SignalTable:
    """Knots of one table signal: interval k starts at t0 + k dt; coefficients (intervals, channels, 4), tau in s.

    Raises ValueError for what the loop could not find an interval in.
    """

    t0: float
    dt: float
    periodic: bool
    coefficients: Floats

    def __post_init__(self) -> None:
        real("t0 of a table", self.t0)
        real("dt of a table", self.dt, positive=True)
        if self.coefficients.ndim != 3 or len(self.coefficients) == 0:
            shape = self.coefficients.shape
            raise ValueError(f"coefficients of a table have shape {shape}, expected (at least 1, channels, 4)")
        real("end of a table, t0 + intervals * dt,", self.t0 + len(self.coefficients) * self.dt)


def print_tables(tables: Sequence[SignalTable], name: str) -> Iterator[str]:
    """Lines of C that define the array `name` of sl_table, and the coefficients it points to."""
    rows = []
    for i, table in enumerate(tables):
        intervals, channels, _ = table.coefficients.shape
        yield f"static const double {name}_{i}[] = {{"
        yield from (f"  {', '.join(literal(c) for c in interval.ravel())}," for interval in table.coefficients)
        yield "};"
        yield ""
        start, step = literal(table.t0), literal(table.dt)
        rows.append(f"  {{{start}, {step}, {intervals}, {channels}, {int(table.periodic)}, {name}_{i}}},")
    yield f"static const sl_table {name}[{len(tables)}] = {{"
    yield from rows
    yield "};"
