"""An arm with another number of joints, on either drive, is as good as the paper's: its defaults, its mechanics."""

import numpy as np
import pytest

from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import Joint, Parameter
from springline.model.structure import SignalShape, Structure
from springline.model.system import System, control_parameters

pytestmark = pytest.mark.usefixtures("other_arms")

SHAKEN = SignalShape("sine", (1, 1, 1))


def structure_of(name, drive="elastic", **changes):
    terms = tuple(len(t) for t in MECHANISMS[name].reference_terms)
    given = {"reference": SignalShape("sine", terms), "base_motion": SHAKEN, "drive": drive} | changes
    return Structure(mechanism=name, **given)


def random_state(n, drive, seed=1):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (4 if drive == "elastic" else 2) * n)


def test_a_scalar_default_is_spread_over_the_joints():
    joints = (Joint("a", "m", "N"), Joint("b", "rad", "N m"), Joint("c", "m", "N"))
    assert Parameter("x", "1", 2.0, "x", per_joint=True).defaults(joints) == (2.0, 2.0, 2.0)
    assert Parameter("x", "1", (1.0, 2.0, 3.0), "x", per_joint=True).defaults(joints) == (1.0, 2.0, 3.0)
    assert Parameter("x", "1", 2.0, "x").defaults(joints) == (2.0,)
    with pytest.raises(ValueError, match=r"x has 2 defaults, expected one per joint \(a, b, c\)"):
        Parameter("x", "1", (1.0, 2.0), "x", per_joint=True).defaults(joints)
    with pytest.raises(ValueError, match="x has 2 defaults: say per_joint=True"):
        Parameter("x", "1", (1.0, 2.0), "x")


def test_nothing_of_the_papers_arm_leaks_into_another(other_arm):
    """Gains are the mechanism's own or fit its motors and springs; limits and surface are spread."""
    mechanism = MECHANISMS[other_arm]
    n = len(mechanism.joints)
    defaults = {item.name: item.defaults(mechanism.joints) for item in control_parameters(mechanism)}
    critical = 2 * np.sqrt(0.05 * 4.0e3)  # of a motor of 0.05 kg m^2 on a spring of 4 kN m/rad
    np.testing.assert_allclose(defaults["K_f"], [0.5 * critical] * n)
    assert defaults["mu"] == mechanism.control_defaults.get("mu", (5.0,) * n)
    assert defaults["U_max"] == (np.inf,) * n
    assert defaults["a_max"] == (200.0,) * n


def test_names_come_from_the_class():
    assert MECHANISMS["transfer_manipulator"].name == "transfer_manipulator"
    assert {"one_link", "three_links"} <= set(MECHANISMS)


@pytest.mark.parametrize("drive", ["elastic", "rigid"])
def test_power_balance(other_arm, make_model, drive):
    """On a base at rest the energy grows by what the motors do, and by nothing else."""
    model = make_model(structure_of(other_arm, drive))
    n, state = model.system.n, random_state(model.system.n, drive)
    rest = (np.zeros(3),) * 3
    u = np.random.default_rng(2).uniform(-5.0, 5.0, n)
    dx = model("plant", *rest, state, u)
    slope = model.system.function("energy").jacobian()(state, model.defaults, 0)[0]
    driven = state[n : 2 * n] if drive == "rigid" else state[3 * n :]
    assert (np.array(slope) @ dx).item() == pytest.approx(u @ driven, rel=1e-12, abs=1e-10)


def test_mass_matrix_is_symmetric_and_positive_definite(other_arm, make_model):
    model = make_model(structure_of(other_arm))
    n = model.system.n
    for seed in range(20):
        mass = model("mass_matrix", random_state(n, "elastic", seed)[:n]).reshape(n, n)
        np.testing.assert_allclose(mass, mass.T, rtol=1e-14)
        assert np.linalg.eigvalsh(mass).min() > 0


def test_a_single_link_is_the_flexible_joint_benchmark(make_model):
    """Spong's single link, on a base that shakes, written by hand."""
    model = make_model(structure_of("one_link"))
    m, length, inertia, g, rotor, spring = 1.0, 0.5, 0.02, 9.81, 0.05, 4.0e3
    x, u, heave = np.array([0.7, -0.3, 0.75, 0.4]), np.array([12.0]), np.array([2.5, 0.0, 0.0])
    dx = model("plant", np.zeros(3), np.zeros(3), heave, x, u)
    torque = spring * (x[2] - x[0])
    link = (torque - m * (g + 2.5) * length / 2 * np.cos(x[0])) / (inertia + m * (length / 2) ** 2)
    np.testing.assert_allclose(dx, [x[1], link, x[3], (u[0] - torque) / rotor], rtol=1e-13)


def test_a_rigid_drive_is_the_limit_of_stiff_springs(other_arm, make_model):
    """The slow subsystem of the elastic drive is the rigid one, to rounding."""
    n = len(MECHANISMS[other_arm].joints)
    elastic, rigid = make_model(structure_of(other_arm)), make_model(structure_of(other_arm, "rigid"))
    x, u = random_state(n, "rigid"), np.linspace(-3.0, 4.0, n)
    base = [np.array(v) for v in ([0.1, 0.2, -0.3], [0.3, -0.4, 0.5], [1.0, 0.6, -0.7])]
    slow = elastic("slow_dynamics", *base, x[:n], x[n:], u)
    np.testing.assert_allclose(rigid("plant", *base, x, u)[n:], slow, rtol=1e-12)


def test_the_rigid_drive_has_neither_springs_nor_fast_control():
    system = System(structure_of("three_links", "rigid"))
    names = {slot.key for slot in system.slots}
    assert not [key for key in names if "spring" in key or "K_f" in key or key.endswith(".epsilon") or "q_motor" in key]
    assert not {"fast_control", "fast_dynamics", "quasi_steady_force"} & set(system.functions)
    assert system.x.numel() == 6
    assert [system.function("control").name_out(i) for i in range(4)] == ["u", "u_s", "e", "sigma"]


def test_a_start_on_the_reference_stays_on_it(other_arm, make_model):
    """Joints and rates are the reference's, and the springs give the joints its acceleration on the moving base."""
    structure = structure_of(other_arm, start="reference")
    model = make_model(structure)
    n, keys = model.system.n, model.keys
    rng = np.random.default_rng(5)
    moving = {key: rng.uniform(0.1, 1.0) for key in keys if key.startswith(("reference", "base_motion"))}
    p = model.p(moving)
    x = model("start", np.zeros(1), np.zeros(0), p=p)
    w = model("signals", np.zeros(1), np.zeros(0), p=p)
    np.testing.assert_array_equal(x[: 2 * n], w[: 2 * n])
    np.testing.assert_array_equal(x[3 * n :], w[n : 2 * n])
    base = np.split(w[3 * n :], 3)
    dx = model("plant", *base, x, np.zeros(n), p=p)
    np.testing.assert_allclose(dx[n : 2 * n], w[2 * n : 3 * n], rtol=1e-9, atol=1e-9)
