"""The largest Floquet exponent of the continuous loop, where all that drives it has a common period."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from springline.runner.analysis.continuous import growth
from springline.runner.analysis.loop import AMPLITUDE, Boundary, linear_loop
from springline.runner.analysis.sampled import exponential
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]

_SIGNALS = ("reference", "base_motion", "disturbance")
_LARGEST_DENOMINATOR = 1000
_RATIONAL = 1e-9
# Relative: how near to a ratio of whole numbers two frequencies must be.
_CYCLES = 400
# Of the fastest term in the common period: beyond it, the answer would take longer than it is worth.
_SAMPLES, _FINEST = 24, 4
# Of the matrix, a cycle of the fastest term; and steps of the integration, a sample.
_PASSES = 3


def common_period(scenario: Scenario) -> tuple[float | None, float, str]:
    """Period of all that drives the loop, s; the highest frequency in it, rad/s; and a sentence.

    Without a period it is None, and the sentence says why. 0 where nothing moves.
    """
    for table in _SIGNALS:
        kind = scenario.document[table]["kind"]
        if kind not in ("sine", "none"):
            return None, 0.0, f"{table} is of kind {kind}, which has no period that is known"
    p = {slot.key: value for slot, value in zip(scenario.system().slots, scenario.values(), strict=True)}
    found = {
        value
        for key, value in p.items()
        if key.split(".")[0] in _SIGNALS
        and key.endswith(".omega")
        and p[f"{key.removesuffix('omega')}amplitude"] != 0.0
    }
    omegas = sorted(abs(value) for value in found if value != 0.0)
    if not omegas:
        return 0.0, 0.0, "nothing moves: the exponents are the eigenvalues' real parts"
    ratios = [Fraction(omega / omegas[0]).limit_denominator(_LARGEST_DENOMINATOR) for omega in omegas]
    for ratio, omega in zip(ratios, omegas, strict=True):
        if abs(float(ratio) * omegas[0] - omega) > _RATIONAL * omega:
            text = (
                f"{omegas[0]:.6g} and {omega:.6g} rad/s are in no ratio of whole numbers up to {_LARGEST_DENOMINATOR}"
            )
            return None, omegas[-1], f"the terms have no common period: {text}"
    # Of fractions, the greatest common divisor is that of the numerators over the denominators' least common multiple.
    divisor = math.gcd(*(r.numerator for r in ratios)) / math.lcm(*(r.denominator for r in ratios))
    period = 2 * math.pi / (omegas[0] * divisor)
    cycles = period * omegas[-1] / (2 * math.pi)
    if cycles > _CYCLES:
        return None, omegas[-1], f"the terms' common period, {period:.4g} s, has {cycles:.0f} cycles of the fastest"
    return period, omegas[-1], f"over the common period {period:.6g} s"


def floquet_exponent(scenario: Scenario, amplitude: ArrayLike = AMPLITUDE) -> Boundary:
    """Largest Floquet exponent, 1/s, of the continuous loop linearised along its reference: unstable above 0.

    By QR along the period, so that exponents far below zero do not underflow. None where there is no common period.
    """
    period, fastest, reason = common_period(scenario)
    if period is None:
        return Boundary(None, reason)
    if period == 0.0:
        return Boundary(float(growth(linear_loop(scenario, amplitude, times=[0.0]))[0]), reason)
    cycles = max(period * fastest / (2 * math.pi), 1.0)
    times = np.linspace(0.0, period, math.ceil(max(_SAMPLES * cycles, 64)), endpoint=False)
    matrices = linear_loop(scenario, amplitude, times=times).closed()[0]
    return Boundary(_exponent(_transitions(matrices, period), period), reason)


def _transitions(matrices: Floats, period: float) -> Floats:
    """exp of Magnus's series of fourth order for each step of a period, (steps, m, m).

    matrices  equally spaced over the period; between them the trigonometric polynomial through all
    """
    steps = _FINEST * len(matrices)
    step = period / steps
    spectrum = np.fft.rfft(matrices, axis=0)
    turns = 2j * np.pi * np.arange(len(spectrum))[:, None, None] / steps

    def at(share: float) -> Floats:
        found: Floats = np.fft.irfft(spectrum * np.exp(turns * share), steps, axis=0) * _FINEST
        return found

    early, late = (at(0.5 + sign * math.sqrt(3) / 6) for sign in (-1, 1))
    turned = late @ early - early @ late
    return exponential(step / 2 * (early + late) + math.sqrt(3) / 12 * step**2 * turned)


def _exponent(transitions: Floats, period: float) -> float:
    """Largest exponent of the product of transitions.

    Each pass over the period turns an orthonormal basis towards the fastest directions first. What the last pass makes
    of it is the period's map in that basis, scaled by the growth of the first direction, and has the same eigenvalues.
    """
    size = transitions.shape[-1]
    basis = np.eye(size)
    for _ in range(_PASSES):
        start, scale, upper = basis, 0.0, np.eye(size)
        for transition in transitions:
            basis, r = np.linalg.qr(transition @ basis)
            upper = r @ upper
            size_now = float(np.abs(upper).max())
            upper, scale = upper / size_now, scale + math.log(size_now)
    values = np.abs(np.linalg.eigvals(start.T @ basis @ upper))
    return float(scale + math.log(float(values.max()))) / period
