"""Sweeps from file to dataset: the same table however they are run, and what happens when something breaks."""

import importlib
import importlib.util
import json
import math
import os
import re
import signal
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet
from scipy.stats import spearmanr
from typer.testing import CliRunner

from springline.codegen.kernel import ToolchainError
from springline.runner import batch, load_scenario, simulate
from springline.runner.cli import app
from springline.runner.files import InputError, parquet_bytes
from springline.runner.run import trajectory_schema
from springline.runner.scenario import packaged_sweeps
from springline.runner.sweep import (
    Dataset,
    Plan,
    estimate,
    load_sweep,
    open_pool,
    place,
    read_dataset,
    run_sweep,
    stored_plan,
    summarize,
    versions,
)
from springline.runner.sweep.figures import summary_figures
from springline.runner.sweep.forecast import dataset_bytes
from springline.runner.sweep.influence import rank_correlation
from springline.runner.sweep.places import Folder
from springline.runner.sweep.pool import Cluster, Threads
from springline.runner.sweep.quantiles import Quantiles
from springline.runner.sweep.summary import QUANTILES
from springline.runner.sweep.work import parcel, perform_parcel

# Steps that cost next to nothing; one kernel for most tests of this file and of test_dataset.py.
SWEEP = """
scenario = "paper/nominal"
samples = 300
seed = 2
[set]
simulation.duration = 0.002
[vary]
control.delta = { log_uniform = [0.02, 0.1] }
control.k1 = { uniform = [1.0, 5.0] }
"""

Command = Callable[..., Any]


@pytest.fixture
def command() -> Command:
    """The command line, in this process."""

    def call(*words: object) -> Any:
        return CliRunner().invoke(app, [str(word) for word in words])

    return call


@pytest.fixture
def sweep(tmp_path: Path) -> Path:
    file = tmp_path / "sweep.toml"
    file.write_text(SWEEP, encoding="utf-8")
    return file


def run(sweep: Path, destination: Path | str, *, chunk: int = 0, pool: Any = None, resume: bool = False) -> Any:
    """A sweep without the command line; returns its tally."""
    plan, dataset = Plan(load_sweep(sweep), chunk), Dataset(place(destination))
    with dataset.place.locked():
        plan = dataset.begin(plan, versions(), resume=resume)
        done = dataset.done(plan)
        if pool is not None:
            return run_sweep(plan, dataset, pool, done)
        with open_pool(1) as threads:
            return run_sweep(plan, dataset, threads, done)


def test_the_table_has_what_it_should(sweep: Path, tmp_path: Path) -> None:
    tally = run(sweep, tmp_path / "data")
    assert (tally.done, tally.failed, tally.left) == (300, 0, 0)
    table = read_dataset(tmp_path / "data")
    assert table["run"].to_pylist() == list(range(300))
    assert table.column_names[:3] == ["run", "control.delta", "control.k1"]
    assert table.column_names[-2:] == ["status", "t_end"]
    assert set(table["status"].to_pylist()) == {"ok"}
    assert table.schema.field("iae_lift").metadata[b"unit"] == b"m s"
    assert table.schema.field("control.delta").metadata[b"unit"] == b"m or rad"


def test_tables_do_not_depend_on_jobs_or_chunks(sweep: Path, tmp_path: Path) -> None:
    tables = []
    for i, (jobs, chunk) in enumerate(((1, 300), (2, 32), (3, 77))):
        with open_pool(jobs) as pool:
            run(sweep, tmp_path / str(i), chunk=chunk, pool=pool)
        tables.append(read_dataset(tmp_path / str(i)))
    assert all(table.equals(tables[0], check_metadata=True) for table in tables)


def test_a_sweep_a_python_batch_and_single_runs_agree_to_the_last_bit(sweep: Path, tmp_path: Path) -> None:
    run(sweep, tmp_path / "data")
    table = read_dataset(tmp_path / "data")
    scenario = load_scenario("paper/nominal", {"simulation.duration": 0.002})
    keys = ["control.delta", "control.k1"]
    again = batch(scenario, {key: table[key].to_numpy() for key in keys}, jobs=2)
    assert again.equals(table, check_metadata=True)
    for row in (0, 150, 299):
        one = simulate(scenario.with_overrides({key: table[key][row].as_py() for key in keys}))
        assert one.metrics.to_pylist()[0] == {name: table[name][row].as_py() for name in one.metrics.column_names}


@pytest.mark.parametrize(
    ("columns", "expected"),
    [
        ({}, "non-empty arrays of one length"),
        ({"control.k1": []}, "non-empty arrays of one length"),
        ({"control.k1": [1.0], "control.k2": [1.0, 2.0]}, "non-empty arrays of one length"),
        ({"control.k": [1.0]}, r"unknown numeric key.*control\.k1"),
        ({"control.law": ["power"]}, r"control\.law: unknown numeric key"),
        ({"control.k1": ["1.0"]}, r"control\.k1: expected a column of numbers"),
        ({"control.k1": [True]}, r"control\.k1: expected a column of numbers"),
        ({"control.k1": [[1.0], [1.0, 2.0]]}, r"control\.k1: expected a column of numbers"),
        ({"control.k1": [-1.0]}, r"control\.k1: run 0: expected a number > 0"),
    ],
)
def test_python_batch_refuses_columns_that_do_not_fit(columns: dict[str, Any], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        batch(load_scenario("paper/nominal"), columns)


def test_python_batch_takes_whole_numbers() -> None:
    scenario = load_scenario("paper/nominal", {"simulation.duration": 0.002})
    whole, real = (batch(scenario, {"control.k1": values}, jobs=1) for values in ([3, 4], np.array([3.0, 4.0])))
    assert whole.equals(real, check_metadata=True)


@pytest.mark.parametrize("columns", [[], None, "control.k1", [("control.k1", [1.0])], {1: [1.0]}])
def test_python_batch_refuses_columns_of_another_kind(columns: Any) -> None:
    with pytest.raises(TypeError, match="expected columns such as"):
        batch(load_scenario("paper/nominal"), columns)


@pytest.mark.parametrize(("jobs", "error"), [("2", TypeError), (1.5, TypeError), (0, ValueError), (-1, ValueError)])
def test_python_batch_refuses_jobs_that_are_no_number_of_threads(jobs: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match=r"jobs is .+, expected"):
        batch(load_scenario("paper/nominal"), {"control.k1": [1.0]}, jobs=jobs)


@pytest.mark.parametrize("call", [simulate, lambda scenario: batch(scenario, {"control.k1": [1.0]})])
def test_a_name_is_no_scenario_and_the_remedy_is_told(call: Callable[[Any], object]) -> None:
    with pytest.raises(TypeError, match=r"expected a Scenario, got 'paper/nominal': load_scenario\('paper/nominal'\)"):
        call("paper/nominal")
    with pytest.raises(TypeError, match=r"expected a Scenario, got None$"):
        call(None)


def test_groups_differ_in_structure_and_timing(tmp_path: Path) -> None:
    file = tmp_path / "sweep.toml"
    vary = "simulation.duration = { each = [0.001, 0.002] }\n"
    file.write_text(SWEEP.replace("samples = 300", "samples = 40") + vary, encoding="utf-8")
    run(file, tmp_path / "data")
    table = read_dataset(tmp_path / "data")
    assert np.array_equal(table["t_end"].to_numpy(), np.repeat([0.001, 0.002], 40))
    assert np.array_equal(table["simulation.duration"].to_numpy(), np.repeat([0.001, 0.002], 40))
    assert np.array_equal(table["control.k1"].to_numpy()[:40], table["control.k1"].to_numpy()[40:])


def test_kept_trajectories_are_those_of_the_runs(sweep: Path, tmp_path: Path) -> None:
    sweep.write_text(SWEEP + "[keep]\ntrajectories = 70\n", encoding="utf-8")
    run(sweep, tmp_path / "data", chunk=32)
    dataset = Dataset(place(tmp_path / "data"))
    names = dataset.place.names("trajectories")
    assert names == [f"run-{k:09d}.parquet" for k in (0, 70, 140, 210, 280)]
    scenario = stored_plan(dataset).scenario_of(140)
    assert dataset.read_part(f"trajectories/{names[2]}").equals(simulate(scenario).trajectory)


def test_a_kept_run_that_stopped_ends_where_it_stopped(tmp_path: Path) -> None:
    """Its trajectory has the rows that were written, not those that a complete run would have."""
    file = tmp_path / "sweep.toml"
    limits = "simulation.bound = 60.0\nsimulation.output_every = 3\ncontrol.k3 = 1000.0"
    text = SWEEP.replace("samples = 300", "samples = 20").replace("duration = 0.002", f"duration = 0.02\n{limits}")
    file.write_text(f"{text}[keep]\ntrajectories = 9\n", encoding="utf-8")
    assert run(file, tmp_path / "data").stopped_early > 0
    dataset, table = Dataset(place(tmp_path / "data")), read_dataset(tmp_path / "data")
    plan = stored_plan(dataset)
    stopped = 0
    for number in (0, 9, 18):
        kept = dataset.read_part(f"trajectories/run-{number:09d}.parquet")
        assert kept.equals(simulate(plan.scenario_of(number)).trajectory, check_metadata=True)
        assert not any(np.isnan(column.to_numpy()).any() for column in kept.columns)
        assert kept["t"][-1].as_py() <= table["t_end"][number].as_py()
        stopped += table["status"][number].as_py() == "out_of_bounds"
        assert len(kept) < 68 or table["status"][number].as_py() == "ok"
    assert stopped > 0


# --- workers elsewhere -----------------------------------------------------------------------------------


def test_a_parcel_is_compiled_from_its_sources_and_checked(sweep: Path) -> None:
    plan = Plan(load_sweep(sweep))
    chunk = plan.chunk(0)
    work, inputs = chunk.group.work, plan.inputs(chunk, plan.columns(chunk))
    sent = parcel(work)
    with open_pool(1) as threads:
        here = threads.submit(work, inputs, [3]).result()
    there = perform_parcel(sent, inputs, [3])
    assert np.array_equal(here.runs.final_state, there.runs.final_state)
    assert np.array_equal(here.runs.metrics, there.runs.metrics, equal_nan=True)
    assert np.array_equal(here.trajectories[0], there.trajectories[0])
    files = tuple((name, text.replace("0.5", "0.25")) for name, text in sent.source.files)
    damaged = replace(sent, source=replace(sent.source, files=files))
    with pytest.raises(ValueError, match="damaged on the way"):
        perform_parcel(damaged, inputs)


@pytest.fixture
def distributed() -> Any:
    if importlib.util.find_spec("distributed") is None:
        (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)("dask.distributed is not installed")
    return importlib.import_module("distributed")


def test_a_cluster_whose_worker_is_killed_gives_the_same_table(sweep: Path, tmp_path: Path, distributed: Any) -> None:
    run(sweep, tmp_path / "here", chunk=32)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        victim = next(iter(client.run(os.getpid).values()))
        pool = _Killing(Cluster(client), after=4, pid=victim)
        tally = run(sweep, tmp_path / "there", chunk=32, pool=pool)
        assert pool.killed
    assert (tally.done, tally.failed) == (300, 0)
    assert _parts(tmp_path / "here") == _parts(tmp_path / "there")


class _Killing:
    """A pool that kills a process once some chunks have been submitted."""

    def __init__(self, pool: Cluster, after: int, pid: int) -> None:
        self._pool, self._left, self._pid = pool, after, pid
        self.killed = False
        self.threads = 2

    def submit(self, *arguments: Any) -> Future[Any]:
        self._left -= 1
        if self._left == 0:
            os.kill(self._pid, signal.SIGKILL)
            self.killed = True
        return self._pool.submit(*arguments)

    def underway(self) -> int:
        return self._pool.underway()

    def stop(self) -> None:
        self._pool.stop()


def _parts(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob("part-*.parquet")}


@pytest.mark.parametrize("address", ["local:0", "local:x", "somewhere", "tcp://127.0.0.1:1"])
def test_a_bad_scheduler_is_the_users_mistake(address: str, distributed: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.import_module("springline.runner.sweep.pool"), "_ANSWER", "0.5s")
    with pytest.raises(InputError, match="--scheduler"), open_pool(None, address):
        pass


# --- what breaks -----------------------------------------------------------------------------------------


class _Failing:
    """A pool in which given chunks fail a given number of times; chunk k is the k-th that is submitted."""

    def __init__(self, failures: dict[float, int]) -> None:
        self._threads = Threads(1)
        self._failures = failures
        self._sound: list[Future[Any]] = []
        self.threads = 1

    def submit(self, work: Any, inputs: Any, kept: Any) -> Future[Any]:
        chunk = float(inputs.parameters[0, 0])
        if self._failures.get(chunk, 0) > 0:
            self._failures[chunk] -= 1
            wait(self._sound)  # chunks end in the order of their submission, so that a test can count them
            future: Future[Any] = Future()
            future.set_exception(BrokenProcessPool("a worker died"))
            return future
        self._sound.append(self._threads.submit(work, inputs, kept))
        return self._sound[-1]

    def underway(self) -> int:
        return 0

    def stop(self) -> None:
        self._threads.stop()


def _failing(sweep: Path, times: dict[int, int]) -> _Failing:
    plan = Plan(load_sweep(sweep), 32)
    chunks = {k: plan.chunk(k) for k in times}
    first = {k: float(plan.inputs(chunk, plan.columns(chunk)).parameters[0, 0]) for k, chunk in chunks.items()}
    return _Failing({first[k]: n for k, n in times.items()})


def test_a_bad_chunk_is_tried_again_then_reported_and_the_rest_goes_on(sweep: Path, tmp_path: Path) -> None:
    tally = run(sweep, tmp_path / "a", chunk=32, pool=_failing(sweep, {2: 2, 5: 3}))
    assert (tally.done, tally.failed) == (268, 32)
    assert tally.failures == ["runs 160 to 191: BrokenProcessPool: a worker died"]
    tally = run(sweep, tmp_path / "a", resume=True)
    assert (tally.found, tally.done, tally.left) == (268, 32, 0)
    run(sweep, tmp_path / "b", chunk=32)
    assert _parts(tmp_path / "a") == _parts(tmp_path / "b")


def test_three_lost_chunks_in_a_row_end_a_sweep(sweep: Path, tmp_path: Path) -> None:
    tally = run(sweep, tmp_path / "a", chunk=32, pool=_failing(sweep, dict.fromkeys(range(3, 10), 99)))
    assert (tally.done, tally.failed, tally.left) == (96, 96, 204)


def test_without_a_compiler_a_sweep_fails_at_once(
    sweep: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep.write_text(SWEEP.replace("control.k1", "control.k2"), encoding="utf-8")  # a kernel nobody compiled
    monkeypatch.setenv("CC", "no-such-compiler")
    done = command("batch", sweep, "-o", tmp_path / "data")
    assert done.exit_code == 1
    assert "no-such-compiler" in done.stderr
    with pytest.raises(ToolchainError):
        run(sweep, tmp_path / "other")


def test_ctrl_c_keeps_what_is_done_and_says_how_to_resume(
    sweep: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "data"
    sweep.write_text(SWEEP.replace("0.002", "0.05").replace("300", "2000"), encoding="utf-8")

    def interrupt() -> None:
        while len(list(folder.glob("part-*"))) < 3:
            time.sleep(0.005)
        os.kill(os.getpid(), signal.SIGINT)

    watcher = Thread(target=interrupt)
    watcher.start()
    done = command("batch", sweep, "-o", folder, "--jobs", 1)
    watcher.join()
    assert done.exit_code == 130
    stored = int(re.search(r"stopped: ([\d,]+) of 2,000 runs are stored", done.stderr)[1].replace(",", ""))
    assert 96 <= stored < 2000
    assert f"springline batch {sweep} -o {folder} --resume" in done.stderr.replace("\n", " ")
    again = command("batch", sweep, "-o", folder, "--resume", "--no-plot", "--json")
    assert again.exit_code == 0
    expected = {"group": "all", "ok": 2000, "diverged": 0, "out_of_bounds": 0, "out_of_limits": 0, "chattering": 0}
    assert json.loads(again.stdout)["rows"] == [expected]


# --- the commands ----------------------------------------------------------------------------------------


def test_batch_writes_a_dataset_with_its_summary(sweep: Path, tmp_path: Path, command: Command) -> None:
    folder = tmp_path / "data"
    done = command("batch", sweep, "-o", folder)
    assert done.exit_code == 0, done.output
    assert "settling_time_lift" in done.stdout
    assert {"sweep.json", "report.html", "report.md", "map.png", "map.svg", "part-000000.parquet"} <= {
        f.name for f in folder.iterdir()
    }
    text = (folder / "report.md").read_text(encoding="utf-8")
    assert "](map.png)" in text
    assert "300 of 300 runs" in text and "**All 300 runs came to their end**, none of these chatters." in text
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg viewBox=") == 2 and len(page) < 3_000_000
    assert not re.search(r"https?://|<script|<link", page)
    assert str(tmp_path) not in page + text
    best = summarize(stored_plan(Dataset(place(folder))), Dataset(place(folder))).best
    rows = read_dataset(folder).to_pylist()
    scales = {c: np.median([row[c] for row in rows]) for c in rows[0] if c.startswith("steady_state_error_")}
    ranked = sorted(rows, key=lambda row: max(row[c] / scale for c, scale in scales.items()))
    assert [row["run"] for row in best] == [row["run"] for row in ranked[:5]]
    assert f"`springline replay DIR {ranked[0]['run']}`" in text
    stored = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
    assert (stored["runs"], stored["chunk"], len(stored["groups"])) == (300, 64, 1)
    assert re.fullmatch("[0-9a-f]{64}", stored["groups"][0]["kernel"])


def test_the_packaged_sweeps_are_named_in_the_help(command: Command) -> None:
    said = " ".join(command("batch", "--help").stdout.split())
    assert f"a packaged sweep: {', '.join(packaged_sweeps())}." in said


def test_replay_is_bit_identical_and_notices_what_is_not(sweep: Path, tmp_path: Path, command: Command) -> None:
    """Over a grid, whose numbering depends on the order of its axes, here not the alphabetical one."""
    vary = "control.k1 = { values = [1.0, 2.0, 3.0] }\ncontrol.delta = { log_uniform = [0.02, 0.1], points = 12 }\n"
    text = SWEEP.split("[vary]", maxsplit=1)[0].replace("samples = 300", 'method = "grid"') + "[vary]\n" + vary
    sweep.write_text(text, encoding="utf-8")
    folder = tmp_path / "data"
    assert command("batch", sweep, "-o", folder, "--no-plot").exit_code == 0
    done = command("replay", folder, 17, "-o", tmp_path / "again", "--no-plot")
    assert done.exit_code == 0, done.output
    assert "bit for bit" in done.stdout
    assert (tmp_path / "again" / "trajectory.parquet").exists()

    part = folder / "part-000000.parquet"
    table = Dataset(place(folder)).read_part(part.name)
    column = table["iae_lift"].to_numpy().copy()
    column[17] = np.nextafter(column[17], 1.0)
    place_of = table.column_names.index("iae_lift")
    parquet.write_table(table.set_column(place_of, table.schema.field("iae_lift"), pa.array(column)), part)
    done = command("replay", folder, 17, "-o", tmp_path / "wrong", "--no-plot")
    assert done.exit_code == 1
    assert "iae_lift: 0x" in done.stderr
    assert command("replay", folder, 36, "-o", tmp_path / "none").exit_code == 2
    assert command("replay", tmp_path, 0, "-o", tmp_path / "none").exit_code == 2


def test_replay_of_a_part_that_is_not_whole_says_so(sweep: Path, tmp_path: Path, command: Command) -> None:
    folder = tmp_path / "data"
    run(sweep, folder, chunk=64)
    part = folder / "part-000001.parquet"
    whole = part.read_bytes()
    again = "springline batch --resume makes it again"
    table = parquet.read_table(part)
    other = table.set_column(1, table.schema.field(1), pa.array([0.5] * 64))
    for content, code, said in (
        (b"", 2, "is no Parquet file that can be read"),
        (whole[:-9], 2, "is no Parquet file that can be read"),
        ((folder / "part-000002.parquet").read_bytes(), 2, "holds other runs"),
        (parquet_bytes(pa.table({"a": [1]})), 2, "has other columns"),
        (parquet_bytes(table.slice(0, 63)), 2, "has 63 rows, expected 64"),
        (parquet_bytes(other), 0, "has content that is not what was written"),
        (whole, 0, ""),
    ):
        part.write_bytes(content)
        done = command("replay", folder, 70, "-o", tmp_path / "again", "--no-plot", "--force")
        assert done.exit_code == code, done.output
        assert said in done.stderr
        assert (again in done.stderr) is bool(said)
        assert code == 0 or not (tmp_path / "again").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["batch", "paper/nominal"], "paper/nominal: this is a scenario: springline run paper/nominal"),
        (["batch", "mine.toml"], "mine.toml: this is a scenario: springline run mine.toml"),
        (["batch", "data"], "data: this is a dataset: springline replay data RUN, or springline batch"),
        (["replay", "sweep.toml", "0"], "sweep.toml: this is a sweep: springline batch sweep.toml"),
        (["run", "data/sweep.json"], "data/sweep.json: this is a file of a dataset: springline replay data RUN"),
        (["batch", "data/part-000000.parquet"], "this is a file of a dataset: springline replay data RUN"),
        (["run", "arm.fmu"], "arm.fmu: this is an FMU: other simulators load it"),
        (["replay", "arm.fmu", "0"], "arm.fmu: this is an FMU: other simulators load it"),
        (["run", "c"], "c: this is a folder of an export: it was made from a scenario"),
        (["replay", "gains", "0"], "gains: this is a sweep: springline batch gains"),
        (["replay", "mine.toml", "0"], "this is a scenario: springline run mine.toml"),
        (
            ["replay", "one run", "0"],
            "one run: this is a folder of a run: its scenario is one run/scenario.toml",
        ),
    ],
)
def test_what_belongs_to_another_command_is_told(
    sweep: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch, words: list[str], said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text("[control]\nk1 = 3.0\n", encoding="utf-8")
    Path("one run").mkdir()
    Path("one run", "scenario.toml").write_text("[control]\nk1 = 3.0\n", encoding="utf-8")
    Path("data").mkdir()
    Path("data", "sweep.json").write_text("{}", encoding="utf-8")
    Path("data", "part-000000.parquet").write_bytes(b"PAR1\xff")
    Path("arm.fmu").write_bytes(b"PK\x03\x04\xff")
    Path("c").mkdir()
    Path("c", "self_check.c").touch()
    done = command(*words)
    assert done.exit_code == 2
    assert said in done.stderr
    assert not Path("results").exists()


@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_a_sweep_that_does_not_end_is_told(kind: str, tmp_path: Path, command: Command) -> None:
    path = tmp_path / "sweep.toml"
    os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero")
    done = command("batch", path)
    assert done.exit_code == 2
    assert "a pipe or a device: expected a regular file" in done.stderr


def test_set_overrides_the_scenario_of_a_sweep(sweep: Path, tmp_path: Path, command: Command) -> None:
    folder, change = tmp_path / "data", ["--set", "simulation.duration=0.001", "--set", 'control.law="power"']
    done = command("batch", sweep, "-o", folder, "--no-plot", *change)
    assert done.exit_code == 0, done.output
    assert set(read_dataset(folder)["t_end"].to_pylist()) == {0.001}
    assert stored_plan(Dataset(place(folder))).scenario_of(3).structure().law == "power"
    refused = command("batch", sweep, "-o", folder, "--resume")
    assert refused.exit_code == 2
    assert "simulation.duration: 0.001 -> 0.002" in refused.stderr
    assert command("batch", sweep, "-o", folder, "--resume", "--no-plot", *change).exit_code == 0
    varies = command("batch", sweep, "-o", tmp_path / "other", "--set", "control.k1=3")
    assert varies.exit_code == 2
    assert "control.k1: it varies in this sweep (vary.control.k1): an override has no effect" in varies.stderr
    assert not (tmp_path / "other").exists()


def test_a_sweep_larger_than_memory_or_disk_is_refused_before_it_starts(
    sweep: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    sweep.write_text(SWEEP + "[keep]\ntrajectories = 10\n", encoding="utf-8")
    plan = Plan(load_sweep(sweep))
    columns = len(trajectory_schema(plan.groups[0].work.system))
    need = 2 * 8 * 7 * 3 * columns  # of a chunk of 64 runs each tenth, at rows 0, 10, 20
    batch_module = importlib.import_module("springline.runner.sweep.forecast")
    monkeypatch.setattr(batch_module, "memory", lambda: need - 1)
    done = command("batch", sweep, "-o", tmp_path / "data", "--jobs", 1)
    assert done.exit_code == 2
    assert "keep.trajectories: expected more, a larger simulation.output_every" in done.stderr
    assert (
        f"7 trajectories of 3 rows at a time take {need:,} bytes, and there are {need - 1:,} of memory" in done.stderr
    )
    assert command("batch", sweep, "-o", tmp_path / "data", "--jobs", 2).exit_code == 2
    monkeypatch.setattr(batch_module, "memory", lambda: need)
    monkeypatch.setattr(Folder, "free", lambda self: 5000)
    done = command("batch", sweep, "-o", tmp_path / "data", "--jobs", 1)
    assert done.exit_code == 2
    assert re.search(r"data: has 5,000 bytes free, and the dataset takes about [\d,]{6,}: choose", done.stderr)
    assert not (tmp_path / "data").exists()
    monkeypatch.undo()
    assert command("batch", sweep, "-o", tmp_path / "data", "--jobs", 1, "--no-plot").exit_code == 0


def test_the_size_of_a_dataset_counts_the_trajectories_of_every_group(sweep: Path) -> None:
    keep = "[keep]\ntrajectories = 1\n"
    vary = "simulation.duration = {{ each = {} }}\n"
    sizes = []
    for durations in ("[0.1]", "[0.1, 4.0]", "[4.0, 0.1]"):
        sweep.write_text(SWEEP + vary.format(durations) + keep, encoding="utf-8")
        sizes.append(dataset_bytes(Plan(load_sweep(sweep))))
    assert sizes[1] == sizes[2] > 5 * sizes[0]


@pytest.mark.parametrize(
    ("head", "expected"),
    [
        ("samples = 1", "1 of 1 run"),
        ("samples = 33\nchunk = 32", "2 of up to 32 runs"),
        ("samples = 2048\nchunk = 1024", "2 of 1,024 runs"),
    ],
)
def test_dry_run_tells_the_size_of_chunks(head: str, expected: str, tmp_path: Path, command: Command) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text(f"{head}\n[set]\nsimulation.duration = 0.002\n[vary]\ncontrol.k1 = {{ uniform = [1, 2] }}\n")
    said = command("batch", file, "-o", tmp_path / "data", "--dry-run").stdout
    assert re.search(rf"chunks +{expected} *\n", said), said


def test_dry_run_writes_nothing_and_its_size_is_about_right(sweep: Path, tmp_path: Path, command: Command) -> None:
    folder = tmp_path / "data"
    done = command("batch", sweep, "-o", folder, "--dry-run", "--json")
    assert done.exit_code == 0, done.output
    facts = json.loads(done.stdout)["rows"][0]
    assert (facts["runs"], facts["groups"], facts["chunks"], facts["chunk"]) == (300, 1, 5, 64)
    assert 0 < facts["seconds"] < 10
    assert not folder.exists()
    assert "about" in command("batch", sweep, "-o", folder, "--dry-run").stdout
    run(sweep, folder)
    size = sum(file.stat().st_size for file in folder.glob("part-*"))
    assert size / 3 < facts["bytes"] < 3 * size


def test_a_long_sweep_says_so_before_it_starts(
    sweep: Path, tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("springline.runner.cli.commands.batch._LONG", 0.0)
    done = command("batch", sweep, "-o", tmp_path / "data", "--no-plot")
    assert done.exit_code == 0
    assert "this will take about" in done.stderr


def test_estimate_grows_with_the_sweep(sweep: Path) -> None:
    small = Plan(load_sweep(sweep))
    sweep.write_text(SWEEP.replace("300", "30000"), encoding="utf-8")
    large = Plan(load_sweep(sweep))
    assert 10 < estimate(large, 1).seconds / estimate(small, 1).seconds < 1000
    assert 20 < dataset_bytes(large) / dataset_bytes(small) < 110
    assert estimate(large, 1, left=300).seconds < estimate(large, 1).seconds / 10


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace("control.delta", "control.delt"),
        lambda text: text.replace("[0.02, 0.1]", "[0.1, 0.02]"),
        lambda text: text.replace("[0.02, 0.1]", "[0.0, 0.1]"),
        lambda text: text.replace("samples = 300", "samples = 0"),
        lambda text: text.replace("[vary]", "[vry]"),
    ],
)
def test_bad_input_is_exit_2_and_nothing_is_written(
    sweep: Path, tmp_path: Path, command: Command, change: Callable[[str], str]
) -> None:
    sweep.write_text(change(SWEEP), encoding="utf-8")
    done = command("batch", sweep, "-o", tmp_path / "data")
    assert done.exit_code == 2
    assert "sweep.toml" in done.stderr
    assert not (tmp_path / "data").exists()


def test_summary_numbers_are_those_of_the_table(tmp_path: Path) -> None:
    """With some runs that leave their bounds: what is worst, what is missing, and the quantiles."""
    file = tmp_path / "sweep.toml"
    text = SWEEP.replace("simulation.duration = 0.002", "simulation.duration = 0.01\nsimulation.bound = 40.0")
    file.write_text(text.replace("control.k1 = { uniform = [1.0, 5.0] }", "initial.dq.0 = { uniform = [0, 60] }"))
    run(file, tmp_path / "data", chunk=64)
    dataset = Dataset(place(tmp_path / "data"))
    plan = stored_plan(dataset)
    found, table = summarize(plan, dataset), read_dataset(tmp_path / "data")
    status = np.array(table["status"].to_pylist())
    stopped = int((status != "ok").sum())
    assert 0 < stopped < 300
    assert found.stopped == stopped == found.outcomes["all"]["out_of_bounds"]
    values = table["U_max_lift"].to_numpy()
    median = np.quantile(values, 0.5, method="nearest")
    assert found.metrics["U_max_lift"].quantiles[QUANTILES.index(0.5)] == pytest.approx(median, rel=0.02)
    assert found.metrics["U_max_lift"].quantiles[-1] == values.max()
    missing = np.isnan(table["steady_state_error_lift"].cast(pa.float64()).to_numpy()).mean()
    assert found.metrics["steady_state_error_lift"].missing == pytest.approx(missing)
    first = np.sort(table["t_end"].to_numpy()[status != "ok"])[: len(found.worst)]
    assert [row["t_end"] for row in found.worst][: len(first)] == list(first)


@pytest.mark.parametrize("keys", [1, 2])
def test_chattering_runs_are_counted_and_marked(keys: int, tmp_path: Path, command: Command) -> None:
    """Narrow boundary layers chatter, wide ones do not, and without fast control nothing is left to chatter."""
    second = "control.k1 = { values = [2.0, 3.0] }" if keys == 2 else ""
    file = tmp_path / "sweep.toml"
    file.write_text(
        f"""
        scenario = "paper/nominal"
        method = "grid"
        [set]
        simulation.duration = 1.2
        [vary]
        control.fast = {{ values = [true, false] }}
        control.delta = {{ values = [0.01, 0.015, 0.05, 0.08] }}
        {second}
        """
    )
    done = command("batch", file, "-o", tmp_path / "data", "--no-plot")
    assert done.exit_code == 0, done.stderr
    dataset = Dataset(place(tmp_path / "data"))
    plan, table = stored_plan(dataset), read_dataset(tmp_path / "data").to_pylist()
    summary = summarize(plan, dataset)
    chatter = [
        any(row[f"chatter_{joint}"] is not None and row[f"chatter_{joint}"] > 20.0 for joint in ("lift", "rotation"))
        for row in table
    ]
    assert [row["control.delta"] < 0.02 and row["status"] == "ok" for row in table] == chatter
    counts = {"ok": 4 * keys, "chattering": 2 * keys, "diverged": 0, "out_of_bounds": 0, "out_of_limits": 0}
    assert summary.outcomes["fast = true"] == counts
    assert summary.outcomes["fast = false"]["chattering"] == 0
    assert summary.stopped == 4 * keys
    assert re.search(rf"fast = true +{4 * keys} +{4 * keys} +{2 * keys} ", done.stdout)
    text = (tmp_path / "data" / "report.md").read_text()
    assert f"of these chatter. Of the others {4 * keys} " in text
    assert f"| fast = true | {4 * keys} | {4 * keys} | {2 * keys} | 0 | 0 |" in text
    figures = summary_figures(plan, summary)
    if keys == 1:
        rings = [line for axes in figures["curve"].axes for line in axes.lines if line.get_label() == "chattering"]
        assert [len(line.get_xdata()) for line in rings] == [2] * 4
    else:
        hatched = [
            [
                box
                for patch in axes.patches
                if patch.get_hatch() and patch.get_label() != "chattering"
                for box in patch.get_path().to_polygons()
            ]
            for axes in figures["map"].axes
        ]
        assert [len(boxes) for boxes in hatched] == [2, 2, 0, 0, 0], "two columns, each of two cells, in the upper maps"
        assert all(box[:, 0].max() < 0.05 for boxes in hatched for box in boxes)


def test_quantiles_are_exact_whatever_the_sample_that_figures_show(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "sweep.toml"
    file.write_text(SWEEP.replace("samples = 300", "samples = 4000"), encoding="utf-8")
    run(file, tmp_path / "data", chunk=96)
    dataset, table = Dataset(place(tmp_path / "data")), read_dataset(tmp_path / "data")
    plan = stored_plan(dataset)
    whole = summarize(plan, dataset)
    assert whole.shown.equals(table, check_metadata=True)
    for column, found in whole.metrics.items():
        numbers = np.sort(table[column].drop_null().to_numpy())
        expected = [numbers[round(q * (len(numbers) - 1))] for q in QUANTILES] if len(numbers) else [math.nan] * 7
        assert np.array_equal(found.quantiles, expected, equal_nan=True), column
    monkeypatch.setattr("springline.runner.sweep.summary._SHOWN", 100)
    sampled = summarize(plan, dataset)
    assert 50 < len(sampled.shown) < 200
    assert set(sampled.shown["run"].to_pylist()) < set(range(4000))
    assert repr(sampled.metrics) == repr(whole.metrics)
    assert (sampled.outcomes, repr(sampled.worst)) == (whole.outcomes, repr(whole.worst))


def test_a_damaged_part_is_not_summarized(sweep: Path, tmp_path: Path) -> None:
    run(sweep, tmp_path / "data", chunk=100)
    part = tmp_path / "data" / "part-000001.parquet"
    part.write_bytes(part.read_bytes()[:-10])
    dataset = Dataset(place(tmp_path / "data"))
    assert summarize(stored_plan(dataset), dataset).runs == 200


@given(
    st.lists(st.sampled_from([math.nan, -1.0, 0.0, 1.0, math.inf]) | st.floats(), max_size=200),
    st.lists(st.floats(), max_size=5),
    st.integers(1, 7),
)
def test_quantiles_of_any_numbers_with_any_sample_are_those_of_the_sorted_ones(
    numbers: list[float], sample: list[float], cuts: int
) -> None:
    values = np.array(numbers, dtype=np.float64)
    found = Quantiles(QUANTILES, np.array([*sample, *numbers[::9]], dtype=np.float64))
    for part in np.array_split(values, cuts):
        found.count(part)
    for part in np.array_split(values, cuts):
        found.gather(part)
    known = np.sort(values[~np.isnan(values)])
    assert found.known == len(known)
    expected = [known[round(q * (len(known) - 1))] for q in QUANTILES] if len(known) else [math.nan] * 7
    assert np.array_equal(found.values(), expected, equal_nan=True)


def test_few_numbers_are_gathered_for_a_quantile() -> None:
    rng = np.random.default_rng(1)
    values = np.concatenate([rng.lognormal(size=100_000), np.full(100_000, 0.25)])
    found = Quantiles(QUANTILES, rng.choice(values, 5000))
    found.count(values)
    found.gather(values)
    known = np.sort(values)
    assert found.values() == tuple(known[round(q * (len(known) - 1))] for q in QUANTILES)
    assert 0 < sum(map(len, found._gathered.values())) < 20_000


def test_rank_correlation_is_spearmans_within_groups() -> None:
    rng = np.random.default_rng(0)
    x, noise = rng.normal(size=(2, 500))
    group = np.zeros(500, dtype=np.int64)
    assert rank_correlation(x, np.exp(x) + noise, group) == pytest.approx(spearmanr(x, np.exp(x) + noise).statistic)
    shifted = np.repeat([0.0, 1000.0], 250)
    assert rank_correlation(x + shifted, x - shifted, np.repeat([0, 1], 250)) == pytest.approx(1.0)
    assert np.isnan(rank_correlation(x, np.ones(500), group))


def test_a_batch_beyond_memory_is_refused_before_it_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load_scenario("paper/nominal", {"simulation.duration": 0.001})
    monkeypatch.setattr(importlib.import_module("springline.runner.sweep.arrays"), "memory", lambda: 100_000)
    assert len(batch(scenario, {"control.delta": np.full(50, 0.05)}, jobs=1)) == 50
    with pytest.raises(InputError, match=r"expected fewer runs.*5,000 runs take [\d,]+ bytes, and there are 100"):
        batch(scenario, {"control.delta": np.full(5000, 0.05)}, jobs=1)
