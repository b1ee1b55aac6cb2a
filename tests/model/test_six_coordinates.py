"""Six coordinates of the base and an arm that is mounted anywhere on it, against derivations of their own."""

import casadi as ca
import mpmath as mp
import numpy as np
import pytest

from springline.model.base import COORDINATES, BaseState, moving, shortest
from springline.model.structure import SignalShape, Structure

SIX = SignalShape("sine", (1, 1, 1, 1, 1, 1))
MOUNTED = Structure(base_motion=SIX, mount=True, mount_rpy=True)
HEAVE, PITCH, ROLL, SURGE, SWAY, YAW = range(6)
ARM = ("m2", "m3", "J", "L1", "L3", "g")
SAMPLES = 300


@pytest.fixture(scope="module")
def mounted(make_model):
    return make_model(MOUNTED)


def felt(b, db, ddb, mount=None, rpy=None, g=9.8, keys=("heave", "pitch", "roll", "surge", "sway", "yaw")):
    """omega, alpha, specific, excess and rest force, (15,), that the model gives."""
    coordinates = tuple(c for c in COORDINATES if c.key in keys)
    symbols = [ca.SX.sym(name, len(coordinates)) for name in ("b", "db", "ddb")]
    at, turn = ca.SX.sym("mount", 3), ca.SX.sym("rpy", 3)
    base = BaseState(*symbols, coordinates, None if mount is None else at, None if rpy is None else turn)
    outputs = [base.omega, base.alpha, base.specific_force(g), base.excess_force(g), base.rest_force(ca.SX(g))]
    function = ca.Function("felt", [*symbols, at, turn], [ca.vertcat(*outputs)])
    values = [[row[i] for i, c in enumerate(COORDINATES) if c in coordinates] for row in (b, db, ddb)]
    zero = np.zeros(3)
    return function(*values, zero if mount is None else mount, zero if rpy is None else rpy).full()[:, 0]


def about(axis, angle):
    """Rodrigues' formula for a rotation about a unit axis."""
    x, y, z = axis
    cross = mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return mp.eye(3) + mp.sin(angle) * cross + (1 - mp.cos(angle)) * cross**2


def in_order(roll, pitch, yaw):
    return about((0, 1, 0), yaw) * about((0, 0, 1), pitch) * about((1, 0, 0), roll)


def differentiated(b, db, ddb, mount, rpy, g):
    """The same by numerical differentiation of the rotation and of the place of the arm's foot, with 60 digits."""
    b, db, ddb, mount, rpy = ([mp.mpf(float(x)) for x in values] for values in (b, db, ddb, mount, rpy))
    h = mp.mpf(10) ** -12

    def pose(t):
        heave, pitch, roll, surge, sway, yaw = (x + t * v + t * t / 2 * a for x, v, a in zip(b, db, ddb, strict=True))
        turned = in_order(roll, pitch, yaw)
        return mp.matrix([surge, heave, sway]) + turned * mp.matrix(mount), turned * in_order(*rpy)

    def spin(t):
        rate = pose(t)[1].T * (pose(t + h)[1] - pose(t - h)[1]) / (2 * h)
        return mp.matrix([rate[2, 1], rate[0, 2], rate[1, 0]])

    place = [pose(t)[0] for t in (-h, 0, h)]
    acceleration = (place[0] - 2 * place[1] + place[2]) / h**2
    force = pose(0)[1].T * (acceleration + mp.matrix([0, g, 0]))
    rest = in_order(*rpy).T * mp.matrix([0, g, 0])
    parts = [spin(0), (spin(h) - spin(-h)) / (2 * h), force, force - rest, rest]
    return np.array([float(x) for part in parts for x in part])


def random_motion(rng):
    return rng.uniform(-1, 1, 6), rng.uniform(-2, 2, 6), rng.uniform(-5, 5, 6)


def test_the_measuring_unit_reads_what_differentiation_gives(rng):
    with mp.workdps(60):
        for _ in range(40):
            motion, mount, rpy = random_motion(rng), rng.uniform(-20, 20, 3), rng.uniform(-3, 3, 3)
            expected = differentiated(*motion, mount, rpy, 9.8)
            assert np.max(np.abs(felt(*motion, mount, rpy) - expected)) < 1e-13 * np.max(np.abs(expected))


@pytest.mark.parametrize("key", [c.key for c in COORDINATES])
def test_what_does_not_move_need_not_be_there(rng, key):
    """Of the paper's three it always is; whatever is left out reads as one that stands at zero."""
    motion = random_motion(rng)
    for row in motion:
        row[[c.key == key for c in COORDINATES]] = 0.0
    others = [c.key for c in COORDINATES if c.key != key]
    mount, rpy = rng.uniform(-3, 3, 3), rng.uniform(-3, 3, 3)
    np.testing.assert_allclose(felt(*motion, mount, rpy, keys=others), felt(*motion, mount, rpy), rtol=0, atol=1e-13)
    zero = np.zeros(3)
    assert np.array_equal(felt(*motion), felt(*motion, zero, zero)), "a mount that is zero changes no bit"


def test_the_rotation_is_yaw_then_pitch_then_roll():
    pitch, roll, yaw = 0.3, -0.5, 0.9
    b = ca.SX.sym("b", 6)
    rotation = ca.Function("R", [b], [BaseState(b, b, b, COORDINATES).rotation])
    with mp.workdps(30):
        expected = np.array(in_order(roll, pitch, yaw).tolist(), dtype=float)
    np.testing.assert_allclose(rotation([0, pitch, roll, 0, 0, yaw]).full(), expected, atol=1e-15)


def test_signs():
    """What a passenger would say: which way the bow, the mast and what stands on deck go."""
    b = ca.SX.sym("b", 6)
    rotation = ca.Function("R", [b], [BaseState(b, b, b, COORDINATES).rotation])

    def goes(axis, coordinate):
        angles = np.zeros(6)
        angles[coordinate] = 0.1
        return np.sign(np.round(rotation(angles).full()[:, axis] - np.eye(3)[axis], 12)).astype(int).tolist()

    forward, upward = 0, 1
    assert goes(forward, PITCH) == [-1, 1, 0], "bow up"
    assert goes(upward, ROLL) == [0, -1, 1], "mast to starboard"
    assert goes(forward, YAW) == [-1, 0, -1], "bow to port"
    for coordinate, axis in ((SURGE, 0), (HEAVE, 1), (SWAY, 2)):
        ddb = np.zeros(6)
        ddb[coordinate] = 1.0
        force = felt(np.zeros(6), np.zeros(6), ddb)[6:9]
        assert force.tolist() == (np.eye(3)[axis] + [0, 9.8, 0]).tolist()


def test_a_mirrored_motion_is_felt_mirrored(rng):
    """Port and starboard are alike: z changes its sign, and so do sway, rotations about x and y, and z of the foot."""
    flipped = np.array([1, 1, -1, 1, -1, -1])
    motion, mount, rpy = random_motion(rng), rng.uniform(-5, 5, 3), rng.uniform(-1, 1, 3)
    vector, turn = np.array([1, 1, -1]), np.array([-1, -1, 1])
    mirrored = felt(*(flipped * row for row in motion), vector * mount, [-1, 1, -1] * rpy)
    signs = np.concatenate([turn, turn, vector, vector, vector])
    np.testing.assert_allclose(mirrored, signs * felt(*motion, mount, rpy), rtol=0, atol=1e-12)


def test_heading_is_felt_by_nobody(rng):
    """A ship that sails another way, with its surge and sway turned along, feels the same."""
    b, db, ddb = random_motion(rng)
    turn = 0.7
    other = [row.copy() for row in (b, db, ddb)]
    other[0][YAW] += turn
    for row in other:
        surge, sway = row[SURGE], row[SWAY]
        row[SURGE], row[SWAY] = np.cos(turn) * surge + np.sin(turn) * sway, np.cos(turn) * sway - np.sin(turn) * surge
    np.testing.assert_allclose(felt(*other), felt(b, db, ddb), rtol=0, atol=1e-13)


# The arm on it


@pytest.fixture
def case(mounted, rng):
    """Random motions of arm and base, mounts and parameters; columns are samples."""
    u = rng.uniform
    q, dq = np.stack([u(-3, 3, SAMPLES), u(-np.pi, np.pi, SAMPLES)]), u(-5, 5, (2, SAMPLES))
    base = u(-1, 1, (6, SAMPLES)), u(-3, 3, (6, SAMPLES)), u(-9, 9, (6, SAMPLES))
    low, high = np.array([1, 1, 0.1, -1, 0.1, 1]), np.array([50, 50, 20, 1, 2, 20])
    values = {name: u(a, b, SAMPLES) for name, a, b in zip(ARM, low, high, strict=True)}
    mount, rpy = u(-5, 5, (3, SAMPLES)), u(-3, 3, (3, SAMPLES))
    given = {f"base_motion.mount.{i}": row for i, row in enumerate(mount)}
    given |= {f"base_motion.mount_rpy.{i}": row for i, row in enumerate(rpy)}
    p = mounted.p({**given, **{f"{table}.{k}": v for table in ("plant", "mechanism") for k, v in values.items()}})
    return q, dq, base, np.concatenate([list(values.values()), mount, rpy]), p


def scale_of(q, values, base):
    """Mass times the largest accelerations around, per joint: what rounding is measured against."""
    mass, reach = values[0] + values[1], 12 + np.abs(q[0])
    turn = (
        sum(np.abs(base[2][k]) for k in (PITCH, ROLL, YAW)) + sum(np.abs(base[1][k]) for k in (PITCH, ROLL, YAW)) ** 2
    )
    force = mass * (40 + values[5] + (turn + 30) * reach)
    return np.stack([force, force * 2 + values[2] * (turn + 50)])


def test_against_sympy(mounted, inertial_of_six, case, rng):
    """Inertial coordinates and Euler-Lagrange by SymPy, base moving and at rest: M, C, G and S."""
    q, dq, base, values, p = case
    ddq, zero = rng.uniform(-20, 20, q.shape), np.zeros((6, SAMPLES))
    level = np.einsum("ij...,j...->i...", mounted("mass_matrix", q, p=p), ddq)
    level += mounted("coriolis", q, dq, p=p) + mounted("gravity", q, p=p)
    at_rest = inertial_of_six.left_side(q, dq, ddq, zero, zero, zero, values)
    moved = inertial_of_six.left_side(q, dq, ddq, *base, values)
    disturbance = mounted("base_disturbance", *base, q, dq, p=p)
    scale = scale_of(q, values, base)
    assert np.max(np.abs(level - at_rest) / scale) < 1e-15
    assert np.max(np.abs(disturbance - (at_rest - moved)) / scale) < 1e-15


def test_the_moving_plant_is_what_its_parts_say(mounted, case, rng):
    """The plant's one expression for C dq + G - S, and the controller's G, which knows how the arm stands."""
    q, dq, base, values, p = case
    x = np.concatenate([q, dq, q, dq])
    u = rng.uniform(-100, 100, (2, SAMPLES))
    mass = mounted("mass_matrix", q, p=p)
    bias = mounted("coriolis", q, dq, p=p) + mounted("gravity", q, p=p) - mounted("base_disturbance", *base, q, dq, p=p)
    found = np.einsum("ij...,j...->i...", mass, mounted("plant", *base, x, u, p=p)[2:4])
    assert np.max(np.abs(found + bias) / scale_of(q, values, base)) < 1e-13
    nominal = mounted.system.function("control")
    rest = np.concatenate([q[:, 0], dq[:, 0], np.zeros(2)]), np.concatenate([q[:, 0], dq[:, 0], q[:, 0], dq[:, 0]])
    command = nominal(*np.split(rest[0], 3), rest[1], p[:, 0])[1].full()[:, 0]
    weight = (mounted("coriolis", q, dq, p=p) + mounted("gravity", q, p=p))[:, 0]
    np.testing.assert_allclose(command, weight, rtol=1e-12)


def test_power_balance(mounted, inertial_of_six, case, rng):
    """dE/dt = motor power + power through the base, the latter from Newton and Euler's laws."""
    q, dq, base, values, p = case
    x = np.concatenate([q, dq, q + rng.uniform(-1e-3, 1e-3, q.shape), rng.uniform(-1, 1, q.shape)])
    u = rng.uniform(-500, 500, (2, SAMPLES))
    dx = mounted("plant", *base, x, u, p=p)
    get = {key: value[0] for key, value in zip(mounted.keys, p, strict=True)}
    inertia = np.array([get["plant.m_l"], get["plant.I"]])
    spring = np.array([[get["plant.k_s2"]], [get["plant.k_s3"]]]) * (x[4:6] - x[:2])
    motion = (q, dq, dx[2:4], *base, values)
    stored = inertia @ (x[6:] * dx[6:]) + np.sum(spring * (x[6:] - x[2:4]), axis=0)
    supplied = np.sum(u * x[6:], axis=0) + inertial_of_six.base_power(*motion)
    change = inertial_of_six.power(*motion) + stored
    scale = np.abs(supplied) + np.abs(change) + np.sum(np.abs(spring * dq), axis=0) + 1e3
    assert np.median(np.abs(inertial_of_six.base_power(*motion))) > 100.0
    assert np.max(np.abs(change - supplied) / scale) < 1e-12


def test_energy_counts_height_from_the_foot_along_the_real_vertical(mounted, inertial_of_six, case):
    q, dq, _, values, p = case
    x, zero = np.concatenate([q, dq, q, 0 * q]), np.zeros((6, SAMPLES))
    foot = (values[0] + values[1]) * values[5] * values[7]
    expected = inertial_of_six.energy(q, dq, 0 * q, zero, zero, zero, values) - foot
    assert np.max(np.abs(mounted("energy", x, p=p) - expected) / (np.abs(expected) + np.abs(foot) + 100)) < 1e-13


def test_without_the_others_the_paper_is_left(model, make_model, rng):
    """S of six coordinates, three of which stand still, is S of the paper's three."""
    six = make_model(Structure(base_motion=SIX))
    q, dq = rng.uniform(-2, 2, (2, 100)), rng.uniform(-3, 3, (2, 100))
    three = [rng.uniform(-1, 1, (3, 100)) for _ in range(3)]
    wide = [np.concatenate([row, np.zeros((3, 100))]) for row in three]
    few, many = (m("base_disturbance", *b, q, dq) for m, b in ((model, three), (six, wide)))
    np.testing.assert_allclose(many, few, rtol=1e-12, atol=1e-12 * np.max(np.abs(few)))


def test_on_the_level_a_zero_tilt_gives_the_same_weight(model, make_model, rng):
    turned = make_model(Structure(base_motion=SIX, mount=True, mount_rpy=True))
    q = rng.uniform(-2, 2, (2, 50))
    np.testing.assert_allclose(turned("gravity", q), model("gravity", q), rtol=1e-15)
    upside = turned("gravity", q, p=turned.p({"base_motion.mount_rpy.0": np.full(50, np.pi)}))
    np.testing.assert_allclose(upside, -model("gravity", q), rtol=1e-12)


# What is structure


def test_only_what_moves_is_there(make_model):
    assert [c.key for c in moving((0, 0, 0))] == ["heave", "pitch", "roll"]
    assert [c.key for c in moving((0, 0, 0, 0, 2))] == ["heave", "pitch", "roll", "sway"]
    assert shortest((0, 1, 0, 0, 0, 0)) == (0, 1, 0) and shortest((0, 0, 0, 0, 1, 0)) == (0, 0, 0, 0, 1)
    system = make_model(Structure(base_motion=SignalShape("sine", (0, 1, 0, 0, 2)))).system
    assert system.w.numel() == 3 * system.n + 3 * 4
    names = [entry.name for entry in system.trajectory]
    first = names.index("y_r1")
    assert names[first : names.index("tip_x_ship")] == ["y_r1", "theta_1z", "theta_1x", "sway"]
    keys = [slot.key for slot in system.slots]
    assert "base_motion.sway.1.omega" in keys and not any("mount" in key or "surge" in key for key in keys)
    assert "base_motion.mount_rpy.2" in [slot.key for slot in make_model(MOUNTED).system.slots]
