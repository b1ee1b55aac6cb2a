"""The loop linearised: against the paper's spectra (E3, E13), benchmarks solved by hand, and simulated runs."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springline.runner import load_scenario, simulate
from springline.runner.analysis import (
    LinearLoop,
    delay_max,
    delta_critical,
    equivalent_gain,
    fast_gain,
    floquet_exponent,
    growth,
    limit_cycle,
    limits_from,
    linear_loop,
    margins,
    period_max,
    radius,
    spectrum,
    time_scales,
)

LINEAR = """
from springline.model import Law, Parameter


class Linear(Law):
    parameters = (Parameter("slope", "1/s", 45.0, "of the law"),)

    def rate(self, sigma, p):
        return -p.slope * sigma
"""
CUBIC = LINEAR.replace("Linear", "Cubic").replace("* sigma", "* sigma**3")

ONE_LINK = {"mechanism.name": "planar_arm", "mechanism.n": 1}


def still(rotation: float = 1.0) -> dict[str, Any]:
    """The paper's arm with a reference that stands still."""
    return {
        "reference.lift": {"offset": 0.0, "terms": []},
        "reference.rotation": {"offset": rotation, "terms": []},
    }


def sampled(period: float, **actuator: float) -> dict[str, Any]:
    changes = {f"actuator.{key}": value for key, value in actuator.items()}
    return {"control.mode": "sampled", "control.period": period} | changes


def with_law(folder: Path, text: str = LINEAR) -> dict[str, Any]:
    path = folder / "law.py"
    path.write_text(text)
    name = "Cubic" if text is CUBIC else "Linear"
    return {"control.law": f"{path}:{name}"}


def nearest(found: np.ndarray, *wanted: complex) -> list[complex]:
    return [complex(found[np.abs(found - value).argmin()]) for value in wanted]


# The law's gain


@pytest.mark.parametrize("amplitude", [1e-4, 0.1, 3.0])
def test_the_equivalent_gain_is_the_describing_function(amplitude: float) -> None:
    """Closed forms: Gelb and Vander Velde (1968), appendix B; |s|^a by the integral of sin^(a+1), a gamma function."""
    assert equivalent_gain(np.sign, amplitude) == pytest.approx(4 / (math.pi * amplitude), rel=1e-9)
    assert equivalent_gain(lambda s: s**3, amplitude) == pytest.approx(0.75 * amplitude**2, rel=1e-9)
    assert equivalent_gain(lambda s: 7 * s + s**2, amplitude) == pytest.approx(7.0, rel=1e-9)
    for a in (0.1, 0.5, 0.9):
        exact = 2 / math.sqrt(math.pi) * math.gamma(a / 2 + 1) / math.gamma((a + 3) / 2) * amplitude ** (a - 1)
        found = equivalent_gain(lambda s, a=a: np.abs(s) ** a * np.sign(s), amplitude)  # type: ignore[misc]
        assert found == pytest.approx(exact, rel=1e-7)


@pytest.mark.parametrize("amplitude", [1e-4, 1e-3, 1e-2, 0.1, 0.5])
def test_the_paper_s_law_has_the_slope_of_e3(amplitude: float) -> None:
    gain = linear_loop(load_scenario("paper/nominal"), amplitude, times=[0.0, 1.3]).law_gain
    assert np.all((-gain[0, :, [0, 1], [0, 1]] > 42.0) & (-gain[0, :, [0, 1], [0, 1]] < 46.0))
    np.testing.assert_allclose(gain[0, :, 0, 1], 0.0, atol=1e-9)


def test_each_joint_may_have_an_amplitude_of_its_own(tmp_path: Path) -> None:
    """A cubic law: 3/4 A^2 of each; the power law that the paper prints: 3 times the closed form of |s|^(1/2)."""
    loop = linear_loop(load_scenario("paper/nominal", with_law(tmp_path, CUBIC)), [0.2, 1.0], times=[0.0])
    np.testing.assert_allclose(-loop.law_gain[0, 0], np.diag([45 * 0.75 * 0.04, 45 * 0.75]), atol=1e-9)
    loop = linear_loop(load_scenario("paper/nominal", {"control.law": "power"}), [0.01, 0.04], times=[0.0])
    root = 3 * 2 / math.sqrt(math.pi) * math.gamma(1.25) / math.gamma(1.75)
    np.testing.assert_allclose(-np.diagonal(loop.law_gain[0, 0]), [root / 0.1, root / 0.2], rtol=1e-7)


def test_super_twisting_is_seen_by_its_root_and_its_sign() -> None:
    """Without a layer: root_gain |s|^(1/2) in the command, integral_gain 4 / (pi A) in the rate of nu."""
    changes = {"control.controller": "super_twisting", "control.super_twisting.layer": 0.0}
    loop = linear_loop(load_scenario("paper/nominal", changes), 0.04, times=[0.0])
    root = 15.0 * 2 / math.sqrt(math.pi) * math.gamma(1.25) / math.gamma(1.75) / 0.2
    np.testing.assert_allclose(-np.diagonal(loop.law_gain[0, 0]), root, rtol=1e-7)
    lift_rate = loop.Dx[0, 0][0]
    assert lift_rate[2] == pytest.approx(-110.0 * 4 / (math.pi * 0.04), rel=1e-7)  # by dq1: sigma = de + slope e
    assert lift_rate[0] == pytest.approx(15.0 * lift_rate[2], rel=1e-9)


UNSEEN = """
import casadi as ca
from springline.model import Control, Controller, quantities


class Unseen(Controller):
    diagnostics = (quantities.SIGMA,)

    def control(self, r, y, z, model, p):
        e = r.q - y.q1
        return Control(ca.sign(3 * e), e, diagnostics={"sigma": (r.dq - y.dq1) + e})
"""


def test_a_controller_that_does_not_use_its_sigma_is_refused(tmp_path: Path) -> None:
    (tmp_path / "unseen.py").write_text(UNSEEN)
    scenario = load_scenario("paper/nominal", {"control.controller": f"{tmp_path / 'unseen.py'}:Unseen"})
    with pytest.raises(ValueError, match=r"controller unseen: neither u nor dz is computed from the sigma"):
        linear_loop(scenario)


# The continuous loop


def test_the_spectra_of_e3(tmp_path: Path) -> None:
    """Largest real part for nine boundary layers, law's slope 45, as printed; at two places within their last digit."""
    layers = np.array([0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05, 0.1])
    printed = np.array([57, 26, 14, 7, 2, -2, -6, -9, -16])
    for place in (0.0, 1.5):
        scenario = load_scenario("paper/nominal", with_law(tmp_path) | still(place))
        loop = linear_loop(scenario, times=[0.0], columns={"control.delta": layers})
        np.testing.assert_allclose(growth(loop), printed, atol=0.52)
    rest = load_scenario("paper/nominal", with_law(tmp_path) | still(0.0))
    found = growth(linear_loop(rest, times=[0.0], columns={"control.delta": layers}))
    np.testing.assert_array_equal(np.round(found), printed)


def test_the_smallest_boundary_layer_of_e3(tmp_path: Path) -> None:
    scenario = load_scenario("paper/nominal", with_law(tmp_path) | still())
    low, high = delta_critical(scenario, times=[0.0], columns={"control.linear.slope": np.array([42.0, 46.0])})
    assert low.value == pytest.approx(0.0255, rel=5e-3)
    assert high.value == pytest.approx(0.028, rel=2e-2)
    for found, slope in ((low, 42.0), (high, 46.0)):
        assert found.value is not None
        columns = {"control.delta": found.value * np.array([0.99, 1.01]), "control.linear.slope": np.full(2, slope)}
        below, above = growth(linear_loop(scenario, times=[0.0], columns=columns))
        assert below > 0.0 > above


def test_of_a_scenario_the_smallest_boundary_layer_is_that_of_its_worst_time() -> None:
    (found,) = delta_critical(load_scenario("paper/nominal"))
    assert found.value is not None
    assert 0.0255 < found.value < 0.028


def test_without_fast_control_no_boundary_layer_is_stable() -> None:
    (found,) = delta_critical(load_scenario("paper/nominal", {"control.fast": False}))
    assert found.value is None
    assert "no boundary layer" in found.reason


def test_what_has_no_boundary_layer_has_no_smallest_one() -> None:
    (found,) = delta_critical(load_scenario("paper/nominal", {"control.controller": "computed_torque"}))
    assert found.value is None
    assert "computed_torque has no boundary layer" in found.reason


def test_the_fast_modes_of_e13(tmp_path: Path) -> None:
    scales = time_scales(linear_loop(load_scenario("paper/nominal", with_law(tmp_path) | still()), times=[0.0]))
    free, alone, composite = (item[0, 0] for item in (scales.fast_free, scales.fast_alone, scales.fast_composite))
    np.testing.assert_allclose(free.real, 0.0, atol=1e-6)
    np.testing.assert_allclose(alone.real, [-50, -130], atol=0.5)
    np.testing.assert_allclose(alone.imag, [1020, 1408], atol=3.0)
    np.testing.assert_allclose(composite.real, [-9, -89], atol=0.5)
    np.testing.assert_allclose(composite.imag, [1022, 1406], atol=0.5)
    assert scales.slow_bandwidth[0, 0] == pytest.approx(45.0, rel=1e-3)  # the law's; the surface's is 36.8
    assert scales.epsilon_ratio[0, 0] == pytest.approx(45.0 / abs(alone[0]), rel=1e-3)
    assert scales.fast_damping[0] == pytest.approx(9 / 1022, rel=0.05)


def test_a_rigid_drive_has_no_fast_modes() -> None:
    scenario = load_scenario("paper/nominal", {"drive.kind": "rigid"})
    scales = time_scales(linear_loop(scenario))
    assert scales.fast_composite.shape == (1, 17, 0)
    assert np.isnan(scales.epsilon_ratio).all()
    assert [item.value for item in fast_gain(scenario)] == [None, None]


@pytest.mark.parametrize("composite", [False, True])
def test_the_smallest_fast_gain_gives_the_damping_that_is_wanted(composite: bool) -> None:
    scenario = load_scenario("paper/nominal")
    gains = [item.value for item in fast_gain(scenario, wanted=0.07, composite=composite)]
    scales = time_scales(linear_loop(scenario.with_overrides({"control.K_f": gains})))
    modes = scales.fast_composite if composite else scales.fast_alone
    ratios = (-modes.real / np.abs(modes))[0].min(axis=0)
    np.testing.assert_allclose(ratios, 0.07, rtol=2e-3)


def test_spong_s_single_link_with_a_flexible_joint() -> None:
    """I = J = 1, M g L = 10, k = 100 (Spong 1987), hanging: s^4 + 210 s^2 + 1000 = 0 by hand."""
    arm = {"mechanism.mass": 1.0, "mechanism.com": 1.0, "mechanism.inertia": 0.0, "mechanism.g": 10.0}
    drive = {"drive.motor_inertia": 1.0, "drive.stiffness": 100.0}
    hanging = {"reference.joint1": {"offset": -math.pi / 2, "terms": []}}
    loop = linear_loop(load_scenario("paper/nominal", ONE_LINK | arm | drive | hanging), times=[0.0])
    wanted = [math.sqrt(105 - math.sqrt(105**2 - 1000)), math.sqrt(105 + math.sqrt(105**2 - 1000))]
    found = np.linalg.eigvals(loop.A[0, 0])
    np.testing.assert_allclose(found.real, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.sort(found.imag), [-wanted[1], -wanted[0], wanted[0], wanted[1]], rtol=1e-12)


def test_the_benchmark_of_the_american_control_conference() -> None:
    """Two masses of 1 and a spring (Wie and Bernstein 1992): 0, 0, +-i sqrt(2 k)."""
    arm = {"mechanism.mass": 1.0, "mechanism.com": 1.0, "mechanism.inertia": 0.0, "mechanism.g": 0.0}
    for k in (0.5, 1.0, 2.0):
        changes = ONE_LINK | arm | {"drive.motor_inertia": 1.0, "drive.stiffness": k}
        loop = linear_loop(load_scenario("paper/nominal", changes), times=[0.0])
        found = np.linalg.eigvals(loop.A[0, 0])
        np.testing.assert_allclose(np.sort(found.imag), np.sqrt(2 * k) * np.array([-1, 0, 0, 1]), atol=1e-7)
        assert time_scales(loop).fast_free[0, 0, 0] == pytest.approx(1j * np.sqrt(2 * k), rel=1e-12)


def test_a_chain_of_four_masses_has_the_eigenvalues_that_are_known() -> None:
    masses = np.array([5e-3, 2e-3, 0.02, 0.02])
    own = np.array([6e-3, 1e-3, 1e-3, 1e-3])
    bonds = np.diff(np.eye(4), axis=0)  # elongation of each spring
    stiffness, damping = (bonds.T @ np.diag(v) @ bonds for v in ((100.0, 110.0, 80.0), (0.08, 0.06, 0.08)))
    inverse = np.diag(1 / masses)
    a = np.block([[np.zeros((4, 4)), np.eye(4)], [-inverse @ stiffness, -inverse @ (damping + np.diag(own))]])
    base = linear_loop(load_scenario("paper/nominal"), times=[0.0])
    chain = replace(base, A=a[None, None], B=np.zeros((1, 1, 8, 2)))
    found = spectrum(chain)[0, 0]
    wanted = [-40.6453 + 341.0511j, -5.6528 + 120.0060j, -3.0062 + 77.8696j, -0.191492, 0.0]
    np.testing.assert_allclose(nearest(found, *wanted), wanted, rtol=2e-6, atol=1e-9)


def test_the_floquet_exponent_is_of_the_period_that_all_terms_have() -> None:
    found = floquet_exponent(load_scenario("paper/nominal"))
    assert "4 s" in found.reason
    assert found.value is not None
    frozen = spectrum(linear_loop(load_scenario("paper/nominal"))).real.max(axis=2)
    assert frozen.min() < found.value < frozen.max()


def test_where_nothing_moves_the_floquet_exponent_is_an_eigenvalue() -> None:
    scenario = load_scenario("paper/nominal", still())
    (exact,) = growth(linear_loop(scenario, times=[0.0]))
    assert floquet_exponent(scenario).value == pytest.approx(exact, rel=1e-9)
    # A reference that hardly moves has a period to go along, and the same exponents.
    terms = [{"amplitude": 1e-9, "omega": 2.0}]
    moving = scenario.with_overrides({"reference.lift": {"offset": 0.0, "terms": terms}})
    assert floquet_exponent(moving).value == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"base_motion.kind": "sine", "base_motion.heave": [{"amplitude": 0.1, "omega": 1.5}]}, "no common period"),
        ({"reference.kind": "polynomial", "reference.lift": {"t": [0.0, 1.0], "q": [0.0, 1.0]},
          "reference.rotation": {"t": [0.0, 1.0], "q": [0.0, 1.0]}}, "polynomial"),
    ],
)  # fmt: skip
def test_without_a_common_period_there_is_no_floquet_exponent(changes: dict[str, Any], reason: str) -> None:
    found = floquet_exponent(load_scenario("paper/nominal", changes))
    assert found.value is None
    assert reason in found.reason


# The sampled loop


def test_the_edge_of_e11_is_500_hz() -> None:
    """1.9 ms nothing happens, 2.1 ms diverges."""
    for changes in ({}, sampled(1e-3)):
        (found,) = period_max(linear_loop(load_scenario("paper/nominal", changes)))
        assert found.value is not None
        assert 1.9e-3 < found.value < 2.1e-3


@pytest.mark.parametrize(("period", "survived"), [(5e-4, 7e-4), (1e-3, 5e-4), (2e-3, 1e-4)])
def test_the_delays_of_e11(period: float, survived: float) -> None:
    """To within the grid of 0.1 ms of which it is the last that survived."""
    loop = linear_loop(load_scenario("paper/nominal", sampled(period)))
    (found,) = delay_max(loop)
    assert found.value is not None
    assert survived <= found.value < survived + 1e-4
    assert radius(loop, delay=found.value)[0] == pytest.approx(1.0, abs=1e-5)


def test_a_short_period_comes_to_the_continuous_loop() -> None:
    """A hold delays by half a sample."""
    continuous = linear_loop(load_scenario("paper/nominal"))
    (limit,), (growing,) = delay_max(continuous), growth(continuous)
    loop = linear_loop(load_scenario("paper/nominal", sampled(1e-4)))
    assert np.log(radius(loop, 1e-6)) / 1e-6 == pytest.approx(growing, rel=1e-3)
    (found,) = delay_max(loop)
    assert found.value is not None
    assert limit.value is not None
    assert found.value + 0.5e-4 == pytest.approx(limit.value, rel=1e-3)
    # And of the characteristic equation with exp(-s tau) by a long line of short samples.
    assert radius(loop, 2e-5, limit.value * 0.97)[0] < 1.0 < radius(loop, 2e-5, limit.value * 1.03)[0]


def test_a_lag_is_a_state_and_costs_delay() -> None:
    plain, lagging = (
        linear_loop(load_scenario("paper/nominal", sampled(5e-4, **more))) for more in ({}, {"lag": [2e-4, 0.0]})
    )
    assert lagging.closed().shape[-1] == plain.closed().shape[-1] + 1
    assert spectrum(lagging)[0, 0].real.min() < -3000.0
    (without,), (with_lag,) = delay_max(plain), delay_max(lagging)
    assert without.value is not None
    assert with_lag.value is not None
    assert with_lag.value <= without.value


def test_the_radius_of_a_double_integrator_that_is_sampled() -> None:
    """A rigid link, k_p e + k_d de held for T, by hand: [[1 - k_p T^2/2, T - k_d T^2/2], [-k_p T, 1 - k_d T]]."""
    changes = ONE_LINK | {"drive.kind": "rigid", "mechanism.g": 0.0, "control.controller": "computed_torque"}
    kp, kd, period = 200.0, 30.0, 0.01
    gains = {"control.computed_torque.k_p": kp, "control.computed_torque.k_d": kd}
    scenario = load_scenario("paper/nominal", changes | gains | still_link() | sampled(period))
    hand = np.array([[1 - kp * period**2 / 2, period - kd * period**2 / 2], [-kp * period, 1 - kd * period]])
    loop = linear_loop(scenario, times=[0.0])
    assert radius(loop)[0] == pytest.approx(np.abs(np.linalg.eigvals(hand)).max(), rel=1e-9)
    (found,) = period_max(loop)
    assert found.value == pytest.approx(2 / kd, rel=1e-5)  # by Jury's conditions: z = -1 at k_d T = 2


def still_link() -> dict[str, Any]:
    return {"reference.joint1": {"offset": 0.3, "terms": []}}


@pytest.mark.parametrize("changes", [{}, sampled(1e-3), sampled(1e-3, delay=3e-4)])
def test_margins_are_distances_to_the_boundary(changes: dict[str, Any]) -> None:
    """A channel's gain times its margin: the loop is neither stable nor unstable, and is both on either side."""
    loop = linear_loop(load_scenario("paper/nominal", changes), times=[1.0])
    (found,) = margins(loop)

    def excess(joint: int, factor: float) -> float:
        share = np.ones(2)
        share[joint] = factor
        other = replace(loop, Cx=loop.Cx * share[:, None])
        return float(growth(other)[0]) if not changes else float(np.log(radius(other)[0]) / 1e-3)

    for joint in range(2):
        factors = [f for f in (found.gain_up[joint], found.gain_down[joint]) if 0.0 < f < np.inf]
        assert factors
        for factor in factors:
            inside = factor ** (1 - 1e-4)
            assert excess(joint, inside) < 0.0 < excess(joint, factor ** (1 + 1e-4))
        assert abs(math.log(found.gain[joint])) == min(abs(math.log(factor)) for factor in factors)
        assert 0.0 < found.phase[joint] < math.pi
        if changes:  # whole steps of a line of short samples are what a delay of one channel would be
            continue
        omega, delay = found.delay_frequency[joint], found.delay[joint]
        assert delay <= found.phase[joint] / found.phase_frequency[joint]
        turned = np.eye(2, dtype=complex)
        turned[joint, joint] = np.exp(-1j * omega * delay)
        closed = loop.A[0, 0] + loop.B[0, 0] @ turned @ loop.Cx[0, 0]
        assert np.abs(np.linalg.eigvals(closed) - 1j * omega).min() < 1e-6 * omega


def test_a_phase_margin_is_a_delay_of_one_channel() -> None:
    """Of one joint there is one channel: phase margin over frequency is the largest delay, where it is a lag."""
    (margin,) = margins(loop := linear_loop(load_scenario("paper/nominal", ONE_LINK | still_link()), times=[0.0]))
    (delay,) = delay_max(loop)
    assert delay.value is not None
    assert delay.value <= margin.phase[0] / margin.phase_frequency[0] + 1e-9


@pytest.mark.skipif(importlib.util.find_spec("control") is None, reason="python-control is not installed")
def test_margins_are_those_of_python_control() -> None:
    control = importlib.import_module("control")
    loop = linear_loop(load_scenario("paper/nominal", ONE_LINK | still_link()), times=[0.0])
    (found,) = margins(loop)
    system = control.ss(loop.A[0, 0], loop.B[0, 0], -loop.Cx[0, 0], 0.0)
    gain, phase, *_ = control.stability_margins(system)
    assert found.gain[0] == pytest.approx(gain, rel=1e-4)
    assert found.phase[0] == pytest.approx(math.radians(phase), rel=1e-4)


def test_a_loop_of_three_links_has_all_of_it() -> None:
    scenario = load_scenario("paper/nominal", {"mechanism.name": "planar_arm", "mechanism.n": 3})
    loop = linear_loop(scenario, times=[0.0, 1.0])
    (period,), (delay,), (margin,) = period_max(loop), delay_max(loop), margins(loop)
    assert growth(loop)[0] < 0.0
    assert period.value is not None
    assert delay.value is not None
    assert radius(loop, period.value * 0.999, 0.0)[0] < 1.0 < radius(loop, period.value * 1.001, 0.0)[0]
    assert radius(loop, 2e-5, delay.value * 0.97)[0] < 1.0 < radius(loop, 2e-5, delay.value * 1.03)[0]
    assert margin.phase.shape == (3,)
    gains = [item.value for item in fast_gain(scenario, wanted=0.2)]
    damped = time_scales(linear_loop(scenario.with_overrides({"control.K_f": gains})))
    assert (-damped.fast_alone.real / np.abs(damped.fast_alone)).min() == pytest.approx(0.2, rel=1e-3)


@pytest.mark.parametrize("observer", ["disturbance", "extended_state"])
@pytest.mark.parametrize("controller", ["super_twisting", "nonsingular_terminal", "computed_torque"])
def test_every_packaged_controller_has_a_linear_loop(controller: str, observer: str) -> None:
    """On the reference the controller with its states commands what carries the arm."""
    changes = {"control.controller": controller, "control.observer": observer, "plant.m3": {"scale": 1.2}}
    scenario = load_scenario("paper/nominal", changes)
    loop = linear_loop(scenario, times=[0.0, 0.7])
    assert growth(loop)[0] < 0.0
    system, p = scenario.system(), scenario.values()
    for k, t in enumerate((0.0, 0.7)):
        w = system.function("signals")(t, [], p)
        u = np.array(system.function("loop_control")(w, loop.x[0, k], loop.z[0, k], p)[0]).ravel()
        if controller != "super_twisting" or observer != "none":
            np.testing.assert_allclose(u, loop.u[0, k], rtol=1e-6)
        dx = np.array(system.function("loop_plant")(w, loop.x[0, k], loop.u[0, k], p)).ravel()
        ddq = np.array(w).ravel()[4:6]
        np.testing.assert_allclose([*dx[2:4], *dx[6:8]], [*ddq, *ddq], rtol=1e-6, atol=1e-6)
    (found,) = margins(loop)
    assert np.all(np.isfinite(found.phase))


def test_limits_act_from_an_amplitude_on() -> None:
    """Closed form: 3 |s|^(1/2) > 6 from 4 on; without any limit there is none; and a motor may be too weak at once."""
    scenario = load_scenario("paper/nominal", {"control.law": "power", "control.a_max": 6.0})
    found = limits_from(scenario)
    assert found.value == pytest.approx(4.0, rel=1e-3)
    assert "a_max" in found.reason
    assert limits_from(scenario.with_overrides({"control.a_max": math.inf})).value is None
    weak = limits_from(scenario.with_overrides({"control.U_max": [200.0, 200.0]}))
    assert weak.value == 0.0


# Against simulated runs


def envelope(values: np.ndarray, t: np.ndarray) -> float:
    """Rate of growth of an oscillation, 1/s, from its largest values in eight pieces of the second half."""
    pieces = np.array_split(np.arange(len(t) // 2, len(t)), 8)
    sizes = np.array([np.abs(values[piece]).max() for piece in pieces])
    middles = np.array([t[piece].mean() for piece in pieces])
    return float(np.polyfit(middles, np.log(sizes), 1)[0])


@pytest.mark.parametrize(
    ("period", "delay", "velocity"),
    [(2.2e-3, 0.0, "measured"), (1e-3, 7e-4, "measured"), (1.2e-3, 0.0, "differenced")],
)
def test_a_long_run_grows_as_the_spectral_radius_says(period: float, delay: float, velocity: str) -> None:
    start = {  # without weight, for there is no command to carry it until the first one arrives
        "initial.q": [1e-9, 1.0], "mechanism.g": 0.0, "initial.q_motor": "equilibrium",
        "control.controller": "computed_torque",
        "simulation.duration": 0.44 if delay else 0.396, "simulation.output_every": 1, "simulation.step": 1e-4,
        "sensor.velocity": velocity,
    }  # fmt: skip
    scenario = load_scenario("paper/nominal", still() | start | sampled(period, delay=delay))
    rate = np.log(radius(linear_loop(scenario, times=[0.0]))[0]) / period
    trajectory = simulate(scenario).trajectory
    assert rate > 5.0
    found = envelope(trajectory["e_rotation"].to_numpy(), trajectory["t"].to_numpy())
    assert found == pytest.approx(rate, rel=0.02)


def test_a_limit_cycle_is_as_large_and_as_fast_as_predicted() -> None:
    """The power law's gain has no bound at sigma = 0: it chatters."""
    start = {"initial.q": [1e-3, 1.001], "initial.q_motor": "equilibrium", "simulation.duration": 1.0,
             "simulation.output_every": 1, "control.law": "power"}  # fmt: skip
    scenario = load_scenario("paper/nominal", still() | start)
    found = limit_cycle(scenario, times=[0.0])
    assert found.amplitude is not None
    trajectory = simulate(scenario).trajectory
    t = trajectory["t"].to_numpy()
    late = t > 0.6
    for joint, predicted in zip(("lift", "rotation"), found.amplitude, strict=True):
        sigma = trajectory[f"sigma_{joint}"].to_numpy()[late]
        assert np.abs(sigma).max() == pytest.approx(predicted, rel=0.05)
        turns = np.count_nonzero(np.diff(np.signbit(sigma))) / 2
        assert turns * 2 * math.pi / (t[late][-1] - t[late][0]) == pytest.approx(found.frequency, rel=0.01)


def test_a_loop_that_is_stable_in_the_small_has_no_limit_cycle() -> None:
    found = limit_cycle(load_scenario("paper/nominal", {"control.controller": "super_twisting"}), times=[0.0])
    assert found.amplitude is None
    assert "stable at every amplitude" in found.reason


def test_a_loop_is_one_of_arrays() -> None:
    loop = linear_loop(load_scenario("paper/nominal"), times=[0.0], columns={"plant.m3": np.array([40.0, 48.0])})
    assert isinstance(loop, LinearLoop)
    assert loop.A.shape == (2, 1, 8, 8)
    assert growth(loop).shape == (2,)
    assert len(period_max(loop)) == 2
