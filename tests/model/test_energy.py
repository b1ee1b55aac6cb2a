"""Energy: kept with the base at rest and no motor force; with a moving base it changes by the work done on it."""

import numpy as np
import pytest

START = np.array([0.8, 0.5, 0.3, -2.0, 0.8, 0.5, 0.0, 0.0])
REST = (np.zeros(3),) * 3
ARM = ("m2", "m3", "J", "L1", "L3", "g")


def drift(model, rk4, p, h, duration):
    """Change of the total energy over a free motion, J."""
    plant = model.system.function("plant")
    end = rk4(lambda t, x: plant(*REST, x, np.zeros(2), p).full()[:, 0], START, h, round(duration / h))
    return (model("energy", end, p=p) - model("energy", START, p=p))[0]


def test_free_motion_keeps_the_energy_to_fourth_order(model, rk4):
    """Springs soft enough that the arm's nonlinear motion, not the springs' vibration, sets the error."""
    p = model.p({"plant.k_s2": 50.0, "plant.k_s3": 5.0, "plant.I": 1.0})
    errors = np.array([drift(model, rk4, p, h, 1.0) for h in (1e-2, 5e-3, 2.5e-3)])
    np.testing.assert_allclose(errors[:-1] / errors[1:], 16, rtol=0.06)
    assert abs(errors[-1]) < 1e-11 * model("energy", START, p=p)[0]


def test_stiff_vibration_loses_energy_as_rk4_must(model, rk4):
    """The paper's springs: RK4 damps a linear vibration by (omega h)^6 / 72 a step, so halving h gains 32."""
    errors = np.array([drift(model, rk4, model.defaults, h, 0.05) for h in (2e-4, 1e-4, 5e-5)])
    ratio = errors[:-1] / errors[1:]
    np.testing.assert_allclose(ratio, 32, rtol=0.03)
    assert abs(errors[-1]) < 1e-9 * model("energy", START)[0]


def test_energy_function_is_the_inertial_energy(model, inertial, rng):
    """Arm energy from the inertial derivation plus motors and springs, at random states."""
    x = rng.uniform(-3, 3, (8, 200))
    zero = np.zeros((3, 200))
    arm = inertial.energy(x[:2], x[2:4], 0 * x[:2], zero, zero, zero, arm_values(model))
    expected = arm + motors_and_springs(model, x)
    np.testing.assert_allclose(model("energy", x), np.atleast_2d(expected), rtol=1e-13)


def arm_values(model):
    return [model.defaults[model.keys.index(f"plant.{name}")] for name in ARM]


def drive_values(model):
    get = {key: model.defaults[i] for i, key in enumerate(model.keys)}
    return (
        np.array([get["plant.m_l"], get["plant.I"]]),
        np.array([get["plant.k_s2"], get["plant.k_s3"]]),
    )


def motors_and_springs(model, x):
    inertia, stiffness = drive_values(model)
    q1, _, q2, dq2 = np.split(x, 4)
    return (inertia @ dq2**2 + stiffness @ (q2 - q1) ** 2) / 2


@pytest.mark.parametrize("moving", [(0,), (1,), (2,), (0, 1, 2)], ids=["shake", "pitch", "roll", "all"])
def test_power_balance_at_random_states(model, inertial, rng, moving):
    """dE/dt = motor power + power through the base, the latter from Newton and Euler's laws (conftest.Inertial)."""
    count = 1000
    x, u = rng.uniform(-1, 1, (8, count)), rng.uniform(-500, 500, (2, count))
    x[4:6] = x[:2] + rng.uniform(-1e-3, 1e-3, (2, count))  # springs stretched by newtons, not meganewtons
    base = [np.zeros((3, count)) for _ in range(3)]
    for row in moving:
        for part, size in zip(base, (1, 3, 9), strict=True):
            part[row] = rng.uniform(-size, size, count)
    dx = model("plant", *base, x, u)
    inertia, stiffness = drive_values(model)
    motion = (x[:2], x[2:4], dx[2:4], *base, arm_values(model))
    spring = stiffness[:, None] * (x[4:6] - x[:2])
    stored = inertia @ (x[6:] * dx[6:]) + np.sum(spring * (x[6:] - x[2:4]), axis=0)
    supplied = np.sum(u * x[6:], axis=0) + inertial.base_power(*motion)
    change = inertial.power(*motion) + stored
    scale = sum(np.sum(np.abs(a), axis=0) for a in (spring * x[2:4], spring * x[6:], u * x[6:]))
    assert np.max(np.abs(change - supplied) / (scale + np.abs(inertial.power(*motion)))) < 1e-12


def test_work_along_a_run(model, inertial, rk4):
    """The same balance integrated: a driven arm on a ship that shakes, pitches and rolls."""
    amplitude, omega = np.array([0.3, 0.15, 0.25]), np.array([1.5, 2.1, 1.1])
    plant = model.system.function("plant")
    values = arm_values(model)

    def base(t):
        return (
            amplitude * np.sin(omega * t),
            amplitude * omega * np.cos(omega * t),
            -amplitude * omega**2 * np.sin(omega * t),
        )

    def energy(t, x):
        b = base(t)
        return inertial.energy(x[:2], x[2:4], 0 * x[:2], *b, values) + motors_and_springs(model, x)

    def rate(t, extended):
        x, u = extended[:8], np.array([480 + 40 * np.sin(3 * t), 200 * np.cos(2 * t)])
        b = base(t)
        dx = plant(*b, x, u, model.defaults).full()[:, 0]
        through_base = inertial.base_power(x[:2], x[2:4], dx[2:4], *b, values)
        return np.array([*dx, u @ x[6:], float(through_base[0])])

    start = np.zeros(10)
    start[:8] = START
    h, steps = 1e-4, 2000
    end = rk4(rate, start, h, steps)
    change = float((energy(h * steps, end[:8]) - energy(0.0, start[:8]))[0])
    by_motors, by_base = end[8:]
    assert abs(by_base) > 10.0
    assert change == pytest.approx(by_motors + by_base, abs=1e-5 * (abs(by_motors) + abs(by_base)))
