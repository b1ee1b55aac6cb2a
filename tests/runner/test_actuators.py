"""[actuator] in scenarios and batches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from springline.runner import InputError, batch, load_scenario, simulate
from springline.runner.sweep import Plan, load_sweep

SAMPLED = {"control.mode": "sampled", "control.period": 1e-3, "simulation.duration": 0.02}
SLOW = SAMPLED | {"actuator.delay": 5e-4, "actuator.lag": [0.0, 2e-4], "actuator.rate_limit": 1e7}


def test_a_command_stands_beside_what_acts(tmp_path: Path) -> None:
    scenario = load_scenario("paper/nominal", SLOW | {"simulation.output_every": 1})
    result = simulate(scenario)
    assert result.trajectory.column_names[-2:] == ["U_cmd_lift", "U_cmd_rotation"]
    assert result.trajectory.schema.field("U_cmd_rotation").metadata == {b"unit": b"N m"}
    acts, asked = (result.trajectory[name].to_numpy() for name in ("U_lift", "U_cmd_lift"))
    assert not acts[:5].any() and asked[0] != 0.0
    assert "U_cmd_lift" not in simulate(load_scenario("paper/nominal", SAMPLED)).trajectory.column_names
    path = tmp_path / "again.toml"
    path.write_text(scenario.to_toml(tmp_path))
    assert load_scenario(path) == scenario
    assert scenario.structure().effects == ("rate_limit", "lag") and scenario.structure().delay == 5


def test_a_batch_varies_what_motors_do() -> None:
    scenario = load_scenario("paper/nominal", SLOW)
    lags = np.array([1e-4, 2e-4])
    table = batch(scenario, {"actuator.lag": lags})
    for k, lag in enumerate(lags):
        alone = simulate(scenario.with_overrides({"actuator.lag": lag}))
        assert alone.metrics["rms_error_lift"][0].as_py() == table["rms_error_lift"][k].as_py()


def test_limits_vary_from_none_in_a_scenario_that_has_none(tmp_path: Path) -> None:
    """In a batch and in a sweep: infinity among them changes no bit; lags and sensors vary from zero."""
    scenario = load_scenario("paper/nominal", SAMPLED | {"drive.kind": "rigid"})
    rates = np.array([np.inf, 1e5, 1e6])
    table = batch(scenario, {"actuator.rate_limit": rates})
    found = table["rms_error_lift"].to_pylist()
    assert len(set(found)) == 3
    for k, rate in enumerate(rates):
        alone = simulate(scenario.with_overrides({"actuator.rate_limit": rate}))
        assert alone.metrics["rms_error_lift"][0].as_py() == found[k]
    (tmp_path / "limits.toml").write_text("""
        scenario = "paper/nominal"
        method = "grid"
        [set]
        "control.mode" = "sampled"
        "control.period" = 1e-3
        "drive.kind" = "rigid"
        "simulation.duration" = 0.02
        [vary]
        "actuator.rate_limit.1" = { values = [inf, 1e5] }
        "actuator.lag" = { values = [0.0, 1e-4] }
        "sensor.position_resolution" = { values = [0.0, 1e-4] }
    """)
    sweep = load_sweep(tmp_path / "limits.toml")
    assert {group.work.system.structure.effects for group in Plan(sweep).groups} == {
        ("rate_limit",),
        ("rate_limit", "lag"),
        ("position_resolution", "rate_limit"),
        ("position_resolution", "rate_limit", "lag"),
    }


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (SAMPLED | {"actuator.delay": 1.7e-4}, "actuator.delay: expected a whole multiple of simulation.step"),
        (SAMPLED | {"actuator.delay": -1e-4}, "actuator.delay: expected a number >= 0 [s]"),
        (SAMPLED | {"actuator.delay": 1.0}, "actuator.delay: expected at most 0.1 s"),
        (SAMPLED | {"actuator.lag": -1.0}, "actuator.lag: expected a number >= 0 [s]"),
        (SAMPLED | {"actuator.rate_limit": 0.0}, "actuator.rate_limit: expected a number > 0"),
        ({"actuator.delay": 1e-4}, 'actuator.delay: only goes with control.mode = "sampled"'),
        ({"actuator.lag": 1e-4}, 'actuator.lag: only goes with control.mode = "sampled"'),
    ],
)
def test_wrong_actuators_are_refused(changes: dict[str, object], told: str) -> None:
    with pytest.raises(InputError) as error:
        load_scenario("paper/nominal", changes)
    assert told in str(error.value)
