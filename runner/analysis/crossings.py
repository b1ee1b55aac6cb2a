"""Where a loop's frequency response says that it is at a boundary: largest delay, gain and phase margins."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from springline.runner.analysis.continuous import growth
from springline.runner.analysis.loop import Boundary, LinearLoop
from springline.runner.analysis.sampled import (
    LONGEST_HISTORY,
    OpenLoop,
    bisected,
    continuous,
    cut,
    one_run,
    period_of,
    radii,
    sampled,
    worst_time,
)

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

_PARTS = 8
# Of a sample: delays that are tried between two whole ones.
_EVENLY = 160
_AROUND = np.sinh(np.linspace(-4.0, 4.0, 16))
# Of a pole's distance from the axis: where the response is looked at beside its frequency, never at it.
_FARTHEST = 1e4
# A factor beyond it, or its inverse, is none: the loop is where it was without that channel.


@dataclass(frozen=True, slots=True)
class Margins:
    """How far each motor's channel is from a boundary, the loop cut there and the others closed; (joints,) each.

    gain_up, gain_down  the nearest factors above and below 1 at which the loop is at its boundary; inf and 0 without
    gain                of these the one nearest to 1, as a factor (2 and 0.5 are equally near)
    gain_frequency      at which it would oscillate then, rad/s; NaN without
    phase               least phase, rad, whose lag or lead would bring it there; inf without
    phase_frequency     likewise
    at                  time along the reference of the least phase, or of the gain where there is no phase, s
    """

    gain_up: Floats
    gain_down: Floats
    gain: Floats
    gain_frequency: Floats
    phase: Floats
    phase_frequency: Floats
    at: Floats


class _Response:
    """Frequency response C (s - F)^-1 G of matrices at one operating point, in rad/s."""

    def __init__(self, f: Floats, g: Floats, c: Floats, period: float | None) -> None:
        self.f, self.g, self.c, self.period = f, g, c, period

    def __call__(self, omega: Floats) -> Complex:
        """(frequencies, outputs, inputs)."""
        point = 1j * omega if self.period is None else np.exp(1j * omega * self.period)
        matrix = np.asarray(point)[..., None, None] * np.eye(len(self.f)) - self.f
        found: Complex = self.c @ np.linalg.solve(matrix, np.broadcast_to(self.g, (*matrix.shape[:-2], *self.g.shape)))
        return found

    def grid(self) -> Floats:
        """Frequencies above zero, up to where nothing happens any more, dense beside the poles, open and closed."""
        poles = np.concatenate([np.linalg.eigvals(self.f), np.linalg.eigvals(self.f + self.g @ self.c)]).astype(complex)
        if self.period is not None:
            poles = np.log(np.where(np.abs(poles) > 0.0, poles, 1e-300)) / self.period
            highest = np.pi / self.period
        else:
            highest = 1e3 * max(float(np.abs(poles).max()), 1.0)
        sizes = np.abs(poles[np.abs(poles) > 1e-9 * highest])
        lowest = 1e-3 * float(sizes.min()) if sizes.size else 1e-6 * highest
        upper = poles[poles.imag > 0.0]
        width = np.maximum(np.abs(upper.real), 1e-7 * np.abs(upper))
        near = (upper.imag[:, None] + width[:, None] * _AROUND).ravel()
        even = np.geomspace(min(lowest, 0.1 * highest), highest, _EVENLY)
        found = np.unique(np.concatenate([even, near]))
        inside: Floats = found[(found >= even[0]) & (found < highest * (1 - 1e-9))]
        return inside


def _roots(f: Callable[[float], float], grid: Floats, values: Floats) -> list[float]:
    """Where f changes its sign between neighbours of a grid, at which it has `values`."""
    changes = np.flatnonzero(np.signbit(values[1:]) != np.signbit(values[:-1]))
    return [float(brentq(f, grid[k], grid[k + 1], xtol=1e-12 * grid[k + 1], rtol=1e-12)) for k in changes]


def _least_delay(response: _Response) -> tuple[float, float]:
    """Smallest delay, s, alike in all channels, that brings a root to the axis, and its frequency; inf without.

    Of a sampled loop, whose delays are whole samples, it is one that there would be between two of them.
    """
    grid = response.grid()

    def sizes(omega: Floats) -> Floats:
        found: Floats = np.sort(np.abs(np.linalg.eigvals(response(omega))), axis=-1)
        return found

    tables = sizes(grid) - 1.0
    best = (np.inf, np.nan)
    for k in range(tables.shape[-1]):
        for omega in _roots(lambda w, k=k: float(sizes(np.array([w]))[0, k]) - 1.0, grid, tables[:, k]):  # type: ignore[misc]
            values = np.linalg.eigvals(response(np.array([omega]))[0])
            turned = values[np.argsort(np.abs(values))[k]]
            best = min(best, (float(np.angle(turned) % (2 * np.pi)) / omega, omega))
    return best


def delay_max(loop: LinearLoop) -> tuple[Boundary, ...]:
    """The largest delay, s, of all motors' commands alike, with which the loop is stable at all times; one a run.

    Of a sampled scenario at its period, the delay that it has included; of a continuous one, of the continuous loop:
    the smallest delay with a root of its characteristic equation on the imaginary axis.
    """
    return tuple(_delay_max(one_run(loop, run)) for run in range(len(loop.values)))


def _delay_max(loop: LinearLoop) -> Boundary:
    period = period_of(loop)
    unstable = growth(loop)[0] >= 0.0 if period is None else radii(loop, period, 0.0).max() >= 1.0
    if unstable:
        return Boundary(None, "the loop is unstable without any delay")
    opened = continuous(loop) if period is None else sampled(loop, period, 0.0)
    found = [
        _least_delay(_Response(opened.F[0, k], opened.G[0, k], opened.C[0, k], period)) for k in range(len(loop.times))
    ]
    delay, omega = min(found)
    if not np.isfinite(delay):
        return Boundary(None, "every delay is stable")
    if period is None:
        return Boundary(delay, f"unstable above, at {omega:.4g} rad/s", float(loop.times[found.index((delay, omega))]))
    return _between_samples(loop, period, delay)


def _between_samples(loop: LinearLoop, period: float, near: float) -> Boundary:
    """The largest delay of a sampled loop that is stable with the whole samples in `near`, and not with one more."""
    whole = math.floor(near / period)
    if whole > LONGEST_HISTORY:
        return Boundary(None, f"every delay up to {LONGEST_HISTORY} samples is stable")

    def stable(delay: float) -> bool:
        return bool(radii(loop, period, delay).max() < 1.0)

    low = whole * period
    for k in range(1, _PARTS + 1):
        high = (whole + k / _PARTS) * period
        if not stable(high):
            value = bisected(stable, low, high)
            return Boundary(value, "unstable above", worst_time(loop, radii(loop, period, value)))
        low = high
    return Boundary(low, "unstable above")


def margins(loop: LinearLoop) -> tuple[Margins, ...]:
    """Gain and phase margins of each motor's channel over the times, of the loop as its scenario has it; one a run.

    They are distances to a boundary: of a loop that is unstable, from the other side.
    """
    return tuple(_margins(cut(one_run(loop, run)), loop.times) for run in range(len(loop.values)))


def _margins(opened: OpenLoop, times: Floats) -> Margins:
    n = opened.G.shape[-1]
    found = [_channel(opened, times, joint) for joint in range(n)]
    columns = [np.array(column) for column in zip(*found, strict=True)]
    return Margins(*columns)


def _channel(opened: OpenLoop, times: Floats, joint: int) -> tuple[float, ...]:
    """The entries of Margins for one joint."""
    up, down = (np.inf, np.nan, np.nan), (0.0, np.nan, np.nan)
    phase = (np.inf, np.nan, np.nan)
    others = [k for k in range(opened.G.shape[-1]) if k != joint]
    for k, time in enumerate(times):
        f, g, c = opened.F[0, k], opened.G[0, k], opened.C[0, k]
        response = _Response(f + g[:, others] @ c[others], g[:, [joint]], c[[joint]], opened.period)
        gains, phases = _boundaries(response)
        for factor, omega in gains:
            if factor >= 1.0:
                up = min(up, (factor, omega, float(time)))
            else:
                down = max(down, (factor, omega, float(time)))
        for angle, omega in phases:
            phase = min(phase, (angle, omega, float(time)))
    nearest = up if down[0] == 0.0 or up[0] < 1 / down[0] else down
    at = phase[2] if np.isfinite(phase[0]) else nearest[2]
    return up[0], down[0], nearest[0], nearest[1], phase[0], phase[1], at


def _boundaries(response: _Response) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Factors, and phases (rad), with their frequencies, at which a loop of one channel is at its boundary."""

    def at(omega: float) -> complex:
        return complex(response(np.array([omega]))[0, 0, 0])

    grid = response.grid()
    values = response(grid)[:, 0, 0]
    gains = []
    for omega in _roots(lambda w: at(w).imag, grid, values.imag):
        here = at(omega).real
        gains.append((here, omega))
    for omega in [0.0] if response.period is None else [0.0, np.pi / response.period]:
        try:
            gains.append((at(omega).real, omega))
        except np.linalg.LinAlgError:  # an integrator: the response has no bound there, and no gain a boundary
            continue
    phases = [
        (abs(float(np.angle(at(omega)))), omega)
        for omega in _roots(lambda w: abs(at(w)) - 1.0, grid, np.abs(values) - 1.0)
    ]
    return [(1 / here, omega) for here, omega in gains if 1 / _FARTHEST < here < _FARTHEST], phases
