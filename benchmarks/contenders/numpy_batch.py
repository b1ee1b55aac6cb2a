"""NumPy on columns of 1,024 runs: the columns stay in the first-level caches, and calls cost little beside the work."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from springline.benchmarks import problem

BATCH = 1024


def build(mode: problem.Control) -> problem.Runner:
    """Nothing to compile."""

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        delta2 = delta * delta
        x = np.repeat(np.array(problem.INITIAL_STATE)[:, None], delta.size, axis=1)
        h = problem.STEP
        after = signals(0.0)
        for k in range(steps):
            now, middle, after = after, signals((k + 0.5) * h), signals((k + 1) * h)
            s1, u = slope(now, x, delta2, None)
            held = u if mode == "sampled" else None
            s2, _ = slope(middle, x + (h / 2) * s1, delta2, held)
            s3, _ = slope(middle, x + (h / 2) * s2, delta2, held)
            s4, _ = slope(after, x + h * s3, delta2, held)
            s2 += s3
            s2 *= 2.0
            s2 += s1
            s2 += s4
            s2 *= h / 6
            x += s2
        return np.ascontiguousarray(x.T)

    return run


def signals(t: float) -> tuple[problem.Floats, problem.Floats, problem.Floats, float]:
    """q1d, dq1d, ddq1d (2 x 1) and the shake's acceleration: scalars, the same for all runs."""
    w1, w2 = problem.REFERENCE_OMEGA
    s1, s2 = math.sin(w1 * t), math.sin(w2 * t)
    return (
        np.array([[s1], [1.0 + s2]]),
        np.array([[w1 * math.cos(w1 * t)], [w2 * math.cos(w2 * t)]]),
        np.array([[-w1 * w1 * s1], [-w2 * w2 * s2]]),
        -problem.SHAKE_AMPLITUDE * problem.SHAKE_OMEGA**2 * math.sin(problem.SHAKE_OMEGA * t),
    )


MU = np.array([[problem.MU_LIFT], [problem.MU_ROTATION]])
KF = np.array([[problem.KF_LIFT], [problem.KF_ROTATION]])
STIFFNESS = np.array([[problem.K_LIFT], [problem.K_ROTATION]])
PER_MOTOR = 1.0 / np.array([[problem.MOTOR_LIFT], [problem.MOTOR_ROTATION]])
MASS, INERTIA, ARM = problem.M2 + problem.M3, problem.M3 * problem.L3**2 + problem.J, problem.M3 * problem.L3


def wished_acceleration(e: problem.Floats, de: problem.Floats, delta2: problem.Floats) -> problem.Floats:
    """u_e of (25), both joints at once: 2 x runs."""
    e2 = e * e
    h = e2 + delta2
    root = np.log(h)
    root *= -1.0 / 3.0
    np.exp(root, out=root)
    cube = MU * e2
    sigma = root * problem.LAMBDA
    sigma += cube
    sigma *= e
    sigma += de
    size = np.abs(sigma)
    np.maximum(size, 1e-200, out=size)
    rate = np.log(size)
    rate *= np.maximum(size, 1.0)
    rate *= problem.ZETA
    np.minimum(rate, 700.0, out=rate)
    np.exp(rate, out=rate)
    rate *= problem.K1
    logarithm = size
    logarithm *= size
    logarithm *= problem.EPSILON_LOG
    np.log1p(logarithm, out=logarithm)
    root_of = np.sqrt(logarithm)
    logarithm *= problem.K2
    logarithm += problem.K3
    logarithm *= root_of
    rate += logarithm
    np.minimum(rate, problem.A_MAX, out=rate)
    np.copysign(rate, sigma, out=rate)
    root *= root
    root *= root
    root *= problem.LAMBDA
    e2 *= 1.0 / 3.0
    e2 += delta2
    root *= e2
    cube *= 3.0
    root += cube
    root *= de
    rate += root
    return np.negative(rate, out=rate)


def slope(
    now: tuple[problem.Floats, problem.Floats, problem.Floats, float],
    x: problem.Floats,
    delta2: problem.Floats,
    held: problem.Floats | None,
) -> tuple[problem.Floats, problem.Floats]:
    """dx/dt (8 x runs) and the motor forces (2 x runs), which are `held` if given."""
    q_d, dq_d, ddq_d, shake = now
    q, dq, q_motor, dq_motor = x[0:2], x[2:4], x[4:6], x[6:8]
    coupling = np.cos(q[1])
    coupling *= ARM
    centrifugal = np.sin(q[1])
    centrifugal *= dq[1]
    centrifugal *= dq[1]
    centrifugal *= ARM
    if held is None:
        wished = wished_acceleration(q_d - q, dq_d - dq, delta2)
        np.subtract(ddq_d, wished, out=wished)
        u = dq - dq_motor
        u *= KF
        u[0] += (MASS + problem.MOTOR_LIFT) * wished[0] + coupling * wished[1]
        u[0] -= centrifugal
        u[0] += MASS * problem.G
        u[1] += coupling * (wished[0] + problem.G) + (INERTIA + problem.MOTOR_ROTATION) * wished[1]
    else:
        u = held
    z = q_motor - q
    z *= STIFFNESS
    felt = problem.G + shake
    f_lift, f_rotation = z[0] + centrifugal, z[1] - felt * coupling
    f_lift -= MASS * felt
    inverse = coupling * coupling
    np.subtract(MASS * INERTIA, inverse, out=inverse)
    np.reciprocal(inverse, out=inverse)
    dx = np.empty_like(x)
    dx[0:2], dx[4:6] = dq, dq_motor
    np.multiply(INERTIA * f_lift - coupling * f_rotation, inverse, out=dx[2])
    np.multiply(MASS * f_rotation - coupling * f_lift, inverse, out=dx[3])
    np.subtract(u, z, out=dx[6:8])
    dx[6:8] *= PER_MOTOR
    return dx, u


CONTENDERS = tuple(problem.Contender("NumPy", mode, mode, partial(build, mode), batch=BATCH) for mode in problem.MODES)
