"""What the loop is told of a scenario."""

from __future__ import annotations

from springline.codegen.kernel import LoopSettings
from springline.runner.scenario import Scenario


def loop_settings(scenario: Scenario, *, trajectory: bool) -> LoopSettings:
    """What the loop is told about the scenario."""
    return LoopSettings(
        steps=scenario.steps,
        step=scenario.step,
        bound=scenario.bound,
        hold=max(scenario.control_every, 1),
        output_every=scenario.output_every if trajectory else 0,
        response_band=scenario.response_band,
        settling_band=scenario.settling_band,
        response_error=scenario.response_error,
        settling_error=scenario.settling_error,
        limits=scenario.limits,
        seed=scenario.seed,
    )
