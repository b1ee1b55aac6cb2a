"""Where delay and sample period end a run of the paper's arm (PAPER.md E11, docs/hardware.md)."""

from __future__ import annotations

import pytest

from springline.codegen.kernel import CHATTERING
from springline.runner import load_scenario, simulate


def outcome(period: float, delay: float) -> str:
    """calm, chatters, or stops."""
    changes = {"control.mode": "sampled", "control.period": period, "actuator.delay": delay}
    result = simulate(load_scenario("paper/nominal", changes))
    (row,) = result.metrics.to_pylist()
    if result.status != "ok":
        return "stops"
    return "chatters" if max(row["chatter_lift"], row["chatter_rotation"]) > CHATTERING else "calm"


@pytest.mark.parametrize(
    ("period", "outcomes"),
    [
        (1e-4, {0.7e-3: "calm", 0.9e-3: "calm", 1.0e-3: "stops"}),
        (5e-4, {0.7e-3: "calm", 0.8e-3: "chatters", 0.9e-3: "stops"}),
        (1e-3, {0.5e-3: "calm", 0.6e-3: "stops", 1.0e-3: "stops"}),
        (1.9e-3, {0.0: "calm"}),
        (2e-3, {0.0: "calm", 0.1e-3: "chatters", 0.2e-3: "stops"}),
        (2.1e-3, {0.0: "stops"}),
    ],
)
def test_edges_of_delay_at_a_period(period: float, outcomes: dict[float, str]) -> None:
    assert {delay: outcome(period, delay) for delay in outcomes} == outcomes
