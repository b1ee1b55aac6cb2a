"""What the paper proves about the closed loop, as numbers, and where the proof does not reach (docs/paper.md, E9).

Plain NumPy on numbers of one run; nothing here is symbolic. Vectors have one entry per joint.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from springline.model.control import SurfaceExponents

Vector = NDArray[np.float64]


class Gap(Enum):
    """Why a run may miss the bounds although the theorems hold; the value says it in a sentence."""

    NO_MARGIN = "k1 does not exceed the bound on |H^-1 S|, so no c1 > 0 exists and the reaching time has no bound"
    DISTURBANCE = (
        "the proof takes |sigma|^zeta >= 1, true only for |sigma| >= 1: with S != 0, sigma ends in the set where the "
        "law is no larger than |H^-1 S|, not at 0"
    )
    BOUNDARY_LAYER = "delta > 0 makes the surface linear near e = 0: the error's tail is exponential, not finite-time"
    CLIPPED = "a_max clips the reaching law, which then is slower than the one that the reaching time belongs to"
    OTHER_LAW = "the reaching time is proved for the variable power log law only"


@dataclass(frozen=True, slots=True)
class Margin:
    """The condition k1 - S0 >= c1 > 0 with S0 measured along a run.

    per_joint  largest |H^-1 S| of each joint, m/s^2 or rad/s^2
    bound      S0, the largest norm of the vector H^-1 S over the run
    c1         k1 - bound; the proof needs it positive
    """

    per_joint: Vector
    bound: float
    c1: float

    @property
    def holds(self) -> bool:
        """Whether k1 - S0 > 0."""
        return self.c1 > 0.0


@dataclass(frozen=True, slots=True)
class SettlingBounds:
    """Upper bounds on the settling time, s.

    sliding   t_smax per joint: from the surface to e = 0
    reaching  t_q: from sigma(0) to the surface, one number for all joints; inf without a margin
    """

    sliding: Vector
    reaching: float

    @property
    def total(self) -> Vector:
        """t_a = t_smax + t_q per joint                                                          (32)."""
        return self.sliding + self.reaching


def sliding_time_bound(mu: ArrayLike, lambda_: ArrayLike, exponents: SurfaceExponents) -> Vector:
    """t_smax = (1/mu) m/(l - m) + (1/lambda) r/(r - p), s (Theorem 1, delta = 0).

    mu, lambda_: surface gains, positive, one number or one per joint. Raises ValueError where l <= m or r <= p.
    """
    x = exponents
    if x.l <= x.m or x.r <= x.p:
        raise ValueError(f"the surface needs l > m and r > p, not l = {x.l}, m = {x.m}, p = {x.p}, r = {x.r}")
    far, near = np.asarray(mu, dtype=float), np.asarray(lambda_, dtype=float)
    return np.atleast_1d(x.m / (x.l - x.m) / far + x.r / (x.r - x.p) / near)


def reaching_time_bound(sigma0: ArrayLike, c1: float, zeta: float) -> float:
    """t_q = 2 V^((1 - zeta)/2) / (c1 2^((zeta + 1)/2) (1 - zeta)) with V = |sigma0|^2 / 2, s; inf for c1 <= 0.

    sigma0: sliding variables at the start, one per joint. zeta in (0, 1).
    """
    if c1 <= 0.0:
        return float("inf")
    lyapunov = float(np.sum(np.square(sigma0))) / 2
    return float(2 * lyapunov ** ((1 - zeta) / 2) / (c1 * 2 ** ((zeta + 1) / 2) * (1 - zeta)))


def tail_rate(lambda_: float, delta: float, exponents: SurfaceExponents) -> float:
    """Rate lambda delta^(p/r - 1), 1/s, at which e decays on the surface once |e| << delta; inf for delta = 0 (E9)."""
    if delta == 0.0:
        return float("inf")
    return float(lambda_ * delta ** (exponents.p / exponents.r - 1))


def felt_acceleration(slow_mass: ArrayLike, disturbance: ArrayLike) -> Vector:
    """H^-1 S along a run, n x samples: what the base's motion does to the joints' accelerations in (16).

    slow_mass    H at each sample, samples x n x n
    disturbance  S at each sample, n x samples
    """
    rhs = np.asarray(disturbance, dtype=float).T[:, :, None]
    felt: Vector = np.linalg.solve(np.asarray(slow_mass, dtype=float), rhs)[:, :, 0].T
    return felt


def margin(felt: ArrayLike, k1: float) -> Margin:
    """Margin of the reaching condition over one run.

    felt  H^-1 S per joint and sample, n x samples (`felt_acceleration`); its sign does not matter
    k1    gain of the reaching law's first term
    Raises ValueError where `felt` has another shape or holds no finite number.
    """
    values = np.abs(np.asarray(felt, dtype=float))
    if values.ndim != 2 or values.size == 0:
        raise ValueError(f"H^-1 S must be joints x samples, not of shape {values.shape}")
    if not np.all(np.isfinite(values)):
        raise ValueError("H^-1 S is not finite: leave out the samples after the run diverged")
    bound = float(np.max(np.linalg.norm(values, axis=0)))
    return Margin(np.max(values, axis=1), bound, k1 - bound)


def settling_bounds(
    sigma0: ArrayLike,
    c1: float,
    zeta: float,
    mu: ArrayLike,
    lambda_: ArrayLike,
    exponents: SurfaceExponents,
) -> SettlingBounds:
    """Both phases for one run: arguments as in `sliding_time_bound` and `reaching_time_bound`."""
    return SettlingBounds(sliding_time_bound(mu, lambda_, exponents), reaching_time_bound(sigma0, c1, zeta))


def residual_set(law: Callable[[float], float], bound: float) -> float:
    """Largest |sigma| with |law(sigma)| <= bound: where sigma may stay under a disturbance of that size (E9).

    law    d sigma/dt of one joint with the sign and limits it runs with; |law| must not fall with |sigma|
    bound  largest |H^-1 S| of that joint, its unit is the law's
    Returns 0 for bound = 0 and inf where the law never exceeds the bound (a_max <= bound, say).
    """
    if bound <= 0.0:
        return 0.0

    def inside(sigma: float) -> bool:
        return abs(law(sigma)) <= bound

    high = 1.0
    while inside(high):
        high *= 2.0
        if high > 1e9:
            return float("inf")
    low = high
    while not inside(low):
        low /= 2.0
        if low < 1e-60:
            return 0.0
    for _ in range(60):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if inside(middle) else (low, middle)
    return low


def gaps(margin_: Margin, delta: float, clipped: bool, law: str) -> tuple[Gap, ...]:
    """Where the proof does not reach one run, in the order of `Gap`; empty: the bounds apply as they stand.

    margin_  measured along the run
    delta    boundary layer of the surface, m or rad
    clipped  whether a_max limited the law at any sample
    law      name of the reaching law
    """
    found = {
        Gap.NO_MARGIN: not margin_.holds,
        Gap.DISTURBANCE: margin_.bound > 0.0,
        Gap.BOUNDARY_LAYER: delta > 0.0,
        Gap.CLIPPED: clipped,
        Gap.OTHER_LAW: law != "variable_power_log",
    }
    return tuple(gap for gap, applies in found.items() if applies)
