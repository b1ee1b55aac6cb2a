"""Damping and friction: what they take is what the energy loses, and where they are zero there is nothing of them."""

import re
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from springline.model.drive import FRICTION, friction, friction_parameters
from springline.model.parameters import Values
from springline.model.structure import Structure
from springline.model.system import System

NAMES = tuple(item.name for item in FRICTION)
ARM = ("m2", "m3", "J", "L1", "L3", "g")
REST = (np.zeros(3),) * 3


@pytest.fixture
def damped(request, make_model):
    """A Model of a drive with all damping and friction, every number of the plant another one."""
    model = make_model(Structure(drive=request.param, friction=NAMES if request.param == "elastic" else NAMES[1:]))
    rng = np.random.default_rng(3)
    chosen = {key: rng.uniform(0.5, 20.0) for key in model.keys if key.startswith("plant.") and _is_friction(key)}
    model.chosen = chosen | {f"plant.coulomb_velocity.{i}": 0.1 + i for i in range(2)}
    model.defaults = model.p(model.chosen)
    return model


def _is_friction(key):
    return key.split(".")[1] in NAMES


def per_joint(model, name):
    return np.array([model.chosen[f"plant.{name}.{i}"] for i in range(2)])[:, None]


def against(model, rate, *sides):
    """Friction by its formula."""
    smooth = rate / np.sqrt(rate**2 + per_joint(model, "coulomb_velocity") ** 2)
    return sum(per_joint(model, f"{s}_viscous") * rate + per_joint(model, f"{s}_coulomb") * smooth for s in sides)


def arm(model):
    return [model.defaults[model.keys.index(f"plant.{name}")] for name in ARM]


def plant_value(model, *names):
    return np.array([model.defaults[model.keys.index(f"plant.{name}")] for name in names])


@pytest.mark.parametrize("damped", ["elastic"], indirect=True)
@pytest.mark.parametrize("moving", [False, True], ids=["base at rest", "base moving"])
def test_power_balance_with_damping(damped, inertial, rng, moving):
    """dE/dt = motor power + power through the base - dissipation, at 1000 random states."""
    count = 1000
    x, u = rng.uniform(-1, 1, (8, count)), rng.uniform(-500, 500, (2, count))
    x[4:6] = x[:2] + rng.uniform(-1e-3, 1e-3, (2, count))
    base = [size * moving * rng.uniform(-1, 1, (3, count)) for size in (1, 3, 9)]
    dx = damped("plant", *base, x, u)
    inertia, stiffness = plant_value(damped, "m_l", "I"), plant_value(damped, "k_s2", "k_s3")
    dq1, dq2 = x[2:4], x[6:]
    motion = (x[:2], dq1, dx[2:4], *base, arm(damped))
    spring = stiffness[:, None] * (x[4:6] - x[:2])
    stored = inertia @ (dq2 * dx[6:]) + np.sum(spring * (dq2 - dq1), axis=0)
    slip = dq2 - dq1
    lost = np.sum(
        per_joint(damped, "spring_damping") * slip**2
        + dq1 * against(damped, dq1, "link")
        + dq2 * against(damped, dq2, "motor"),
        axis=0,
    )
    supplied = np.sum(u * dq2, axis=0) + inertial.base_power(*motion) - lost
    change = inertial.power(*motion) + stored
    scale = sum(np.sum(np.abs(a), axis=0) for a in (spring * dq1, spring * dq2, u * dq2))
    assert lost.min() > 0
    assert np.max(np.abs(change - supplied) / (scale + np.abs(inertial.power(*motion)))) < 1e-12


@pytest.mark.parametrize("damped", ["rigid"], indirect=True)
def test_on_a_rigid_drive_frictions_add_up(damped, inertial, rng):
    count = 500
    x, u = rng.uniform(-1, 1, (4, count)), rng.uniform(-500, 500, (2, count))
    base = [size * rng.uniform(-1, 1, (3, count)) for size in (1, 3, 9)]
    dx = damped("plant", *base, x, u)
    dq1 = x[2:]
    motion = (x[:2], dq1, dx[2:], *base, arm(damped))
    change = inertial.power(*motion) + plant_value(damped, "m_l", "I") @ (dq1 * dx[2:])
    lost = np.sum(dq1 * against(damped, dq1, "link", "motor"), axis=0)
    supplied = np.sum(u * dq1, axis=0) + inertial.base_power(*motion) - lost
    scale = np.sum(np.abs(u * dq1), axis=0) + np.abs(inertial.power(*motion)) + lost
    assert np.max(np.abs(change - supplied) / scale) < 1e-12
    assert not any(slot.key.endswith("spring_damping.0") for slot in damped.system.slots)


@pytest.mark.parametrize("damped", ["elastic"], indirect=True)
def test_what_is_lost_along_a_run_converges_to_fourth_order(damped, rk4):
    """Energy at the end, plus what formulas say was lost on the way, is the energy at the start: order by halving."""
    p = damped.p(damped.chosen | {"plant.k_s2": 50.0, "plant.k_s3": 5.0, "plant.I": 1.0})
    plant = damped.system.function("plant")

    def rate(t, extended):
        x = extended[:8]
        dq1, dq2 = x[2:4, None], x[6:, None]
        lost = (
            per_joint(damped, "spring_damping") * (dq2 - dq1) ** 2
            + dq1 * against(damped, dq1, "link")
            + dq2 * against(damped, dq2, "motor")
        )
        return np.array([*plant(*REST, x, np.zeros(2), p).full()[:, 0], lost.sum()])

    start = np.array([0.8, 0.5, 0.3, -2.0, 0.8, 0.5, 0.0, 0.0, 0.0])
    errors = []
    for h in (2e-2, 1e-2, 5e-3):
        end = rk4(rate, start, h, round(0.5 / h))
        change = damped("energy", end[:8], p=p) - damped("energy", start[:8], p=p)
        errors.append(abs(float(change[0] + end[8])))
    assert end[8] > 1.0
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 4, atol=0.3)


@pytest.mark.parametrize("kind", ["elastic", "rigid"])
@pytest.mark.parametrize("name", NAMES)
def test_each_is_in_the_plant_only_where_the_structure_names_it(kind, name):
    if kind == "rigid" and name == "spring_damping":
        assert name not in {item.name for item in friction_parameters("rigid")}
        return
    bare, system = System(Structure(drive=kind)), System(Structure(drive=kind, friction=(name,)))
    added = [slot.key for slot in system.slots if slot.key not in {s.key for s in bare.slots}]
    needed = (name, "coulomb_velocity") if "coulomb" in name else (name,)
    assert added == [f"{table}.{item}.{i}" for table in ("drive", "plant") for item in needed for i in range(2)]
    read = {system.slots[k].key for k in _read(system.function("loop_plant"))}
    assert {key for key in read if key in added} == {key for key in added if key.startswith("plant.")}
    assert system.function("loop_control").n_instructions() == bare.function("loop_control").n_instructions()


def _read(function):
    inputs = [function.instruction_input(k) for k in range(function.n_instructions())
              if function.instruction_id(k) == ca.OP_INPUT]  # fmt: skip
    return {entry for source, entry in inputs if source == function.n_in() - 1}


def test_zero_friction_is_no_friction(model, make_model, rng):
    """Bits of a plant whose friction is zero are those of one that has none: a sweep may cross zero."""
    other = make_model(Structure(friction=NAMES))
    x, u = rng.uniform(-3, 3, (8, 500)), rng.uniform(-500, 500, (2, 500))
    base = [rng.uniform(-1, 1, (3, 500)) for _ in range(3)]
    np.testing.assert_array_equal(other("plant", *base, x, u), model("plant", *base, x, u))


@pytest.mark.parametrize("damped", ["elastic"], indirect=True)
def test_a_start_on_the_reference_carries_the_friction_too(damped, make_model):
    """Motors stand where springs carry the arm along its reference: the links' acceleration is the reference's."""
    on = make_model(Structure(friction=NAMES, start="reference"))
    p = on.p(damped.chosen | {"reference.lift.terms.0.amplitude": 1.0, "reference.lift.terms.0.omega": 3.0})
    x = on("start", 0.0, np.zeros(0), p=p)
    w = on("signals", 0.0, np.zeros(0), p=p)
    dx = on("plant", w[6:9], w[9:12], w[12:15], x, np.zeros(2), p=p)
    assert abs(x[2]) == 3.0
    np.testing.assert_allclose(dx[2:4], w[4:6], atol=1e-8)


def test_the_share_of_coulomb_friction_that_the_docs_say() -> None:
    page = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text("utf-8")
    told = re.search(r"at this rate it has (\d+) % of F, at ten times as much ([\d.]+) %", page)
    rate, p = ca.SX.sym("rate"), Values({"link_coulomb": ca.SX(8.0), "coulomb_velocity": ca.SX(0.01)})
    shares = ca.Function("share", [rate], [friction(rate, p, "link") / 8.0])
    assert told and [f"{100 * float(shares(0.01)):.0f}", f"{100 * float(shares(0.1)):.1f}"] == list(told.groups())
