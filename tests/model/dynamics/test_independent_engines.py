"""The model against Pinocchio and MuJoCo, which share no line of code with it (extra: verify).

The base is a chain of massless links there, one for each of its six coordinates: along x, y and z, then about y, z and
x. What the arm's joints need, with that chain led through the base's motion, is what our equations say.
"""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from springline.model.base import COORDINATES
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import ParameterVector
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

BASE = tuple(item.key for item in COORDINATES)  # as w has them
CHAIN = (
    ("surge", "p", (1, 0, 0)),
    ("heave", "p", (0, 1, 0)),
    ("sway", "p", (0, 0, 1)),
    ("yaw", "r", (0, 1, 0)),
    ("pitch", "r", (0, 0, 1)),
    ("roll", "r", (1, 0, 0)),
)
SIX = SignalShape("sine", (1,) * len(BASE))
"""Joints of the base from the inertial frame on: coordinate, kind, axis."""


@pytest.fixture(scope="module")
def pin():
    return pytest.importorskip("pinocchio", reason="pin is not installed: pip install 'springline[verify]'")


@pytest.fixture(scope="module")
def mujoco():
    return pytest.importorskip("mujoco", reason="mujoco is not installed: pip install 'springline[verify]'")


def links_of(mechanism, numbers):
    """The mechanism's links as plain numbers: revolute, parent, origin, frame, axis, mass, com, inertia."""
    vector = ParameterVector()
    p = vector.table("mechanism", mechanism.parameters, mechanism.joints)
    values = [numbers.get(slot.key.removeprefix("mechanism."), slot.default) for slot in vector.slots]
    result = []
    for s in mechanism.segments(p):
        parts = [s.origin, s.frame, s.axis, s.mass, s.com, s.inertia]
        found = [np.array(v) for v in ca.Function("link", [vector.sx], parts)(values)]
        result.append((s.revolute, s.parent, *(v.ravel() if v.shape[1] == 1 else v for v in found)))
    return result


class AsSlide:
    """The paper's arm for those who know neither energies nor ours."""

    @staticmethod
    def links(m2, m3, J, L1, L3):
        return [
            (False, -1, np.array([L1, 0, 0]), np.eye(3), np.array([0, 1, 0]), [m2], np.zeros(3), np.zeros((3, 3))),
            (True, 0, np.zeros(3), np.eye(3), np.array([0, 0, 1]), [m3], np.array([L3, 0, 0]), np.diag([0, 0, J])),
        ]


def pinocchio_model(pin, links, g):
    model, at = pin.Model(), 0
    kinds = {"p": pin.JointModelPrismaticUnaligned, "r": pin.JointModelRevoluteUnaligned}
    for name, kind, axis in CHAIN:
        at = model.addJoint(at, kinds[kind](np.array(axis, dtype=float)), pin.SE3.Identity(), name)
    joints = {-1: at}
    for i, (revolute, parent, origin, frame, axis, mass, com, inertia) in enumerate(links):
        joint = kinds["r" if revolute else "p"](np.array(axis, dtype=float))
        joints[i] = model.addJoint(joints[parent], joint, pin.SE3(frame, origin), f"joint{i}")
        model.appendBodyToJoint(joints[i], pin.Inertia(float(mass[0]), com, inertia), pin.SE3.Identity())
    model.gravity.linear = np.array([0, -g, 0])
    return model


def mujoco_model(mujoco, links, g):
    """MuJoCo compiles no body without mass, and none whose inertia is about one axis: numbers are put in afterwards."""
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, -g, 0]
    body = spec.worldbody
    stand_in = {"mass": 1.0, "inertia": [1.0, 1.0, 1.0], "explicitinertial": True}
    for name, kind, axis in CHAIN:
        body = body.add_body(name=name, **stand_in)
        body.add_joint(name=name, type=_joint(mujoco, kind == "r"), axis=axis)
    bodies = {-1: body}
    for i, (revolute, parent, origin, frame, axis, _, com, _) in enumerate(links):
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(frame).ravel())
        bodies[i] = bodies[parent].add_body(name=f"b{i}", pos=origin, quat=quat, ipos=com, **stand_in)
        bodies[i].add_joint(name=f"j{i}", type=_joint(mujoco, revolute), axis=axis)
    model = spec.compile()
    model.body_mass[:], model.body_inertia[:] = 0.0, 0.0
    model.body_sameframe[:], model.body_simple[:] = 0, 0  # found of the stand-ins
    for i, (_, _, _, _, _, mass, _, inertia) in enumerate(links):
        moments, axes = (np.diag(inertia), np.eye(3)) if np.count_nonzero(inertia) <= 1 else np.linalg.eigh(inertia)
        k = model.body(f"b{i}").id
        model.body_mass[k], model.body_inertia[k] = float(mass[0]), moments
        mujoco.mju_mat2Quat(model.body_iquat[k], np.ascontiguousarray(axes * np.linalg.det(axes)).ravel())
    return model


def _joint(mujoco, revolute):
    return mujoco.mjtJoint.mjJNT_HINGE if revolute else mujoco.mjtJoint.mjJNT_SLIDE


def ours(structure, numbers):
    """(b, db, ddb, q, dq) -> M, C dq, G and what holds ddq at zero, of the system's own functions."""
    system = System(structure)
    p, n, m = parameters(system, numbers), system.n, len(BASE)
    *_, q, dq = symbols = [ca.SX.sym(name, size) for name, size in zip("bvaqd", (m, m, m, n, n), strict=True)]
    coriolis, gravity = system.function("coriolis")(q, dq, p), system.function("gravity")(q, p)
    bias = coriolis + gravity - system.function("base_disturbance")(*symbols, p)
    function = ca.Function("terms", symbols, [system.function("mass_matrix")(q, p), coriolis, gravity, bias])

    def terms(*state):
        mass, *others = function(*state)
        return np.array(mass), *(np.array(other).ravel() for other in others)

    return terms


def parameters(system, numbers):
    """The system's parameters, with the mechanism's own for the plant and for the controller's arm."""
    p = np.array([slot.default for slot in system.slots])
    for k, slot in enumerate(system.slots):
        table, name = slot.key.split(".", 1)
        if table in ("plant", "mechanism") and name in numbers:
            p[k] = numbers[name]
    return p


CHAINS = {"planar": ("planar_arm", 3), "spatial": ("chain", 0)}


@pytest.fixture(params=["paper", "planar", "spatial"])
def arm(request, monkeypatch, make_chain, make_numbers):
    """A structure, numbers of its mechanism, and its links as numbers."""
    if request.param == "paper":
        numbers = {"m2": 10.0, "m3": 40.0, "J": 7.3, "L1": 0.5, "L3": 0.74}
        return Structure(base_motion=SIX), numbers, AsSlide.links(**numbers), 9.8
    name, size = CHAINS[request.param]
    numbers = {}
    if name == "chain":
        monkeypatch.setitem(MECHANISMS, "chain", make_chain("rrprrpr"))
        numbers = make_numbers(7, np.random.default_rng(11))
    mechanism = MECHANISMS[name].of_size(size)
    structure = Structure(
        mechanism=name, size=size, reference=SignalShape("sine", (0,) * len(mechanism.joints)), base_motion=SIX
    )
    return structure, numbers, links_of(mechanism, numbers), 9.81


def states(n, count):
    rng = np.random.default_rng(2)
    for _ in range(count):
        yield [rng.normal(size=len(BASE)) for _ in range(3)] + [rng.normal(size=n), rng.normal(size=n)]


def in_chain(values):
    """Coordinates of the base in the order of CHAIN."""
    return [values[BASE.index(name)] for name, _, _ in CHAIN]


def close(found, wanted, scale, what):
    assert np.abs(found - wanted).max() <= 1e-9 * scale, f"{what}: {found} and {wanted}"


def test_pinocchio(pin, arm):
    structure, numbers, links, g = arm
    model, terms, n, six = pinocchio_model(pin, links, g), ours(structure, numbers), len(links), len(CHAIN)
    data, rest = model.createData(), np.zeros(len(CHAIN))
    for b, db, ddb, q, dq in states(n, 1000):
        mass, coriolis, gravity, bias = terms(b, db, ddb, q, dq)
        still = np.concatenate([rest, q])
        inertia = np.array(pin.crba(model, data, still))
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        close(mass, inertia[six:, six:], np.abs(mass).max(), "M")
        weight = pin.rnea(model, data, still, np.zeros(six + n), np.zeros(six + n))[six:].copy()
        close(gravity, weight, np.abs(weight).max(), "G")
        moved = pin.rnea(model, data, still, np.concatenate([rest, dq]), np.zeros(six + n))[six:].copy()
        close(coriolis, moved - weight, np.abs(moved).max(), "C dq")
        needed = pin.rnea(
            model, data, *(np.concatenate([in_chain(v), w]) for v, w in ((b, q), (db, dq), (ddb, np.zeros(n))))
        )[six:]
        close(bias, needed, np.abs(needed).max(), "C dq + G - S")


def test_mujoco(mujoco, arm, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where MuJoCo keeps a log
    structure, numbers, links, g = arm
    model, terms, n, six = mujoco_model(mujoco, links, g), ours(structure, numbers), len(links), len(CHAIN)
    data = mujoco.MjData(model)
    for b, db, ddb, q, dq in states(n, 200):
        data.qpos, data.qvel = np.concatenate([in_chain(b), q]), np.concatenate([in_chain(db), dq])
        data.qacc = np.concatenate([in_chain(ddb), np.zeros(n)])
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse[six:]
        close(terms(b, db, ddb, q, dq)[3], needed, np.abs(needed).max(), "C dq + G - S")


def test_an_open_loop_of_the_elastic_plant(pin, arm):
    """1 s from rest on a moving base, with Pinocchio's articulated bodies and SciPy's integrator on the other side."""
    structure, numbers, links, g = arm
    system, n = System(structure), len(links)
    model = pinocchio_model(pin, links, g)
    data = model.createData()
    p = parameters(system, numbers)
    keys = [slot.key for slot in system.slots]
    values = {key: p[k] for k, key in enumerate(keys) if key.startswith("plant.")}
    declared = {
        what: [item.name for item in getattr(system.mechanism, what)] for what in ("motor_inertia", "stiffness")
    }
    rotor, spring = (
        np.array([v for name in declared[what] for key, v in values.items()
                  if key == f"plant.{name}" or key.startswith(f"plant.{name}.")])
        for what in ("motor_inertia", "stiffness")
    )  # fmt: skip
    amplitude, omega = 0.3 / np.arange(1, 7), np.linspace(0.7, 1.2, 6)

    def base(t):
        return (
            amplitude * np.sin(omega * t),
            amplitude * omega * np.cos(omega * t),
            -amplitude * omega**2 * np.sin(omega * t),
        )

    def command(t):
        return 3.0 * np.sin(np.arange(1, n + 1) + 2.0 * t)

    def theirs(t, x):
        q1, dq1, q2, dq2 = np.split(x, 4)
        b, db, ddb = base(t)
        force = spring * (q2 - q1)
        # The base is led: its six equations are solved for the forces that lead it, the arm's for its accelerations.
        q, v = np.concatenate([in_chain(b), q1]), np.concatenate([in_chain(db), dq1])
        led = np.concatenate([in_chain(ddb), np.zeros(n)])
        bias = pin.rnea(model, data, q, v, led)[-n:].copy()
        inertia = np.array(pin.crba(model, data, q))[-n:, -n:]
        inertia = np.triu(inertia) + np.triu(inertia, 1).T
        return np.concatenate([dq1, np.linalg.solve(inertia, force - bias), dq2, (command(t) - force) / rotor])

    def mine(t, x):
        return np.array(system.function("plant")(*base(t), x, command(t), p)).ravel()

    start, given = np.tile(0.1 * np.arange(1, n + 1), 4) * np.repeat([1, 0, 1, 0], n), {"rtol": 1e-9, "atol": 1e-10}
    ends = [solve_ivp(f, (0, 1), start, method="DOP853", **given).y[:, -1] for f in (mine, theirs)]
    scale = np.abs(np.split(ends[1], 4)).max(axis=1).repeat(n)
    np.testing.assert_allclose(ends[0] / scale, ends[1] / scale, atol=1e-6)
