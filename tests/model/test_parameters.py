"""Declared parameters: bounds, defaults, and the vector p they become."""

import math
import re

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from springline.model.control import LAWS
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import (
    EVEN,
    LIMIT,
    NON_NEGATIVE,
    POSITIVE,
    REAL,
    UNIT_OPEN,
    Bounds,
    Joint,
    Parameter,
    ParameterVector,
    Values,
)
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

JOINTS = (Joint("lift", "m", "N"), Joint("rotation", "rad", "N m"))

RICH = Structure(reference=SignalShape("sine", (1, 2)), base_motion=SignalShape("sine", (2, 0, 1)))


@pytest.mark.parametrize(
    ("bounds", "inside", "outside"),
    [
        (REAL, [-1e300, 0.0, 5.0], [math.inf, -math.inf, math.nan]),
        (POSITIVE, [1e-300, 1.0], [0.0, -0.0, -1.0, math.inf, math.nan]),
        (NON_NEGATIVE, [0.0, -0.0, 3.0], [-1e-300, math.inf, math.nan]),
        (UNIT_OPEN, [1e-12, 0.5, 1 - 1e-12], [0.0, 1.0, -0.5, 1.5, math.nan]),
        (LIMIT, [1e-12, 200.0, math.inf], [0.0, -1.0, -math.inf, math.nan]),
        (EVEN, [2.0, 4.0, 100.0], [0.0, -2.0, 1.0, 3.0, 2.5, math.inf, math.nan]),
        (Bounds(0.0, 1.0, low_open=True), [1e-9, 1.0], [0.0, 1.0 + 1e-15]),
    ],
)
def test_bounds(bounds, inside, outside):
    assert [value for value in inside if not bounds.holds(value)] == []
    assert [value for value in outside if bounds.holds(value)] == []


@pytest.mark.parametrize(
    ("bounds", "text"),
    [
        (REAL, "a finite number"),
        (POSITIVE, "a number > 0"),
        (NON_NEGATIVE, "a number >= 0"),
        (UNIT_OPEN, "a number in (0, 1)"),
        (Bounds(0.0, 1.0, low_open=True), "a number in (0, 1]"),
        (LIMIT, "a number > 0 (inf means no limit)"),
        (EVEN, "a positive even integer"),
    ],
)
def test_bounds_in_words(bounds, text):
    assert str(bounds) == text


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False))
def test_open_and_closed_ends_differ_at_the_ends_only(low, value):
    closed, opened = Bounds(low=low), Bounds(low=low, low_open=True)
    assert closed.holds(value) == (value >= low)
    assert opened.holds(value) == (value > low)


def test_vector_of_a_table():
    vector = ParameterVector()
    values = vector.table(
        "control",
        [
            Parameter("mu", "{F}/{q}", (1.0, 2.0), "gain", POSITIVE, per_joint=True),
            Parameter("k", "{F}", 3.0, "stiffness", POSITIVE, per_joint=True),
            Parameter("delta", "{q}", 0.05, "layer", NON_NEGATIVE),
            Parameter("zeta", "1", 0.9, "exponent", UNIT_OPEN),
        ],
        JOINTS,
    )
    assert [(s.key, s.symbol, s.unit, s.default, s.meaning) for s in vector.slots] == [
        ("control.mu.0", "control_mu_lift", "N/m", 1.0, "gain (lift)"),
        ("control.mu.1", "control_mu_rotation", "N m/rad", 2.0, "gain (rotation)"),
        ("control.k.0", "control_k_lift", "N", 3.0, "stiffness (lift)"),
        ("control.k.1", "control_k_rotation", "N m", 3.0, "stiffness (rotation)"),
        ("control.delta", "control_delta", "m or rad", 0.05, "layer"),
        ("control.zeta", "control_zeta", "1", 0.9, "exponent"),
    ]
    assert vector.sx.shape == (6, 1)
    assert [symbol.name() for symbol in ca.vertsplit(vector.sx)] == [slot.symbol for slot in vector.slots]
    assert values.mu.shape == (2, 1)
    assert values["zeta"].name() == "control_zeta"


def test_a_default_for_every_joint_is_demanded():
    mu = Parameter("mu", "1", (1.0, 2.0, 3.0), "gain", per_joint=True)
    with pytest.raises(ValueError, match=r"mu has 3 defaults, expected one per joint \(lift, rotation\)"):
        ParameterVector().table("control", [mu], JOINTS)


def test_values_are_a_mapping_with_attributes():
    values = Values({"m": ca.SX(1)}) | Values({"lambda": ca.SX(2)})
    assert sorted(values) == ["lambda", "m"]
    assert len(values) == 2
    assert float(values["lambda"]) == 2
    with pytest.raises(AttributeError, match="mass"):
        _ = values.mass
    with pytest.raises(KeyError, match="mass"):
        _ = values["mass"]


@pytest.mark.parametrize("structure", [Structure(), RICH], ids=["default", "rich"])
def test_slots_of_the_system(structure):
    system = System(structure)
    slots = system.slots
    assert system.p.numel() == len(slots)
    assert [symbol.name() for symbol in ca.vertsplit(system.p)] == [slot.symbol for slot in slots]
    for field in ("key", "symbol"):
        names = [getattr(slot, field) for slot in slots]
        assert len(set(names)) == len(names)
    for slot in slots:
        assert slot.bounds.holds(slot.default), slot.key
        assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", slot.symbol), slot.symbol
        assert slot.unit, slot.key
        assert "{" not in slot.unit, slot.key
        assert slot.meaning, slot.key
        assert not slot.meaning.endswith("."), slot.key


def test_plant_and_nominal_models_have_the_same_parameters_and_defaults():
    by_key = {slot.key: slot for slot in System().slots}
    plant = [key for key in by_key if key.startswith("plant.")]
    assert plant
    for key in plant:
        name = key.removeprefix("plant.")
        nominal = by_key.get(f"mechanism.{name}") or by_key[f"drive.{name}"]
        here = by_key[key]
        assert (here.default, here.unit, here.meaning) == (nominal.default, nominal.unit, nominal.meaning)


def test_parameters_do_not_depend_on_the_law():
    """A changed law is another kernel, but a scenario's keys and the vector p stay."""
    expected = [slot.key for slot in System().slots]
    for law in LAWS:
        assert [slot.key for slot in System(Structure(law=law)).slots] == expected


def test_defaults_are_table_3():
    table_3 = {
        "mechanism.m2": 10, "mechanism.m3": 40, "mechanism.L3": 0.74, "mechanism.g": 9.8,
        "drive.m_l": 2, "drive.I": 0.01, "drive.k_s2": 2e6, "drive.k_s3": 2e4,
        "control.k1": 3, "control.k2": 5, "control.k3": 12, "control.alpha": 0.5, "control.beta": 5,
        "control.mu.0": 12, "control.mu.1": 5, "control.lambda": 5, "control.epsilon_log": 10, "control.nu": 2,
        "control.zeta": 0.9, "control.K_f.0": 200, "control.K_f.1": 2.6,
    }  # fmt: skip
    ours = {
        "mechanism.J": 40 * 0.74**2 / 3, "mechanism.L1": 0.5, "control.delta": 0.05,
        "control.a_max.0": 200, "control.a_max.1": 200, "control.U_max.0": math.inf, "control.U_max.1": math.inf,
    }  # fmt: skip
    defaults = {slot.key: slot.default for slot in System().slots}
    for key, value in (table_3 | ours).items():
        assert defaults[key] == pytest.approx(value, rel=1e-15), key
    exponents = Structure().exponents
    assert (exponents.r, exponents.p, exponents.l, exponents.m) == (3, 1, 3, 1)


def test_every_mechanism_declares_what_the_system_needs():
    for name, mechanism in MECHANISMS.items():
        assert mechanism.name == name
        assert "g" in [item.name for item in mechanism.parameters]
        for declared in (mechanism.motor_inertia, mechanism.stiffness):
            entries = [value for item in declared for value in item.defaults(mechanism.joints)]
            assert len(entries) == len(mechanism.joints)
        assert all(item.meaning for item in mechanism.parameters)


def test_unknown_function_is_answered_with_the_names_there_are():
    with pytest.raises(KeyError, match="no function 'mass'; there are: mass_matrix, coriolis"):
        System().function("mass")


def test_start(make_model):
    """Motors start with unloaded springs, where the springs carry the weight, or where they are told."""
    given_ = {"initial.q.0": 0.8, "initial.q.1": 0.5, "initial.dq.1": 2.0, "initial.q_motor.0": 3.0}
    weight = np.array([50 * 9.8 / 2e6, 40 * 0.74 * 9.8 * math.cos(0.5) / 2e4])
    for start, motor in (
        ("unloaded", [0.8, 0.5]),
        ("given", [3.0, 0.0]),
        ("equilibrium", np.array([0.8, 0.5]) + weight),
    ):
        model = make_model(Structure(initial_motor=start))
        p = model.p(given_)
        x = model("start", np.zeros(1), np.zeros(0), p=p)
        np.testing.assert_allclose(x, [0.8, 0.5, 0.0, 2.0, *motor, 0.0, 0.0], rtol=1e-15)
        if start == "equilibrium":
            rest = (np.zeros(3),) * 3
            x[2:4] = 0.0
            weight_carried = model("gravity", x[:2], p=p)
            dx = model("plant", *rest, x, weight_carried, p=p)
            assert np.max(np.abs(dx)) < 1e-7
