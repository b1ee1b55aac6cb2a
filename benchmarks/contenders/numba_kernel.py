"""The loop that numba_loop compiles. It needs Numba at import, so it stands in a file of its own.

The functions are global, not closures: Numba does not find a closure in its cache again. fastmath changes nothing that
can be measured: the time goes into elementary functions.
"""

from __future__ import annotations

from math import copysign, cos, exp, log, log1p, sin, sqrt

from numba import njit

from springline.benchmarks.problem import (
    A_MAX,
    EPSILON_LOG,
    INITIAL_STATE,
    K1,
    K2,
    K3,
    K_LIFT,
    K_ROTATION,
    KF_LIFT,
    KF_ROTATION,
    L3,
    LAMBDA,
    M2,
    M3,
    MOTOR_LIFT,
    MOTOR_ROTATION,
    MU_LIFT,
    MU_ROTATION,
    REFERENCE_OMEGA,
    SHAKE_AMPLITUDE,
    SHAKE_OMEGA,
    STEP,
    ZETA,
    Floats,
    G,
    J,
)

Numbers = tuple[float, ...]

W1, W2 = REFERENCE_OMEGA
MASS, INERTIA, COUPLING = M2 + M3, M3 * L3**2 + J, M3 * L3


jit = njit(cache=True, error_model="numpy")


@jit
def wished_acceleration(e: float, de: float, mu: float, delta2: float) -> float:
    e2 = e * e
    root = exp(log(e2 + delta2) * (-1.0 / 3.0))
    sigma = de + e * (mu * e2 + LAMBDA * root)
    size = abs(sigma)
    logarithm = log1p(EPSILON_LOG * (size * size))
    root_of = sqrt(logarithm)
    rate = K1 * size ** (ZETA * (size if size > 1.0 else 1.0)) + root_of * (K2 * logarithm + K3)
    root2 = root * root
    slope = 3.0 * mu * e2 + LAMBDA * (root2 * root2) * (e2 * (1.0 / 3.0) + delta2)
    return -copysign(rate if rate < A_MAX else A_MAX, sigma) - de * slope


@jit
def control(now: Numbers, x: Numbers, sine: float, cosine: float, delta2: float) -> Numbers:
    y, theta, dy, dtheta, _, _, dy_motor, dtheta_motor = x
    yd, thetad, dyd, dthetad, ddyd, ddthetad, _ = now
    a_lift = ddyd - wished_acceleration(yd - y, dyd - dy, MU_LIFT, delta2)
    a_rotation = ddthetad - wished_acceleration(thetad - theta, dthetad - dtheta, MU_ROTATION, delta2)
    coupling = COUPLING * cosine
    return (
        (MASS + MOTOR_LIFT) * a_lift
        + coupling * a_rotation
        - COUPLING * sine * (dtheta * dtheta)
        + MASS * G
        + KF_LIFT * (dy - dy_motor),
        coupling * (a_lift + G) + (INERTIA + MOTOR_ROTATION) * a_rotation + KF_ROTATION * (dtheta - dtheta_motor),
    )


@jit
def signals(t: float) -> Numbers:
    s1, c1, s2, c2 = sin(W1 * t), cos(W1 * t), sin(W2 * t), cos(W2 * t)
    shake = -SHAKE_AMPLITUDE * SHAKE_OMEGA * SHAKE_OMEGA * sin(SHAKE_OMEGA * t)
    return s1, 1.0 + s2, W1 * c1, W2 * c2, -W1 * W1 * s1, -W2 * W2 * s2, shake


@jit
def slope(now: Numbers, x: Numbers, u: Numbers, held: bool, delta2: float) -> tuple[Numbers, Numbers]:
    y, theta, dy, dtheta, y_motor, theta_motor, dy_motor, dtheta_motor = x
    sine, cosine = sin(theta), cos(theta)
    if not held:
        u = control(now, x, sine, cosine, delta2)
    coupling = COUPLING * cosine
    z_lift, z_rotation = K_LIFT * (y_motor - y), K_ROTATION * (theta_motor - theta)
    felt = G + now[6]
    f_lift = z_lift + COUPLING * sine * (dtheta * dtheta) - MASS * felt
    f_rotation = z_rotation - coupling * felt
    inverse = 1.0 / (MASS * INERTIA - coupling * coupling)
    dx = (
        dy,
        dtheta,
        (INERTIA * f_lift - coupling * f_rotation) * inverse,
        (MASS * f_rotation - coupling * f_lift) * inverse,
        dy_motor,
        dtheta_motor,
        (u[0] - z_lift) * (1.0 / MOTOR_LIFT),
        (u[1] - z_rotation) * (1.0 / MOTOR_ROTATION),
    )
    return dx, u


@jit
def ahead(x: Numbers, h: float, dx: Numbers) -> Numbers:
    return (
        x[0] + h * dx[0],
        x[1] + h * dx[1],
        x[2] + h * dx[2],
        x[3] + h * dx[3],
        x[4] + h * dx[4],
        x[5] + h * dx[5],
        x[6] + h * dx[6],
        x[7] + h * dx[7],
    )


@jit
def loop(delta: Floats, steps: int, sampled: bool, final: Floats) -> None:
    """Final states of one run per entry of delta, into final (runs, 8)."""
    for i in range(delta.size):
        delta2 = delta[i] * delta[i]
        x = INITIAL_STATE
        after = signals(0.0)
        for k in range(steps):
            now, middle, after = after, signals((k + 0.5) * STEP), signals((k + 1.0) * STEP)
            s1, u = slope(now, x, (0.0, 0.0), False, delta2)
            s2, u = slope(middle, ahead(x, 0.5 * STEP, s1), u, sampled, delta2)
            s3, u = slope(middle, ahead(x, 0.5 * STEP, s2), u, sampled, delta2)
            s4, u = slope(after, ahead(x, STEP, s3), u, sampled, delta2)
            x = ahead(ahead(ahead(ahead(x, STEP / 6.0, s1), STEP / 3.0, s2), STEP / 3.0, s3), STEP / 6.0, s4)
        for j in range(8):
            final[i, j] = x[j]
