"""planar_arm: an arm of as many links as a scenario says."""

import math

import numpy as np
import pytest

from springline.runner import load_scenario, simulate
from springline.runner.files import InputError
from springline.runner.sweep import Plan, load_sweep

ARM = {"mechanism.name": "planar_arm"}
SHORT = {"simulation.duration": 0.01, "simulation.output_every": 10}


def arm(n, **changes):
    return load_scenario("paper/nominal", ARM | SHORT).with_overrides({"mechanism.n": n, **changes})


@pytest.mark.parametrize("n", [1, 2, 7])
def test_it_runs_with_as_many_joints(n):
    result = simulate(arm(n))
    assert result.status == "ok"
    names = [f"q1_joint{k + 1}" for k in range(n)]
    assert [name for name in result.trajectory.column_names if name.startswith("q1_")] == names
    assert result.trajectory["tip_x_ship"][0].as_py() == pytest.approx(0.5 * n)


def test_it_settles_under_its_default_gains():
    """Seven joints on one period of their packaged gains, each led by 0.2 rad within a second."""
    led = {f"joint{k + 1}": {"t": [0.0, 0.5], "q": [0.0, 0.2]} for k in range(7)}
    changes = {
        "reference": {"kind": "polynomial", **led},
        "simulation.duration": 1.0,
        "simulation.settling_error": 0.01,
    }
    result = simulate(arm(7, **changes))
    assert result.status == "ok"
    assert all(result.metrics[f"chatter_joint{k + 1}"][0].as_py() < 20 for k in range(7))
    assert all(result.metrics[f"steady_state_error_joint{k + 1}"][0].as_py() < 0.005 for k in range(7))


def test_another_number_of_joints_keeps_what_is_the_same_for_all():
    given = arm(2, **{"mechanism.mass": 5.0, "control.mu": 7.0, "reference.joint1.offset": 0.3})
    three = given.with_overrides({"mechanism.n": 3})
    assert three.value_of("mechanism.mass.2") == 5.0
    assert three.value_of("control.mu.2") == 7.0
    assert three.value_of("reference.joint1.offset") == 0.3
    assert three == given.with_overrides({"mechanism.n": 7}).with_overrides({"mechanism.n": 3})
    assert len(given.with_overrides({"mechanism.n": 1}).system().joints) == 1
    with pytest.raises(
        InputError, match=r"mechanism\.mass: .*as a list of 3 \(joint1, joint2, joint3\), got \[1\.0, 2\.0\]"
    ):
        given.with_overrides({"mechanism.mass": [1.0, 2.0]}).with_overrides({"mechanism.n": 3})


@pytest.mark.parametrize("n", [0, 8, 2.0, True, "two"])
def test_other_numbers_are_refused(n):
    with pytest.raises(InputError, match=r"mechanism\.n: expected the number of joints, one of 1, 2, 3, 4, 5, 6, 7"):
        arm(n)


def test_a_mass_on_its_axis_is_refused_only_where_nothing_carries_inertia():
    assert simulate(arm(1, **{"mechanism.com": 0.0})).status == "ok"
    assert simulate(arm(1, **{"mechanism.inertia": 0.0})).status == "ok"
    with pytest.raises(InputError, match=r"mechanism: the mass matrix .*joint1 = 0\) is not positive definite"):
        arm(1, **{"mechanism.com": 0.0, "mechanism.inertia": 0.0})


def test_one_link_is_the_flexible_joint_benchmark():
    """Spong's equations, integrated by hand in the same steps: same numbers to rounding."""
    scenario = arm(1, **{"control.U_max": 1e-9, "initial.q": [0.4], "simulation.output_every": 1})
    q, dq, q2, dq2 = (simulate(scenario).trajectory[f"{name}_joint1"].to_numpy() for name in ("q1", "dq1", "q2", "dq2"))

    def slope(x):
        spring = 1e4 * (x[2] - x[0])
        weight = 2.0 * 9.81 * 0.25 * math.cos(x[0])
        return np.array([x[1], (spring - weight) / (0.042 + 2.0 * 0.25**2), x[3], -spring / 0.1])

    x, h = np.array([0.4, 0.0, 0.4, 0.0]), scenario.step
    for k in range(len(q)):
        np.testing.assert_allclose([q[k], dq[k], q2[k], dq2[k]], x, rtol=1e-7, atol=1e-9)
        k1 = slope(x)
        k2 = slope(x + h / 2 * k1)
        k3 = slope(x + h / 2 * k2)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + slope(x + h * k3))


def test_a_sweep_over_the_number_of_joints_is_one_table(tmp_path):
    """What an arm does not have is null, never absent."""
    file = tmp_path / "sizes.toml"
    file.write_text(
        'scenario = "paper/nominal"\nmethod = "grid"\n[set]\nmechanism.name = "planar_arm"\n'
        "[vary]\nmechanism.n = { each = [1, 3] }\nmechanism.mass = { values = [1.0, 2.0] }\n"
    )
    plan = Plan(load_sweep(file))
    assert [joint.name for joint in plan.joints] == ["joint1", "joint2", "joint3"]
    names = [name for name in plan.schema.names if name.startswith("iae_")]
    assert names == ["iae_joint1", "iae_joint2", "iae_joint3"]
    assert plan.scenario_of(3).value_of("mechanism.mass.2") == 2.0


def test_arms_whose_joints_differ_in_unit_are_not_one_table(tmp_path):
    (tmp_path / "arms.py").write_text(
        "from springline.model import Joint, Link, Mechanism, Parameter\n"
        "class Slide(Mechanism):\n  joints = (Joint('joint1', 'm', 'N'),)\n"
        "  parameters = (Parameter('m', 'kg', 1.0, 'mass'), Parameter('g', 'm/s^2', 9.81, 'gravity'))\n"
        "  motor_inertia = (Parameter('motor', 'kg', 1.0, 'motor'),)\n"
        "  stiffness = (Parameter('spring', 'N/m', 1e4, 'spring'),)\n"
        "  def links(self, p): return [Link('slide', 'prismatic', mass=p.m)]\n"
    )
    file = tmp_path / "mixed.toml"
    file.write_text(
        'scenario = "paper/nominal"\nmethod = "grid"\n'
        '[vary]\nmechanism.name = { each = ["planar_arm", "arms.py:Slide"] }\n'
    )
    with pytest.raises(InputError, match=r"vary: .* would be in rad and in m: joints of one name in one sweep"):
        Plan(load_sweep(file))
