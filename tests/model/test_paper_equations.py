"""The derived M1, C dq1, G, S against the paper's lines, term by term (Guo et al. 2023, section 2, errata E1)."""

import numpy as np
import pytest

SAMPLES = 1000
TOLERANCE = 1e-12  # of the largest term of the line


class Sample:
    """Random states, base motions and parameters, one per column."""

    def __init__(self, model, rng, *, moving=()):
        u = rng.uniform
        self.q = np.stack([u(-3, 3, SAMPLES), u(-np.pi, np.pi, SAMPLES)])
        self.dq = u(-5, 5, (2, SAMPLES))
        self.b, self.db, self.ddb = (np.zeros((3, SAMPLES)) for _ in range(3))
        for i in moving:
            self.b[i], self.db[i], self.ddb[i] = u(-1, 1, SAMPLES), u(-3, 3, SAMPLES), u(-9, 9, SAMPLES)
        self.m2, self.m3, self.J = u(1, 50, SAMPLES), u(1, 50, SAMPLES), u(0.1, 20, SAMPLES)
        self.L1, self.L3, self.g = u(-1, 1, SAMPLES), u(0.1, 2, SAMPLES), u(1, 20, SAMPLES)
        names = ("m2", "m3", "J", "L1", "L3", "g")
        self.p = model.p({f"plant.{name}": getattr(self, name) for name in names})
        self.base = (self.b, self.db, self.ddb)
        self.y, self.theta = self.q
        self.dy, self.dtheta = self.dq
        self.sin, self.cos = np.sin(self.theta), np.cos(self.theta)


def agree(derived, *terms):
    """`derived` is the sum of `terms` to TOLERANCE of the largest of them, at every sample."""
    terms = [np.broadcast_to(term, derived.shape) for term in terms]
    scale = np.maximum(np.max(np.abs(terms), axis=0), np.finfo(float).tiny)
    error = np.max(np.abs(derived - np.sum(terms, axis=0)) / scale)
    assert error < TOLERANCE


def disturbance_shake(s):
    """S1s, S2s."""
    acceleration = s.ddb[0]
    return [-(s.m2 + s.m3) * acceleration], [-s.m3 * s.L3 * s.cos * acceleration]


def disturbance_pitch(s):
    """S1p, S2p."""
    angle, rate, acceleration = s.b[1], s.db[1], s.ddb[1]
    first = [
        -s.m2 * s.L1 * acceleration,
        -s.m3 * s.L1 * acceleration,
        -s.m3 * s.L3 * s.cos * acceleration,
        2 * s.m3 * s.L3 * s.sin * rate * s.dtheta,
        s.m2 * s.y * rate**2,
        s.m3 * s.y * rate**2,
        s.m3 * s.L3 * s.sin * rate**2,
        -(s.m2 + s.m3) * s.g * np.cos(angle),
        (s.m2 + s.m3) * s.g,
    ]
    second = [
        -s.J * acceleration,
        -s.m3 * s.L3**2 * acceleration,
        -s.m3 * s.L1 * s.L3 * s.cos * acceleration,
        -s.m3 * s.L3 * s.y * s.sin * acceleration,
        -2 * s.m3 * s.L3 * s.sin * rate * s.dy,
        -s.m3 * s.L1 * s.L3 * s.sin * rate**2,
        s.m3 * s.L3 * s.y * s.cos * rate**2,
        -s.m3 * s.g * s.L3 * np.cos(angle + s.theta),
        s.m3 * s.g * s.L3 * s.cos,
    ]
    return first, second


def disturbance_roll(s):
    """S1r, S2r as derived (E1)."""
    angle, rate = s.b[2], s.db[2]
    first = [
        (s.m2 + s.m3) * s.y * rate**2,
        s.m3 * s.L3 * s.sin * rate**2,
        -(s.m2 + s.m3) * s.g * np.cos(angle),
        (s.m2 + s.m3) * s.g,
    ]
    second = [
        s.m3 * s.L3 * s.cos * s.y * rate**2,
        s.m3 * s.L3 * s.cos * s.L3 * s.sin * rate**2,
        -s.m3 * s.g * s.L3 * np.cos(angle) * s.cos,
        s.m3 * s.g * s.L3 * s.cos,
    ]
    return first, second


def printed_roll(s):
    """S1r, S2r as the paper prints them."""
    angle, rate = s.b[2], s.db[2]
    first = [
        (s.m2 + s.m3) * s.y * rate**2,
        s.m3 * s.L3 * s.sin * rate**2,
        (s.m2 + s.m3) * s.g * np.cos(angle),
        -(s.m2 + s.m3) * s.g,
    ]
    second = [
        s.m3 * s.y * rate**2,
        s.m3 * s.L3 * s.sin * rate**2,
        -s.m3 * s.g * s.L3 * np.cos(angle) * s.cos,
        s.m3 * s.g * s.L3 * s.cos,
    ]
    return first, second


def test_mass_matrix(model, rng):
    s = Sample(model, rng)
    mass = model("mass_matrix", s.q, p=s.p)
    agree(mass[0, 0], s.m2, s.m3)
    agree(mass[0, 1], s.m3 * s.L3 * s.cos)
    agree(mass[1, 0], s.m3 * s.L3 * s.cos)
    agree(mass[1, 1], s.m3 * s.L3**2, s.J)


def test_coriolis(model, rng):
    s = Sample(model, rng)
    coriolis = model("coriolis", s.q, s.dq, p=s.p)
    agree(coriolis[0], -s.m3 * s.L3 * s.sin * s.dtheta**2)
    assert np.all(coriolis[1] == 0.0)


def test_gravity(model, rng):
    s = Sample(model, rng)
    gravity = model("gravity", s.q, p=s.p)
    agree(gravity[0], (s.m2 + s.m3) * s.g)
    agree(gravity[1], s.m3 * s.g * s.L3 * s.cos)


@pytest.mark.parametrize(
    ("oscillation", "lines"),
    [(0, disturbance_shake), (1, disturbance_pitch), (2, disturbance_roll)],
    ids=["shake", "pitch", "roll"],
)
def test_base_disturbance(model, rng, oscillation, lines):
    s = Sample(model, rng, moving=[oscillation])
    derived = model("base_disturbance", *s.base, s.q, s.dq, p=s.p)
    for joint, terms in enumerate(lines(s)):
        agree(derived[joint], *terms)


def test_base_at_rest_disturbs_nothing(model, rng):
    s = Sample(model, rng)
    assert np.all(model("base_disturbance", *s.base, s.q, s.dq, p=s.p) == 0.0)


def test_a_constant_shake_and_its_rate_disturb_nothing(model, rng):
    s = Sample(model, rng, moving=[0])
    still = (s.b, s.db, np.zeros_like(s.ddb))
    assert np.all(model("base_disturbance", *still, s.q, s.dq, p=s.p) == 0.0)


@pytest.mark.parametrize(
    ("oscillation", "lines"), [(0, disturbance_shake), (1, disturbance_pitch)], ids=["shake", "pitch"]
)
def test_a_slight_motion_keeps_its_digits(model, rng, oscillation, lines):
    """S is derived without the weight, so its rounding does not hide what a base that hardly moves does."""
    s = Sample(model, rng, moving=[oscillation])
    s.b *= 0.0
    s.db *= 0.0
    s.ddb *= 1e-9
    derived = model("base_disturbance", *s.base, s.q, s.dq, p=s.p)
    for joint, terms in enumerate(lines(s)):
        small = [term for term in terms if np.max(np.abs(term)) < 1e-3]
        agree(derived[joint], *small)


def test_roll_acceleration_disturbs_nothing(model, rng):
    """Both centroids lie in the plane z = 0, so the roll's angular acceleration pushes across the joints."""
    s = Sample(model, rng, moving=[2])
    derived = model("base_disturbance", *s.base, s.q, s.dq, p=s.p)
    without = model("base_disturbance", s.b, s.db, np.zeros_like(s.ddb), s.q, s.dq, p=s.p)
    np.testing.assert_array_equal(derived, without)


def test_printed_roll_lines_differ_by_the_erratum(model, rng):
    """E1: S1r's gravity pair has the opposite sign, S2r's rate terms lost the factor L3 cos theta3."""
    s = Sample(model, rng, moving=[2])
    derived = model("base_disturbance", *s.base, s.q, s.dq, p=s.p)
    printed = printed_roll(s)
    angle, rate = s.b[2], s.db[2]
    gravity = 2 * (s.m2 + s.m3) * s.g
    agree(sum(printed[0]) - derived[0], gravity * np.cos(angle), -gravity, *zero_sum(printed[0]))
    lost = 1 - s.L3 * s.cos
    agree(
        sum(printed[1]) - derived[1],
        s.m3 * rate**2 * s.y * lost,
        s.m3 * rate**2 * s.L3 * s.sin * lost,
        *zero_sum(printed[1]),
    )
    for line, own in zip(printed, derived, strict=True):
        assert np.median(np.abs(sum(line) - own) / np.max(np.abs(line), axis=0)) > 0.1


def zero_sum(terms):
    """Terms and their negatives: they add nothing but their size, against which rounding is measured."""
    return [sign * term for term in terms for sign in (1, -1)]


def test_erratum_in_numbers(model):
    """Table 3's arm at (0.8 m, 0.5 rad), roll of 0.2 rad at 0.5 rad/s: what the print is off by, N and N m."""
    zero = np.zeros(3)
    q, dq, b, db = np.array([0.8, 0.5]), np.zeros(2), np.array([0, 0, 0.2]), np.array([0, 0, 0.5])
    derived = model("base_disturbance", b, db, zero, q, dq)
    s = Sample.__new__(Sample)
    s.m2, s.m3, s.L3, s.g, s.y, s.sin, s.cos = 10.0, 40.0, 0.74, 9.8, 0.8, np.sin(0.5), np.cos(0.5)
    s.b, s.db = b, db
    difference = np.array([sum(line) for line in printed_roll(s)]) - derived
    np.testing.assert_allclose(derived, [23.3151, 12.5737], rtol=1e-5)
    np.testing.assert_allclose(difference, [-19.5347, 4.0485], rtol=1e-4)
