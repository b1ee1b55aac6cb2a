"""Recorded base motion and references in whole runs: simulated, in a batch, in an FMU, and on the command line."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from typer.testing import CliRunner, Result

from springline.runner import batch, load_scenario, simulate
from springline.runner.cli import app
from springline.runner.files import InputError
from springline.runner.scenario import Scenario
from springline.runner.sweep import load_sweep, read_dataset

RECORD = {
    "kind": "table",
    "path": "springline:data/vessel_orcaflex_10hz.csv",
    "columns": {"t": "time_s", "shake": "heave", "pitch": "pitch", "roll": "roll"},
}
LASTS = 359.86328125


def sailing(duration: float = 1.0, **extra: object) -> Scenario:
    """The paper's arm on a piece of the packaged record, with a row of the trajectory every 0.5 ms."""
    changes = {"base_motion": RECORD | extra, "simulation.duration": duration, "simulation.output_every": 5}
    return load_scenario("paper/nominal", changes)


def base_of(trajectory: pa.Table) -> tuple[np.ndarray, np.ndarray]:
    """Times, and the base's motion (rows, 3)."""
    names = ("y_r1", "theta_1z", "theta_1x")
    return np.asarray(trajectory["t"]), np.stack([np.asarray(trajectory[name]) for name in names], axis=1)


@pytest.mark.parametrize("t0", [0.0, 100.03, 358.5])
def test_the_motion_within_the_record_does_not_depend_on_ends(t0: float) -> None:
    _, held = base_of(simulate(sailing(ends="hold", t0=t0)).trajectory)
    _, none = base_of(simulate(sailing(ends="error", t0=t0)).trajectory)
    assert np.abs(held - none).max() <= 1e-12
    assert np.ptp(held, axis=0).min() > 1e-4


@pytest.mark.parametrize("t0", [0.0, -0.4, -2.0, 123.0, LASTS - 0.5, LASTS - 0.01])
def test_a_vessel_is_nowhere_accelerated_more_than_in_its_record(t0: float) -> None:
    """Of 6 minutes of the record: 0.436 m/s^2 in heave, 0.0060 rad/s^2 in pitch and in roll."""
    scenario = sailing(2.1, ends="hold", t0=t0)
    (table,) = scenario.tables()
    own = np.abs(2 * table.coefficients[:, :, 2]).max(axis=0)
    assert own == pytest.approx([0.4357, 0.0060, 0.0060], rel=0.01)
    t, base = base_of(simulate(scenario).trajectory)
    felt = np.abs(np.diff(base[::20], n=2, axis=0) / (t[20] - t[0]) ** 2).max(axis=0)
    assert np.all(felt <= own * 1.001)
    assert np.all(felt >= 0.01 * own)  # it does move


def test_a_vessel_lies_still_long_before_and_after_its_record(tmp_path: Path) -> None:
    """At the first and at the last sample, a second before the one and a second after the other."""
    t = np.linspace(0.0, 1.0, 21)
    text = "t,a\n" + "".join(
        f"{time!r},{value!r}\n" for time, value in zip(t.tolist(), np.sin(9 * t).tolist(), strict=True)
    )
    (tmp_path / "m.csv").write_text(text)
    table = {"kind": "table", "path": str(tmp_path / "m.csv"), "columns": {"t": "t", "shake": "a"}}
    run = {"simulation.duration": 4.0, "simulation.output_every": 100}
    scenario = load_scenario("paper/nominal", {"base_motion": table | {"t0": -1.5}} | run)
    times, base = base_of(simulate(scenario).trajectory)
    assert np.all(base[times < 0.5, 0] == 0.0)
    assert np.all(base[times > 3.5, 0] == pytest.approx(math.sin(9.0), abs=1e-15))
    inside = (times >= 1.5) & (times <= 2.5)
    assert np.abs(base[inside, 0] - np.sin(9 * (times[inside] - 1.5))).max() < 1e-3


# The same record everywhere


def test_a_batch_reads_the_record_where_a_run_does() -> None:
    scenario = sailing(0.3, t0=200.5)
    (row,) = batch(scenario, {"control.delta": np.array([0.02])}).to_pylist()
    alone = simulate(scenario.with_overrides({"control.delta": 0.02})).metrics.to_pylist()[0]
    elsewhere = simulate(scenario.with_overrides({"control.delta": 0.02, "base_motion.t0": 40.0})).metrics.to_pylist()[
        0
    ]
    assert {name: row[name] for name in alone} == alone != elsewhere


def test_a_sweep_may_begin_at_several_times_of_the_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The record's path counts from the sweep's file, in whatever folder the command is given."""
    (tmp_path / "sweep").mkdir()
    t = np.linspace(0.0, 9.0, 91)
    rows = zip(t.tolist(), np.sin(3 * t).tolist(), strict=True)
    (tmp_path / "sweep" / "m.csv").write_text("t,a\n" + "".join(f"{time!r},{value!r}\n" for time, value in rows))
    (tmp_path / "sweep" / "s.toml").write_text("""
        method = "grid"
        [set]
        simulation.duration = 0.2
        base_motion = { kind = "table", path = "m.csv", columns = { t = "t", shake = "a" } }
        [vary]
        "base_motion.t0" = { values = [0.0, 2.5, 8.9] }
        "control.delta" = { values = [0.02, 0.03] }
    """)
    monkeypatch.chdir(tmp_path)
    assert springline("batch", "sweep/s.toml", "-o", "data", "--no-plot", "--jobs", 1).exit_code == 0
    for row in read_dataset(tmp_path / "data").to_pylist():
        table = {
            "kind": "table",
            "path": "sweep/m.csv",
            "columns": {"t": "t", "shake": "a"},
            "t0": row["base_motion.t0"],
        }
        changes = {"base_motion": table, "control.delta": row["control.delta"], "simulation.duration": 0.2}
        alone = simulate(load_scenario("paper/nominal", changes)).metrics.to_pylist()[0]
        assert {name: row[name] for name in alone} == alone


def test_an_fmu_reads_the_record_where_a_run_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fmpy = pytest.importorskip("fmpy")
    monkeypatch.chdir(tmp_path)
    scenario = sailing(0.05, t0=-0.02)  # from before the record into it
    Path("s.toml").write_text(scenario.to_toml(tmp_path))
    result = springline("export", "fmu2", "s.toml", "--part", "loop", "-o", "fmu")
    assert result.exit_code == 0 and "the run takes -0.02 to 0.03 s of it" in result.stderr
    (file,) = Path("fmu").glob("*.fmu")
    got = fmpy.simulate_fmu(
        str(file), stop_time=0.05, output_interval=0.01, output=["y_r1", "theta_1z", "theta_1x"], step_size=0.01
    )
    times, base = base_of(simulate(scenario).trajectory)
    expected = base[::20]
    found = np.stack([got[name] for name in ("y_r1", "theta_1z", "theta_1x")], axis=1)
    assert np.allclose(got["time"], times[::20], rtol=0, atol=1e-12)
    assert np.abs(found - expected).max() <= 1e-15
    assert np.abs(np.diff(expected, axis=0)).min() > 0.0


# What the user is told


def springline(*arguments: Any) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="springline")


def test_run_tells_the_span_and_writes_a_scenario_that_can_be_moved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("work").mkdir()
    Path("work/m.csv").write_text("t,a\n" + "".join(f"{170 + k},{(350 + 7 * k) % 360}\n" for k in range(9)))
    Path("work/s.toml").write_text("""
        [base_motion]
        kind = "table"
        path = "m.csv"
        columns = { t = "t", roll = "a" }
        units = { roll = "deg" }
        t0 = 171.5
        [simulation]
        duration = 0.1
    """)
    shown = springline("run", "work/s.toml", "-o", "work/results", "--no-plot")
    assert shown.exit_code == 0
    unwrapped, span, largest = shown.stderr.splitlines()
    assert unwrapped.startswith("base_motion.columns.roll: column 'a' of ") and "line 4: " in unwrapped
    assert "m.csv lasts from 170 to 178 s, and the run takes 171.5 to 171.6 s of it" in span
    assert span.endswith(": less than one of its sample intervals of 1 s (is units.t right?)")
    assert "the largest accelerations" in largest
    assert str(tmp_path) not in Path("work/results/scenario.toml").read_text()
    Path("work").rename("moved")
    again = springline("run", "moved/results/scenario.toml", "-o", "again", "--no-plot", "--json")
    assert again.exit_code == 0 and len(again.stderr.splitlines()) == 3
    assert json.loads(again.stdout)["status"] == "ok"
    for name in ("trajectory.parquet", "metrics.parquet"):
        assert Path("again", name).read_bytes() == Path("moved/results", name).read_bytes()


def test_nothing_is_written_where_the_record_and_the_run_do_not_meet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = springline("run", "ship/vessel_10hz", "-o", "out", "--set", "base_motion.t0=360", "--no-plot")
    assert result.exit_code == 2
    assert "base_motion.t0" in result.stderr and "lasts from 0 to 359.86328125 s" in result.stderr
    assert not Path("out").exists()


UNIX = 1.7e9


@pytest.fixture
def unix(tmp_path: Path) -> Path:
    """A scenario whose record is stamped in Unix seconds and which does not say where in it the run begins."""
    t = [UNIX + k / 10 for k in range(200)]
    rows = "\n".join(f"{time!r},{0.1 * math.sin(0.9 * (time - UNIX))!r}" for time in t)
    (tmp_path / "unix.csv").write_text(f"t,heave\n{rows}\n")
    path = tmp_path / "unix.toml"
    path.write_text(
        '[base_motion]\nkind = "table"\npath = "unix.csv"\ncolumns = { t = "t", shake = "heave" }\n'
        "[simulation]\nduration = 0.5\n"
    )
    return path


def test_the_remedy_for_a_record_beside_the_run_can_be_given_as_an_override(unix: Path, tmp_path: Path) -> None:
    """The file is not judged by what an override replaces."""
    with pytest.raises(InputError, match=r"base_motion\.t0: .* which is outside"):
        load_scenario(unix)
    expected = simulate(load_scenario(unix, {"base_motion.t0": UNIX + 3.0})).trajectory["y_r1"].to_numpy()
    assert expected[0] == pytest.approx(0.1 * math.sin(2.7), abs=1e-4)
    with pytest.raises(InputError, match=r"override of .*unix.toml: base_motion\.t0: .*1700000100"):
        load_scenario(unix, {"base_motion.t0": UNIX + 100.0})
    sweep = tmp_path / "sweep.toml"
    vary = '[vary]\n"control.delta" = { values = [0.04, 0.05] }\n'
    sweep.write_text(f'scenario = "unix.toml"\nsamples = 2\n[set]\n"base_motion.t0" = {UNIX + 3.0}\n{vary}')
    assert load_sweep(sweep).scenario == load_scenario(unix, {"base_motion.t0": UNIX + 3.0})
    sweep.write_text(f'scenario = "unix.toml"\nsamples = 2\n{vary}')
    with pytest.raises(InputError, match=r"sweep.toml: scenario: .*unix.toml: base_motion\.t0"):
        load_sweep(sweep)
    assert load_sweep(sweep, {"base_motion.t0": UNIX + 3.0}).scenario.tables()[0].t0 == pytest.approx(-3.0)
