"""The loop with a command that is held: exact zero-order hold, delay, lags, and the control's states once a sample."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from springline.runner.analysis.continuous import growth, spectrum
from springline.runner.analysis.loop import Boundary, LinearLoop, joined, linearised
from springline.runner.analysis.roots import root

Floats = NDArray[np.float64]

_GROWTH = 2 ** (1 / 12)
# Of the period, from one that is tried to the next.
LONGEST_HISTORY = 64
"""Samples of delay: beyond it, the loop would have more states than it is worth."""
_WHOLE = 1e-9


@dataclass(frozen=True, eq=False, slots=True)
class OpenLoop:
    """A loop cut between command and motors, (runs, times, ...): X' = F X + G v, u = C X, closed by v = u.

    period  s, of X' = X at the next sample; None where X' is the rate of X
    """

    F: Floats
    G: Floats
    C: Floats
    period: float | None

    @property
    def closed(self) -> Floats:
        """The closed loop's matrix."""
        result: Floats = self.F + self.G @ self.C
        return result


def continuous(loop: LinearLoop) -> OpenLoop:
    """The continuous loop, cut."""
    a, b, cx, dx = loop.driven()
    memory = loop.Dz.shape[-1]
    f = joined(a, np.zeros((*a.shape[:3], memory)), dx, loop.Dz)
    g = np.concatenate([b, np.zeros((*b.shape[:2], memory, b.shape[-1]))], axis=-2)
    return OpenLoop(f, g, np.concatenate([cx, loop.Cz], axis=-1), None)


def sampled(loop: LinearLoop, period: float, delay: float) -> OpenLoop:
    """The sampled loop, cut: states of the plant and its lags, z, and the commands that wait, the latest first.

    period  s;  delay: s, any that is not negative
    """
    a, b, _, _ = loop.driven()
    cx, cz, by_state, by_memory = loop.held(period)
    n, plant, memory = loop.n, a.shape[-1], by_memory.shape[-1]
    whole = math.floor(delay / period + _WHOLE)
    part = max(delay - whole * period, 0.0)
    part = 0.0 if part < _WHOLE * period else part
    history = n * (whole + (part > 0.0))
    size = plant + memory + history
    f = np.zeros((*a.shape[:2], size, size))
    g = np.zeros((*a.shape[:2], size, n))
    over, late = _held(a, b, period - part)
    if part > 0.0:
        before, early = _held(a, b, part)
        at = plant + memory + n * whole
        f[..., :plant, at : at + n] = over @ early
        over = over @ before
    f[..., :plant, :plant] = over
    if whole:
        at = plant + memory + n * (whole - 1)
        f[..., :plant, at : at + n] += late
    else:
        g[..., :plant, :] = late
    if memory:
        f[..., plant : plant + memory, : by_state.shape[-1]] = by_state
        f[..., plant : plant + memory, plant : plant + memory] = by_memory
    if history:
        first = plant + memory
        g[..., first : first + n, :] = np.eye(n)
        f[..., range(first + n, size), range(first, size - n)] = 1.0
    lags, waiting = (np.zeros((*cx.shape[:3], size)) for size in (plant - cx.shape[-1], history))
    c = np.concatenate([cx, lags, cz, waiting], axis=-1)
    return OpenLoop(f, g, c, period)


def _held(a: Floats, b: Floats, duration: float) -> tuple[Floats, Floats]:
    """exp(a t), and the integral of exp(a s) b from 0 to t."""
    size, n = a.shape[-1], b.shape[-1]
    block = np.zeros((*a.shape[:2], size + n, size + n))
    block[..., :size, :size], block[..., :size, size:] = a * duration, b * duration
    whole = exponential(block)
    return whole[..., :size, :size], whole[..., :size, size:]


_TAYLOR = [1 / math.factorial(k) for k in range(16)]


def exponential(matrices: Floats) -> Floats:
    """exp of each of a stack of matrices: SciPy's, one after the other, takes ten times as long for small ones.

    A Taylor polynomial of degree 15 where the norm is 1/2 at most, squared up from there.
    """
    norm = float(np.abs(matrices).sum(axis=-2).max(initial=0.0))
    halvings = max(math.ceil(math.log2(norm)) + 1, 0) if norm > 0.0 else 0
    small = matrices * 0.5**halvings
    one = np.eye(matrices.shape[-1])
    powers = [one, small, small @ small]
    powers.append(powers[2] @ small)
    fourth = powers[2] @ powers[2]
    result: Floats = np.zeros_like(matrices)
    for k in (12, 8, 4, 0):
        group = sum((_TAYLOR[k + i] * powers[i] for i in range(1, 4)), start=_TAYLOR[k] * one)
        result = result @ fourth + group
    for _ in range(halvings):
        result = result @ result
    return result


def period_of(loop: LinearLoop) -> float | None:
    """Sample period of the loop's scenario, s; None where its control is continuous."""
    return loop.scenario.step * loop.scenario.control_every or None


def delay_of(loop: LinearLoop) -> float:
    """Delay of the loop's scenario, s."""
    return float(loop.scenario.step * linearised(loop.scenario).system.structure.delay)


def cut(loop: LinearLoop) -> OpenLoop:
    """The loop as its scenario has it, sampled and with its delay, or continuous; cut between command and motors."""
    period = period_of(loop)
    return continuous(loop) if period is None else sampled(loop, period, delay_of(loop))


def radii(loop: LinearLoop, period: float, delay: float) -> Floats:
    """Spectral radius of the sampled loop, (runs, times): unstable above 1."""
    found: Floats = np.abs(np.linalg.eigvals(sampled(loop, period, delay).closed)).max(axis=-1)
    return found


def radius(loop: LinearLoop, period: float | None = None, delay: float | None = None) -> Floats:
    """Largest spectral radius of the sampled loop over the times, (runs,): unstable above 1.

    period, delay  s; the scenario's where they are not given. Raises ValueError where it is continuous and there is no
    period.
    """
    period = period_of(loop) if period is None else period
    if period is None:
        raise ValueError("the scenario's control is continuous: expected a period")
    largest: Floats = radii(loop, period, delay_of(loop) if delay is None else delay).max(axis=-1)
    return largest


def rates_of(loop: LinearLoop) -> Floats:
    """Largest growth rate, 1/s, of the loop as its scenario has it, (runs, times): unstable above 0."""
    opened = cut(loop)
    values = np.linalg.eigvals(opened.closed)
    if opened.period is None:
        return np.asarray(values.real.max(axis=-1), dtype=np.float64)
    return np.asarray(np.log(np.maximum(np.abs(values).max(axis=-1), 1e-300)) / opened.period, dtype=np.float64)


def one_run(loop: LinearLoop, run: int) -> LinearLoop:
    """One of the runs of a loop."""
    names = ("values", "x", "u", "z", "A", "B", "Cx", "Cz", "Dx", "Dz", "Sx", "Sz", "N", "law_gain", "lag")
    changes = {name: getattr(loop, name)[run : run + 1] for name in names}
    amplitude = loop.amplitude[run] if loop.amplitude.ndim > 1 else loop.amplitude
    return LinearLoop(scenario=loop.scenario, amplitude=amplitude, times=loop.times, **changes)


def period_max(loop: LinearLoop) -> tuple[Boundary, ...]:
    """The largest sample period, s, that is stable at all times with all shorter ones that are tried; one a run.

    The scenario's delay stays as it is. Of a scenario whose period is unstable: the largest stable one below it.
    """
    return tuple(_period_max(one_run(loop, run)) for run in range(len(loop.values)))


def _period_max(loop: LinearLoop) -> Boundary:
    delay, given = delay_of(loop), period_of(loop)
    fastest = float(np.abs(spectrum(loop)).max())
    if given is None and growth(loop)[0] >= 0.0:
        return Boundary(None, "the continuous loop is unstable")
    period = given or 0.1 / fastest
    least, most = max(1e-3 / fastest, delay / LONGEST_HISTORY), 1e3 * max(period, 1 / fastest)

    def excess(at: float) -> float:
        return float(radii(loop, at, delay).max()) - 1.0

    if excess(period) < 0.0:
        while excess(period * _GROWTH) < 0.0:
            period *= _GROWTH
            if period > most:
                return Boundary(None, f"every period up to {most:.3g} s is stable")
    else:
        while period > least and excess(period / _GROWTH) >= 0.0:
            period /= _GROWTH
        if period <= least:
            return Boundary(None, f"no period down to {least:.3g} s is stable")
        period /= _GROWTH
    value = root(excess, np.array([period, period * _GROWTH]), 1e-6)
    return Boundary(value, "unstable above", worst_time(loop, radii(loop, value, delay)))


def worst_time(loop: LinearLoop, of: Floats) -> float:
    """Time at which what is computed of a loop's first run, (runs, times), is largest, s."""
    return float(loop.times[int(of[0].argmax())])
