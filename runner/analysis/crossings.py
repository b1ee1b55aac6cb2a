"""Where a loop's frequency response says that it is at a boundary: largest delay, gain and phase margins."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from springline.runner.analysis.continuous import growth
from springline.runner.analysis.loop import Boundary, LinearLoop
from springline.runner.analysis.roots import root, roots
from springline.runner.analysis.sampled import (
    LONGEST_HISTORY,
    OpenLoop,
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
Places = NDArray[np.intp]

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
    delay               least delay of the channel alone, s, that brings it there, over all frequencies at which its
                        response has the size 1: not that of the least phase, where a faster one has less; inf without
    delay_frequency     likewise
    at                  time along the reference of the least phase, or of the gain where there is no phase, s
    """

    gain_up: Floats
    gain_down: Floats
    gain: Floats
    gain_frequency: Floats
    phase: Floats
    phase_frequency: Floats
    delay: Floats
    delay_frequency: Floats
    at: Floats


class _Response:
    """Frequency responses C (s - F)^-1 G of matrices at several operating points, (points, ...), in rad/s."""

    def __init__(self, f: Floats, g: Floats, c: Floats, period: float | None) -> None:
        self.f, self.g, self.c, self.period = f, g, c, period

    def __call__(self, omega: Floats, at: Places) -> Complex:
        """At frequencies of the points `at`: (frequencies, outputs, inputs)."""
        variable = 1j * omega if self.period is None else np.exp(1j * omega * self.period)
        matrix = variable[:, None, None] * np.eye(self.f.shape[-1]) - self.f[at]
        found: Complex = self.c[at] @ np.linalg.solve(matrix, self.g[at].astype(complex))
        return found

    def grid(self) -> tuple[Floats, Places]:
        """Frequencies above zero, up to where nothing happens any more, dense beside the poles, open and closed.

        They rise for one point after the other, and which point it is stands beside them.
        """
        opened, closed = np.linalg.eigvals(self.f), np.linalg.eigvals(self.f + self.g @ self.c)
        grids = [self._frequencies(np.concatenate(pair).astype(complex)) for pair in zip(opened, closed, strict=True)]
        return np.concatenate(grids), np.repeat(np.arange(len(grids)), [len(grid) for grid in grids])

    def _frequencies(self, poles: Complex) -> Floats:
        if self.period is not None:
            poles = np.asarray(np.log(np.where(np.abs(poles) > 0.0, poles, 1e-300)) / self.period, dtype=np.complex128)
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


def _roots(f: Callable[[Floats, Places], Floats], grid: Floats, at: Places, values: Floats) -> tuple[Floats, Places]:
    """Where f, of frequencies and points, changes its sign between neighbours of a grid, at which it has `values`."""
    changes = np.flatnonzero((np.signbit(values[1:]) != np.signbit(values[:-1])) & (at[1:] == at[:-1]))
    places = at[changes]
    return roots(lambda omega: f(omega, places), grid[changes], grid[changes + 1], 1e-12), places


def _least_delay(response: _Response) -> tuple[float, float, int]:
    """Smallest delay, s, alike in all channels, that brings a root to the axis, its frequency, and at which point.

    inf without. Of a sampled loop, whose delays are whole samples, it is one that there would be between two of them.
    """
    grid, at = response.grid()

    def sizes(omega: Floats, at: Places) -> Floats:
        found: Floats = np.sort(np.abs(np.linalg.eigvals(response(omega, at))), axis=-1)
        return found

    tables = sizes(grid, at) - 1.0
    best = (np.inf, np.nan, 0)
    for k in range(tables.shape[-1]):

        def excess(omega: Floats, at: Places, k: int = k) -> Floats:
            return sizes(omega, at)[:, k] - 1.0

        found, places = _roots(excess, grid, at, tables[:, k])
        if not found.size:
            continue
        values = np.asarray(np.linalg.eigvals(response(found, places)), dtype=np.complex128)
        turned = np.take_along_axis(values, np.argsort(np.abs(values), axis=-1), axis=-1)[:, k]
        delays = _lags(turned, found)
        least = int(delays.argmin())
        best = min(best, (float(delays[least]), float(found[least]), int(places[least])))
    return best


def _lags(turned: Complex, omega: Floats) -> Floats:
    """Delays, s, that turn back what is turned by a loop's response of size 1."""
    found: Floats = np.angle(turned) % (2 * np.pi) / omega
    return found


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
    delay, omega, place = _least_delay(_Response(opened.F[0], opened.G[0], opened.C[0], period))
    if not np.isfinite(delay):
        return Boundary(None, "every delay is stable")
    if period is None:
        return Boundary(delay, f"unstable above, at {omega:.4g} rad/s", float(loop.times[place]))
    return _between_samples(loop, period, delay)


def _between_samples(loop: LinearLoop, period: float, near: float) -> Boundary:
    """The largest delay of a sampled loop that is stable with the whole samples in `near`, and not with one more."""
    whole = math.floor(near / period)
    if whole > LONGEST_HISTORY:
        return Boundary(None, f"every delay up to {LONGEST_HISTORY} samples is stable")

    def excess(delay: float) -> float:
        return float(radii(loop, period, delay).max()) - 1.0

    low = whole * period
    for k in range(1, _PARTS + 1):
        high = (whole + k / _PARTS) * period
        if excess(high) >= 0.0:
            value = root(excess, np.array([low, high]), 1e-6)
            return Boundary(value, "unstable above", worst_time(loop, radii(loop, period, value)))
        low = high
    return Boundary(low, "unstable above", worst_time(loop, radii(loop, period, low)))


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
    others = [k for k in range(opened.G.shape[-1]) if k != joint]
    f, g, c = opened.F[0], opened.G[0], opened.C[0]
    rest = f + g[:, :, others] @ c[:, others]
    response = _Response(rest, g[:, :, [joint]], c[:, [joint]], opened.period)
    grid, at = response.grid()
    values = response(grid, at)[:, 0, 0]

    def imaginary(omega: Floats, at: Places) -> Floats:
        return np.asarray(response(omega, at)[:, 0, 0].imag, dtype=np.float64)

    def excess(omega: Floats, at: Places) -> Floats:
        return np.asarray(np.abs(response(omega, at)[:, 0, 0]) - 1.0, dtype=np.float64)

    up, down = (np.inf, np.nan, np.nan), (0.0, np.nan, np.nan)
    for factor, omega, place in _factors(response, *_roots(imaginary, grid, at, values.imag)):
        if factor >= 1.0:
            up = min(up, (factor, omega, float(times[place])))
        else:
            down = max(down, (factor, omega, float(times[place])))
    nearest = up if down[0] == 0.0 or up[0] < 1 / down[0] else down
    crossed, places = _roots(excess, grid, at, np.abs(values) - 1.0)
    if not crossed.size:
        return up[0], down[0], nearest[0], nearest[1], np.inf, np.nan, np.inf, np.nan, nearest[2]
    turned: Complex = response(crossed, places)[:, 0, 0]
    angles, delays = np.abs(np.angle(turned)), _lags(turned, crossed)
    k, late = int(angles.argmin()), int(delays.argmin())
    phase, delay = (float(angles[k]), float(crossed[k])), (float(delays[late]), float(crossed[late]))
    return up[0], down[0], nearest[0], nearest[1], *phase, *delay, float(times[places[k]])


def _factors(response: _Response, crossed: Floats, places: Places) -> list[tuple[float, float, int]]:
    """Gains that bring a loop of one channel to its boundary, with frequency and point: where its response is real."""
    found = list(zip(response(crossed, places)[:, 0, 0].real, crossed, places, strict=True))
    for omega in [0.0] if response.period is None else [0.0, np.pi / response.period]:
        for place in range(len(response.f)):
            try:
                real = response(np.array([omega]), np.array([place]))[0, 0, 0].real
            except np.linalg.LinAlgError:  # an integrator: the response has no bound there, and no gain a boundary
                continue
            found.append((real, omega, place))
    return [(float(1 / real), float(at), int(k)) for real, at, k in found if 1 / _FARTHEST < real < _FARTHEST]
