"""The tip as seen from ship and earth: against rotation matrices written out, and rates against differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from springline.model.base import COORDINATES
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import Values
from springline.model.quantities import TIP, TIP_RATE
from springline.model.structure import SignalShape, Structure

L1, L3 = 0.5, 0.74


def on_ship(q):
    """The end of a rod of length 2 L3 that turns about a hinge on the lift."""
    y, theta = q
    return np.array([L1 + 2 * L3 * np.cos(theta), y + 2 * L3 * np.sin(theta), 0.0])


def on_earth(q, b):
    shake, pitch, roll = b
    about_z = np.array([[np.cos(pitch), -np.sin(pitch), 0], [np.sin(pitch), np.cos(pitch), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    return np.array([0.0, shake, 0.0]) + about_z @ about_x @ on_ship(q)


@pytest.mark.parametrize("drive", ["elastic", "rigid"])
def test_position_and_rate_at_random_states(drive, make_model, rng):
    model, h = make_model(Structure(drive=drive)), 1e-5
    for _ in range(200):
        x = rng.uniform(-2, 2, 8 if drive == "elastic" else 4)
        b, db = rng.uniform(-1, 1, (2, 3))
        q, dq = x[:2], x[2:4]
        found = model("tip", b, db, x)
        np.testing.assert_allclose(found[:6], [*on_ship(q), *on_earth(q, b)], rtol=0, atol=1e-14)
        late, early = (q + h * dq, b + h * db), (q - h * dq, b - h * db)
        rates = [on_ship(late[0]) - on_ship(early[0]), on_earth(*late) - on_earth(*early)]
        np.testing.assert_allclose(found[6:], np.concatenate(rates) / (2 * h), rtol=0, atol=1e-8)
    assert len(TIP) == len(TIP_RATE) == 6


def test_on_a_ship_that_moves_in_all_six(make_model, rng):
    """Seen from a foot that is mounted elsewhere, turned: SciPy's rotations, and rates as differences."""
    shape = SignalShape("sine", (1,) * 6)
    model, h = make_model(Structure(base_motion=shape, mount=True, mount_rpy=True)), 1e-5
    keys = [item.key for item in COORDINATES]
    foot, rpy = np.array([4.0, 2.0, -1.5]), (0.2, -0.1, 0.7)
    numbers = {f"base_motion.mount.{i}": v for i, v in enumerate(foot)}
    p = model.p(numbers | {f"base_motion.mount_rpy.{i}": v for i, v in enumerate(rpy)})

    def turned(roll, pitch, yaw):
        return Rotation.from_euler("YZX", [yaw, pitch, roll]).as_matrix()

    def seen(q, b):
        at = dict(zip(keys, b, strict=True))
        ship = foot + turned(*rpy) @ on_ship(q)
        along = np.array([at["surge"], at["heave"], at["sway"]])
        return np.concatenate([ship, along + turned(at["roll"], at["pitch"], at["yaw"]) @ ship])

    for _ in range(100):
        x, (b, db) = rng.uniform(-2, 2, 8), rng.uniform(-1, 1, (2, 6))
        found = model("tip", b, db, x, p=p)
        np.testing.assert_allclose(found[:6], seen(x[:2], b), rtol=0, atol=1e-13)
        rates = (seen(x[:2] + h * x[2:4], b + h * db) - seen(x[:2] - h * x[2:4], b - h * db)) / (2 * h)
        np.testing.assert_allclose(found[6:], rates, rtol=0, atol=1e-7)


@pytest.mark.parametrize("n", [1, 3, 7])
def test_a_planar_arm_ends_at_its_last_links_end(make_model, n):
    structure = Structure(mechanism="planar_arm", size=n, reference=SignalShape("sine", (0,) * n))
    model, still = make_model(structure), np.zeros(3)
    q = np.linspace(0.3, -0.5, n)
    angles = np.cumsum(q)
    found = model("tip", still, still, np.concatenate([q, np.zeros(3 * n)]))
    np.testing.assert_allclose(found[:3], [0.5 * np.cos(angles).sum(), 0.5 * np.sin(angles).sum(), 0.0], atol=1e-14)


def test_it_is_the_plants_arm_that_has_it(make_model):
    model = make_model()
    x = np.array([0.1, 0.0, *np.zeros(6)])
    longer = model("tip", np.zeros(3), np.zeros(3), x, p=model.p({"plant.L3": 1.0}))
    assert longer[0] == 2.5
    believed = model("tip", np.zeros(3), np.zeros(3), x, p=model.p({"mechanism.L3": 1.0}))
    assert believed[0] == pytest.approx(0.5 + 2 * 0.74)


@pytest.mark.parametrize(
    ("tip", "text"),
    [
        (lambda q, p: q, "tip: expected 3 x 1, got 2 x 1"),
        (lambda q, p: (q[0], q[1], 0.0), "tip: expected a CasADi SX expression, got tuple"),
    ],
)
def test_what_is_no_point_is_told(tip, text, make_model, monkeypatch):
    arm = MECHANISMS["transfer_manipulator"]
    monkeypatch.setattr(type(arm), "tip", lambda self, q, p: tip(q, p))
    with pytest.raises(ValueError, match="mechanism transfer_manipulator: ") as error:
        make_model().system.functions  # noqa: B018 - it is built on demand
    assert text in str(error.value)


def test_an_arm_need_not_have_one(make_model, monkeypatch):
    arm = MECHANISMS["transfer_manipulator"]
    monkeypatch.setattr(type(arm), "tip", lambda self, q, p: None)
    system = make_model().system
    assert "tip" not in system.functions and "loop_tip" not in system.functions
    assert not [entry.name for entry in system.trajectory if "tip" in entry.name]
    assert isinstance(system._plant, Values)
