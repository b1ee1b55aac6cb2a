"""A single run: what its columns mean, what its last words are, and what is refused before it starts."""

import hashlib
import shutil
from collections import namedtuple
from importlib import import_module
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from typer.testing import CliRunner, Result

from springline.codegen.kernel import METRICS, MOST_STEPS, LoopSettings, Runs
from springline.runner.cli import app
from springline.runner.files import InputError
from springline.runner.run import metrics_schema, metrics_table, simulate, trajectory_hash, trajectory_table
from springline.runner.run.simulation import outcome
from springline.runner.scenario import load_scenario


def springline(*arguments: str | Path) -> Result:
    """Run a command in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="springline")


def test_tables_have_the_loops_doubles_and_null_for_a_metric_that_there_is_none() -> None:
    system = load_scenario("paper/nominal").system()
    found = np.random.default_rng(1).normal(size=(3, system.n, len(METRICS)))
    found[1, 0, 2] = found[2, 1, 0] = np.nan
    runs = Runs(found, np.zeros((3, 8)), np.array([4.0, -0.0, 1.0]), np.array([0, 1, 0]), np.full(3, -1), None, None)
    table = metrics_table(system, runs)
    table.validate(full=True)
    assert table.schema.equals(metrics_schema(system), check_metadata=True)
    assert table["status"].to_pylist() == ["ok", "diverged", "ok"]
    assert table["t_end"].equals(pa.chunked_array([pa.array(runs.end_time)]))
    for number, name in enumerate(table.column_names[:-2]):
        values = found[:, number % system.n, number // system.n]
        assert table[name].equals(pa.chunked_array([pa.array(values, mask=np.isnan(values))]))
    assert sum(table[name].null_count for name in table.column_names) == 2
    rows = np.random.default_rng(2).normal(size=(5, len(system.trajectory)))
    rows[4, 3] = np.nan  # stays a number, which is none
    for length in (5, 0):
        table = trajectory_table(system, rows[:length])
        table.validate(full=True)
        assert table.num_rows == length and table["t"].null_count == 0
        for column, values in zip(table.columns, rows[:length].T, strict=True):
            assert column.to_numpy().tobytes() == values.tobytes()


def test_a_trajectorys_hash_is_of_its_doubles_in_their_order() -> None:
    """Null and NaN are one number, neither chunks nor other columns count, the order and a zero's sign do."""
    t, x = [0.0, 0.5, 1.0], [1.0, None, -0.0]
    wanted = hashlib.sha256(
        bytes.fromhex("0000000000000000 000000000000e03f 000000000000f03f")
        + bytes.fromhex("000000000000f03f 000000000000f87f 0000000000000080")
    ).hexdigest()
    assert trajectory_hash(pa.table({"t": t, "x": x})) == wanted
    negative = -np.array([np.nan])[0]
    assert trajectory_hash(pa.table({"t": t, "n": [1, 2, 3], "x": [1.0, negative, -0.0]})) == wanted
    chunked = pa.chunked_array([pa.array([1.0]), pa.array([None, -0.0], pa.float64())])
    assert trajectory_hash(pa.table({"t": t, "x": chunked})) == wanted
    for other in ({"x": x, "t": t}, {"t": t, "x": [1.0, None, 0.0]}, {"t": t}):
        assert trajectory_hash(pa.table(other)) != wanted


def test_metrics_have_the_unit_of_what_they_measure() -> None:
    system = load_scenario("paper/nominal").system()
    joints, schema = system.joints, metrics_schema(system)
    found = {field.name: field.metadata[b"unit"].decode() for field in schema}
    expected = {
        "response_time": ("s", "s"),
        "settling_time": ("s", "s"),
        "overshoot": ("m", "rad"),
        "steady_state_error": ("m", "rad"),
        "rms_error": ("m", "rad"),
        "iae": ("m s", "rad s"),
        "U_max": ("N", "N m"),
        "U_rms": ("N", "N m"),
        "chatter": ("1/s", "1/s"),
        "U_tv": ("N", "N m"),
        "sigma_tv": ("m/s", "rad/s"),
        "dq1_tv": ("m/s", "rad/s"),
    }
    assert list(found) == [f"{metric}_{joint.name}" for metric in METRICS for joint in joints] + ["status", "t_end"]
    for metric, pair in expected.items():
        assert tuple(found[f"{metric}_{joint.name}"] for joint in joints) == pair, metric


@pytest.mark.parametrize(
    ("overrides", "low", "high"),
    [
        ({}, 0.9, 1.3),
        ({"control.delta": 0.02}, 240.0, 440.0),
        ({"control.mode": "sampled", "control.period": 2e-3, "control.law": "double_power"}, 140.0, 280.0),
    ],
)
def test_chatter_tells_swinging_commands_from_clean_ones(
    overrides: dict[str, object], low: float, high: float, tmp_path: Path
) -> None:
    """The figures of the nominal run; by hand from a trajectory of every step."""
    scenario = load_scenario("paper/nominal", {**overrides, "simulation.output_every": 1})
    result = simulate(scenario)
    assert result.status == "ok"
    (row,) = result.metrics.to_pylist()
    for joint in ("lift", "rotation"):
        force = result.trajectory[f"U_{joint}"].to_numpy()
        second = force[scenario.steps // 2 :]
        length = (scenario.steps - scenario.steps // 2) * scenario.step
        scale = max(np.ptp(second), 1e-3 * np.abs(force).max())
        assert row[f"chatter_{joint}"] == pytest.approx(np.abs(np.diff(second)).sum() / length / scale, rel=1e-9)
        assert low < row[f"chatter_{joint}"] < high
        assert (f"U_{joint} by {row[f'chatter_{joint}']:.3g} 1/s" in result.message) == (low > 20.0)
    assert ("chattering" in result.message) == (low > 20.0)
    settings = [argument for key, value in overrides.items() for argument in ("--set", f"{key}={value!r}")]
    shown = springline("run", "paper/nominal", "--no-plot", "-o", tmp_path / "out", *settings)
    assert shown.exit_code == 0, shown.stderr
    assert shown.stdout.splitlines()[-1] == result.message


@pytest.mark.parametrize("duration", [0.02, 0.1, 0.2])
def test_the_one_swing_of_a_short_run_is_no_chatter(duration: float) -> None:
    result = simulate(load_scenario("paper/group1_shake", {"simulation.duration": duration}))
    assert result.metrics["chatter_lift"][0].as_py() > 1.9 / duration, "about one swing in half of it"
    assert "chattering" not in result.message


@pytest.mark.parametrize(
    ("chatter", "told"),
    [
        ((20.1, 19.9), "; chattering: U_lift by 20.1 1/s (calm is up to 20)"),
        ((0.0, 300.0), "; chattering: U_rotation by 300 1/s (calm is up to 20)"),
        ((np.nan, 20.0), ""),
    ],
)
def test_only_the_command_that_chatters_is_named(chatter: tuple[float, float], told: str) -> None:
    metrics = np.full((1, 2, len(METRICS)), np.nan)
    metrics[0, :, METRICS.index("chatter")] = chatter
    none = np.zeros(1, np.int32)
    runs = Runs(metrics, np.zeros((1, 8)), np.array([1.0]), none, none - 1)
    system = load_scenario("paper/nominal").system()
    assert outcome(system, runs, 0, LoopSettings(1000, 1e-3)) == ("ok", f"done: 1 s in 1000 steps{told}")


@pytest.mark.parametrize("engine", ["lanes", "casadi"])
@pytest.mark.parametrize(
    ("overrides", "quantity"),
    [
        ({"reference.rotation.offset": -1e200}, "sigma_rotation"),
        ({"mechanism.L3": 1e300}, "U_rotation"),
        ({"control.k1": 1e300, "control.a_max": float("inf"), "drive.m_l": 1e60}, "U_lift"),
    ],
)
def test_an_overflow_that_the_limits_hide_is_told(engine: str, overrides: dict[str, object], quantity: str) -> None:
    scenario = load_scenario("paper/nominal", {**overrides, "control.U_max": [700.0, 90.0]})
    result = simulate(scenario, engine=engine)  # type: ignore[arg-type] # parametrized
    assert (result.status, result.message) == (
        "diverged",
        f"diverged: {quantity} left the finite numbers at t = 0 s, where results end",
    )
    assert len(result.trajectory) == 1
    assert not np.isfinite(result.trajectory[quantity].to_numpy()).any()


@pytest.mark.parametrize("engine", ["lanes", "casadi"])
@pytest.mark.parametrize("a_max", [200.0, float("inf")])
def test_a_law_that_overflows_before_a_max_is_told_in_words(engine: str, a_max: float) -> None:
    scenario = load_scenario("paper/nominal", {"control.k1": 1e308, "control.a_max": a_max})
    result = simulate(scenario, engine=engine)  # type: ignore[arg-type] # parametrized
    assert (result.status, result.message) == (
        "diverged",
        "diverged: the acceleration that the reaching law asks for before a_max (lift) left the finite numbers "
        "at t = 0 s, where results end",
    )
    assert len(result.trajectory) == 1


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (["control.l=101"], "control.l: expected a positive odd integer up to 99, got 101"),
        (["control.r=100000001"], "control.r: expected a positive odd integer up to 99, got 100000001"),
        (["control.m=9223372036854775809"], "control.m: expected a positive odd integer up to 99"),
        (
            ["simulation.output_every=18446744073709551617"],
            f"output_every: expected a positive integer up to {MOST_STEPS}",
        ),
        (
            ["control.mode='sampled'", "control.period=3.6893488147419103e15"],
            f"control.period: expected at most 9.0072e+11 s, {MOST_STEPS} times simulation.step = 0.0001 s",
        ),
        (["simulation.duration=1e305"], f"simulation.duration: expected at most 9.0072e+11 s, {MOST_STEPS} times"),
        (["simulation.step=1e-300"], "simulation.duration: expected at most 9.0072e-285 s"),
        (
            ["simulation.duration=1e11"],
            "simulation.output_every: expected at least 100000021 for 1000000000000000 steps",
        ),
    ],
)
def test_numbers_too_large_to_run_with_are_refused_with_key_and_limit(
    changes: list[str], told: str, tmp_path: Path
) -> None:
    settings = [argument for change in changes for argument in ("--set", change)]
    result = springline("run", "paper/nominal", *settings, "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert told in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_trajectory_beyond_the_memory_is_refused_before_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three times 32 numbers a row; the first row and the last come besides those that output_every asks for."""
    scenario = load_scenario("paper/nominal", {"simulation.duration": 0.1, "simulation.output_every": 3})
    rows, module = 1000 // 3 + 2, import_module("springline.runner.run.limits")
    monkeypatch.setattr(module, "memory", lambda: 3 * 8 * 32 * rows)
    assert len(simulate(scenario).trajectory) == rows
    monkeypatch.setattr(module, "memory", lambda: 3 * 8 * 32 * rows - 1)
    told = (
        f"output_every: expected at least 4 for 1000 steps: {rows} rows are more than {rows - 1}, all that .* of memory"
    )
    with pytest.raises(InputError, match=told):
        simulate(scenario)
    assert len(simulate(scenario.with_overrides({"simulation.output_every": 4})).trajectory) < rows


@pytest.mark.parametrize(("form", "size"), [("parquet", 256), ("csv", 640)])
def test_a_trajectory_beyond_the_disk_is_refused_before_the_run(
    form: str, size: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = namedtuple("disk", "free")
    monkeypatch.setattr(shutil, "disk_usage", lambda _: disk(101 * size - 1))
    arguments = ("run", "paper/nominal", "--set", "simulation.duration=0.1", "--format", form, "-o", tmp_path / "out")
    result = springline(*arguments, "--no-plot")
    assert result.exit_code == 2
    assert "simulation.output_every: expected at least 11 for 1000 steps: 101 rows are more than 100" in result.stderr
    assert "free disk space" in result.stderr
    assert not (tmp_path / "out").exists()
    monkeypatch.setattr(shutil, "disk_usage", lambda _: disk(101 * size))
    assert springline(*arguments, "--no-plot").exit_code == 0


@pytest.mark.parametrize("tunable", ["none", "all"])
def test_generate_names_the_number_that_the_model_cannot_compute_with(tunable: str, tmp_path: Path) -> None:
    scenario = tmp_path / "large.toml"
    for key, value in (("L3", "1e300"), ("m3", "3e305")):
        scenario.write_text(f"[mechanism]\n{key} = {value}\n")
        result = springline("generate", scenario, "-o", tmp_path / "c", "--tunable", tunable)
        assert result.exit_code == 2
        assert f"large.toml: mechanism.{key}: " in result.stderr
        assert "is not a finite double" in result.stderr
        assert not (tmp_path / "c").exists()
    result = springline("generate", scenario, "-o", tmp_path / "c", "--tunable", tunable, "--real", "float")
    assert result.exit_code == 2
