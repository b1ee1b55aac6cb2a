"""The closed loop as a user of CasADi writes it: numbers where numbers are known, delta as the one parameter."""

from __future__ import annotations

import casadi as ca

from springline.benchmarks import problem


def signals(t: ca.SX) -> tuple[ca.SX, ca.SX]:
    """[q1d, dq1d, ddq1d] (6 x 1) and the shake's acceleration."""
    w = ca.DM(problem.REFERENCE_OMEGA)
    sines, cosines = ca.sin(w * t), ca.cos(w * t)
    reference = ca.vertcat(sines[0], 1 + sines[1], w * cosines, -w * w * sines)
    return reference, -problem.SHAKE_AMPLITUDE * problem.SHAKE_OMEGA**2 * ca.sin(problem.SHAKE_OMEGA * t)


def control(t: ca.SX, x: ca.SX, delta: ca.SX) -> ca.SX:
    """U = U_s + U_f, 2 x 1."""
    reference, _ = signals(t)
    q, dq, dq_motor = x[0:2], x[2:4], x[6:8]
    wished = []
    for i, mu in enumerate((problem.MU_LIFT, problem.MU_ROTATION)):
        e, de = reference[i] - q[i], reference[2 + i] - dq[i]
        e2 = e * e
        root = (e2 + delta**2) ** (-1.0 / 3.0)
        sigma = de + e * (mu * e2 + problem.LAMBDA * root)
        size = ca.fmax(ca.fabs(sigma), 1e-200)
        power = ca.exp(ca.fmin(problem.ZETA * ca.fmax(size, 1) * ca.log(size), 700))
        logarithm = ca.log1p(problem.EPSILON_LOG * size**2)
        rate = problem.K1 * power + ca.sqrt(logarithm) * (problem.K2 * logarithm + problem.K3)
        slope = 3 * mu * e2 + problem.LAMBDA * (root**2) ** 2 * (e2 / 3 + delta**2)
        wished.append(reference[4 + i] + ca.fmin(rate, problem.A_MAX) * ca.sign(sigma) + de * slope)
    coupling, inertia = problem.M3 * problem.L3 * ca.cos(q[1]), problem.M3 * problem.L3**2 + problem.J
    return ca.vertcat(
        (problem.M2 + problem.M3 + problem.MOTOR_LIFT) * wished[0]
        + coupling * wished[1]
        - problem.M3 * problem.L3 * ca.sin(q[1]) * dq[1] ** 2
        + (problem.M2 + problem.M3) * problem.G
        + problem.KF_LIFT * (dq[0] - dq_motor[0]),
        coupling * (wished[0] + problem.G)
        + (inertia + problem.MOTOR_ROTATION) * wished[1]
        + problem.KF_ROTATION * (dq[1] - dq_motor[1]),
    )


def plant(t: ca.SX, x: ca.SX, u: ca.SX) -> ca.SX:
    """dx/dt under the motor forces u."""
    _, shake = signals(t)
    q, dq, q_motor, dq_motor = x[0:2], x[2:4], x[4:6], x[6:8]
    z = ca.DM([problem.K_LIFT, problem.K_ROTATION]) * (q_motor - q)
    mass, coupling, inertia = (
        problem.M2 + problem.M3,
        problem.M3 * problem.L3 * ca.cos(q[1]),
        problem.M3 * problem.L3**2 + problem.J,
    )
    felt = problem.G + shake
    f_lift = z[0] + problem.M3 * problem.L3 * ca.sin(q[1]) * dq[1] ** 2 - mass * felt
    f_rotation = z[1] - coupling * felt
    inverse = 1 / (mass * inertia - coupling**2)
    return ca.vertcat(
        dq,
        (inertia * f_lift - coupling * f_rotation) * inverse,
        (mass * f_rotation - coupling * f_lift) * inverse,
        dq_motor,
        (u - z) / ca.DM([problem.MOTOR_LIFT, problem.MOTOR_ROTATION]),
    )


def step_function(mode: problem.Control) -> ca.Function:
    """One RK4 step, (state 9 x 1, delta) -> state: x and the number of steps done, so that steps can be chained."""
    state, delta = ca.SX.sym("state", 9), ca.SX.sym("delta")
    x, k, h = state[:8], state[8], problem.STEP
    held = control(k * h, x, delta)

    def slope(t: ca.SX, x: ca.SX) -> ca.SX:
        return plant(t, x, held if mode == "sampled" else control(t, x, delta))

    t = k * h
    s1 = slope(t, x)
    s2 = slope(t + h / 2, x + h / 2 * s1)
    s3 = slope(t + h / 2, x + h / 2 * s2)
    s4 = slope(t + h, x + h * s3)
    after = ca.vertcat(x + h / 6 * (s1 + 2 * s2 + 2 * s3 + s4), k + 1)
    return ca.Function("step", [state, delta], [after], {"cse": True})
