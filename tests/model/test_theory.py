"""The paper's bounds as numbers (section 6) and the honesty about them (E9)."""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

from springline.model.control import SurfaceExponents
from springline.model.theory import (
    Gap,
    felt_acceleration,
    gaps,
    margin,
    reaching_time_bound,
    residual_set,
    settling_bounds,
    sliding_time_bound,
    tail_rate,
)

TABLE_3 = SurfaceExponents(l=3, m=1, p=1, r=3)
SIGMA_0 = (-7.64, 6.16)


def test_sliding_time_with_table_3():
    np.testing.assert_allclose(sliding_time_bound([12.0, 5.0], 5.0, TABLE_3), [0.342, 0.400], atol=5e-4)


@pytest.mark.parametrize(("c1", "expected"), [(3.0, 4.19), (2.0, 6.28), (1.0, 12.6)])
def test_reaching_time_with_table_3(c1, expected):
    assert reaching_time_bound(SIGMA_0, c1, 0.9) == pytest.approx(expected, rel=3e-3)


def test_total_exceeds_the_papers_run():
    """A measured time below a bound that is longer than the 4 s run proves little."""
    bounds = settling_bounds(SIGMA_0, 3.0, 0.9, [12.0, 5.0], 5.0, TABLE_3)
    np.testing.assert_allclose(bounds.total, bounds.sliding + 4.19, atol=5e-3)
    assert np.all(bounds.total > 4.0)


def test_no_reaching_time_without_a_margin():
    assert reaching_time_bound(SIGMA_0, 0.0, 0.9) == math.inf
    assert reaching_time_bound(SIGMA_0, -1.0, 0.9) == math.inf


@pytest.mark.parametrize("exponents", [(1, 1, 1, 3), (3, 1, 3, 3), (1, 3, 1, 3)])
def test_exponents_out_of_order(exponents):
    with pytest.raises(ValueError, match="l > m and r > p"):
        sliding_time_bound(1.0, 1.0, SurfaceExponents(*exponents))


@pytest.mark.parametrize("exponents", [(3, 1, 1, 3), (5, 3, 3, 5), (9, 7, 1, 9)])
def test_the_sliding_time_is_a_bound(exponents):
    """de/dt = -mu e^(l/m) - lambda e^(p/r) from a huge error: time to zero by quadrature of de / (…)."""
    x = SurfaceExponents(*exponents)
    strong, weak, mu, lam = x.l / x.m, x.p / x.r, 12.0, 5.0
    e = np.geomspace(1e-60, 1e60, 2_000_001)
    time = trapezoid(e / (mu * e**strong + lam * e**weak), np.log(e))
    bound = float(sliding_time_bound(mu, lam, x)[0])
    assert time < bound
    assert time > 0.5 * bound


def test_the_reaching_time_is_what_its_differential_inequality_takes():
    """d|sigma|/dt = -c1 |sigma|^zeta reaches 0 at exactly t_q (V' = -c V^kappa with equality)."""
    size, c1, zeta = math.hypot(*SIGMA_0), 2.0, 0.9
    assert reaching_time_bound(SIGMA_0, c1, zeta) == pytest.approx(size ** (1 - zeta) / (c1 * (1 - zeta)), rel=1e-12)


def test_tail_rate():
    assert tail_rate(5.0, 0.05, TABLE_3) == pytest.approx(36.8, abs=0.05)
    assert tail_rate(5.0, 0.0, TABLE_3) == math.inf


def test_tail_rate_is_the_surfaces(make_model):
    """On the surface, close to e = 0, the System's sigma at de = 0 is (tail rate) e."""
    model = make_model()
    e = 1e-6
    x = np.zeros(8)
    _, _, sigma = model.outputs("slow_control", np.array([e, e]), np.zeros(2), np.zeros(2), x)
    np.testing.assert_allclose(sigma / e, tail_rate(5.0, 0.05, TABLE_3), rtol=1e-6)


def test_margin_along_a_run():
    felt = np.array([[0.0, -1.5, 0.5], [0.0, 2.0, -2.2]])
    found = margin(felt, 3.0)
    np.testing.assert_array_equal(found.per_joint, [1.5, 2.2])
    assert found.bound == pytest.approx(2.5)
    assert found.c1 == pytest.approx(0.5)
    assert found.holds
    assert not margin(felt, 2.5).holds


def test_margin_of_the_model(model, rng):
    """H^-1 S from the System's own functions: under shake alone it is what the slow subsystem's ddq1 loses."""
    q, dq = rng.uniform(-1, 1, (2, 50)), rng.uniform(-1, 1, (2, 50))
    zero = np.zeros((3, 50))
    ddb = zero.copy()
    ddb[0] = rng.uniform(-10, 10, 50)
    felt = felt_acceleration(
        model("slow_mass", q).transpose(2, 0, 1), model("base_disturbance", zero, zero, ddb, q, dq)
    )
    u = np.zeros((2, 50))
    change = model("slow_dynamics", zero, zero, ddb, q, dq, u) - model("slow_dynamics", zero, zero, zero, q, dq, u)
    np.testing.assert_allclose(felt, change, atol=1e-12)


@pytest.mark.parametrize("felt", [np.zeros(4), np.zeros((2, 0)), np.array([[1.0, np.nan]])])
def test_margin_refuses_what_it_cannot_judge(felt):
    with pytest.raises(ValueError, match=r"H\^-1 S"):
        margin(felt, 3.0)


def law_of(model, name, a_max=math.inf):
    return lambda sigma: max(-a_max, min(a_max, float(model(f"law_{name}", [sigma])[0])))


@pytest.mark.parametrize("name", ["variable_power_log", "double_power", "power"])
@pytest.mark.parametrize("bound", [0.01, 0.5, 5.0, 50.0])
def test_residual_set(model, name, bound):
    law = law_of(model, name)
    sigma = residual_set(law, bound)
    assert abs(law(sigma)) <= bound
    assert abs(law(sigma * (1 + 1e-9))) == pytest.approx(bound, rel=1e-7)


def test_residual_set_of_the_power_law(model):
    """k1 |sigma|^alpha = S0 solved by hand: (S0/3)^2."""
    assert residual_set(law_of(model, "power"), 1.5) == pytest.approx(0.25, rel=1e-9)


def test_residual_sets_rank_the_laws(model):
    """Claim 4's reason: under 5 m/s^2 the new law lets sigma stray 0.12, the others 0.85 and 2.8."""
    sizes = {name: residual_set(law_of(model, name), 5.0) for name in ("variable_power_log", "double_power", "power")}
    found = [sizes[name] for name in ("variable_power_log", "double_power", "power")]
    assert found == pytest.approx([0.1179, 0.8511, 2.7778], rel=1e-3)


def test_residual_set_at_the_ends(model):
    assert residual_set(law_of(model, "power"), 0.0) == 0.0
    assert residual_set(law_of(model, "variable_power_log", a_max=200.0), 200.0) == math.inf
    assert math.isfinite(residual_set(law_of(model, "variable_power_log", a_max=200.0), 199.0))


def test_residual_set_holds_sigma(model):
    """d sigma/dt = law(sigma) + S with |S| <= S0 ends inside the set and, pushed one way, at its rim."""
    bound = 4.0
    law = law_of(model, "variable_power_log")
    rim = residual_set(law, bound)
    for push, at_the_rim in ((lambda t: bound, True), (lambda t: bound * math.sin(7 * t), False)):
        sigma, h = 2.0, 1e-3
        for k in range(2000):
            sigma += h * (law(sigma) + push(k * h))
        assert abs(sigma) <= rim * (1 + 1e-6)
        assert (sigma == pytest.approx(rim, rel=1e-6)) == at_the_rim


def test_gaps_are_named():
    still, shaken, strong = (margin(np.full((2, 1), size), 3.0) for size in (0.0, 1.0, 5.0))
    log = "variable_power_log"
    assert gaps(still, 0.0, False, log) == ()
    assert gaps(shaken, 0.0, False, log) == (Gap.DISTURBANCE,)
    assert gaps(strong, 0.0, False, log) == (Gap.NO_MARGIN, Gap.DISTURBANCE)
    assert gaps(still, 0.05, True, log) == (Gap.BOUNDARY_LAYER, Gap.CLIPPED)
    assert gaps(still, 0.0, False, "power") == (Gap.OTHER_LAW,)
    for gap in Gap:
        assert len(gap.value.split()) > 8
