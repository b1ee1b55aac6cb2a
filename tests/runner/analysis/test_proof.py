"""The disturbance that a law meets along a run, and what the paper's theorems say with it."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from springline.model.theory import Gap
from springline.runner.analysis import Proof, disturbance, proof_of, proof_reaches, reaching_law
from springline.runner.run import simulate
from springline.runner.scenario import Scenario, load_scenario, packaged_scenarios

STOPS = {"paper/as_printed", "paper/group4_fast_off"}
SETTLES = sorted(name for name in packaged_scenarios() if name.startswith("paper/") and name not in STOPS)


def columns_of(scenario: Scenario) -> dict[str, NDArray[np.float64]]:
    trajectory = simulate(scenario.with_overrides({"simulation.output_every": 2})).trajectory
    return {name: trajectory[name].to_numpy() for name in trajectory.column_names}


@cache
def proof(name: str, **overrides: Any) -> Proof:
    scenario = load_scenario(name, {key.replace("__", "."): value for key, value in overrides.items()})
    return proof_of(scenario, columns_of(scenario))


@pytest.mark.parametrize("name", SETTLES)
def test_sigma_stays_in_the_residual_set_once_the_run_has_settled(name: str) -> None:
    found = proof(name)
    assert np.all(np.array(found.remaining) <= np.array(found.residual))


def test_with_the_base_alone_two_runs_would_leave_it() -> None:
    """E12: a payload that the controller does not know is a disturbance too, of which H^-1 S says nothing."""
    found = proof("paper/group3_payload_plus")
    assert found.remaining == pytest.approx((0.179, 0.072), abs=5e-4)
    law = reaching_law(load_scenario("paper/group3_payload_plus"))
    assert np.all(np.abs(law(np.array(found.remaining))) > found.margin.per_joint)
    assert np.all(found.disturbed.per_joint > found.margin.per_joint)


def test_a_base_that_moves_is_all_that_disturbs_a_controller_that_knows_its_arm() -> None:
    found = proof("paper/group1_shake")
    assert found.disturbed.per_joint == pytest.approx([5.713, 0.579], rel=0.01)
    assert found.margin.per_joint == pytest.approx([5.869, 0.579], rel=0.01)
    assert found.margin.c1 == pytest.approx(3 - found.margin.bound)
    assert found.bounds.sliding == pytest.approx([0.342, 0.400], abs=5e-4)
    assert found.tail == pytest.approx(36.8, abs=0.1)
    assert Gap.NO_MARGIN in found.gaps
    # The law asks for the disturbance at the edge of the residual set.
    edge = np.abs(reaching_law(load_scenario("paper/group1_shake"))(np.array(found.residual)))
    assert edge == pytest.approx(found.disturbed.per_joint, rel=1e-6)


def test_the_disturbance_is_what_sigma_does_beyond_its_law() -> None:
    """Against differences of sigma along the run; the springs' ringing of the first moments is left out."""
    scenario = load_scenario("paper/group3_payload_plus", {"simulation.duration": 1.0, "simulation.step": 5e-5})
    columns = columns_of(scenario)
    sigma, d = disturbance(scenario, columns)
    assert sigma == pytest.approx(np.array([columns["sigma_lift"], columns["sigma_rotation"]]), abs=1e-9)
    rate = np.gradient(sigma, columns["t"], axis=1)
    asked = np.array([np.clip(reaching_law(scenario)(row), -200.0, 200.0) for row in sigma])
    late = slice(6000, -1)
    assert d[:, late] == pytest.approx((rate - asked)[:, late], abs=0.02)


def test_a_controller_without_the_paper_s_law_has_no_proof() -> None:
    assert proof_reaches(load_scenario("paper/nominal")) == ""
    assert "has no reaching law" in proof_reaches(load_scenario("controllers/super_twisting"))
    text = proof_reaches(load_scenario("paper/nominal", {"control.controller": "computed_torque"}))
    assert "computed torque" in text
