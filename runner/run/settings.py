"""What the loop is told of a scenario."""

from __future__ import annotations

from dataclasses import replace

from springline.codegen.kernel import LoopSettings
from springline.model.structure import Structure
from springline.runner.scenario import Scenario

_ROOM = 64  # steps of delay that a kernel has room for at least: all these delays share one


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
        delay=scenario.structure().delay or None,
    )


def kernel_structure(scenario: Scenario) -> Structure:
    """The structure of a scenario's kernel: with room for its delay and others, for how long it is is a number."""
    structure = scenario.structure()
    delay = structure.delay and max(_ROOM, 1 << (structure.delay - 1).bit_length())
    return replace(structure, delay=delay)
