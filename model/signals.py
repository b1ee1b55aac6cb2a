"""Signals of time: sums of sines, and tables interpolated by cubic splines (value, rate and acceleration continuous).

A table is a list of uniform knots. Which knot interval holds t, and the interval's four coefficients, are data that
the caller supplies per step; the polynomial itself, and every derivative, is written here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True, slots=True)
class SineTerm:
    """amplitude sin(omega t + phase); omega in rad/s, phase in rad."""

    amplitude: float
    omega: float
    phase: float = 0.0


@dataclass(frozen=True, slots=True)
class Signal:
    """A scalar signal and its first two time derivatives."""

    value: ca.SX
    rate: ca.SX
    acceleration: ca.SX


CONSTANT_ZERO = Signal(ca.SX(0), ca.SX(0), ca.SX(0))


def sine_sum(t: ca.SX, offset: ca.SX, terms: Sequence[tuple[ca.SX, ca.SX, ca.SX]]) -> Signal:
    """offset + sum of amplitude sin(omega t + phase) over `terms` of (amplitude, omega, phase)."""
    value, rate, acceleration = offset, ca.SX(0), ca.SX(0)
    for amplitude, omega, phase in terms:
        angle = omega * t + phase
        swing = amplitude * ca.sin(angle)
        value = value + swing
        rate = rate + amplitude * omega * ca.cos(angle)
        acceleration = acceleration - omega**2 * swing
    return Signal(value, rate, acceleration)


def cubic(tau: ca.SX, coefficients: ca.SX) -> Signal:
    """c0 + c1 tau + c2 tau^2 + c3 tau^3, with tau (s) counted from the knot; coefficients 4 x 1."""
    c0, c1, c2, c3 = ca.vertsplit(coefficients)
    return Signal(
        c0 + tau * (c1 + tau * (c2 + tau * c3)),
        c1 + tau * (2 * c2 + tau * (3 * c3)),
        2 * c2 + tau * (6 * c3),
    )


def stack(signals: Sequence[Signal]) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Columns of values, rates and accelerations."""
    return (
        ca.vertcat(*(s.value for s in signals)),
        ca.vertcat(*(s.rate for s in signals)),
        ca.vertcat(*(s.acceleration for s in signals)),
    )
