"""Observers of disturbances, by what they make of one that is known (docs/controllers.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springline.runner import load_scenario, simulate
from springline.runner.files import InputError

ONE_JOINT = {"mechanism.name": "planar_arm", "mechanism.n": 1, "control.controller": "computed_torque"}
FORCE = {"disturbance.kind": "sine", "disturbance.joint1": {"offset": 0.7}, "simulation.output_every": 1}
SHORT = {"simulation.duration": 0.4}


def observing(name: str, **parameters: Any) -> dict[str, Any]:
    return {"control.observer": name} | {f"control.{name}.{key}": value for key, value in parameters.items()}


def columns(changes: dict[str, Any], *names: str) -> list[np.ndarray]:
    result = simulate(load_scenario("paper/nominal", changes))
    assert result.status == "ok"
    return [result.trajectory[name].to_numpy() for name in names]


def inertia(function: str, changes: dict[str, Any]) -> float:
    scenario = load_scenario("paper/nominal", changes)
    return float(scenario.system().function(function)(0.0, scenario.values()))


@pytest.mark.parametrize(("drive", "source"), [("rigid", "command"), ("elastic", "spring")])
def test_a_disturbance_observer_lags_the_applied_force_by_one_pole(drive: str, source: str) -> None:
    """Of a step F / H that is d (1 - exp(-Lt)), whatever the controller does; behind the springs of F / M."""
    changes = ONE_JOINT | FORCE | SHORT | {"drive.kind": drive} | observing("disturbance", bandwidth=20.0, input=source)
    t, xi, dq = columns(changes, "t", "z_xi_d_joint1", "dq1_joint1")
    true = 0.7 / inertia("slow_mass" if drive == "rigid" else "mass_matrix", changes)
    np.testing.assert_allclose(xi + 20.0 * dq, true * (1 - np.exp(-20.0 * t)), atol=1e-6 * true)
    assert np.ptp(dq) > 1e-3  # the arm did move


@pytest.mark.parametrize(("drive", "source"), [("rigid", "command"), ("elastic", "spring")])
def test_an_extended_state_observer_lags_it_by_two(drive: str, source: str) -> None:
    w = 30.0
    changes = ONE_JOINT | FORCE | SHORT | {"drive.kind": drive} | observing("extended_state", bandwidth=w, input=source)
    t, found = columns(changes, "t", "z_d_hat_joint1")
    true = 0.7 / inertia("slow_mass" if drive == "rigid" else "mass_matrix", changes)
    np.testing.assert_allclose(found, true * (1 - (1 + w * t) * np.exp(-w * t)), atol=1e-6 * true)


@pytest.mark.parametrize("observer", ["disturbance", "extended_state"])
@pytest.mark.parametrize("source", ["command", "spring"])
def test_what_is_observed_is_taken_away(observer: str, source: str) -> None:
    """A force that a PD law alone bears with an error of d / k_p leaves none."""
    push = {"disturbance.kind": "sine", "disturbance.lift": {"offset": 60.0}, "simulation.duration": 2.0}
    push |= {"control.controller": "computed_torque", "drive.kind": "elastic"}
    (alone,) = columns(push, "e_lift")
    (helped,) = columns(push | observing(observer, input=source), "e_lift")
    assert np.max(np.abs(alone[-200:])) > 1e-3
    assert np.max(np.abs(helped[-200:])) < 0.1 * np.max(np.abs(alone[-200:]))


@pytest.mark.parametrize("controller", ["terminal_sliding", "super_twisting", "nonsingular_terminal"])
def test_on_the_ship_the_error_is_smaller(controller: str) -> None:
    def error(**changes: Any) -> float:
        found = load_scenario("paper/group1_shake", {"control.controller": controller} | changes)
        (row,) = simulate(found).metrics.to_pylist()
        return float(row["steady_state_error_lift"])

    alone = error()
    assert error(**observing("disturbance")) < 0.9 * alone
    assert error(**observing("disturbance", bandwidth=15.0)) < 0.6 * alone
    assert error(**observing("extended_state", input="spring")) < 0.6 * alone


FED = {"control.feedforward": "base", "control.controller": "computed_torque"}
SWELL = {
    "base_motion.kind": "sine",
    "base_motion.heave": [{"amplitude": 0.5, "omega": 3.0}],
    "base_motion.pitch": [{"amplitude": 0.1, "omega": 2.0}],
    "base_motion.roll": [{"amplitude": 0.1, "omega": 2.5}],
    "base_motion.sway": [{"amplitude": 0.3, "omega": 2.2}],
    "base_motion.mount": [3.0, 1.0, 0.5],
}


def test_with_feedforward_a_rigid_arm_does_not_feel_the_ship() -> None:
    """dde + 60 de + 900 e = 0 as on a base at rest, in six coordinates and away from the ship's origin."""
    changes = SWELL | FED | {"drive.kind": "rigid", "simulation.duration": 1.0}
    t, e = columns(changes, "t", "e_lift")
    np.testing.assert_allclose(e, (-0.8 + (np.pi + 30 * -0.8) * t) * np.exp(-30 * t), atol=1e-9)
    (felt,) = columns(changes | {"control.feedforward": "none"}, "e_lift")
    assert np.max(np.abs(felt[500:])) > 1e-3


def test_an_observer_does_not_find_again_what_is_fed_forward() -> None:
    changes = SWELL | FED | {"drive.kind": "rigid", "simulation.duration": 1.0} | observing("extended_state")
    (found,) = columns(changes, "z_d_hat_lift")
    assert np.max(np.abs(found)) < 1e-6
    (alone,) = columns(changes | {"control.feedforward": "none"}, "z_d_hat_lift")
    assert np.max(np.abs(alone)) > 1.0


def test_a_resolved_scenario_says_what_drives_it() -> None:
    scenario = load_scenario("paper/nominal", observing("disturbance"))
    assert 'input = "command"' in scenario.to_toml()
    assert scenario.structure().observer_input == "command"
    other = scenario.with_overrides({"control.disturbance.input": "spring"})
    assert other.structure().observer_input == "spring"
    assert other.with_overrides({"control.observer": "none"}) == load_scenario("paper/nominal")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"control.observer": "disturbence"}, "disturbance"),
        ({"control.disturbance.bandwidth": 3.0}, "control.disturbance"),
        (observing("disturbance", bandwidth=-1.0), "control.disturbance.bandwidth"),
        (observing("disturbance", bandwith=1.0), "bandwidth"),
        (observing("disturbance", input="spring") | {"drive.kind": "rigid"}, "control.disturbance.input"),
    ],
)
def test_wrong_use_is_told(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message.replace(".", r"\.")):
        load_scenario("paper/nominal", changes)


OWN = """
from springline.model import Observer, Parameter, Quantity

class Slow(Observer):
    parameters = (Parameter("rate", "1/s", 5.0, "of forgetting"),)
    states = (Quantity("bias", "b", "{q}/s^2", "what is left"),)
    def estimate(self, y, u, z, model, p):
        arm = model(y.q1, y.dq1)
        return DISTURBANCE, {"bias": -p.rate * z.bias + 0 * u}
"""


def own(folder: Path, disturbance: str) -> dict[str, Any]:
    file = folder / "slow.py"
    file.write_text(OWN.replace("DISTURBANCE", disturbance))
    return {"control.observer": f"{file}:Slow", "simulation.duration": 0.1}


def test_an_observer_of_a_user_s_file_has_columns_and_keys(tmp_path: Path) -> None:
    changes = own(tmp_path, "z.bias") | {"control.slow.rate": 7.0}
    scenario = load_scenario("paper/nominal", changes)
    assert scenario.values_for({"control.slow.rate": [1.0, 2.0]}).shape[0] == 2
    table = simulate(scenario).trajectory
    assert "z_bias_lift" in table.column_names
    plain = simulate(load_scenario("paper/nominal", {"simulation.duration": 0.1})).trajectory
    np.testing.assert_array_equal(table["U_lift"], plain["U_lift"])  # a bias that starts at zero stays there


@pytest.mark.parametrize(
    ("disturbance", "message"),
    [
        ("z.bias + u", "observer slow: d depends on u, expected y and z alone: u is computed from d"),
        ("z.bias[0]", "observer slow: d: expected 2 x 1, got 1 x 1"),
        ("None", "observer slow: d: expected a CasADi SX expression, got NoneType"),
    ],
)
def test_an_observer_that_cannot_be_is_told_with_its_file(disturbance: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        load_scenario("paper/nominal", own(tmp_path, disturbance))
    assert message in str(error.value)
    assert "slow.py" in str(error.value)
    assert "control.observer" in str(error.value)


def test_a_controller_and_an_observer_of_one_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "from springline.model import Control, Controller, Observer, Parameter\n"
        "class Mine(Controller):\n"
        "  name, parameters = 'mine', (Parameter('k', '1', 1.0, 'gain'),)\n"
        "  def control(self, r, y, z, model, p): return Control(p.k * (r.q - y.q1), r.q - y.q1)\n"
        "class Other(Observer):\n"
        "  name, parameters = 'mine', (Parameter('k', '1', 1.0, 'gain'),)\n"
        "  def estimate(self, y, u, z, model, p): return 0 * y.q1, {}\n"
    )
    (tmp_path / "s.toml").write_text("[control]\ncontroller = 'own.py:Mine'\nobserver = 'own.py:Other'\n")
    with pytest.raises(InputError, match="two of controller, observer and law are called 'mine'"):
        load_scenario(tmp_path / "s.toml")
