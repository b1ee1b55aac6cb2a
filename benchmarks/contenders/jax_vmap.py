"""JAX: jit(vmap(fori_loop)) in double precision on the CPU, one core. What depends on time only is not mapped."""

from __future__ import annotations

import os
from functools import partial
from typing import Any

import numpy as np

from springline.benchmarks import problem

BATCHES = (64, 1024)
ENVIRONMENT = {
    "JAX_PLATFORMS": "cpu",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
}


def build(mode: problem.Control) -> problem.Runner:
    """Compile for the batch at the first call, as JAX does."""
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    import jax

    configure: Any = jax.config.update  # has no types
    configure("jax_enable_x64", True)
    loop = jax.jit(jax.vmap(one_run(mode), in_axes=(0, None)))

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        return np.stack([np.asarray(column) for column in loop(delta, steps)], axis=1)

    return run


def one_run(mode: problem.Control) -> Any:
    """The run of one delta; the state is a tuple of scalars, which vmap turns into contiguous columns."""
    import jax.numpy as jnp
    from jax import lax

    w1, w2 = problem.REFERENCE_OMEGA
    mass, inertia, arm, h = (
        problem.M2 + problem.M3,
        problem.M3 * problem.L3**2 + problem.J,
        problem.M3 * problem.L3,
        problem.STEP,
    )

    def signals(t: Any) -> Any:
        s1, c1, s2, c2 = jnp.sin(w1 * t), jnp.cos(w1 * t), jnp.sin(w2 * t), jnp.cos(w2 * t)
        shake = -problem.SHAKE_AMPLITUDE * problem.SHAKE_OMEGA**2 * jnp.sin(problem.SHAKE_OMEGA * t)
        return s1, 1.0 + s2, w1 * c1, w2 * c2, -w1 * w1 * s1, -w2 * w2 * s2, shake

    def wished_acceleration(e: Any, de: Any, mu: float, delta2: Any) -> Any:
        e2 = e * e
        root = jnp.exp(jnp.log(e2 + delta2) * (-1.0 / 3.0))
        sigma = de + e * (mu * e2 + problem.LAMBDA * root)
        size = jnp.maximum(jnp.abs(sigma), 1e-200)
        power = jnp.exp(problem.ZETA * jnp.maximum(size, 1.0) * jnp.log(size))
        logarithm = jnp.log1p(problem.EPSILON_LOG * (size * size))
        rate = problem.K1 * power + jnp.sqrt(logarithm) * (problem.K2 * logarithm + problem.K3)
        root2 = root * root
        slope = 3.0 * mu * e2 + problem.LAMBDA * (root2 * root2) * (e2 * (1.0 / 3.0) + delta2)
        return -jnp.copysign(jnp.minimum(rate, problem.A_MAX), sigma) - de * slope

    def control(now: Any, x: Any, delta2: Any) -> Any:
        y, theta, dy, dtheta, _, _, dy_motor, dtheta_motor = x
        a_lift = now[4] - wished_acceleration(now[0] - y, now[2] - dy, problem.MU_LIFT, delta2)
        a_rotation = now[5] - wished_acceleration(now[1] - theta, now[3] - dtheta, problem.MU_ROTATION, delta2)
        coupling, centrifugal = arm * jnp.cos(theta), arm * jnp.sin(theta) * (dtheta * dtheta)
        return (
            (mass + problem.MOTOR_LIFT) * a_lift
            + coupling * a_rotation
            - centrifugal
            + mass * problem.G
            + problem.KF_LIFT * (dy - dy_motor),
            coupling * (a_lift + problem.G)
            + (inertia + problem.MOTOR_ROTATION) * a_rotation
            + problem.KF_ROTATION * (dtheta - dtheta_motor),
        )

    def plant(now: Any, x: Any, u: Any) -> Any:
        y, theta, dy, dtheta, y_motor, theta_motor, dy_motor, dtheta_motor = x
        coupling, centrifugal = arm * jnp.cos(theta), arm * jnp.sin(theta) * (dtheta * dtheta)
        z_lift, z_rotation = problem.K_LIFT * (y_motor - y), problem.K_ROTATION * (theta_motor - theta)
        felt = problem.G + now[6]
        f_lift, f_rotation = z_lift + centrifugal - mass * felt, z_rotation - coupling * felt
        inverse = 1.0 / (mass * inertia - coupling * coupling)
        return (
            dy,
            dtheta,
            (inertia * f_lift - coupling * f_rotation) * inverse,
            (mass * f_rotation - coupling * f_lift) * inverse,
            dy_motor,
            dtheta_motor,
            (u[0] - z_lift) / problem.MOTOR_LIFT,
            (u[1] - z_rotation) / problem.MOTOR_ROTATION,
        )

    def step(k: Any, x: Any, delta2: Any) -> Any:
        now, middle, after = (signals((k + shift) * h) for shift in (0.0, 0.5, 1.0))
        held = control(now, x, delta2)

        def slope(at: Any, x: Any) -> Any:
            return plant(at, x, held if mode == "sampled" else control(at, x, delta2))

        def ahead(ds: Any, length: float) -> Any:
            return tuple(a + length * b for a, b in zip(x, ds, strict=True))

        s1 = slope(now, x)
        s2 = slope(middle, ahead(s1, h / 2))
        s3 = slope(middle, ahead(s2, h / 2))
        s4 = slope(after, ahead(s3, h))
        return tuple(a + h / 6 * (b + 2 * (c + d) + e) for a, b, c, d, e in zip(x, s1, s2, s3, s4, strict=True))

    def run(delta: Any, steps: Any) -> Any:
        start = tuple(jnp.full_like(delta, value) for value in problem.INITIAL_STATE)
        return lax.fori_loop(0, steps, lambda k, x: step(k, x, delta * delta), start)

    return run


CONTENDERS = tuple(
    problem.Contender("JAX", mode, mode, partial(build, mode), batch=batch, modules=("jax",), compiles=True)
    for mode in problem.MODES
    for batch in BATCHES
)
