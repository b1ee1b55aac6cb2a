"""Signals from CSV files: uniform samples in, cubic spline coefficients out.

Between the samples runs a cubic spline: value, rate and acceleration are continuous. It is the not-a-knot spline, which
reproduces a cubic, whatever lies outside the samples; that is what `ends` says:

    hold      the first and the last value stand still. A record that does not begin or end at rest is brought to rest
              there, before its first and after its last sample, with accelerations no larger than its own: see `_rest`
              and, for ramps, which have none, `_bounds`
    periodic  the samples repeat, and so the spline is the periodic one. If the last row repeats the first, it closes
              the period; if it does not, the first row follows one sample after the last, unless that would be a jump
    error     nothing: the scenario's run must lie inside
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from springline.codegen.program import SignalTable
from springline.runner.files import InputError, Problem, unknown

Floats = NDArray[np.float64]
Ends = Literal["hold", "periodic", "error"]

ENDS: tuple[Ends, ...] = ("hold", "periodic", "error")

UNITS = {
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0},
}
"""SI unit -> the units a column may have instead, and how much of the SI unit one of them is."""

HALF_TURN = {"rad": math.pi, "mrad": 1e3 * math.pi, "deg": 180.0}
"""Unit of an angle -> half a turn in it."""

_FEWEST_ROWS = 4
# A number as instruments and spreadsheets write it. What Python reads besides (1_000, digits of other scripts) is more
# likely a damaged cell than a number.
_NUMBER = re.compile(r"\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*", re.ASCII)
# Time stamps may be off the uniform grid by this much of a sample: rounding of what was printed, not jitter.
_UNIFORM = 1e-6
# The doubles of large times, such as Unix seconds, lie far apart: what they cannot tell, up to this much of a sample,
# is no jitter either.
_ROUNDED = 1e-3
# A last row this near to the first (of the channel's range) repeats it.
_REPEATS = 1e-6
# The step from the last row back to the first may be this much longer than the longest step between rows.
_CLOSING_STEP = 1.5
# Samples rounded to multiples of r have, in the spline through them, accelerations of up to 6 r / dt^2 between them and
# three times that at its ends: what stays within this many r / dt^2 may be nothing but rounding.
_ROUNDING = 20.0
# Samples and coefficients that are no better than doubles: what they are rounded to, in spacings of the largest.
_DOUBLE = 8.0
# A record whose rate varies by more than this share of the largest is no ramp, however coarse its digits.
_RAMP = 0.25
# No way to rest takes more intervals, 8 MiB a channel: accelerations that need more are hardly any.
_LONGEST = 2**18
# Squares and products of what is larger (and of its inverse) leave the doubles.
_LARGEST = 1e150
_LARGEST_INTERVAL = 1e50
# How many lines a note names.
_MOST_LINES = 5

_BOUNDARY = {"hold": "not-a-knot", "periodic": "periodic", "error": "not-a-knot"}


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a CSV file.

    name, key  its name there, and the scenario key that asks for it
    factor     what its numbers are multiplied with to be in SI units, negative where they have the other sign
    half_turn  half a turn in its unit if it is an angle, else inf
    """

    name: str
    key: str
    factor: float = 1.0
    half_turn: float = math.inf


@dataclass(frozen=True, eq=False, slots=True)
class Spline:
    """Cubic splines through uniform samples, SI units.

    t0            time of the first sample, s of the run
    dt            sample interval, s
    coefficients  (intervals, channels, 4): in interval k, c0 + c1 tau + c2 tau^2 + c3 tau^3 with tau = t - (t0 + k dt)
    ends          what lies outside the samples
    bounds        (channels,): the largest accelerations that there may be outside the samples, SI units

    Two are equal if they are the same signal, wherever their samples came from.
    """

    t0: float
    dt: float
    coefficients: Floats
    ends: Ends
    bounds: Floats

    @property
    def end(self) -> float:
        """Time of the last sample, s (of the period's end, where the table is periodic)."""
        return self.t0 + self.dt * len(self.coefficients)

    def covers(self, duration: float) -> bool:
        """Whether there is a value at every time from 0 to `duration`, s."""
        slack = _ROUNDED * self.dt
        return self.ends != "error" or (self.t0 <= slack and self.end >= duration - slack)

    def touches(self, duration: float) -> bool:
        """Whether the samples, or their repeats, have something to say about the times from 0 to `duration`, s."""
        return self.ends == "periodic" or (self.t0 < duration and self.end > 0.0)

    def astray(self, duration: float) -> Floats:
        """The value farthest from its samples that each channel takes on its way to or from rest, (channels,).

        Of the times from 0 to `duration`, s; NaN for a channel that leaves its range by less than half of it.
        """
        before, after = (intervals[:, :, 0] for intervals in self.rests())
        early = min(max(math.ceil(self.t0 / self.dt), 0), len(before))
        late = max(math.floor((duration - self.end) / self.dt) + 1, 0)
        values = np.concatenate([before[len(before) - early :], after[:late]])
        own = self.coefficients[:, :, 0]
        middle, range_ = (own.max(axis=0) + own.min(axis=0)) / 2, np.ptp(own, axis=0)
        if not len(values):
            return np.full(len(middle), math.nan)
        far = np.abs(values - middle).argmax(axis=0)
        found = values[far, np.arange(len(middle))]
        return np.where(np.abs(found - middle) > range_, found, math.nan)

    def rests(self) -> tuple[Floats, Floats]:
        """Intervals that bring the motion to rest before the first and after the last sample, as coefficients.

        In the outermost interval all stands still; the record's last sample, or first, is where they begin.
        """
        before, after = (_rest(self.coefficients, self.dt, self.bounds, last=last) for last in (False, True))
        return before, after

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, Spline)
            and (self.t0, self.dt, self.ends) == (other.t0, other.dt, other.ends)
            and np.array_equal(self.coefficients, other.coefficients)
            and np.array_equal(self.bounds, other.bounds)
        )

    def __hash__(self) -> int:
        return hash((self.t0, self.dt, self.ends, self.coefficients.shape))


def spline(t0: float, dt: float, samples: Floats, ends: Ends, digit: Floats | float = 0.0) -> Spline:
    """The Spline through `samples` (rows, channels), at least four rows; a periodic one repeats its first row last.

    digit  what the last digit of each channel's samples is worth, (channels,) or one for all: see `_bounds`

    Coefficients beyond the doubles are infinite or NaN.
    """
    # Here, because it takes longer to import than everything that a scenario without tables needs.
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - slow to load, and only tables need it

    # Powers of two bring every channel and the interval near 1 and change no bit of the result, which then overflows
    # where the coefficients do, and not on the way.
    size = np.frexp(np.abs(samples).max(axis=0))[1]
    unit, interval = math.frexp(dt)[::-1]
    times = interval * np.arange(samples.shape[0])
    fit = CubicSpline(times, np.ldexp(samples, -size), bc_type=_BOUNDARY[ends])
    powers = size[:, None] - unit * np.arange(4)
    with np.errstate(over="ignore"):
        coefficients = np.ldexp(fit.c[::-1].transpose(1, 2, 0), powers)
    if ends == "periodic":
        t0 = 0.0 - -t0 % (dt * len(coefficients))  # what repeats needs no large times
    coarse: Floats = np.maximum(digit, _DOUBLE * np.spacing(np.abs(samples).max(axis=0)))
    return Spline(t0, dt, np.ascontiguousarray(coefficients), ends, _bounds(coefficients, dt, coarse))


def kernel_tables(tables: Sequence[Spline]) -> list[SignalTable]:
    """Signal tables as the loop takes them, which stays on the first and the last interval outside of them.

    Held ends become intervals that bring each channel to rest, and one in which all stand still.
    """
    result = []
    for table in tables:
        coefficients, t0 = table.coefficients, table.t0
        if table.ends == "hold":
            before, after = table.rests()
            coefficients = np.concatenate([before, coefficients, after])
            t0 -= table.dt * len(before)
        result.append(SignalTable(t0, table.dt, table.ends == "periodic", coefficients))
    return result


def _motion(coefficients: Floats, dt: float) -> tuple[Floats, Floats]:
    """Rates and accelerations at the samples, (samples, channels) each."""
    _, c1, c2, c3 = np.moveaxis(coefficients, 2, 0)
    with np.errstate(over="ignore", invalid="ignore"):  # of coefficients that are refused later
        rates = np.vstack([c1, c1[-1] + dt * (2 * c2[-1] + dt * 3 * c3[-1])])
        return rates, np.vstack([2 * c2, 2 * c2[-1] + dt * 6 * c3[-1]])


def _bounds(coefficients: Floats, dt: float, digit: Floats) -> Floats:
    """The largest accelerations that each channel (channels,) may have on its way to rest: its own.

    A ramp has none: what bends it, if anything, is the rounding of its samples to multiples of `digit`. It stops as at
    a corner of its samples, with at most its rate over the sample interval.
    """
    rates, accelerations = _motion(coefficients, dt)
    with np.errstate(over="ignore", invalid="ignore"):
        fastest, own = np.abs(rates).max(axis=0), np.abs(accelerations).max(axis=0)
        ramp = (own <= _ROUNDING * digit / dt**2) & (np.ptp(rates, axis=0) < _RAMP * fastest)
        result: Floats = np.where(ramp, np.maximum(own, fastest / dt), own)
    return result


def _rest(coefficients: Floats, dt: float, bounds: Floats, *, last: bool) -> Floats:
    """Intervals that follow the last sample (or precede the first) and bring every channel to rest at its value there.

    Each channel takes as many as keep its accelerations within its bound, (channels,).
    Returns (intervals, channels, 4); all channels stand still in the outermost interval.
    """
    rates, accelerations = _motion(coefficients, dt)
    first, final = coefficients[0, :, 0], coefficients[-1]
    # Before the first sample the same motion runs backwards: its rates change their sign, its accelerations do not.
    at, sign = (-1, 1.0) if last else (0, -1.0)
    ways = [
        _stopping(sign * dt * rate, dt**2 * acceleration, dt**2 * bound) / dt**2
        for rate, acceleration, bound in zip(rates[at], accelerations[at], bounds, strict=True)
    ]
    result = np.zeros((max(map(len, ways)), len(ways), 4))
    c0, c1, c2, c3 = final.T
    result[:, :, 0] = c0 + dt * (c1 + dt * (c2 + dt * c3)) if last else first
    for channel, knots in enumerate(ways):
        moving = len(knots) - 1
        if last:
            result[:moving, channel] += _intervals(knots, rates[-1, channel], dt)
        else:
            result[len(result) - moving :, channel] += _intervals(knots[::-1], 0.0, dt)
    return result


def _stopping(rate: float, acceleration: float, bound: float) -> Floats:
    """Accelerations at the knots of a motion that ends at rest where it began, linear in between and within `bound`.

    Time is counted in intervals. Of all such motions in as many intervals, this is the one whose accelerations change
    least (in the sum of squares): they are a cubic of the knot's number, the sampled twin of the quintic of least jerk.
    Returns (intervals + 1,), the first being `acceleration` and the last 0.
    """
    if rate == 0.0 and acceleration == 0.0:
        return np.zeros(1)
    count = 3
    while True:
        s = np.arange(count + 1) / count
        basis = np.stack([1 - s, s * (1 - s), s * (1 - s) * (1 - 2 * s)])
        # What each of them does to the rate and to the value at the end, where an interval has `left` others after it.
        left = np.arange(count - 1, -1, -1)
        gained = (basis[:, :-1] + basis[:, 1:]).sum(axis=1) / 2
        moved = (basis[:, :-1] * (3 * left + 2) + basis[:, 1:] * (3 * left + 1)).sum(axis=1) / 6
        swing = (-rate - acceleration * gained[0]) / gained[1]  # the third, odd about the middle, gains no rate
        sway = (-rate * count - acceleration * moved[0] - swing * moved[1]) / moved[2]
        knots: Floats = acceleration * basis[0] + swing * basis[1] + sway * basis[2]
        if np.abs(knots).max() <= bound or count > _LONGEST:
            return knots
        count = max(count + 1, count * 9 // 8)


def _intervals(knots: Floats, rate: float, dt: float) -> Floats:
    """Cubics (intervals, 4) of a motion from 0 at `rate`, whose accelerations are linear between `knots`."""
    rates = rate + np.concatenate([[0.0], np.cumsum((knots[:-1] + knots[1:]) / 2 * dt)])
    values = np.concatenate([[0.0], np.cumsum(rates[:-1] * dt + (2 * knots[:-1] + knots[1:]) / 6 * dt**2)])
    return np.stack([values[:-1], rates[:-1], knots[:-1] / 2, np.diff(knots) / (6 * dt)], axis=1)


def read_table(
    data: bytes,
    file: str,
    time: Column,
    channels: Sequence[Column],
    ends: Ends,
    *,
    t0: float = 0.0,
    where: str,
    key: str,
) -> tuple[Spline, list[str]]:
    """Read a CSV file with a header row: its Spline, and notes on what was made of it.

    data, file  the file's contents and its name for messages
    t0          the record's time at run time 0, s
    where, key  the scenario file and the table that refer to it, for messages
    Raises InputError for a missing column, a cell that is no finite number, times that are not uniform, too few rows,
    numbers so large that the spline leaves the doubles, and a periodic signal that does not close.
    """
    columns = [time, *channels]
    lines, cells = _read_cells(data, file, columns, where, key)
    samples = _numbers(lines, cells, file, columns, where)
    if len(lines) < _FEWEST_ROWS:
        raise InputError(Problem(where, key, f"{file} needs at least {_FEWEST_ROWS} rows of samples", str(len(lines))))
    notes = [note for i, column in enumerate(columns) if (note := _unwrap(samples[:, i], lines, file, column))]
    with np.errstate(over="ignore"):
        samples *= [column.factor for column in columns]
    t, values = samples[:, 0], samples[:, 1:]
    dt = _interval(t, lines, file, time, where)
    _expect_moderate(values, file, channels, where)
    if ends == "periodic":
        values = _closed(values, file, channels, where)
    digit = [_digit(row[i] for row in cells) * abs(column.factor) for i, column in enumerate(columns)]
    table = spline(float(t[0]) - t0, dt, values, ends, np.array(digit[1:]))
    _expect_moderate(np.abs(table.coefficients).max(axis=2), file, channels, where)
    return table, notes


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
    problems = []
    for i, column in enumerate(columns):
        bad = next(((line, row[i]) for line, row in zip(lines, cells, strict=True) if not _is_finite(row[i])), None)
        if bad:
            line, cell = bad
            text = f"{file}, line {line}, column {column.name!r}: expected a finite number such as -1.5e-3"
            problems.append(Problem(where, column.key, text, repr(cell)))
    if problems:
        raise InputError(*problems)
    return np.array(cells, dtype=np.float64).reshape(len(cells), len(columns))


def _digit(cells: Iterable[str]) -> float:
    """What the last digit of a column's numbers is worth, at most 1."""
    least = 0.0
    for match in map(_NUMBER.fullmatch, cells):
        assert match  # they were found to be numbers
        mantissa, exponent = match.groups()
        least = min(least, float((exponent or "e0")[1:]) - len(mantissa.partition(".")[2]))
    return float(10.0**least)


def _is_finite(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None and math.isfinite(float(cell))


def _unwrap(samples: Floats, lines: list[int], file: str, column: Column) -> str:
    """Takes whole turns out of the steps of an angle that pass half a turn, in place; a note on it, or ""."""
    if math.isinf(column.half_turn):
        return ""
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that are refused later
        turns = np.round(np.diff(samples) / (2 * column.half_turn))
        wraps = np.flatnonzero(turns)
        if not wraps.size:
            return ""
        samples[1:] -= np.cumsum(turns) * (2 * column.half_turn)
    named = ", ".join(str(lines[k + 1]) for k in wraps[:_MOST_LINES])
    at = f"line {named}" if wraps.size == 1 else f"lines {named}"
    more = f" and {wraps.size - _MOST_LINES} more" if wraps.size > _MOST_LINES else ""
    return (
        f"{column.key}: column {column.name!r} of {file} steps by more than half a turn at {at}{more}: read as an "
        "angle that wraps, and unwrapped (one that does turn that fast needs more samples)"
    )


def _expect_moderate(values: Floats, file: str, channels: Sequence[Column], where: str) -> None:
    """Raise InputError for channels whose values or coefficients, (rows, channels), are too large to compute with."""
    text = f"overflows: expected values and their rates of change up to {_LARGEST:g} in SI units (is its unit right?)"
    problems = [
        Problem(where, column.key, f"column {column.name!r} of {file} {text}")
        for column, channel in zip(channels, values.T, strict=True)
        if not (np.abs(channel) <= _LARGEST).all()
    ]
    if problems:
        raise InputError(*problems)


def _interval(t: Floats, lines: list[int], file: str, time: Column, where: str) -> float:
    """The sample interval, s; refused if the times are not uniform."""
    with np.errstate(over="ignore", invalid="ignore"):
        dt = float(t[-1] - t[0]) / (len(t) - 1)
        off = np.abs(t - (t[0] + dt * np.arange(len(t)))) / abs(dt) if dt else np.full(len(t), math.inf)
    if math.isinf(dt) or not (dt <= 0 or 1 / _LARGEST_INTERVAL <= dt <= _LARGEST_INTERVAL):
        text = f"column {time.name!r} of {file}: expected samples less than {_LARGEST_INTERVAL:g} s and more than "
        raise InputError(Problem(where, time.key, f"{text}{1 / _LARGEST_INTERVAL:g} s apart", f"{dt:g} s"))
    rounded = 2 * float(np.spacing(np.abs(t).max()))
    allowed = _UNIFORM + min(rounded / dt, _ROUNDED) if dt > 0 else 0.0
    if dt > 0 and off.max() <= allowed:
        return dt
    worst = int(off.argmax()) if dt > 0 else int(np.argmax(np.diff(t) <= 0)) + 1
    detail = f"off by {off[worst]:.1g} of a sample" if dt > 0 else "not later than the row before"
    text = (
        f"{file}, line {lines[worst]}, column {time.name!r}: expected increasing times at a uniform interval, each "
        f"within {allowed or _UNIFORM:.1g} of a sample; this one is {detail} (write times with more digits, or "
        "resample the record)"
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
