"""[sensor] in scenarios, batches and replay."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from springline.runner import InputError, batch, load_scenario, simulate

SAMPLED = {"control.mode": "sampled", "control.period": 1e-3, "simulation.duration": 0.02}
NOISY = SAMPLED | {"sensor.position_noise": 1e-4, "sensor.velocity_noise": [1e-3, 2e-3], "sensor.seed": 42}


def test_each_run_of_a_batch_has_noise_of_its_own_and_has_it_again_alone() -> None:
    scenario = load_scenario("paper/nominal", NOISY)
    same = np.full(5, 0.05)
    table = batch(scenario, {"control.delta": same})
    errors = table["rms_error_lift"].to_pylist()
    assert len(set(errors)) == 5
    for run in (0, 3):
        alone = simulate(scenario.with_overrides({"control.delta": 0.05, "sensor.run": run}))
        assert alone.metrics["rms_error_lift"][0].as_py() == errors[run]
    other = batch(scenario.with_overrides({"sensor.seed": 43}), {"control.delta": same})
    assert not set(errors) & set(other["rms_error_lift"].to_pylist())


def test_columns_of_what_is_measured_stand_beside_the_state() -> None:
    result = simulate(load_scenario("paper/nominal", NOISY))
    names = result.trajectory.column_names
    assert [name for name in names if "measured" in name] == [
        f"{quantity}_measured_{joint}" for quantity in ("q1", "dq1", "q2", "dq2") for joint in ("lift", "rotation")
    ]
    assert result.trajectory.schema.field("dq1_measured_rotation").metadata == {b"unit": b"rad/s"}
    coarse = simulate(load_scenario("paper/nominal", SAMPLED | {"sensor.position_resolution": [0.0, 1e-3]}))
    assert "q1_measured_lift" in coarse.trajectory.column_names
    assert "dq1_measured_lift" not in coarse.trajectory.column_names
    measured = coarse.trajectory["q1_measured_rotation"].to_numpy() / 1e-3
    np.testing.assert_allclose(measured, np.round(measured), atol=1e-9)
    ideal = coarse.trajectory["q1_measured_lift"].to_numpy()
    np.testing.assert_array_equal(ideal, coarse.trajectory["q1_lift"].to_numpy())  # a row is a sample here


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (NOISY | {"control.mode": "continuous"}, 'sensor.position_noise: only goes with control.mode = "sampled"'),
        (SAMPLED | {"sensor.velocity_noise": -1.0}, "sensor.velocity_noise: expected a number >= 0 [m/s]"),
        (SAMPLED | {"sensor.position_resolution": [1e-3]}, "as a list of 2 (lift, rotation)"),
        (SAMPLED | {"sensor.seed": 2**32}, "sensor.seed: expected an integer from 0 to 4294967295"),
        (SAMPLED | {"sensor.seed": 1.5}, "sensor.seed: expected an integer"),
        (SAMPLED | {"sensor.run": -1}, "sensor.run: expected an integer"),
        (SAMPLED | {"sensor.noise": 1.0}, "sensor.noise: unknown key"),
    ],
)
def test_wrong_sensors_are_refused(changes: dict[str, object], told: str) -> None:
    with pytest.raises(InputError) as error:
        load_scenario(
            "paper/nominal",
            {k: v for k, v in changes.items() if k != "control.period"}
            | ({"control.period": 1e-3} if changes["control.mode"] == "sampled" else {}),
        )
    assert told in str(error.value)


def test_a_resolved_scenario_keeps_its_sensors(tmp_path: Path) -> None:
    scenario = load_scenario("paper/nominal", NOISY | {"sensor.run": 7})
    path = tmp_path / "again.toml"
    path.write_text(scenario.to_toml(tmp_path))
    again = load_scenario(path)
    assert again == scenario and (again.seed, again.run_number) == (42, 7)
    assert again.structure().effects == ("position_noise", "velocity_noise")
    assert load_scenario("paper/nominal", SAMPLED).structure().effects == ()


def test_a_sweep_over_noise_groups_what_has_none() -> None:
    scenario = load_scenario("paper/nominal", SAMPLED)
    levels = np.array([1e-4, 2e-4, 1e-3])
    table = batch(scenario, {"sensor.position_noise": levels})
    assert len(set(table["rms_error_lift"].to_pylist())) == 3
