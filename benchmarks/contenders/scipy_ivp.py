"""SciPy's solve_ivp with a right-hand side in plain Python: what most would write first."""

from __future__ import annotations

from functools import partial
from math import copysign, cos, exp, log, log1p, pi, sin, sqrt
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from springline.benchmarks import problem

RTOL, ATOL = 1e-6, 1e-9


def wished_acceleration(e: float, de: float, mu: float, delta: float) -> float:
    """u_e of (25) for one joint."""
    e2 = e * e
    h = e2 + delta * delta
    root: float = h ** (-1.0 / 3.0)
    sigma = de + e * (mu * e2 + problem.LAMBDA * root)
    size = max(abs(sigma), 1e-200)
    exponent = problem.ZETA * max(size, 1.0) * log(size)
    logarithm = log1p(problem.EPSILON_LOG * size * size)
    rate = problem.K1 * exp(min(exponent, 700.0)) + sqrt(logarithm) * (problem.K2 * logarithm + problem.K3)
    slope = 3.0 * mu * e2 + problem.LAMBDA * root**4 * (e2 / 3.0 + delta * delta)
    return -copysign(min(rate, problem.A_MAX), sigma) - de * slope


def rhs(t: float, x: Any, delta: float) -> list[float]:
    """dx/dt of the closed loop."""
    y, theta, dy, dtheta, y_motor, theta_motor, dy_motor, dtheta_motor = x
    w1, w2 = pi, 0.5 * pi
    a_lift = -w1 * w1 * sin(w1 * t) - wished_acceleration(
        sin(w1 * t) - y, w1 * cos(w1 * t) - dy, problem.MU_LIFT, delta
    )
    a_rotation = -w2 * w2 * sin(w2 * t) - wished_acceleration(
        1.0 + sin(w2 * t) - theta, w2 * cos(w2 * t) - dtheta, problem.MU_ROTATION, delta
    )
    sine, cosine = sin(theta), cos(theta)
    mass, coupling, inertia = (
        problem.M2 + problem.M3,
        problem.M3 * problem.L3 * cosine,
        problem.M3 * problem.L3**2 + problem.J,
    )
    centrifugal = problem.M3 * problem.L3 * sine * dtheta * dtheta
    u_lift = (
        (mass + problem.MOTOR_LIFT) * a_lift
        + coupling * a_rotation
        - centrifugal
        + mass * problem.G
        + problem.KF_LIFT * (dy - dy_motor)
    )
    u_rotation = (
        coupling * (a_lift + problem.G)
        + (inertia + problem.MOTOR_ROTATION) * a_rotation
        + problem.KF_ROTATION * (dtheta - dtheta_motor)
    )
    felt = problem.G - problem.SHAKE_AMPLITUDE * problem.SHAKE_OMEGA**2 * sin(problem.SHAKE_OMEGA * t)
    z_lift, z_rotation = problem.K_LIFT * (y_motor - y), problem.K_ROTATION * (theta_motor - theta)
    f_lift, f_rotation = z_lift + centrifugal - mass * felt, z_rotation - coupling * felt
    determinant = mass * inertia - coupling * coupling
    return [
        dy,
        dtheta,
        (inertia * f_lift - coupling * f_rotation) / determinant,
        (mass * f_rotation - coupling * f_lift) / determinant,
        dy_motor,
        dtheta_motor,
        (u_lift - z_lift) / problem.MOTOR_LIFT,
        (u_rotation - z_rotation) / problem.MOTOR_ROTATION,
    ]


def build(method: str) -> problem.Runner:
    """A Runner with one of solve_ivp's methods."""

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        span = (0.0, steps * problem.STEP)
        return np.array(
            [
                solve_ivp(rhs, span, problem.INITIAL_STATE, method, t_eval=span[1:], args=(d,), rtol=RTOL, atol=ATOL).y[
                    :, 0
                ]
                for d in delta.tolist()
            ]
        )

    return run


CONTENDERS = tuple(
    problem.Contender(
        f"scipy solve_ivp {method}",
        "continuous",
        "continuous",
        partial(build, method),
        adaptive=True,
        tolerance=5e-3,
    )
    for method in ("RK45", "LSODA")
)
