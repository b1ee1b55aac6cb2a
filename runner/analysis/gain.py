"""Equivalent gains: what a sine of some amplitude sees of a function that has no useful slope at zero."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_NODES = 32


def quadrature() -> tuple[Floats, Floats]:
    """Where on a sine of amplitude 1 a function is looked at, and what its values are weighted with, (nodes,) each.

    The weighted sum of f(A s) is A times the describing function of f at amplitude A, (1 / (pi A)) times the integral
    of f(A sin th) sin th over a turn. Jumps and roots at zero cost no accuracy: the nodes, those of Gauss and Legendre
    in the cube root of th, are close there and on both sides.
    """
    tau, weights = np.polynomial.legendre.leggauss(_NODES)
    tau, weights = (tau + 1) / 2, weights / 2
    angle, step = np.pi / 2 * tau**3, weights * (np.pi / 2 * 3 * tau**2)
    sine = np.sin(angle)
    half = 2 / np.pi * step * sine
    return np.concatenate([sine, -sine]), np.concatenate([half, -half])


def equivalent_gain(f: Callable[[Floats], Floats], amplitude: float) -> Floats:
    """Describing function of f at an amplitude: output's fundamental over the sine that goes in, (...,).

    f  takes (nodes,) numbers and gives (..., nodes). Its even part, and what is not odd about it, does not count.
    """
    sines, weights = quadrature()
    found: Floats = np.asarray(f(amplitude * sines)) @ weights / amplitude
    return found
