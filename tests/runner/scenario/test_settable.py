"""The keys that a scenario offers to be set, and the values that it says they have."""

from __future__ import annotations

import re

import numpy as np
import pytest

from springline.runner.files import InputError, read_toml
from springline.runner.scenario import Scenario, draft_scenario, settable_keys
from springline.runner.scenario.dotted import flat

WAVES = {"base_motion.kind": "sine", "base_motion.heave": [{"amplitude": 0.1, "omega": 1.0}]}
CASES = {
    "nominal": ("paper/nominal", {}),
    "scaled plant": ("paper/nominal", {"plant.m3.scale": 1.2, "plant.link_viscous": [3.0, 2.0]}),
    "rigid": ("paper/nominal", {"drive.kind": "rigid"}),
    "polynomial": ("paper/nominal", {"reference": {"kind": "polynomial", "lift": {"t": [0.0, 1.0], "q": [0.0, 0.5]}}}),
    "limited": ("paper/nominal", {"mechanism.limits": [[-2.0, 2.0], [-3.0, 3.0]]}),
    "ship": ("ship/vessel_10hz", {}),
    "waves and observer": ("controllers/super_twisting", {**WAVES, "control.observer": "disturbance"}),
    "planar": ("paper/nominal", {"mechanism.name": "planar_arm"}),
}


@pytest.fixture(params=CASES)
def scenario(request: pytest.FixtureRequest) -> Scenario:
    name, changes = CASES[request.param]
    return draft_scenario(name).with_overrides(changes, read=False)


def test_every_value_that_is_offered_is_taken_and_changes_nothing(scenario: Scenario) -> None:
    offered = {key: item.value for key, item in settable_keys(scenario).items() if isinstance(item.value, float | str)}
    assert len(offered) > 60
    for key, value in offered.items():
        again = scenario.with_overrides({key: value}, read=False)
        assert np.array_equal(again.values(), scenario.values()), key


def test_every_name_that_is_offered_is_known(scenario: Scenario) -> None:
    """It may need another key beside it, or a file; but nothing says that there is no such thing."""
    taken, refused = 0, []
    for key, item in settable_keys(scenario).items():
        for name in item.names:
            value = read_toml(
                f"value = {name}" if name in ("true", "false") or name.isdecimal() else f'value = "{name}"'
            )
            try:
                scenario.with_overrides({key: value["value"]}, read=False)
                taken += 1
            except InputError as error:
                said = [problem.expected for problem in error.problems if problem.key == key]
                refused += [(key, name, text) for text in said if not text.startswith("only goes with")]
    assert taken > 15
    assert not refused


def test_no_key_of_a_scenario_is_missing(scenario: Scenario) -> None:
    """Nor any place of a list of numbers, but for the via points of a polynomial, of which there may be any number."""
    known = settable_keys(scenario)
    lost = [
        key
        for key in (key for key, _ in flat(scenario.document))
        if key not in known and not re.search(r"^reference\.\w+\.[tq]\.|limits|\.scale", key)
    ]
    assert not lost
