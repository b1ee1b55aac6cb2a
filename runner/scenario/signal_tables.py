"""Signal tables: a record of a CSV file as the spline that a run reads, and what is to be said of it.

The loop wants samples at equal steps. What the rows' times are decides how it gets them:

    uniform   as far as doubles tell: the rows are the samples
    rounded   30 or 60 Hz written in ms, say: every time is that of a uniform grid up to its last digit. The rows are
              the samples here, too. Through the times as written, their rounding would be in the motion: at 30 Hz, a
              swell of 1 m and 10 s would have accelerations of up to 2 m/s^2, where it has 0.4. Rows may have been
              lost: the cubic spline through the others, each at its place on the grid, is sampled there
    any other the times are believed, and the cubic spline through the rows is sampled at the median interval

The spline passes through every sample, with its noise, and its second derivative takes noise up with the square of the
sample rate. What the rows themselves show of accelerations are their second differences. Where a sine has n samples a
period, the spline has 3 / (2 + cos(2 pi / n)) times these at the samples: 1.006 for 32, 1.11 for 8, 3 for the fastest
that there is. A spline that exceeds them markedly is made of motion that its samples hardly resolve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from springline.runner.files import InputError, Problem
from springline.runner.scenario.signal_csv import Column, read_samples
from springline.runner.scenario.splines import Ends, Spline, resampled, spline

Floats = NDArray[np.float64]

MAX_GAP = 3.0
"""How many median intervals two rows may be apart, unless the scenario says."""

_FEWEST_ROWS = 4
# Time stamps may be off the uniform grid by this much of a sample: rounding of what was printed, not jitter.
_UNIFORM = 1e-6
# The doubles of large times, such as Unix seconds, lie far apart: what they cannot tell, up to this much of a sample,
# is no jitter either.
_ROUNDED = 1e-3
# Times rounded to no more than this much of a sample, in at least so many rows, are told from a table whose
# steps do differ: by chance none keeps to a grid for that long.
_COARSEST = 1 / 3
_ENOUGH_ROWS = 20
# A rounded median interval miscounts the rows that a long gap has lost; the mean that follows from it does no more.
_PASSES = 3
# A last row this near to the first (of the channel's range) repeats it.
_REPEATS = 1e-6
# The step from the last row back to the first may be this much longer than the longest step between rows.
_CLOSING_STEP = 1.5
# Squares and products of what is larger (and of its inverse) leave the doubles.
_LARGEST = 1e150
_LARGEST_INTERVAL = 1e50
# Gaps may make more samples than there are rows, up to this many (256 MiB of coefficients for six channels).
_MOST_SAMPLES = 2**20
# Accelerations of the spline that are this many times those of the rows come from noise, corners or too few samples.
_EXCESS = 1.25
# Rows that are no better than doubles have second differences of this many of their spacings from rounding alone.
_ROUNDING = 64.0


@dataclass(frozen=True, slots=True)
class TableRead:
    """A signal table as it was read.

    spline  what the run gets
    shown   (channels,): the largest accelerations that the rows themselves show, by second differences, SI units
    notes   what was made of the record, a sentence each
    """

    spline: Spline
    shown: Floats
    notes: list[str]


def read_table(
    data: bytes,
    file: str,
    time: Column,
    channels: Sequence[Column],
    ends: Ends,
    *,
    t0: float = 0.0,
    max_gap: float | None = None,
    where: str,
    key: str,
) -> TableRead:
    """Read a signal table from a CSV file with a header row.

    data, file  the file's contents and its name for messages
    t0          the record's time at run time 0, s
    max_gap     the longest time between two rows, s; None for MAX_GAP median intervals
    where, key  the scenario file and the path in it that refers to the file, for messages
    Raises InputError for what `read_samples` refuses, times that do not increase or have gaps, too few rows, numbers so
    large that the spline leaves the doubles, and a periodic signal that does not close.
    """
    columns = [time, *channels]
    samples = read_samples(data, file, columns, where, key)
    lines, notes = samples.lines, samples.notes
    if len(lines) < _FEWEST_ROWS:
        raise InputError(Problem(where, key, f"{file} needs at least {_FEWEST_ROWS} rows of samples", str(len(lines))))
    t, values = samples.numbers[:, 0], samples.numbers[:, 1:]
    place = f"{file}, line {{}}, column {time.name!r}"
    _expect_increasing(t, lines, place, time, where)
    _expect_moderate_interval(t, file, time, where)
    _expect_no_gap(t, samples.digits[0], lines, place, max_gap, where, f"{key.rpartition('.')[0]}.max_gap")
    _expect_moderate(values, file, channels, where)
    if ends == "periodic":
        values = _closed(values, file, channels, where)
    places = np.arange(len(t), dtype=np.float64)
    dt, off = _grid(t, places)
    jittering = False
    about = f"{time.key}: the times in column {time.name!r} of {file}"
    if off <= _UNIFORM + min(2 * float(np.spacing(np.abs(t).max())) / dt, _ROUNDED):
        rows = t[0] + dt * np.arange(len(values))
        taken = values
    elif _rounded(t, places, samples.digits[0]):
        rows = t[0] + dt * np.arange(len(values))
        taken = values
        notes.append(f"{about} are rounded to {samples.digits[0]:.3g} s: read as uniform, one every {dt:.9g} s")
    elif _rounded(t, places := _places(t), samples.digits[0]) and places[-1] < max(_MOST_SAMPLES, len(t)):
        dt, _ = _grid(t, places)
        lost = int(places[-1]) + 1 - len(t)
        if len(values) > len(t):
            places = np.append(places, places[-1] + 1)
        rows = t[0] + dt * places
        taken = resampled(places, values, int(places[-1]), ends)
        _expect_moderate(taken, file, channels, where)
        notes.append(
            f"{about} are rounded to {samples.digits[0]:.3g} s: read as uniform, one every {dt:.9g} s, "
            f"{lost} of them missing, where the cubic spline through the rows is taken"
        )
    else:
        median = float(np.median(np.diff(t)))
        rows = np.append(t, t[-1] + median) if len(values) > len(t) else t
        count = max(round(float(rows[-1] - rows[0]) / median), _FEWEST_ROWS - 1)
        if count > max(_MOST_SAMPLES, len(rows)):
            text = f"{file} would take {count} samples at its median interval of {median:.6g} s: cut it at its gaps"
            raise InputError(Problem(where, key, text))
        dt = float(rows[-1] - rows[0]) / count
        taken = resampled(rows, values, count, ends)
        _expect_moderate(taken, file, channels, where)
        jittering = True
    table = spline(float(t[0]) - t0, dt, taken, ends, np.array(samples.digits[1:]))
    least, most = table.coefficients.min(axis=2), table.coefficients.max(axis=2)
    _expect_moderate(np.maximum(most, -least), file, channels, where)
    if jittering:
        steps = np.diff(t)
        missed = _missed(table, rows - rows[0] + table.t0, values)
        notes.append(
            f"{about} are {steps.min():.6g} to {steps.max():.6g} s apart: the cubic spline through the rows is sampled "
            f"every {dt:.6g} s, which passes them by no more than {missed:.1g} of a column's range"
        )
    return TableRead(table, _second_differences(rows, values, periodic=ends == "periodic"), notes)


def excess_notes(read: TableRead, channels: Sequence[Column], units: Sequence[str], file: str, t0: float) -> list[str]:
    """A warning for each channel whose spline has accelerations well beyond what the rows show.

    Both are compared at the rows that have neighbours, since the ends have no second differences.
    units  of the accelerations;  t0  the record's time at run time 0, s
    """
    accelerations = np.abs(read.spline.accelerations())
    first = 0 if read.spline.ends == "periodic" else 1
    inner = accelerations[first : len(accelerations) - first]
    largest = np.abs(read.spline.coefficients[:, :, 0]).max(axis=0)
    noise = _ROUNDING * np.spacing(largest) / read.spline.dt**2
    notes = []
    for i, (column, unit) in enumerate(zip(channels, units, strict=True)):
        k = int(inner[:, i].argmax())
        found, shown = float(inner[k, i]), float(max(read.shown[i], noise[i]))
        if found > _EXCESS * shown:
            at = read.spline.t0 + t0 + (first + k) * read.spline.dt
            notes.append(
                f"{column.key}: the spline through column {column.name!r} of {file} has accelerations of up to "
                f"{found:.3g} {unit} (at {at:.6g} s), {found / shown:.2g} times the {shown:.3g} {unit} of its rows' "
                "second differences: noise, coarse digits or corners reach the motion (smooth the record, or give it "
                "more digits or rows)"
            )
    return notes


def _grid(t: Floats, places: Floats) -> tuple[float, float]:
    """The interval, s, of a uniform grid from the first to the last time, and how far it is off, in intervals.

    places  whole multiples of the interval at which the times stand on it
    """
    dt = float(t[-1] - t[0]) / float(places[-1])
    return dt, float((np.abs(t - (t[0] + dt * places)) / dt).max())


def _rounded(t: Floats, places: Floats, digit: float) -> bool:
    """Whether times are those of a uniform grid, rounded to no more than `digit`, s."""
    dt, off = _grid(t, places)
    return len(t) >= _ENOUGH_ROWS and off * dt <= digit * (1 + _UNIFORM) <= _COARSEST * dt


def _places(t: Floats) -> Floats:
    """Where times stand on the grid that most of their steps are one interval of, from 0, whole numbers."""
    steps = np.diff(t)
    dt = float(np.median(steps))
    for _ in range(_PASSES):
        places = np.append(0.0, np.cumsum(np.maximum(np.rint(steps / dt), 1.0)))
        dt = float(t[-1] - t[0]) / float(places[-1])
    return places


def _expect_increasing(t: Floats, lines: list[int], place: str, time: Column, where: str) -> None:
    with np.errstate(over="ignore", invalid="ignore"):
        steps = np.diff(t)
    if (steps > 0).all():
        return
    k = int(np.argmax(steps <= 0))
    early, late, before = f"{t[k]:.15g} s", f"{t[k + 1]:.15g} s", lines[k]
    if t[k] == t[k + 1]:
        text = f"repeats the time of line {before}, {early}: take one of them out, or write times with more digits"
    else:
        text = f"expected increasing times, later than that of line {before}, {early}: sort the rows, or cut the record"
    raise InputError(Problem(where, time.key, f"{place.format(lines[k + 1])}: {text}", late))


def _expect_moderate_interval(t: Floats, file: str, time: Column, where: str) -> None:
    with np.errstate(over="ignore"):
        dt = float(t[-1] - t[0]) / (len(t) - 1)
    if not 1 / _LARGEST_INTERVAL <= dt <= _LARGEST_INTERVAL:
        text = f"column {time.name!r} of {file}: expected samples less than {_LARGEST_INTERVAL:g} s and more than "
        raise InputError(Problem(where, time.key, f"{text}{1 / _LARGEST_INTERVAL:g} s apart", f"{dt:g} s"))


def _expect_no_gap(
    t: Floats, digit: float, lines: list[int], place: str, max_gap: float | None, where: str, key: str
) -> None:
    """Raise InputError for the first two rows that are too far apart. digit: what the times' last one is worth, s."""
    steps = np.diff(t)
    median = float(np.median(steps))
    if digit <= _COARSEST * median:  # 30 Hz in ms: steps of 33 or 34, and of 100 where two rows are lost
        median += digit
    most = MAX_GAP * median if max_gap is None else max_gap
    # What a digit more or less makes of the limit itself is no gap.
    over = np.flatnonzero(steps > most * (1 + _UNIFORM) + 2 * np.spacing(np.abs(t).max()))
    if not over.size:
        return
    k = int(over[0])
    limit = f"{most:.6g} s apart" + (f" ({MAX_GAP:g} times the median interval)" if max_gap is None else "")
    more = f" (and {over.size - 1} more)" if over.size > 1 else ""
    text = (
        f"{place.format(lines[k + 1])}: a gap from {t[k]:.15g} s (line {lines[k]}) to {t[k + 1]:.15g} s{more}: "
        f"expected rows at most {limit} (max_gap = {steps.max():.8g} bridges them all by the spline)"
    )
    raise InputError(Problem(where, key, text, f"{steps[k]:.6g} s"))


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


def _missed(table: Spline, t: Floats, values: Floats) -> float:
    """How far a table passes the rows by, (rows, channels) at times `t`: the most, of a channel's range."""
    ranges = np.ptp(values, axis=0)
    off = np.abs(table.values(t) - values).max(axis=0)
    return float(np.divide(off, ranges, out=np.zeros_like(off), where=ranges > 0).max())


def _second_differences(t: Floats, values: Floats, *, periodic: bool) -> Floats:
    """The largest |second divided difference| of three rows that follow each other, twice, (channels,)."""
    if periodic:
        t, values = np.append(t, t[-1] + t[1] - t[0]), np.concatenate([values, values[1:2]])
    steps = np.diff(t)[:, None]
    slopes = np.diff(values, axis=0) / steps
    result: Floats = np.abs(2 * np.diff(slopes, axis=0) / (steps[:-1] + steps[1:])).max(axis=0)
    return result
