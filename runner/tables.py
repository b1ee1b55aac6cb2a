"""Signals from CSV files: uniform samples in, cubic spline coefficients out.

What lies between the samples, and its first two derivatives, is continuous. What lies outside them is `ends`:

    hold      the first and the last value stand still; the spline starts and ends with rate zero, so that the rate is
              continuous there too
    periodic  the samples repeat. If the last row repeats the first, it closes the period; if it does not, the first row
              follows one sample after the last, unless that would be a jump
    error     nothing: the scenario's run must lie inside (not-a-knot spline, which reproduces a cubic)
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from springline.runner.errors import InputError, Problem, unknown

Floats = NDArray[np.float64]
Ends = Literal["hold", "periodic", "error"]

ENDS: tuple[Ends, ...] = ("hold", "periodic", "error")

UNITS = {
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0},
}
"""SI unit -> the units a column may have instead, and how much of the SI unit one of them is."""

_FEWEST_ROWS = 4
# Time stamps may be off the uniform grid by this much of a sample: rounding of what was printed, not jitter.
_UNIFORM = 1e-6
# A last row this near to the first (of the channel's range) repeats it.
_REPEATS = 1e-6
# The step from the last row back to the first may be this much longer than the longest step between rows.
_CLOSING_STEP = 1.5

_BOUNDARY = {"hold": "clamped", "periodic": "periodic", "error": "not-a-knot"}


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a CSV file: its name there, the scenario key that asks for it, and its unit in SI units."""

    name: str
    key: str
    factor: float = 1.0


@dataclass(frozen=True, eq=False, slots=True)
class Table:
    """Cubic splines through uniform samples, SI units.

    t0            time of the first sample, s
    dt            sample interval, s
    coefficients  (intervals, channels, 4): in interval k, c0 + c1 tau + c2 tau^2 + c3 tau^3 with tau = t - (t0 + k dt)
    ends          what lies outside the samples
    """

    t0: float
    dt: float
    coefficients: Floats
    ends: Ends

    @property
    def end(self) -> float:
        """Time of the last sample, s (of the period's end, where the table is periodic)."""
        return self.t0 + self.dt * len(self.coefficients)

    def covers(self, duration: float) -> bool:
        """Whether there is a value at every time from 0 to `duration`, s."""
        slack = _UNIFORM * self.dt
        return self.ends != "error" or (self.t0 <= slack and self.end >= duration - slack)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Table)
            and (self.t0, self.dt, self.ends) == (other.t0, other.dt, other.ends)
            and np.array_equal(self.coefficients, other.coefficients)
        )

    def __hash__(self) -> int:
        return hash((self.t0, self.dt, self.ends, self.coefficients.shape))


def spline(t0: float, dt: float, samples: Floats, ends: Ends) -> Table:
    """The Table through `samples` (rows, channels), at least four rows; a periodic one repeats its first row last."""
    # Here, because it takes longer to import than everything that a scenario without tables needs.
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - slow to load, and only tables need it

    times = dt * np.arange(samples.shape[0])
    fit = CubicSpline(times, samples, bc_type=_BOUNDARY[ends])
    return Table(t0, dt, np.ascontiguousarray(fit.c[::-1].transpose(1, 2, 0)), ends)


def read_table(
    data: bytes, file: str, time: Column, channels: Sequence[Column], ends: Ends, *, where: str, key: str
) -> Table:
    """Read a CSV file with a header row.

    data, file  the file's contents and its name for messages
    where, key  the scenario file and the table that refer to it, for messages
    Raises InputError for a missing column, a cell that is no finite number, times that are not uniform, too few rows,
    and a periodic signal that does not close.
    """
    columns = [time, *channels]
    lines, cells = _read_cells(data, file, columns, where, key)
    samples = _numbers(lines, cells, file, columns, where)
    if len(lines) < _FEWEST_ROWS:
        raise InputError(Problem(where, key, f"{file} needs at least {_FEWEST_ROWS} rows of samples", str(len(lines))))
    samples *= [column.factor for column in columns]
    t, values = samples[:, 0], samples[:, 1:]
    dt = _interval(t, lines, file, time, where)
    if ends == "periodic":
        values = _closed(values, file, channels, where)
    return spline(float(t[0]), dt, values, ends)


def _read_cells(
    data: bytes, file: str, columns: Sequence[Column], where: str, key: str
) -> tuple[list[int], list[list[str]]]:
    """Line number and the wanted cells of every row."""
    try:
        reader = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""), strict=True)
        header = [name.strip() for name in next(reader, [])]
        rows = [(reader.line_num, row) for row in reader if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(Problem(where, key, f"{file} is no CSV file in UTF-8 ({error})")) from error
    problems = []
    for column in columns:
        if column.name not in header:
            problems.append(unknown(where, column.key, f"column of {file}", column.name, header))
        elif header.count(column.name) > 1:
            problems.append(Problem(where, column.key, f"{file} has more than one column {column.name!r}"))
    ragged = next(((line, row) for line, row in rows if len(row) != len(header)), None)
    if ragged:
        line, row = ragged
        problems.append(Problem(where, key, f"{file}, line {line}: expected {len(header)} cells", str(len(row))))
    if problems:
        raise InputError(*problems)
    wanted = [header.index(column.name) for column in columns]
    return [line for line, _ in rows], [[row[i] for i in wanted] for _, row in rows]


def _numbers(lines: list[int], cells: list[list[str]], file: str, columns: Sequence[Column], where: str) -> Floats:
    """The cells as numbers, (rows, columns); one problem for each column that holds anything else."""
    try:
        numbers = np.array(cells, dtype=np.float64).reshape(len(cells), len(columns))
        if np.isfinite(numbers).all():
            return numbers
    except ValueError:
        pass  # the search below names the cell
    problems = []
    for i, column in enumerate(columns):
        bad = next(((line, row[i]) for line, row in zip(lines, cells, strict=True) if not _is_finite(row[i])), None)
        if bad:
            line, cell = bad
            text = f"{file}, line {line}, column {column.name!r}: expected a finite number"
            problems.append(Problem(where, column.key, text, repr(cell)))
    raise InputError(*problems)


def _is_finite(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _interval(t: Floats, lines: list[int], file: str, time: Column, where: str) -> float:
    """The sample interval, s; refused if the times are not uniform."""
    dt = float(t[-1] - t[0]) / (len(t) - 1)
    off = np.abs(t - (t[0] + dt * np.arange(len(t)))) / abs(dt) if dt else np.full(len(t), math.inf)
    if dt > 0 and off.max() <= _UNIFORM:
        return dt
    worst = int(off.argmax()) if dt > 0 else int(np.argmax(np.diff(t) <= 0)) + 1
    detail = f"off by {off[worst]:.1g} of a sample" if dt > 0 else "not later than the row before"
    text = (
        f"{file}, line {lines[worst]}, column {time.name!r}: expected increasing times at a uniform interval, each "
        f"within {_UNIFORM:g} of a sample; this one is {detail} (write times with more digits, or resample the record)"
    )
    raise InputError(Problem(where, time.key, text, f"{t[worst]:.10g} s"))


def _closed(values: Floats, file: str, channels: Sequence[Column], where: str) -> Floats:
    """Samples whose last row repeats the first, so that they make a whole period."""
    span = np.ptp(values, axis=0)
    gap = np.abs(values[-1] - values[0])
    if np.all(gap <= _REPEATS * span):
        return np.concatenate([values[:-1], values[:1]])
    longest = np.abs(np.diff(values, axis=0)).max(axis=0)
    jumps = [channel for channel, jump in zip(channels, gap > _CLOSING_STEP * longest, strict=True) if jump]
    if jumps:
        raise InputError(
            *(
                Problem(
                    where,
                    channel.key,
                    f"column {channel.name!r} of {file} jumps where it should repeat: cut the record where it returns "
                    "to its first value and direction, or use ends = 'hold'",
                )
                for channel in jumps
            )
        )
    return np.concatenate([values, values[:1]])
