"""Reaching laws as numbers: rate, time to reach, and equivalent gain of what is no gain at sigma = 0."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from springline.model.control import LAWS
from springline.runner.analysis.gain import equivalent_gain
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]
Rate = Callable[[Floats], Floats]

AMPLITUDES = (1e-4, 0.5)
"""Of sigma, SI: what every boundary states its range over."""

_SPEEDS = 2001  # of sigma, where a reaching time is integrated: an odd number, by Simpson's rule


@dataclass(frozen=True, slots=True)
class LawCurves:
    """One reaching law in numbers; limited as its joint limits it.

    sigma, rate  |d sigma/dt| that it asks for at some |sigma|
    amplitude, gain  equivalent gain, 1/s, at amplitudes of sigma
    start, reaching_time  from |sigma(0)| of each joint to 1 % of it, s
    """

    name: str
    title: str
    sigma: Floats
    rate: Floats
    amplitude: Floats
    gain: Floats
    start: Floats
    reaching_time: Floats


def reaching_law(scenario: Scenario, name: str = "") -> Rate:
    """d sigma / dt that a law asks for, without the limit a_max, as a function of an array of sigma.

    name  of a law, "" for the scenario's own; all have the scenario's gains
    Raises KeyError where the scenario's controller has no law.
    """
    system, values = scenario.system(), scenario.values()
    law = system.function(f"law_{name or scenario.structure().law}")

    def rate(sigma: Floats) -> Floats:
        asked: Floats = law(np.atleast_1d(sigma)[None, :], values).full()[0]
        return asked

    return rate


def limited(rate: Rate, limit: float) -> Rate:
    """The law as it acts: within +-limit."""
    return lambda sigma: np.clip(rate(sigma), -limit, limit)


def reaching_time(rate: Rate, start: float, to: float) -> float:
    """Time from |sigma| = start to |sigma| = to > 0 under the law alone, s: integral of d sigma / |rate|.

    inf where the law stands still on the way; 0 for start <= to.
    """
    if start <= to:
        return 0.0
    logarithm = np.linspace(np.log(to), np.log(start), _SPEEDS)
    sigma = np.exp(logarithm)
    speed = np.abs(rate(sigma))
    if not np.all(speed > 0.0):
        return float("inf")
    weights = np.full(_SPEEDS, 2.0)
    weights[1::2], weights[[0, -1]] = 4.0, 1.0
    return float(weights @ (sigma / speed) * (logarithm[1] - logarithm[0]) / 3)


def law_curves(scenario: Scenario, start: Floats) -> dict[str, LawCurves]:
    """Every packaged law and the scenario's own with the scenario's gains and limits, by name; {} without a law.

    start  |sigma(0)| of each joint, SI
    """
    system, structure = scenario.system(), scenario.structure()
    if system.controller.law is None:
        return {}
    limits = np.array([scenario.number_of(f"control.a_max.{i}") for i in range(system.n)])
    sigma = np.geomspace(1e-5, max(10.0, float(np.max(np.abs(start), initial=0.0))), 241)
    amplitude = np.geomspace(1e-6, 10.0, 141)
    curves = {}
    for name, law in {**LAWS, structure.law: system.controller.law}.items():
        rate = reaching_law(scenario, name)
        acting = limited(rate, float(limits.max()))
        times = [
            reaching_time(limited(rate, float(limit)), abs(float(s)), 0.01 * abs(float(s)))
            for s, limit in zip(start, limits, strict=True)
        ]
        curves[name] = LawCurves(
            name,
            law.title,
            sigma,
            np.abs(acting(sigma)),
            amplitude,
            np.array([-float(equivalent_gain(acting, size)) for size in amplitude]),
            np.abs(start),
            np.array(times),
        )
    return curves
