"""Signals of time: every rate is the derivative of its value, for sums of sines and for tables."""

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_interp_spline

from springline.model.signals import cubic, sine_sum, via_points
from springline.model.structure import SignalShape, Structure

REFERENCE = {"reference.lift.terms.0.amplitude": 1.0, "reference.lift.terms.0.omega": np.pi}


def derivatives_agree(signal, symbol):
    """Largest structural difference of rate and acceleration from AD, as a function of `symbol` and the rest."""
    expressions = [
        ca.jacobian(signal.value, symbol) - signal.rate,
        ca.jacobian(signal.rate, symbol) - signal.acceleration,
    ]
    free = ca.symvar(ca.vertcat(*expressions, symbol))
    return ca.Function("difference", [ca.vertcat(*free)], [ca.vertcat(*expressions)])


def test_sine_sum_derivatives(rng):
    t, numbers = ca.SX.sym("t"), ca.SX.sym("n", 7)
    terms = [tuple(ca.vertsplit(numbers[1 + 3 * k : 4 + 3 * k])) for k in range(2)]
    difference = derivatives_agree(sine_sum(t, numbers[0], terms), t)
    for _ in range(50):
        assert np.max(np.abs(np.array(difference(rng.uniform(-3, 3, difference.size1_in(0)))))) < 1e-13


def test_cubic_derivatives(rng):
    tau, coefficients = ca.SX.sym("tau"), ca.SX.sym("c", 4)
    difference = derivatives_agree(cubic(tau, coefficients), tau)
    for _ in range(50):
        assert np.max(np.abs(np.array(difference(rng.uniform(-3, 3, difference.size1_in(0)))))) < 1e-13


def test_the_papers_reference(make_model):
    """q1d = [sin pi t, 1 + sin(pi t / 2)], so dq1d(0) = (pi, pi/2); base at rest."""
    model = make_model()
    p = model.p(REFERENCE | {
        "reference.rotation.offset": 1.0,
        "reference.rotation.terms.0.amplitude": 1.0,
        "reference.rotation.terms.0.omega": np.pi / 2,
    })  # fmt: skip
    for t in (0.0, 0.3, 2.7):
        w = model("signals", t, np.zeros(0), p=p)
        a, b = np.pi * t, np.pi * t / 2
        expected = [np.sin(a), 1 + np.sin(b), np.pi * np.cos(a), np.pi / 2 * np.cos(b)]
        expected += [-(np.pi**2) * np.sin(a), -(np.pi**2) / 4 * np.sin(b)]
        np.testing.assert_allclose(w, [*expected, *np.zeros(9)], atol=1e-14)


def test_base_motion_is_a_sum_of_its_terms(make_model, rng):
    """Two shakes, no pitch, one roll: value, rate and acceleration in their places of w."""
    model = make_model(Structure(base_motion=SignalShape("sine", (2, 0, 1))))
    numbers = {}
    for key, count in (("heave", 2), ("roll", 1)):
        for k in range(count):
            for name in ("amplitude", "omega", "phase"):
                numbers[f"base_motion.{key}.{k}.{name}"] = rng.uniform(0.1, 3)
    p, t = model.p(numbers), 1.3
    b, db, ddb = np.split(model("signals", t, np.zeros(0), p=p)[6:], 3)

    def term(key, k, derivative):
        amplitude, omega, phase = (numbers[f"base_motion.{key}.{k}.{n}"] for n in ("amplitude", "omega", "phase"))
        return amplitude * omega**derivative * np.sin(omega * t + phase + derivative * np.pi / 2)

    for derivative, found in enumerate((b, db, ddb)):
        expected = [term("heave", 0, derivative) + term("heave", 1, derivative), 0.0, term("roll", 0, derivative)]
        np.testing.assert_allclose(found, expected, atol=1e-13)


def spline_blocks(knots, values):
    """Coefficients, lowest power first, of the C2 cubic through the points, one row per interval."""
    return CubicSpline(knots, values).c[::-1].T


@pytest.fixture
def table(make_model):
    """Lift reference and shake, roll from tables (no rotation, no pitch), and the splines they come from."""
    structure = Structure(reference=SignalShape("table", (1, 0)), base_motion=SignalShape("table", (1, 0, 1)))
    knots = np.linspace(0, 5, 26)
    signals = {"lift": np.sin(knots), "shake": np.cos(2 * knots), "roll": 0.1 * knots**2 - np.sin(3 * knots)}
    return make_model(structure), knots, signals


def test_layout_of_tables(table):
    """d holds, per table, tau and then four coefficients for each channel."""
    model, _, _ = table
    reference, base = model.system.tables
    assert (reference.signal, reference.start, reference.channels) == ("reference", 0, (0,))
    assert (base.signal, base.start, base.channels) == ("base_motion", 5, (0, 2))
    assert model.system.d.numel() == 14


def table_data(knots, signals, interval, tau):
    blocks = {name: spline_blocks(knots, values)[interval] for name, values in signals.items()}
    return np.concatenate([[tau], blocks["lift"], [tau], blocks["shake"], blocks["roll"]])


def test_tables_are_their_splines(table, rng):
    model, knots, signals = table
    for _ in range(50):
        t = rng.uniform(0, 5)
        interval = min(int(t / 0.2), 24)
        w = model("signals", t, table_data(knots, signals, interval, t - knots[interval]))
        for derivative in range(3):
            lift, shake, roll = (CubicSpline(knots, signals[n])(t, derivative) for n in ("lift", "shake", "roll"))
            np.testing.assert_allclose(w[2 * derivative : 2 * derivative + 2], [lift, 0], atol=1e-12)
            start = 6 + 3 * derivative
            np.testing.assert_allclose(w[start : start + 3], [shake, 0, roll], atol=1e-12)


def test_acceleration_is_continuous_at_the_knots(table):
    """Entered from the left (tau = step) and from the right (tau = 0) a knot gives the same w."""
    model, knots, signals = table
    for k in range(1, 25):
        left = model("signals", knots[k], table_data(knots, signals, k - 1, knots[k] - knots[k - 1]))
        right = model("signals", knots[k], table_data(knots, signals, k, 0.0))
        np.testing.assert_allclose(left, right, atol=1e-11)


def via(times, values):
    """The polynomial reference as a function of t: value, rate, acceleration."""
    t = ca.SX.sym("t")
    signal = via_points(t, [ca.SX(x) for x in times], [ca.SX(x) for x in values])
    return ca.Function("via", [t], [signal.value, signal.rate, signal.acceleration])


def test_two_points_are_the_quintic_of_least_jerk():
    found = via([0.5, 2.5], [0.8, -1.0])
    for t in (0.5, 0.9, 1.7, 2.5):
        s = (t - 0.5) / 2.0
        expected = (
            0.8 - 1.8 * (10 * s**3 - 15 * s**4 + 6 * s**5),
            -1.8 * (30 * s**2 - 60 * s**3 + 30 * s**4) / 2.0,
            -1.8 * (60 * s - 180 * s**2 + 120 * s**3) / 4.0,
        )
        np.testing.assert_allclose([float(x) for x in found(t)], expected, atol=1e-13)


@pytest.mark.parametrize("count", [3, 4, 7])
def test_via_points_are_joined_by_the_quintic_spline_at_rest_at_both_ends(count, rng):
    times, values = np.cumsum(rng.uniform(0.2, 1.5, count)), rng.uniform(-2, 2, count)
    rest = [(1, 0.0), (2, 0.0)]
    spline = make_interp_spline(times, values, k=5, bc_type=(rest, rest))
    found = via(times, values)
    for t in np.linspace(times[0], times[-1], 57):
        value, rate, acceleration = (float(x) for x in found(t))
        scale = np.abs(spline.derivative(2)(np.linspace(times[0], times[-1], 500))).max()
        assert value == pytest.approx(float(spline(t)), abs=1e-9)
        assert rate == pytest.approx(float(spline.derivative()(t)), abs=1e-9 * scale)
        assert acceleration == pytest.approx(float(spline.derivative(2)(t)), abs=1e-9 * scale)


def test_outside_its_points_a_polynomial_stands_still_exactly():
    found = via([0.0, 1.0, 2.0], [0.3, 0.9, 0.1])
    for t, value in ((-5.0, 0.3), (0.0, 0.3), (2.0, 0.1), (2.0000001, 0.1), (1e9, 0.1)):
        assert [float(x) for x in found(t)] == [value, 0.0, 0.0]
    assert [float(x) for x in via([3.0], [0.7])(1.0)] == [0.7, 0.0, 0.0]
