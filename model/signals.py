"""Signals of time: sums of sines, polynomials through via points, and tables interpolated by cubic splines (value, rate
and acceleration continuous).

A table is a list of uniform knots. Which knot interval holds t, and the interval's four coefficients, are data that
the caller supplies per step; the polynomial itself, and every derivative, is written here.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from springline.model import lazy_casadi as ca
from springline.model.symbolic import solve_spd


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


@functools.cache
def constant_zero() -> Signal:
    """What is zero all the time; it is one and the same, by which it is known."""
    return Signal(ca.SX(0), ca.SX(0), ca.SX(0))


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


def via_points(t: ca.SX, times: Sequence[ca.SX], values: Sequence[ca.SX]) -> Signal:
    """The quintic spline through points (times, values), times ascending: at rest at both ends, and held outside them.

    Of all motions from rest to rest through the points it is the one with the least integral of squared jerk (which
    makes snap and the derivative after it continuous at the points in between); it is found as that minimum.
    """
    inner = len(times) - 2
    if inner < 0:
        return Signal(values[0], ca.SX(0), ca.SX(0))
    free = ca.SX.sym("free", 2 * inner)  # rate and acceleration at each point in between
    rates = [ca.SX(0), *(free[2 * i] for i in range(inner)), ca.SX(0)]
    accelerations = [ca.SX(0), *(free[2 * i + 1] for i in range(inner)), ca.SX(0)]
    points = list(zip(values, rates, accelerations, strict=True))
    spans = [late - early for early, late in pairwise(times)]
    pieces = [_quintic(span, *pair) for span, pair in zip(spans, pairwise(points), strict=True)]
    if inner:
        jerk = sum((_squared_jerk(span, piece) for span, piece in zip(spans, pieces, strict=True)), ca.SX(0))
        curvature, slope = ca.hessian(jerk, free)
        chosen = solve_spd(curvature, -ca.substitute(slope, free, ca.SX.zeros(2 * inner)))
        pieces = [ca.vertsplit(ca.substitute(ca.vertcat(*piece), free, chosen)) for piece in pieces]
    pieces.append([values[-1]] + [ca.SX(0)] * 5)
    knot, coefficients = times[0], pieces[0]
    for time, piece in zip(times[1:], pieces[1:], strict=True):
        late = t >= time
        knot = ca.if_else(late, time, knot)
        coefficients = [ca.if_else(late, new, old) for new, old in zip(piece, coefficients, strict=True)]
    tau = ca.fmax(t, times[0]) - knot
    c0, c1, c2, c3, c4, c5 = coefficients
    return Signal(
        c0 + tau * (c1 + tau * (c2 + tau * (c3 + tau * (c4 + tau * c5)))),
        c1 + tau * (2 * c2 + tau * (3 * c3 + tau * (4 * c4 + tau * (5 * c5)))),
        2 * c2 + tau * (6 * c3 + tau * (12 * c4 + tau * (20 * c5))),
    )


_Point = tuple["ca.SX", "ca.SX", "ca.SX"]


def _quintic(span: ca.SX, start: _Point, end: _Point) -> list[ca.SX]:
    """Six coefficients, lowest first, of the quintic between two points (value, rate, acceleration), `span` s apart."""
    (q0, v0, a0), (q1, v1, a1) = start, end
    step, T = q1 - q0, span
    return [
        q0,
        v0,
        a0 / 2,
        (20 * step - (8 * v1 + 12 * v0) * T - (3 * a0 - a1) * T**2) / (2 * T**3),
        ((14 * v1 + 16 * v0) * T + (3 * a0 - 2 * a1) * T**2 - 30 * step) / (2 * T**4),
        (12 * step - 6 * (v1 + v0) * T - (a0 - a1) * T**2) / (2 * T**5),
    ]


def _squared_jerk(span: ca.SX, coefficients: Sequence[ca.SX]) -> ca.SX:
    """Integral over `span` s of the squared third derivative of a quintic."""
    a, b, c = 6 * coefficients[3], 24 * coefficients[4], 60 * coefficients[5]
    T = span
    return a**2 * T + a * b * T**2 + (b**2 + 2 * a * c) * T**3 / 3 + b * c * T**4 / 2 + c**2 * T**5 / 5


def stack(signals: Sequence[Signal]) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Columns of values, rates and accelerations."""
    return (
        ca.vertcat(*(s.value for s in signals)),
        ca.vertcat(*(s.rate for s in signals)),
        ca.vertcat(*(s.acceleration for s in signals)),
    )
