"""Cubic splines through samples of signals, and what lies outside of them: coefficients as the loop takes them.

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

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from springline.codegen.program import SignalTable

Floats = NDArray[np.float64]
Ends = Literal["hold", "periodic", "error"]

ENDS: tuple[Ends, ...] = ("hold", "periodic", "error")

# The doubles of large times, such as Unix seconds, lie far apart: what they cannot tell, up to this much of a sample,
# is no jitter either.
_ROUNDED = 1e-3
# Samples rounded to multiples of r have, in the spline through them, accelerations of up to 6 r / dt^2 between them and
# three times that at its ends: what stays within this many r / dt^2 may be nothing but rounding.
_ROUNDING = 20.0
# Samples and coefficients that are no better than doubles: what they are rounded to, in spacings of the largest.
_DOUBLE = 8.0
# A record whose rate varies by more than this share of the largest is no ramp, however coarse its digits.
_RAMP = 0.25
# No way to rest takes more intervals, 8 MiB a channel: accelerations that need more are hardly any.
_LONGEST = 2**18

_BOUNDARY = {"hold": "not-a-knot", "periodic": "periodic", "error": "not-a-knot"}


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

    def values(self, t: Floats) -> Floats:
        """Values at times (times,) between the first and the last sample, s of the run: (times, channels)."""
        k = np.clip(np.floor((t - self.t0) / self.dt).astype(np.int64), 0, len(self.coefficients) - 1)
        tau = (t - (self.t0 + k * self.dt))[:, None]
        c0, c1, c2, c3 = np.moveaxis(self.coefficients[k], 2, 0)
        result: Floats = c0 + tau * (c1 + tau * (c2 + tau * c3))
        return result

    def row(self, t: float) -> Floats:
        """What the model's signals take of the table: s since a sample, and the coefficients from there on, flat.

        For a time outside of the samples, those of the nearest one.
        """
        inside = min(max(t, self.t0), self.end)
        k = min(max(math.floor((inside - self.t0) / self.dt), 0), len(self.coefficients) - 1)
        return np.concatenate([[inside - (self.t0 + k * self.dt)], self.coefficients[k].ravel()])

    def accelerations(self) -> Floats:
        """Accelerations at the samples, (samples, channels), SI units; between them they are linear."""
        return _motion(self.coefficients, self.dt)[1]

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
    # Powers of two bring every channel and the interval near 1 and change no bit of the result, which then overflows
    # where the coefficients do, and not on the way.
    size = np.frexp(np.abs(samples).max(axis=0))[1]
    unit, interval = math.frexp(dt)[::-1]
    times = interval * np.arange(samples.shape[0])
    fit = _cubic_spline(times, np.ldexp(samples, -size), ends)
    powers = size[:, None] - unit * np.arange(4)
    coefficients: Floats = np.empty((len(times) - 1, samples.shape[1], 4))
    with np.errstate(over="ignore"):
        np.ldexp(fit.c[::-1].transpose(1, 2, 0), powers, out=coefficients)
    del fit  # as large, and a long record's is half a gigabyte
    if ends == "periodic":
        t0 = 0.0 - -t0 % (dt * len(coefficients))  # what repeats needs no large times
    coarse: Floats = np.maximum(digit, _DOUBLE * np.spacing(np.abs(samples).max(axis=0)))
    return Spline(t0, dt, coefficients, ends, _bounds(coefficients, dt, coarse))


def resampled(t: Floats, samples: Floats, intervals: int, ends: Ends) -> Floats:
    """The cubic spline through `samples` (rows, channels) at times `t` (rows,), at as many equal `intervals`.

    It is of the same kind as that of `spline`. First and last time stay. Returns (intervals + 1, channels).
    """
    size = np.frexp(np.abs(samples).max(axis=0))[1]
    places = (t - t[0]) * (intervals / (t[-1] - t[0]))
    fit = _cubic_spline(places, np.ldexp(samples, -size), ends)
    result: Floats = np.ldexp(fit(np.arange(intervals + 1.0)), size)
    result[[0, -1]] = samples[[0, -1]]
    return result


def _cubic_spline(t: NDArray[np.floating[Any]], samples: Floats, ends: Ends) -> Any:
    # Here, because it takes longer to import than everything that a scenario without tables needs.
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - slow to load, and only tables need it

    return CubicSpline(t, samples, bc_type=_BOUNDARY[ends])


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
