"""Surface, reaching laws and their limits (section 4, errata E3, E4, E8)."""

import math
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest

from springline.model.control import LAWS, ArmModel, Law, SurfaceExponents
from springline.model.control.reaching import reaching_rate
from springline.model.control.sliding import surface
from springline.model.control.terminal_sliding import TerminalSliding
from springline.model.drive import DRIVES
from springline.model.dynamics import equations_of_motion
from springline.model.parameters import Values
from springline.model.structure import Structure
from springline.model.system import System

EXPONENTS = [(3, 1, 1, 3), (5, 3, 3, 5), (7, 5, 5, 7), (5, 1, 1, 5), (7, 3, 5, 9), (9, 7, 1, 9), (5, 3, 1, 11)]
LAW_NAMES = ["variable_power_log", "double_power", "power"]
TABLE_3 = {
    "k1": 3.0, "k2": 5.0, "k3": 12.0, "alpha": 0.5, "beta": 5.0, "epsilon_log": 10.0, "nu": 2.0, "zeta": 0.9,
}  # fmt: skip


def surface_of_one_joint(exponents, delta, mu=12.0, lam=5.0):
    """CasADi function (e, de) -> sigma, the slope that the control cancels, and both by automatic differentiation."""
    e, de = ca.SX.sym("e"), ca.SX.sym("de")
    p = Values({"mu": ca.SX(mu), "lambda": ca.SX(lam), "delta": ca.SX(delta)})
    sigma, slope = surface(e, de, p, SurfaceExponents(*exponents))
    derivative = ca.jacobian(sigma, e) * de
    twice = ca.jacobian(slope, ca.vertcat(e, de))
    return ca.Function("surface", [e, de], [sigma, slope, derivative, twice])


# --- surface ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("exponents", EXPONENTS)
@pytest.mark.parametrize("delta", [0.0, 0.001, 0.05, 1.0])
def test_surface_and_its_derivative(exponents, delta, rng):
    """sigma is (22) with the boundary layer of E3; the cancelled slope is its derivative by AD."""
    f = surface_of_one_joint(exponents, delta)
    strong, weak = exponents[0] / exponents[1], exponents[2] / exponents[3]
    for e, de in zip(np.concatenate([rng.uniform(-2, 2, 40), [1e-3, -1e-6]]), rng.uniform(-9, 9, 42), strict=True):
        sigma, slope, derivative = (float(v) for v in f(e, de)[:3])
        odd = math.copysign(abs(e) ** strong, e)
        layer = e * (e**2 + delta**2) ** ((weak - 1) / 2)
        assert sigma == pytest.approx(de + 12 * odd + 5 * layer, rel=1e-13, abs=1e-13 * abs(de))
        assert slope == pytest.approx(derivative, rel=1e-11)


@pytest.mark.parametrize("exponents", EXPONENTS)
def test_without_a_layer_the_surface_is_the_papers(exponents):
    """delta = 0: sgn(e) |e|^(p/r), the real odd root."""
    f = surface_of_one_joint(exponents, 0.0, mu=1e-300, lam=1.0)
    n = exponents[2] / exponents[3]
    for e in (-2.0, -0.3, -1e-8, 1e-8, 0.3, 2.0):
        assert float(f(e, 0.0)[0]) == pytest.approx(math.copysign(abs(e) ** n, e), rel=1e-13)


@pytest.mark.parametrize("exponents", EXPONENTS)
@pytest.mark.parametrize("delta", [0.0, 0.05])
@pytest.mark.parametrize("de", [0.0, 1.0])
def test_surface_at_zero_error_is_finite(exponents, delta, de):
    """A run that starts on the reference must work, and so must a linearisation of the control there."""
    values = [np.array(v) for v in surface_of_one_joint(exponents, delta)(0.0, de)]
    assert all(np.all(np.isfinite(v)) for v in values)
    assert float(values[0][0, 0]) == de
    if de == 0.0:
        assert float(values[1][0, 0]) == 0.0


@pytest.mark.parametrize("delta", [0.0, 0.05])
def test_surface_is_odd(delta, rng):
    f = surface_of_one_joint((3, 1, 1, 3), delta)
    for e, de in rng.uniform(-3, 3, (50, 2)):
        assert float(f(e, de)[0]) == -float(f(-e, -de)[0])
        assert float(f(e, de)[1]) == -float(f(-e, -de)[1])


def test_surface_at_the_papers_start():
    """e(0) = (-0.8, 0.5), de(0) = (pi, pi/2), delta = 0: sigma(0) = (-7.64, 6.16)."""
    lift = surface_of_one_joint((3, 1, 1, 3), 0.0, mu=12.0)
    rotation = surface_of_one_joint((3, 1, 1, 3), 0.0, mu=5.0)
    assert float(lift(-0.8, math.pi)[0]) == pytest.approx(-7.64, abs=0.005)
    assert float(rotation(0.5, math.pi / 2)[0]) == pytest.approx(6.16, abs=0.005)


# --- reaching laws ---------------------------------------------------------------------------------------


def written_out(law, log_form, sigma):
    """(18)-(21) with Table 3's numbers, for |sigma| of moderate size. log1p keeps the digits of a small sigma."""
    c, size, sign = TABLE_3, abs(sigma), math.copysign(1.0, sigma)
    if law == "power":
        return -c["k1"] * size ** c["alpha"] * sign
    if law == "double_power":
        return -(c["k1"] * size ** c["alpha"] + c["k2"] * size ** c["beta"]) * sign
    f = size ** c["zeta"] if size < 1 else size ** (c["zeta"] * size)
    log = math.log1p(c["epsilon_log"] * size ** c["nu"])
    if log_form == "power":
        logs = c["k2"] * log ** (1 + c["alpha"]) + c["k3"] * log ** (1 - c["alpha"])
    else:  # to the bases 1 + alpha and 1 - alpha; the latter is negative, so its sign is turned (E8)
        logs = c["k2"] * log / math.log(1 + c["alpha"]) - c["k3"] * log / math.log(1 - c["alpha"])
    return -(c["k1"] * f + logs) * sign


@pytest.fixture(scope="module", params=["power", "base"])
def laws(request, make_model):
    return request.param, make_model(Structure(log_form=request.param))


SIZES = np.concatenate([10.0 ** np.arange(-9.0, 0.0), [0.3, 0.99, 1 - 1e-12, 1.0, 1 + 1e-12, 1.01, 2.0, 5.0, 10.0]])


@pytest.mark.parametrize("law", LAW_NAMES)
def test_law_as_written(laws, law):
    """Both branches of (19) and both readings of the logarithms; odd, and pointing at the surface."""
    log_form, model = laws
    for size in SIZES:
        rate = float(model(f"law_{law}", [size])[0])
        assert rate == pytest.approx(written_out(law, log_form, size), rel=1e-12, abs=0.0)
        assert rate < 0
        assert float(model(f"law_{law}", [-size])[0]) == -rate


@pytest.mark.parametrize("law", LAW_NAMES)
def test_law_grows_with_the_distance(laws, law):
    _, model = laws
    sizes = np.geomspace(1e-12, 20, 4000)
    rates = model(f"law_{law}", sizes.reshape(1, -1))[0]
    assert np.all(np.diff(rates) < 0)


@pytest.mark.parametrize("law", LAW_NAMES)
def test_law_on_the_surface_is_zero(laws, law):
    _, model = laws
    assert float(model(f"law_{law}", [0.0])[0]) == 0.0


def test_base_reading_as_printed_would_push_away():
    """E8: log to the base 1 - alpha < 1 is negative, so with the printed minus its term leaves the surface."""
    size = 0.5
    log = math.log(10 * size**2 + 1)
    third = -12.0 * log / math.log(0.5)
    assert third > 0
    assert written_out("variable_power_log", "base", size) == pytest.approx(
        -3 * size**0.9 - 5 * log / math.log(1.5) - third
    )


def test_variable_power_is_continuous_with_a_kink():
    """(19) is |sigma|^(zeta max(1, |sigma|)): one value at |sigma| = 1, and the same slope zeta on both sides."""
    one = {"k1": 1.0, "k2": 1e-300, "k3": 1e-300, "alpha": 0.5, "epsilon_log": 10.0, "nu": 2.0, "zeta": 0.9}
    f = isolated_law("variable_power_log", one)
    for side in (1e-6, -1e-6):
        assert (-float(f(1 + side)) - 1) / side == pytest.approx(0.9, rel=1e-5)


def isolated_law(name, values):
    sigma = ca.SX.sym("sigma")
    p = Values({key: ca.SX(value) for key, value in values.items()})
    return ca.Function("law", [sigma], [LAWS[name].rate(sigma, p)])


@pytest.mark.parametrize("law", LAW_NAMES)
@pytest.mark.parametrize("sigma", [1e2, 1e6, 1e300, 0.0, 1e-300])
def test_no_size_of_sigma_gives_nan(laws, law, sigma):
    """E4: the exponent is bounded; what overflows is infinite with the right sign and is then limited by a_max."""
    _, model = laws
    rate = float(model(f"law_{law}", [sigma])[0])
    assert not math.isnan(rate)
    assert rate <= 0
    if law == "variable_power_log" and sigma <= 1e6:
        assert math.isfinite(rate)


def slope_near_zero(model):
    sizes = np.geomspace(1e-4, 0.5, 200)
    return -model("law_variable_power_log", sizes.reshape(1, -1))[0] / sizes


def test_slope_near_the_surface(model):
    """E3: law(sigma)/sigma is 42 to 46 1/s for |sigma| from 1e-4 to 0.5."""
    slopes = slope_near_zero(model)
    assert slopes.min() > 41.5
    assert slopes.max() < 46.5
    assert slopes.max() - slopes.min() > 2


# --- derivatives at the origin ---------------------------------------------------------------------------


@pytest.mark.parametrize("law", LAW_NAMES)
@pytest.mark.parametrize("log_form", ["power", "base"])
@pytest.mark.parametrize("delta", [0.0, 0.05])
def test_control_on_the_reference(law, log_form, delta):
    """e = 0, de = 0, sigma = 0: command and its Jacobian are finite, and the slow control is that of no error."""
    system = System(Structure(law=law, log_form=log_form))
    f = system.function("control")
    symbols = f.sx_in()
    state = ca.vertcat(*symbols[:-1])
    outputs = f.call(symbols)
    together = ca.Function("g", symbols, [ca.vertcat(*outputs), ca.jacobian(ca.vertcat(*outputs), state)])
    p = np.array([slot.default for slot in system.slots])
    p[[slot.key for slot in system.slots].index("control.delta")] = delta
    q, dq = np.array([0.3, 0.2]), np.array([0.1, -0.4])
    values, jacobian = together(q, dq, np.zeros(2), np.concatenate([q, dq, q, dq]), p)
    assert np.all(np.isfinite(np.array(values)))
    assert np.all(np.isfinite(np.array(jacobian)))
    bias = system.function("coriolis")(q, dq, p) + system.function("gravity")(q, p)
    np.testing.assert_allclose(np.array(values)[:2], np.array(bias), rtol=1e-14)


@pytest.mark.parametrize("law", LAW_NAMES)
@pytest.mark.parametrize("log_form", ["power", "base"])
def test_law_has_a_finite_derivative_at_zero(law, log_form, make_model):
    model = make_model(Structure(log_form=log_form))
    f = model.system.function(f"law_{law}")
    sigma, p = f.sx_in()
    slope = ca.Function("slope", [sigma, p], [ca.jacobian(f(sigma, p), sigma)])
    for at in (0.0, 1e-200, -1e-200, 1e-12):
        assert math.isfinite(float(slope(at, model.defaults)))


# --- limits ----------------------------------------------------------------------------------------------


def test_a_max_limits_the_sum_of_the_law_only():
    """E4: per joint, on the law's sum, before the surface's own derivative is subtracted."""
    sigma = ca.SX.sym("sigma", 2)
    p = Values({**{k: ca.SX(v) for k, v in TABLE_3.items()}, "a_max": ca.SX([200.0, math.inf])})
    f = ca.Function("rate", [sigma], [reaching_rate(LAWS["variable_power_log"], sigma, p)[0]])
    lift, rotation = np.array(f([-7.64, -7.64])).reshape(-1)
    assert lift == 200.0
    assert rotation == pytest.approx(3.5e6, rel=0.1)
    near, _ = np.array(f([0.1, 0.1])).reshape(-1)
    assert near == pytest.approx(written_out("variable_power_log", "power", 0.1), rel=1e-13)


def test_demand_at_the_papers_start(model):
    """E4: 3.5e6 m/s^2 and 7e4 rad/s^2 asked for at t = 0, a total force of 1.8e8 N; double power 1.3e5 m/s^2."""
    assert -float(model("law_variable_power_log", [-7.64])[0]) == pytest.approx(-3.5e6, rel=0.05)
    assert float(model("law_variable_power_log", [6.16])[0]) == pytest.approx(-7e4, rel=0.1)
    assert float(model("law_double_power", [-7.64])[0]) == pytest.approx(1.3e5, rel=0.05)
    unlimited = model.p({"control.a_max.0": np.inf, "control.a_max.1": np.inf, "control.delta": 0.0})
    reference = [np.array([0.0, 1.0]), np.array([np.pi, np.pi / 2]), np.zeros(2)]
    x = np.array([0.8, 0.5, 0.0, 0.0, 0.8, 0.5, 0.0, 0.0])
    command = model("control", *reference, x, p=unlimited)
    assert np.abs(command[0]) == pytest.approx(1.8e8, rel=0.05)


def test_infinite_limits_are_no_limits(model, rng):
    open_ = model.p({f"control.{name}.{i}": np.inf for name in ("a_max", "U_max") for i in range(2)})
    high = model.p({f"control.{name}.{i}": 1e300 for name in ("a_max", "U_max") for i in range(2)})
    x = rng.uniform(-1, 1, (8, 100))
    reference = [rng.uniform(-1, 1, (2, 100)) for _ in range(3)]
    command = model("control", *reference, x, p=open_)
    assert np.all(np.isfinite(command))
    np.testing.assert_array_equal(command, model("control", *reference, x, p=high))


# --- the linearised loop of E3 ---------------------------------------------------------------------------


class Linear(Law):
    """d sigma/dt = -slope sigma: the reaching law as it looks near the surface."""

    def rate(self, sigma, p):
        return -p.slope * sigma


@pytest.fixture(scope="module")
def largest_real_part():
    """(delta, s, theta3, K_f scale) -> largest real part of the 8-state loop's eigenvalues at e = 0, 1/s."""
    system = System()
    delta, slope, gain = ca.SX.sym("delta"), ca.SX.sym("s"), ca.SX.sym("gain")
    p = Values({"delta": delta, "mu": ca.SX([12, 5]), "lambda": ca.SX(5), "slope": slope,
                "K_f": gain * ca.SX([200, 2.6]), "a_max": ca.SX([math.inf] * 2),
                "U_max": ca.SX([math.inf] * 2)})  # fmt: skip
    arm = Values({item.name: ca.SX.sym(item.name) for item in system.mechanism.parameters})
    inertia = ca.SX([2.0, 0.01])
    motors = Values({"m_l": ca.SX(2.0), "I": ca.SX(0.01), "k_s2": ca.SX(2e6), "k_s3": ca.SX(2e4)})
    link = equations_of_motion(system.mechanism, system.q1, system.dq1, system.base, arm)
    zero = ca.SX.zeros(2)
    r = Values({"q": system.q1d, "dq": zero, "ddq": zero})
    y = Values(dict(zip(("q1", "dq1", "q2", "dq2"), ca.vertsplit(system.x, 2), strict=True)))
    model = ArmModel(link, system.q1, system.dq1, inertia)
    command = TerminalSliding(Linear()).control(r, y, Values({}), model, p).u
    flow = DRIVES["elastic"].plant(system.x, command, link, system.mechanism, motors)
    base = ca.vertcat(system.base.b, system.base.db, system.base.ddb)
    arguments = [system.x, system.q1d, base, ca.vertcat(*arm.values()), delta, slope, gain]
    f = ca.Function("flow", arguments, [flow, ca.jacobian(flow, system.x)])
    numbers = np.array([item.default for item in system.mechanism.parameters])
    m2, m3, L3, g = (numbers[[i.name for i in system.mechanism.parameters].index(n)] for n in ("m2", "m3", "L3", "g"))

    def evaluate(layer, s, theta=0.5, scale=1.0):
        q = np.array([0.3, theta])
        weight = np.array([(m2 + m3) * g, m3 * L3 * g * math.cos(theta)])
        x = np.concatenate([q, np.zeros(2), q + weight / [2e6, 2e4], np.zeros(2)])
        at, jacobian = f(x, q, np.zeros(9), numbers, layer, s, scale)
        assert np.max(np.abs(np.array(at))) < 1e-6  # an equilibrium, to the rounding of K (q2 - q1) / I
        return float(np.max(np.linalg.eigvals(np.array(jacobian)).real))

    return evaluate


@pytest.mark.parametrize(
    ("delta", "expected"),
    [(0.005, 57), (0.01, 26), (0.015, 14), (0.02, 7), (0.025, 2), (0.03, -2), (0.04, -6), (0.05, -9), (0.1, -16)],
)
def test_eigenvalues_of_e3(largest_real_part, delta, expected):
    for theta in (-1.0, 0.0, 0.5, 1.5):
        assert largest_real_part(delta, 45.0, theta) == pytest.approx(expected, abs=1.0)
    assert largest_real_part(delta, 45.0) == pytest.approx(expected, abs=0.51)


@pytest.mark.parametrize(("slope", "critical"), [(42.0, 0.0255), (46.0, 0.028)])
def test_critical_boundary_layer_of_e3(largest_real_part, slope, critical):
    low, high = 0.01, 0.1
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if largest_real_part(middle, slope) > 0 else (low, middle)
    assert low == pytest.approx(critical, abs=0.0005)


def test_without_fast_control_no_boundary_layer_is_enough(largest_real_part):
    for delta in (0.005, 0.02, 0.05, 0.1, 0.5, 2.0):
        for slope in (42.0, 46.0):
            assert largest_real_part(delta, slope, scale=0.0) > 0


def test_exponents_are_fractions_not_floats():
    """5/3 and 10/6 are one surface; 1/3 is taken as such, not as 0.333."""
    assert Fraction(5, 3) == Fraction(10, 6)
    a, b = surface_of_one_joint((5, 3, 1, 3), 0.05), surface_of_one_joint((15, 9, 3, 9), 0.05)
    assert float(a(0.3, 0.2)[0]) == float(b(0.3, 0.2)[0])
