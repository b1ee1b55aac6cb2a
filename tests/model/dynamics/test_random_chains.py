"""Whatever the chain: its mass matrix is one, no energy comes from nowhere, and power is accounted for."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from springline.model.drive import COULOMB_VELOCITY, FRICTION
from springline.model.mechanisms import MECHANISMS
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

KINDS = st.text("rp", min_size=1, max_size=5)
FRAMES = st.sampled_from(["generic", "quarter"])
SEEDS = st.integers(0, 2**32 - 1)


@pytest.fixture(scope="module")
def system_of(make_chain, make_numbers):
    """A system whose arm is a chain of these joints, with numbers for its parameters."""

    def made(kinds, frames, seed, **structure):
        rng = np.random.default_rng(seed)
        with pytest.MonkeyPatch.context() as patched:
            patched.setitem(MECHANISMS, "chain", make_chain(kinds, frames))
            shape, moving = SignalShape("sine", (0,) * len(kinds)), SignalShape("sine", (1,) * 6)
            system = System(Structure(mechanism="chain", reference=shape, base_motion=moving, **structure))
            assert system.functions
        numbers = make_numbers(len(kinds), rng)
        p = np.array([numbers.get(slot.key.split(".", 1)[1], slot.default) for slot in system.slots])
        return system, p, rng

    return made


@settings(max_examples=40)
@given(kinds=KINDS, frames=FRAMES, seed=SEEDS)
def test_the_mass_matrix_is_one(derive, make_chain, make_numbers, kinds, frames, seed):
    rng = np.random.default_rng(seed)
    numbers = make_numbers(len(kinds), rng)
    mass = derive(make_chain(kinds, frames), "factored").terms(*rng.normal(size=(2, len(kinds))), numbers=numbers)[
        "mass"
    ]
    np.testing.assert_allclose(mass, mass.T, rtol=0, atol=1e-12 * np.abs(mass).max())
    assert np.linalg.eigvalsh(mass)[0] > 0


@settings(max_examples=8)
@given(kinds=KINDS, frames=FRAMES, seed=SEEDS)
def test_power_balance(system_of, kinds, frames, seed):
    """On a base at rest the energy grows by what the motors do, and by nothing else."""
    system, p, rng = system_of(kinds, frames, seed)
    n = len(kinds)
    x, u, rest = rng.normal(size=4 * n), rng.normal(size=n), np.zeros(system.base.b.numel())
    x[2 * n : 3 * n] = x[:n] + 1e-4 * rng.normal(size=n)  # springs are stiff
    dx = np.array(system.function("plant")(rest, rest, rest, x, u, p)).ravel()
    state = ca.SX.sym("x", 4 * n)
    slope = ca.Function("slope", [state], [ca.gradient(system.function("energy")(state, p), state)])(x)
    power = np.array(slope).ravel()
    assert power @ dx == pytest.approx(u @ x[3 * n :], rel=1e-9, abs=1e-10 * np.abs(power * dx).max())


@settings(max_examples=8)
@given(kinds=KINDS, frames=FRAMES, seed=SEEDS)
def test_power_balance_with_damping_and_friction(system_of, kinds, frames, seed):
    """What is missing from the motors' power is what dampers and frictions take, and they never give."""
    system, p, rng = system_of(kinds, frames, seed, friction=tuple(item.name for item in FRICTION))
    n = len(kinds)
    taken = {item.name: rng.uniform(0.1, 3.0, n) for item in FRICTION}
    for k, slot in enumerate(system.slots):
        table, name, *index = slot.key.split(".")
        if table == "plant" and name in taken:
            p[k] = taken[name][int(index[0])]
    x, u, rest = rng.normal(size=4 * n), rng.normal(size=n), np.zeros(system.base.b.numel())
    x[2 * n : 3 * n] = x[:n] + 1e-4 * rng.normal(size=n)
    dx = np.array(system.function("plant")(rest, rest, rest, x, u, p)).ravel()
    state = ca.SX.sym("x", 4 * n)
    power = np.array(
        ca.Function("slope", [state], [ca.gradient(system.function("energy")(state, p), state)])(x)
    ).ravel()
    dq1, dq2 = x[n : 2 * n], x[3 * n :]
    lost = taken["spring_damping"] * (dq2 - dq1) ** 2
    for side, rate in (("link", dq1), ("motor", dq2)):
        lost = lost + taken[f"{side}_viscous"] * rate**2
        lost = lost + taken[f"{side}_coulomb"] * rate**2 / np.hypot(rate, COULOMB_VELOCITY.default)
    assert power @ dx == pytest.approx(u @ dq2 - lost.sum(), rel=1e-9, abs=1e-10 * np.abs(power * dx).max())
    assert lost.min() > 0


def seen_from_the_earth(system, motion, q, dq, t):
    """Kinetic and potential energy of the arm's bodies in the inertial frame, J, the base moving as b0 + db0 t + …"""
    b0, db0, ddb0 = motion
    b, base = b0 + db0 * t + ddb0 * t**2 / 2, system.base
    turned = ca.substitute(base.rotation, base.b, b)
    along = {item.key: b[i] for i, item in enumerate(base.coordinates)}
    moved = ca.vertcat(along["surge"], along["heave"], along["sway"])
    kinetic, potential, arm = ca.SX(0), ca.SX(0), system._plant
    for body in system.mechanism.checked_bodies(q, arm):
        place = moved + turned @ body.position
        v = ca.jtimes(place, ca.vertcat(q, t), ca.vertcat(dq, 1))
        rotation = turned @ body.rotation
        spin = rotation.T @ ca.reshape(ca.jtimes(ca.vec(rotation), ca.vertcat(q, t), ca.vertcat(dq, 1)), 3, 3)
        w = ca.vertcat(spin[2, 1], spin[0, 2], spin[1, 0])
        kinetic += (body.mass * ca.dot(v, v) + ca.dot(w, body.inertia @ w)) / 2
        potential += body.mass * arm.g * place[1]
    return kinetic, potential


@settings(max_examples=8)
@given(kinds=KINDS, frames=FRAMES, seed=SEEDS)
def test_what_a_moving_base_does(system_of, kinds, frames, seed):
    """S against another derivation: energies in the inertial frame, by Lagrange, the base's motion given over time."""
    system, p, rng = system_of(kinds, frames, seed)
    n = len(kinds)
    motion = rng.normal(size=(3, system.base.b.numel()))
    q, dq, t = ca.SX.sym("q", n), ca.SX.sym("dq", n), ca.SX.sym("t")
    kinetic, potential = seen_from_the_earth(system, motion, q, dq, t)
    momentum = ca.gradient(kinetic, dq)
    needed = ca.jtimes(momentum, ca.vertcat(q, t), ca.vertcat(dq, 1)) - ca.gradient(kinetic - potential, q)
    at = [rng.normal(size=n), rng.normal(size=n)]
    wanted = np.array(ca.Function("needed", [q, dq, t, system.p], [needed])(*at, 0.0, p)).ravel()
    seen = [np.array(f).ravel() for f in (
        system.function("coriolis")(*at, p), system.function("gravity")(at[0], p),
        system.function("base_disturbance")(*motion, *at, p))]  # fmt: skip
    np.testing.assert_allclose(seen[0] + seen[1] - seen[2], wanted, rtol=1e-9, atol=1e-10 * np.abs(wanted).max())


@settings(max_examples=8)
@given(kinds=KINDS, frames=FRAMES, seed=SEEDS)
def test_power_balance_on_a_moving_base(system_of, kinds, frames, seed):
    """Jacobi's integral of arm, motors and springs changes by the motors' power, and by -dL/dt of the base's motion."""
    system, p, rng = system_of(kinds, frames, seed)
    n = len(kinds)
    motion = rng.normal(size=(3, system.base.b.numel()))
    x, u = rng.normal(size=4 * n), rng.normal(size=n)
    x[2 * n : 3 * n] = x[:n] + 1e-4 * rng.normal(size=n)
    dx = np.array(system.function("plant")(*motion, x, u, p)).ravel()
    state, t = ca.SX.sym("x", 4 * n), ca.SX.sym("t")
    q1, dq1, *motors = ca.vertsplit(state, n)
    kinetic, potential = seen_from_the_earth(system, motion, q1, dq1, t)
    drive = system.drive.energy(state, system.mechanism, system._plant)
    assert len(motors) == 2
    jacobi = ca.dot(ca.gradient(kinetic, dq1), dq1) - (kinetic - potential) + drive
    outputs = [ca.gradient(jacobi, state), ca.gradient(jacobi, t), ca.gradient(kinetic - potential, t)]
    slope, by_time, led = (np.array(f).ravel() for f in ca.Function("f", [state, t, system.p], outputs)(x, 0.0, p))
    change = slope @ dx + by_time[0]
    scale = np.abs(slope * dx).max() + np.abs(by_time).max()
    assert change == pytest.approx(u @ x[3 * n :] - led[0], rel=1e-9, abs=1e-10 * scale)


@settings(max_examples=5)
@given(kinds=st.text("rp", min_size=1, max_size=3), frames=FRAMES, seed=SEEDS)
def test_energy_is_conserved(system_of, kinds, frames, seed):
    """Without motors and on a base at rest; the error of RK4 falls with the fifth power of the step."""
    system, p, rng = system_of(kinds, frames, seed)
    n = len(kinds)
    p = np.array([50.0 if "spring" in slot.key else v for slot, v in zip(system.slots, p, strict=True)])
    x, u, rest = ca.SX.sym("x", 4 * n), np.zeros(n), np.zeros(system.base.b.numel())
    plant = ca.Function("plant", [x], [system.function("plant")(rest, rest, rest, x, u, p)])
    start = np.concatenate([0.3 * rng.normal(size=n), 0.3 * rng.normal(size=n)] * 2)

    def drift(h, steps):
        state = start
        for _ in range(steps):
            k1 = plant(state)
            k2 = plant(state + h / 2 * k1)
            k3 = plant(state + h / 2 * k2)
            k4 = plant(state + h * k3)
            state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        energy = system.function("energy")
        return abs(float(energy(state, p) - energy(start, p))), abs(float(energy(start, p))) + 1.0

    coarse, scale = drift(2e-3, 100)
    fine, _ = drift(1e-3, 200)
    assert fine <= max(coarse / 8, 1e-11 * scale)
