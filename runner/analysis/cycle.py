"""Limit cycles: where the law's equivalent gain, which depends on sigma's amplitude, makes the loop turn stable."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from springline.runner.analysis.loop import LinearLoop, linear_loop
from springline.runner.analysis.sampled import cut
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]

_LEAST, _MOST = 1e-6, 10.0
_PER_DECADE = 4
_CLOSE = 1e-3


@dataclass(frozen=True, slots=True)
class Cycle:
    """A limit cycle that is predicted: smaller oscillations grow, larger ones die out.

    amplitude  of sigma, SI;  frequency: rad/s
    joint      whose rate swings the most;  at: time along the reference of the point, s
    """

    amplitude: float
    frequency: float
    joint: int
    at: float


def critical(loop: LinearLoop) -> tuple[float, float, int, int]:
    """How fast the least stable mode of the loop grows (1/s), its frequency (rad/s), joint, and index of the time.

    Of the first run, as it runs: continuous or sampled with the scenario's period and delay.
    """
    opened = cut(loop)
    values, vectors = np.linalg.eig(opened.closed[0])
    if opened.period is None:
        rates, frequencies = values.real, np.abs(values.imag)
    else:
        rates = np.log(np.maximum(np.abs(values), 1e-300)) / opened.period
        frequencies = np.abs(np.angle(values)) / opened.period
    time, mode = np.unravel_index(int(np.argmax(rates)), rates.shape)
    n = loop.n
    joint = int(np.argmax(np.abs(vectors[time, n : 2 * n, mode])))
    return float(rates[time, mode]), float(frequencies[time, mode]), joint, int(time)


def limit_cycle(scenario: Scenario, amplitude: float) -> Cycle | None:
    """The smallest limit cycle below or about an amplitude of sigma that a scenario's loop is predicted to have.

    amplitude  the scenario's own, where the search for the least stable point begins
    Between 1e-6 and 10; None where small oscillations die out, or large ones grow too.
    """
    _, _, _, time = critical(linear_loop(scenario, amplitude))
    at = linear_loop(scenario, amplitude).times[time]

    def rate(size: float) -> float:
        return critical(linear_loop(scenario, size, times=[at]))[0]

    sizes = np.geomspace(_LEAST, _MOST, round(np.log10(_MOST / _LEAST) * _PER_DECADE) + 1)
    rates = np.array([rate(size) for size in sizes])
    turns = np.flatnonzero((rates[:-1] > 0) & (rates[1:] <= 0))
    if not turns.size:
        return None
    low, high = sizes[turns[0]], sizes[turns[0] + 1]
    while high / low > 1 + _CLOSE:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if rate(middle) > 0 else (low, middle)
    size = float(np.sqrt(low * high))
    _, frequency, joint, _ = critical(linear_loop(scenario, size, times=[at]))
    return Cycle(size, frequency, joint, float(at))
