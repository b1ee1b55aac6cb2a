"""Shake, pitch and roll at once (E7) against two derivations that share nothing with the model's."""

import mpmath as mp
import numpy as np
import pytest

SAMPLES = 1000


@pytest.fixture
def case(model, rng):
    """Random motions of arm and base, all at once, and random parameters; columns are samples."""
    u = rng.uniform
    q = np.stack([u(-3, 3, SAMPLES), u(-np.pi, np.pi, SAMPLES)])
    dq, ddq = u(-5, 5, (2, SAMPLES)), u(-20, 20, (2, SAMPLES))
    b, db, ddb = u(-1, 1, (3, SAMPLES)), u(-3, 3, (3, SAMPLES)), u(-9, 9, (3, SAMPLES))
    values = {
        "m2": u(1, 50, SAMPLES),
        "m3": u(1, 50, SAMPLES),
        "J": u(0.1, 20, SAMPLES),
        "L1": u(-1, 1, SAMPLES),
        "L3": u(0.1, 2, SAMPLES),
        "g": u(1, 20, SAMPLES),
    }
    p = model.p({f"plant.{name}": value for name, value in values.items()})
    return q, dq, ddq, b, db, ddb, np.array(list(values.values())), p


def model_left_side(model, q, dq, ddq, base, p):
    """M1 ddq + C dq1 + G - S."""
    mass = model("mass_matrix", q, p=p)
    return (
        np.einsum("ij...,j...->i...", mass, ddq)
        + model("coriolis", q, dq, p=p)
        + model("gravity", q, p=p)
        - model("base_disturbance", *base, q, dq, p=p)
    )


def force_scale(q, dq, ddq, b, db, ddb, values):
    """Mass times the largest accelerations around, per joint: what rounding is measured against."""
    m2, m3, J, L1, L3, g = values
    reach = np.abs(L1) + L3 + np.abs(q[0])
    rate = np.abs(db[1]) + np.abs(db[2])
    turn = np.abs(ddb[1]) + np.abs(ddb[2]) + rate**2
    linear = np.abs(ddq[0]) + g + np.abs(ddb[0]) + turn * reach + 2 * rate * np.abs(dq[0])
    angular = np.abs(ddq[1]) + turn + (np.abs(dq[1]) + rate) ** 2
    force = (m2 + m3) * (linear + L3 * angular)
    return np.stack([force, force * L3 + J * angular])


def test_against_sympy(model, inertial, case):
    """Inertial coordinates and Euler-Lagrange by SymPy: with and without the base's motion."""
    q, dq, ddq, b, db, ddb, values, p = case
    rest = (np.zeros_like(b),) * 3
    for base in ((b, db, ddb), rest):
        expected = inertial.left_side(q, dq, ddq, *base, values)
        found = model_left_side(model, q, dq, ddq, base, p)
        error = np.abs(found - expected) / force_scale(q, dq, ddq, *base, values)
        assert np.max(error) < 1e-14


def test_disturbance_against_sympy(model, inertial, case):
    """S = -(left side, base moving - left side, base at rest), whatever the joints' acceleration is."""
    q, dq, ddq, b, db, ddb, values, p = case
    zero = np.zeros_like(b)
    expected = inertial.left_side(q, dq, ddq, zero, zero, zero, values) - inertial.left_side(
        q, dq, ddq, b, db, ddb, values
    )
    found = model("base_disturbance", b, db, ddb, q, dq, p=p)
    error = np.abs(found - expected) / force_scale(q, dq, ddq, b, db, ddb, values)
    assert np.max(error) < 1e-14


def test_combined_is_more_than_the_sum(model, case):
    """The paper's three cases do not add up to it, so the tests here test something new."""
    q, dq, _, b, db, ddb, _, p = case
    together = model("base_disturbance", b, db, ddb, q, dq, p=p)
    single = np.zeros_like(together)
    for i in range(3):
        only = np.zeros((3, 1))
        only[i] = 1
        single += model("base_disturbance", b * only, db * only, ddb * only, q, dq, p=p)
    assert np.median(np.abs(together - single) / np.abs(together)) > 0.1


def test_order_of_the_rotations(model):
    """E7 says pitch, then roll about the pitched x axis. Told apart by where gravity points in base axes."""
    pitch, roll = 0.3, 0.4
    b, zero, q = np.array([0.0, pitch, roll]), np.zeros(3), np.array([0.8, np.pi / 2])
    S = model("base_disturbance", b, zero, zero, q, np.zeros(2))
    # up = inertial Y in base axes; at theta3 = 90 degrees the rotation feels only its x part
    up = np.array([np.sin(pitch), np.cos(pitch) * np.cos(roll), -np.cos(pitch) * np.sin(roll)])
    np.testing.assert_allclose(S, [50 * 9.8 * (1 - up[1]), 40 * 9.8 * 0.74 * up[0]], rtol=1e-13)


def differentiated_left_side(q, dq, ddq, b, db, ddb, values):
    """Euler-Lagrange by numerical differentiation of the positions, with 120 digits.

    Central differences of step 1e-20 err by about 1e-40 relative; three of them are nested.
    """
    m2, m3, J, L1, L3, g = values
    h = mp.mpf(10) ** -20

    def positions(c):
        y, theta, shake, pitch, roll = c
        points = []
        for x0, y0 in ((L1, y), (L1 + L3 * mp.cos(theta), y + L3 * mp.sin(theta))):
            x1, y1, z1 = x0, y0 * mp.cos(roll), y0 * mp.sin(roll)
            points.append(
                (x1 * mp.cos(pitch) - y1 * mp.sin(pitch), shake + x1 * mp.sin(pitch) + y1 * mp.cos(pitch), z1)
            )
        return points

    def hinge(c):
        """Unit vector from the hinge to B3's centroid, inertial axes."""
        _, theta, _, pitch, roll = c
        x, y = mp.cos(theta), mp.sin(theta)
        return (
            x * mp.cos(pitch) - y * mp.cos(roll) * mp.sin(pitch),
            x * mp.sin(pitch) + y * mp.cos(roll) * mp.cos(pitch),
            y * mp.sin(roll),
        )

    def velocity(f, c, dc):
        ahead, behind = (f([x + sign * h * v for x, v in zip(c, dc, strict=True)]) for sign in (1, -1))
        return [(a - z) / (2 * h) for a, z in zip(ahead, behind, strict=True)]

    def lagrangian(c, dc):
        flat = velocity(lambda at: [x for r in positions(at) for x in r], c, dc)
        across = list(c)
        across[1] += mp.pi / 2
        turning = mp.fdot(velocity(hinge, c, dc), hinge(across))  # dtheta3 + omega_z
        kinetic = (m2 * mp.fdot(flat[:3], flat[:3]) + m3 * mp.fdot(flat[3:], flat[3:]) + J * turning**2) / 2
        r2, r3 = positions(c)
        return kinetic - g * (m2 * r2[1] + m3 * r3[1])

    start = [mp.mpf(float(x)) for x in (*q, *b)]
    rates = [mp.mpf(float(x)) for x in (*dq, *db)]
    accelerations = [mp.mpf(float(x)) for x in (*ddq, *ddb)]

    def at(t):
        c = [x + t * v + t * t / 2 * a for x, v, a in zip(start, rates, accelerations, strict=True)]
        return c, [v + t * a for v, a in zip(rates, accelerations, strict=True)]

    def moved(values_, i, by):
        return [x + by if j == i else x for j, x in enumerate(values_)]

    def momentum(i, t):
        c, dc = at(t)
        return (lagrangian(c, moved(dc, i, h)) - lagrangian(c, moved(dc, i, -h))) / (2 * h)

    def force(i):
        c, dc = at(mp.mpf(0))
        slope = (lagrangian(moved(c, i, h), dc) - lagrangian(moved(c, i, -h), dc)) / (2 * h)
        return (momentum(i, h) - momentum(i, -h)) / (2 * h) - slope

    return np.array([float(force(i)) for i in range(2)])


def test_against_numerical_differentiation(model, case):
    """Nothing but the positions of the two centroids and of B3's axis goes in."""
    q, dq, ddq, b, db, ddb, values, p = case
    few = slice(0, 25)
    found = model_left_side(model, q, dq, ddq, (b, db, ddb), p)[:, few]
    with mp.workdps(120):
        expected = [
            differentiated_left_side(*(a[:, k] for a in (q, dq, ddq, b, db, ddb)), [mp.mpf(v) for v in values[:, k]])
            for k in range(25)
        ]
    error = np.abs(found - np.array(expected).T) / force_scale(q, dq, ddq, b, db, ddb, values)[:, few]
    assert np.max(error) < 1e-14
