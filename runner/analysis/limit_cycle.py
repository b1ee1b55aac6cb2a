"""The limit cycle of a loop that is unstable in the small and stable in the large: its amplitude and frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from springline.runner.analysis.loop import LinearLoop, linearised, points_of
from springline.runner.analysis.roots import root
from springline.runner.analysis.sampled import cut, rates_of
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

_SIZES = np.geomspace(1e-6, 10.0, 29)
_LEAST_SHARE = 0.1
# Of the largest: what the amplitude of a joint that hardly takes part is taken to be.
_ROUNDS = 4


@dataclass(frozen=True, eq=False, slots=True)
class LimitCycle:
    """An oscillation that a loop is predicted to end in, by describing functions.

    amplitude  of sigma, (joints,), SI units; None where none is predicted
    frequency  rad/s;  at: time along the reference where the amplitude is largest, s
    reason     why there is none, or how it was found
    """

    amplitude: Floats | None
    frequency: float | None
    at: float | None
    reason: str


def _modes(loop: LinearLoop) -> tuple[Complex, Complex]:
    """Exponents, 1/s, of every mode of the loop as its scenario has it, (runs, times, modes), and the modes."""
    opened = cut(loop)
    values, vectors = (item.astype(complex) for item in np.linalg.eig(opened.closed))
    if opened.period is not None:
        values = np.log(np.where(np.abs(values) > 0.0, values, 1e-300)) / opened.period
    return values, vectors


def limit_cycle(scenario: Scenario, *, times: ArrayLike | None = None) -> LimitCycle:
    """The limit cycle that the loop as its scenario has it, continuous or sampled, is predicted to end in.

    It is where the loop, unstable for smaller amplitudes of sigma and stable for larger ones, is neither: the first
    such amplitude between 1e-6 and 10, all joints in the ratio of the critical mode, at the time along the reference
    where it is largest. Where the loop is stable in the small, only what starts above that reaches it, and the reason
    says so.
    """
    if not linearised(scenario).cut:
        return LimitCycle(None, None, None, "the controller has no sliding variable, and so no gain by amplitude")

    points = points_of(scenario, times=times)
    n = scenario.system().n
    shape = np.ones(n)
    spread = points.repeated(len(_SIZES)).loop(_SIZES[:, None] * shape)
    table = rates_of(spread)
    falls = (table[:-1] >= 0.0) & (table[1:] < 0.0)
    if not falls.any():
        grows = bool((table[-1] >= 0.0).any())
        text = "unstable at every amplitude up to 10: it grows without bound, or to a limit" if grows else ""
        return LimitCycle(None, None, None, text or "stable at every amplitude from 1e-6 to 10")
    first = np.where(falls.any(axis=0), falls.argmax(axis=0), -1)  # a loop that starts small gets no further
    last = int(first.max())
    place = int(np.where(first == last, table[last], -np.inf).argmax())
    points, at = points.at_time(place), float(points.times[place])
    low, high = _SIZES[last], _SIZES[last + 1]
    size, frequency = 0.0, 0.0
    for _ in range(_ROUNDS):

        def excess(log_size: float, shape: Floats = shape) -> float:
            return float(rates_of(points.loop(np.exp(log_size) * shape))[0, 0])

        ends = np.log([low, high])
        while excess(ends[0]) < 0.0 and ends[0] > np.log(_SIZES[0]):
            ends[0] -= 1.0
        while excess(ends[1]) >= 0.0 and ends[1] < np.log(_SIZES[-1]) + 5.0:
            ends[1] += 1.0
        size = float(np.exp(root(excess, ends, 1e-7)))
        low, high = 0.9 * size, 1.1 * size
        loop = points.loop(size * shape)
        exponents, vectors = _modes(loop)
        critical = int(exponents.real[0, 0].argmax())
        mode, frequency = vectors[0, 0][:, critical], abs(float(exponents[0, 0, critical].imag))
        plant, memory = loop.Sx.shape[-1], loop.z.shape[-1]
        lagged = loop.driven()[0].shape[-1]
        share = np.abs(loop.Sx[0, 0] @ mode[:plant] + loop.Sz[0, 0] @ mode[lagged : lagged + memory])
        shape = np.maximum(share / share.max(), _LEAST_SHARE)
    small = table[0].max() < 0.0
    where = ", stable in the small: what starts larger reaches it" if small else ""
    return LimitCycle(size * shape, frequency, at, f"describing functions of the critical mode{where}")
