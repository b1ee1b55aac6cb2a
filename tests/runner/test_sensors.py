"""[sensor] in scenarios, batches and replay."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

from springline.runner import InputError, batch, load_scenario, simulate
from springline.runner.cli import app
from springline.runner.sweep import read_dataset

SAMPLED = {"control.mode": "sampled", "control.period": 1e-3, "simulation.duration": 0.02}
DIFFERENCED = SAMPLED | {"sensor.velocity": "differenced", "sensor.velocity_cutoff": [500.0, math.inf]}
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
        (
            {"control.mode": "continuous", "sensor.velocity": "differenced"},
            'sensor.velocity: only goes with control.mode = "sampled"',
        ),
        (SAMPLED | {"sensor.velocity": "difference"}, "did you mean 'differenced'?"),
        (DIFFERENCED | {"sensor.velocity_cutoff": 0.0}, "sensor.velocity_cutoff: expected a number > 0"),
        (DIFFERENCED | {"sensor.velocity_cutoff": -1.0}, "sensor.velocity_cutoff: expected a number > 0"),
        (SAMPLED | {"sensor.velocity_cutoff": 300.0}, 'cutoff: only goes with sensor.velocity = "differenced"'),
        (DIFFERENCED | {"sensor.velocity_noise": 1.0}, 'velocity_noise: only goes with sensor.velocity = "measured"'),
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


def test_replay_has_the_noise_of_its_run(tmp_path: Path) -> None:
    """From a dataset, whose runs count through its groups, and as a scenario with the run's number."""
    base = SAMPLED | {
        "drive.kind": "rigid",
        "sensor.velocity": "differenced",
        "sensor.position_resolution": 1e-5,
        "sensor.seed": 42,
    }
    (tmp_path / "noisy.toml").write_text(f"""
        scenario = "paper/nominal"
        method = "grid"
        [set]
        {"".join(f"{key!r} = {json.dumps(value)}" + chr(10) for key, value in base.items())}
        [vary]
        "control.k1" = {{ each = [1.0, 2.0] }}
        "sensor.position_noise" = {{ values = [1e-5, 1.0000000001e-5] }}
    """)
    folder, again = tmp_path / "data", tmp_path / "again"
    invoked = CliRunner().invoke
    done = invoked(app, ["batch", str(tmp_path / "noisy.toml"), "-o", str(folder), "--no-plot", "--jobs", "1"])
    assert done.exit_code == 0, done.output
    rows, seen = {row["run"]: row for row in read_dataset(folder).to_pylist()}, set()
    for run in (0, 3):
        done = invoked(app, ["replay", str(folder), str(run), "-o", str(again), "--no-plot", "--force"])
        assert done.exit_code == 0 and "bit for bit" in done.stdout, done.output
        own = {key: rows[run][key] for key in ("sensor.position_noise", "control.k1")}
        alone = simulate(load_scenario("paper/nominal", base | own | {"sensor.run": run}))
        replayed = parquet.read_table(again / "trajectory.parquet")
        assert replayed.equals(alone.trajectory)
        metrics = {name: alone.metrics[name][0].as_py() for name in ("rms_error_lift", "U_rms_rotation")}
        assert metrics == {name: rows[run][name] for name in metrics}
        seen.add(replayed["q1_measured_lift"].to_numpy().tobytes())
    assert len(seen) == 2


def test_a_noisy_encoder_is_followed_and_a_filter_calms_it(tmp_path: Path) -> None:
    """Steps of a 17-bit turn and of 20 micrometres: settled as with ideal sensors, at rest within a few steps."""
    ideal = SAMPLED | {"drive.kind": "rigid", "simulation.duration": 1.0, "simulation.output_every": 1000}
    steps = {"sensor.position_resolution": [2e-5, 4.8e-5], "sensor.position_noise": 1e-5}
    rough = ideal | steps | {"sensor.velocity": "differenced"}
    scenario = load_scenario("paper/nominal", rough | {"sensor.velocity_cutoff": [1000.0, 500.0]})
    path = tmp_path / "again.toml"
    path.write_text(scenario.to_toml(tmp_path))
    assert load_scenario(path) == scenario
    runs = [simulate(load_scenario("paper/nominal", changes)) for changes in (ideal, rough)]
    [sound], [unfiltered], [filtered] = (run.metrics.to_pylist() for run in (*runs, simulate(scenario)))
    for found in (unfiltered, filtered):
        assert found["settling_time_lift"] == pytest.approx(sound["settling_time_lift"], rel=0.02)
        assert found["steady_state_error_lift"] < 1e-3
    for joint in ("lift", "rotation"):
        assert sound[f"chatter_{joint}"] < filtered[f"chatter_{joint}"] < 0.8 * unfiltered[f"chatter_{joint}"]


def test_rates_are_measured_or_differenced_and_keep_what_goes_with_it() -> None:
    differenced = load_scenario("paper/nominal", DIFFERENCED)
    assert differenced.structure().differenced and "velocity_noise" not in differenced.document["sensor"]
    measured = differenced.with_overrides({"sensor.velocity": "measured", "sensor.velocity_noise": 1e-3})
    assert not measured.structure().differenced and "velocity_cutoff" not in measured.document["sensor"]
    again = measured.with_overrides({"sensor.velocity": "differenced"})
    assert again.value_of("sensor.velocity_cutoff.0") == math.inf
    assert "velocity_noise" not in again.document["sensor"]
