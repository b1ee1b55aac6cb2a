"""Datasets survive: kills at any moment, two writers at once, a full disk, and what somebody else did to the folder."""

import errno
import json
import multiprocessing
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib import import_module
from multiprocessing.context import ForkServerContext
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from pyarrow import parquet
from typer.testing import CliRunner

from springline.codegen.files import TEMPORARY, atomic
from springline.codegen.kernel import lanes, runtime_sources
from springline.runner.cli import app
from springline.runner.cli.commands.batch import batch, replay
from springline.runner.files import InputError
from springline.runner.scenario import load_scenario
from springline.runner.sweep import (
    Dataset,
    Plan,
    load_sweep,
    open_pool,
    place,
    read_dataset,
    run_sweep,
    stored_plan,
    versions,
    work,
)
from springline.runner.sweep.changes import changes

SWEEP = """
scenario = "paper/nominal"
samples = {samples}
seed = 2
chunk = {chunk}
[set]
simulation.duration = 0.002
[vary]
control.delta = {{ log_uniform = [0.02, 0.1] }}
control.k1 = {{ uniform = [1.0, 5.0] }}
"""


@pytest.fixture
def write(tmp_path: Path) -> Callable[..., Path]:
    def make(samples: int = 300, chunk: int = 32, change: tuple[str, str] = ("", "")) -> Path:
        file = tmp_path / "sweep.toml"
        file.write_text(SWEEP.format(samples=samples, chunk=chunk).replace(*change), encoding="utf-8")
        return file

    return make


def run(sweep: Path, destination: Path | str, *, resume: bool = False) -> Any:
    """A sweep without the command line; returns its tally."""
    plan, dataset = Plan(load_sweep(sweep)), Dataset(place(destination))
    with dataset.place.locked(), open_pool(1) as pool:
        plan = dataset.begin(plan, versions(), resume=resume)
        return run_sweep(plan, dataset, pool, dataset.done(plan))


def content(folder: Path) -> dict[str, bytes]:
    """The dataset's own files; summaries and the lock are none."""
    return {f.name: f.read_bytes() for f in folder.iterdir() if f.name.startswith(("part-", "sweep.json", TEMPORARY))}


# --- resuming --------------------------------------------------------------------------------------------


def test_resume_does_exactly_what_is_missing(write: Callable[..., Path], tmp_path: Path) -> None:
    folder = tmp_path / "data"
    run(write(), folder)
    whole = content(folder)
    (folder / "part-000003.parquet").unlink()
    half = whole["part-000005.parquet"][:-100]
    (folder / "part-000005.parquet").write_bytes(half)
    (folder / f"{TEMPORARY}leftover").write_bytes(b"of a process that was killed")
    untouched = (folder / "part-000004.parquet").stat().st_mtime_ns
    tally = run(write(), folder, resume=True)
    assert (tally.found, tally.done) == (300 - 64, 64)
    assert content(folder) == whole
    assert (folder / "part-000004.parquet").stat().st_mtime_ns == untouched
    assert run(write(), folder, resume=True).done == 0


def damage(folder: Path, how: str) -> str:
    """Do something to parts of a dataset; which ones are not whole then."""
    first, second = folder / "part-000002.parquet", folder / "part-000003.parquet"
    content = bytearray(first.read_bytes())
    match how:
        case "copied":
            second.write_bytes(content)
            return "part-000003.parquet holds other runs"
        case "flipped":
            for place_of in range(200, 260):
                content[place_of] ^= 0x55
            first.write_bytes(content)
            return "part-000002.parquet"
        case "foreign":
            parquet.write_table(pa.table({"run": list(range(64, 96))}), first)
            return "part-000002.parquet has other columns"
        case "edited":
            table = parquet.read_table(first)
            row = table.column_names.index("iae_lift")
            values = [1.0, *table["iae_lift"].to_pylist()[1:]]
            parquet.write_table(table.set_column(row, table.schema.field(row), pa.array(values)), first)
            return "part-000002.parquet has content that is not what was written"
        case "of another sweep":
            first.write_bytes((folder.parent / "other" / first.name).read_bytes())
            return "part-000002.parquet is of another sweep"
        case "cut":
            first.write_bytes(content[: len(content) // 2])
            return "part-000002.parquet is no Parquet file"
        case "empty":
            first.write_bytes(b"")
            return "part-000002.parquet is no Parquet file"
    raise AssertionError(how)


@pytest.mark.parametrize("how", ["copied", "flipped", "foreign", "edited", "of another sweep", "cut", "empty"])
def test_a_part_that_is_not_whole_is_named_and_made_again(
    write: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], how: str
) -> None:
    folder = tmp_path / "data"
    run(write(change=("seed = 2", "seed = 3")), tmp_path / "other")
    run(write(), folder)
    whole = content(folder)
    flaw = damage(folder, how)
    batch(str(write()), output=str(folder), resume=True, plot=False)
    said = capsys.readouterr().err
    assert flaw in said
    assert said.count("its runs are simulated again") == 1
    assert content(folder) == whole


def test_a_part_whose_content_is_whole_is_written_anew_without_a_simulation(
    write: Callable[..., Path], tmp_path: Path
) -> None:
    """As another version of the library would have written it; no reader may find statistics that are wrong."""
    folder = tmp_path / "data"
    run(write(), folder)
    whole = content(folder)
    part = folder / "part-000002.parquet"
    parquet.write_table(parquet.read_table(part), part, compression="none")
    assert run(write(), folder, resume=True).done == 0
    assert content(folder) == whole


def test_kept_trajectories_are_checked_and_made_again_too(write: Callable[..., Path], tmp_path: Path) -> None:
    sweep, folder = write(change=("[set]", "[keep]\ntrajectories = 100\n[set]")), tmp_path / "data"
    run(sweep, folder)
    names = sorted((folder / "trajectories").iterdir())
    whole = [name.read_bytes() for name in names]
    names[0].unlink()
    names[1].write_bytes(whole[2])
    names[2].write_bytes(whole[2][:-50])
    said: list[str] = []
    plan, dataset = Plan(load_sweep(sweep)), Dataset(place(folder))
    done = dataset.done(plan, said.append)
    assert sorted(set(range(10)) - done) == [0, 3, 6]
    assert [line.partition(" that")[0] for line in said] == [
        "trajectories/run-000000000.parquet is missing: its runs are simulated again",
        "trajectories/run-000000100.parquet holds other runs: its runs are simulated again",
        "trajectories/run-000000200.parquet is no Parquet file",
    ]
    assert run(sweep, folder, resume=True).done == 96
    assert [name.read_bytes() for name in names] == whole


@pytest.mark.parametrize("name", ["part-000004.parquet", "trajectories/run-000000128.parquet"])
def test_a_folder_in_the_place_of_a_file_is_the_users_to_move(
    write: Callable[..., Path], tmp_path: Path, name: str
) -> None:
    sweep, folder = write(change=("[set]", "[keep]\ntrajectories = 128\n[set]")), tmp_path / "data"
    run(sweep, folder)
    (folder / name).unlink()
    (folder / name).mkdir()
    with pytest.raises(InputError, match=f"{name}: is a folder where a file of the dataset belongs"):
        batch(str(sweep), output=str(folder), resume=True)


def test_each_part_is_read_once_for_check_and_end(
    write: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "data"
    run(write(), folder)
    (folder / "part-000001.parquet").unlink()
    opened: list[int] = []
    genuine = Dataset.read_sealed

    def counted(self: Dataset, plan: Plan, chunk: Any) -> Any:
        opened.append(chunk.number)
        return genuine(self, plan, chunk)

    monkeypatch.setattr(Dataset, "read_sealed", counted)
    batch(str(write()), output=str(folder), resume=True, plot=False)
    assert opened == [0, *range(2, 10)]


def test_datasets_of_earlier_versions_are_refused_by_resume_and_replay_but_read(
    write: Callable[..., Path], tmp_path: Path
) -> None:
    folder = tmp_path / "data"
    run(write(), folder)
    file = folder / "sweep.json"
    stored = json.loads(file.read_text(encoding="utf-8"))
    file.write_text(json.dumps({k: v for k, v in stored.items() if k not in ("format", "sampler")}), encoding="utf-8")
    for refused in (lambda: run(write(), folder, resume=True), lambda: stored_plan(Dataset(place(folder)))):
        with pytest.raises(InputError, match=r"was begun by an earlier version of springline.*begin a new one"):
            refused()
    assert len(read_dataset(folder)) == 300


def test_resume_refuses_another_sampler(
    write: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(write(), tmp_path / "data")
    monkeypatch.setattr("springline.runner.sweep.sampling.VERSION", 2)
    with pytest.raises(InputError, match="\n  sampler: 1 -> 2"):
        run(write(), tmp_path / "data", resume=True)
    with pytest.raises(InputError, match="drawn by another version of the sampler: expected 2, got 1"):
        stored_plan(Dataset(place(tmp_path / "data")))


def test_reading_tells_what_is_not_there(write: Callable[..., Path], tmp_path: Path) -> None:
    folder = tmp_path / "data"
    dataset = Dataset(place(folder))
    dataset.begin(Plan(load_sweep(write())), versions(), resume=False)
    with pytest.raises(InputError, match="holds no runs yet"):
        read_dataset(folder)
    run(write(), folder, resume=True)
    with pytest.raises(InputError, match=r"unknown column, got 'iae_lft'; did you mean 'iae_lift'"):
        read_dataset(folder, ["iae_lft"])
    damage(folder, "foreign")
    with pytest.raises(InputError, match=r"part-000002\.parquet: has other columns than the first part"):
        read_dataset(folder)
    damage(folder, "empty")
    with pytest.raises(InputError, match=r"part-000002\.parquet: is damaged"):
        read_dataset(folder)


# --- the signal tables -----------------------------------------------------------------------------------

RECORD = "t,heave\n" + "\n".join(f"{k / 10},{0.1 * (k % 7) * (k > 2)}" for k in range(12)) + "\n"
MOVED = """
[base_motion]
kind = "table"
path = "records/{record}"
columns = {{ t = "t", shake = "heave" }}
"""


@pytest.fixture
def at_sea(tmp_path: Path) -> Path:
    """A sweep with a scenario and two records in folders of their own."""
    home = tmp_path / "home"
    (home / "records").mkdir(parents=True)
    (home / "records" / "calm.csv").write_text(RECORD, encoding="utf-8")
    (home / "records" / "rough.csv").write_text(RECORD.replace(",0.", ",1."), encoding="utf-8")
    (home / "ship.toml").write_text(MOVED.format(record="calm.csv"), encoding="utf-8")
    sweep = SWEEP.format(samples=40, chunk=32).replace("paper/nominal", "ship.toml")
    (home / "sweep.toml").write_text(sweep, encoding="utf-8")
    return home


def test_a_resume_over_a_changed_table_is_refused(at_sea: Path, tmp_path: Path) -> None:
    run(at_sea / "sweep.toml", tmp_path / "data")
    record = at_sea / "records" / "calm.csv"
    record.write_text(RECORD.replace(",0.4", ",0.5"), encoding="utf-8")
    with pytest.raises(InputError, match=r"\n  tables\.base_motion\.csv\.sha256: .* -> "):
        run(at_sea / "sweep.toml", tmp_path / "data", resume=True)
    record.write_text(RECORD, encoding="utf-8")
    assert run(at_sea / "sweep.toml", tmp_path / "data", resume=True).done == 0


def test_a_sweep_that_moved_with_its_table_resumes_and_its_dataset_replays_without(
    at_sea: Path, tmp_path: Path
) -> None:
    run(at_sea / "sweep.toml", tmp_path / "data")
    whole = content(tmp_path / "data")
    assert str(tmp_path) not in whole["sweep.json"].decode()
    (tmp_path / "data" / "part-000001.parquet").unlink()
    moved = at_sea.rename(tmp_path / "elsewhere")
    assert run(moved / "sweep.toml", tmp_path / "data", resume=True).done == 8
    assert content(tmp_path / "data") == whole
    expected = load_sweep(moved / "sweep.toml").scenario.signal_tables
    shutil.rmtree(moved)
    data = (tmp_path / "data").rename(tmp_path / "archive")
    plan = stored_plan(Dataset(place(data)))
    assert plan.scenario_of(39).signal_tables == expected
    replay(str(data), 39, output=tmp_path / "again", plot=False)
    (data / "tables" / "base_motion.csv").write_text(RECORD.replace(",0.4", ",0.5"), encoding="utf-8")
    with pytest.raises(InputError, match=r"tables/base_motion\.csv: is not what the runs have read"):
        stored_plan(Dataset(place(data)))
    # What was replayed is complete by itself, and has no path of this machine.
    assert str(tmp_path) not in (tmp_path / "again" / "scenario.toml").read_text(encoding="utf-8")
    shutil.rmtree(data)
    assert load_scenario(tmp_path / "again" / "scenario.toml").signal_tables == expected


def test_tables_that_vary_are_kept_and_told_apart_by_content(at_sea: Path, tmp_path: Path) -> None:
    sweep, data = at_sea / "sweep.toml", tmp_path / "data"
    records = '\nbase_motion.path = { each = ["records/calm.csv", "records/rough.csv"] }\n'
    sweep.write_text(sweep.read_text(encoding="utf-8") + records, encoding="utf-8")
    run(sweep, data)
    assert sorted(file.name for file in (data / "tables").iterdir()) == ["base_motion-2.csv", "base_motion.csv"]
    rough = at_sea / "records" / "rough.csv"
    before = rough.read_text(encoding="utf-8")
    rough.write_text(before.replace("1.4", "1.5"), encoding="utf-8")
    with pytest.raises(InputError, match=r"tables\.base_motion-2\.csv\.sha256"):
        run(sweep, data, resume=True)
    rough.write_text(before, encoding="utf-8")
    expected = [Plan(load_sweep(sweep)).scenario_of(number).signal_tables for number in (0, 79)]
    shutil.rmtree(at_sea)
    plan = stored_plan(Dataset(place(data)))
    assert [plan.scenario_of(number).signal_tables for number in (0, 79)] == expected
    assert Dataset(place(data)).done(plan) == {0, 1, 2, 3}


def test_a_dataset_behind_a_url_keeps_its_tables(at_sea: Path, memory: str) -> None:
    run(at_sea / "sweep.toml", memory)
    expected = load_sweep(at_sea / "sweep.toml").scenario.signal_tables
    shutil.rmtree(at_sea)
    dataset = Dataset(place(memory))
    assert stored_plan(dataset).scenario_of(3).signal_tables == expected


def test_resume_of_nothing_begins(write: Callable[..., Path], tmp_path: Path) -> None:
    assert run(write(), tmp_path / "data", resume=True).done == 300


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("seed = 2", "seed = 3"), "\n  seed: 2 -> 3"),
        (("[1.0, 5.0]", "[1.0, 6.0]"), r"\n  vary\.control\.k1\.uniform: \[1\.0, 5\.0\] -> \[1\.0, 6\.0\]"),
        (("control.k1 =", "control.k2 ="), r"\n  vary\.control\.k1: \{ uniform = \[1\.0, 5\.0\] \} -> nothing"),
        (("0.002\n", "0.003\n"), r"\n  simulation\.duration: 0\.002 -> 0\.003"),
        (("0.002\n", "0.002\ncontrol.fast = false\n"), r"\n  control\.fast: true -> false"),
        (("samples = 300", "samples = 299"), "\n  samples: 300 -> 299"),
        (("chunk = 32", "chunk = 64"), "chunk: 32 -> 64"),
    ],
)
def test_resume_refuses_another_sweep_and_says_what_changed(
    write: Callable[..., Path], tmp_path: Path, change: tuple[str, str], said: str
) -> None:
    run(write(), tmp_path / "data")
    before = content(tmp_path / "data")
    with pytest.raises(InputError, match=said):
        run(write(change=change), tmp_path / "data", resume=True)
    assert content(tmp_path / "data") == before


def test_resume_refuses_another_kernel_but_not_another_version(write: Callable[..., Path], tmp_path: Path) -> None:
    folder = tmp_path / "data"
    run(write(), folder)
    file = folder / "sweep.json"
    stored = json.loads(file.read_text(encoding="utf-8"))
    file.write_text(json.dumps(stored | {"springline": "0.0.1", "versions": {"numpy": "0"}}), encoding="utf-8")
    assert run(write(), folder, resume=True).done == 0
    stored["groups"][0]["kernel"] = "0" * 64
    file.write_text(json.dumps(stored), encoding="utf-8")
    with pytest.raises(InputError, match=r'groups\.0\.kernel: "000'):
        run(write(), folder, resume=True)


def test_the_kernels_hash_is_of_what_the_compiler_sees(
    write: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A dataset resumes after a comment in the C was edited, and not after anything else was."""
    own, sources = Plan(load_sweep(write())).groups[0].work, runtime_sources()

    def identity(**edited: str) -> str:
        monkeypatch.setattr(work, "runtime_sources", lambda: sources | edited)
        monkeypatch.setattr(work, "_runtime_tokens", runtime_tokens)
        return str(work._emitted.__wrapped__(own.spec)[0])

    runtime_tokens = work._runtime_tokens.__wrapped__
    loop = sources["loop.c"]
    assert identity() == own.identity
    assert identity(**{"loop.c": f"/* another word */\n{loop.replace('  ', '   ')}"}) == own.identity
    assert identity(**{"loop.c": f"{loop}int another;\n"}) != own.identity
    assert identity(**{"sl_math.h": sources["sl_math.h"].replace("0.5", "0.25", 1)}) != own.identity
    emit = lanes.emit
    for text, same in (("/* another word */", True), ("int another;", False)):  # in the printed kernel

        def edited(*given: Any, text: str = text) -> lanes.Emission:
            emission = emit(*given)
            return replace(emission, text=f"{emission.text}\n{text}\n")

        monkeypatch.setattr(lanes, "emit", edited)
        assert (identity() == own.identity) is same


def test_a_chosen_chunk_size_stays_when_resuming(write: Callable[..., Path], tmp_path: Path) -> None:
    """A version that would choose another size for the same sweep still resumes it."""
    folder = tmp_path / "data"
    free = ("chunk = 32\n", "")
    plan = Plan(load_sweep(write(change=free)), 96)
    dataset = Dataset(place(folder))
    dataset.begin(plan, versions(), resume=False)
    assert run(write(change=free), folder, resume=True).done == 300
    assert len(dataset.parts()) == 4


@pytest.mark.parametrize("resume", [False, True])
def test_a_folder_with_something_else_is_left_alone(
    write: Callable[..., Path], tmp_path: Path, *, resume: bool
) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    (folder / "thesis.tex").write_text("years of work", encoding="utf-8")
    with pytest.raises(InputError, match=r"not empty and holds no dataset.*thesis\.tex"):
        batch(str(write()), output=str(folder), resume=resume)
    assert [file.name for file in folder.iterdir()] == ["thesis.tex"]


def test_a_begun_dataset_is_only_continued_on_request(write: Callable[..., Path], tmp_path: Path) -> None:
    run(write(), tmp_path / "data")
    with pytest.raises(InputError, match="--resume continues it"):
        batch(str(write()), output=str(tmp_path / "data"))


def test_a_file_in_place_of_the_folder_is_named(write: Callable[..., Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a file"):
        batch(str(write()), output=str(tmp_path / "sweep.toml"))


@pytest.mark.parametrize("name", ["/proc/springline/data", "n" * 300])
def test_a_folder_that_cannot_be_made_is_the_users_mistake(
    write: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"cannot hold a dataset \(.+\): -o must name a folder"):
        batch(str(write()), output=name)


@pytest.mark.parametrize("key", ["sweep", "scenario"])
def test_a_damaged_description_is_told(write: Callable[..., Path], tmp_path: Path, key: str) -> None:
    folder = tmp_path / "data"
    run(write(), folder)
    stored = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
    for damaged in ({k: v for k, v in stored.items() if k != key}, stored | {key: "]"}, stored | {key: None}):
        (folder / "sweep.json").write_text(json.dumps(damaged), encoding="utf-8")
        with pytest.raises(InputError, match=r"sweep\.json: is damaged"):
            run(write(), folder, resume=True)


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 100_000, "[]", "9" * 6000, "{", "nonsense", ""])
def test_a_description_that_is_none_is_told(write: Callable[..., Path], tmp_path: Path, text: str) -> None:
    folder = tmp_path / "data"
    run(write(32), folder)
    (folder / "sweep.json").write_text(text, encoding="utf-8")
    for command in (lambda: run(write(32), folder, resume=True), lambda: stored_plan(Dataset(place(folder)))):
        with pytest.raises(InputError, match=r"sweep\.json: is damaged"):
            command()


@pytest.mark.parametrize("key", ["chunk", "runs", "chunks", "groups", "tables", "sweep", "scenario", "sampler"])
def test_no_entry_of_a_description_can_be_missing_or_another(
    write: Callable[..., Path], tmp_path: Path, key: str
) -> None:
    folder = tmp_path / "data"
    run(write(32), folder)
    stored = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
    others = [{k: v for k, v in stored.items() if k != key}]
    others += [stored | {key: value} for value in (None, 0, -1, True, 1.5, "x", [], {"a": {}}, [[]], 10**30)]
    for other in others:
        (folder / "sweep.json").write_text(json.dumps(other), encoding="utf-8")
        for command in (lambda: run(write(32), folder, resume=True), lambda: stored_plan(Dataset(place(folder)))):
            with pytest.raises(
                InputError, match=r"is damaged|cannot be resumed|sampler|chunk: expected|numbers of runs"
            ):
                command()


def test_changes_are_told_by_place() -> None:
    old = {"a": 1, "l": [{"key": "x", "v": 1}, {"key": "y", "v": 2}], "gone": True}
    new = {"a": 2, "l": [{"key": "y", "v": 2}, {"key": "x", "v": 3}], "new": [1]}
    assert set(changes(old, new)) == {
        "a: 1 -> 2",
        "l.x.v: 1 -> 3",
        'l, order: ["x", "y"] -> ["y", "x"]',
        "gone: true -> nothing",
        "new: nothing -> [1]",
    }
    assert list(changes({"l": [{"key": "x", "v": 1}]}, {"l": [{"key": "y", "v": 1}]})) == [
        "l.x: { v = 1 } -> nothing",
        "l.y: nothing -> { v = 1 }",
    ]


# --- URLs ------------------------------------------------------------------------------------------------


@pytest.fixture
def memory() -> Iterator[str]:
    fsspec = pytest.importorskip("fsspec", reason="fsspec is not installed (extra: distributed)")
    yield "memory://bucket/data"
    fsspec.filesystem("memory").store.clear()


def test_a_url_holds_the_same_dataset(write: Callable[..., Path], tmp_path: Path, memory: str) -> None:
    run(write(), tmp_path / "data")
    assert run(write(), memory).done == 300
    assert read_dataset(memory).equals(read_dataset(tmp_path / "data"), check_metadata=True)
    assert Dataset(place(memory)).place.read("part-000001.parquet") == content(tmp_path / "data")["part-000001.parquet"]
    Dataset(place(memory)).place.remove("part-000001.parquet")
    assert run(write(), memory, resume=True).done == 32
    assert ".lock" not in place(memory).names()


def test_a_url_is_locked_by_the_living_only(write: Callable[..., Path], memory: str) -> None:
    run(write(), memory)
    where = place(memory)
    with where.locked(), pytest.raises(InputError, match="is being written by process"):
        run(write(), memory, resume=True)
    host = os.uname().nodename
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    where.write(".lock", f"process {child.pid} on {host}".encode())
    assert run(write(), memory, resume=True).done == 0
    where.write(".lock", b"process 1 on another-host")
    with pytest.raises(InputError, match=r"if that process is gone, remove memory://bucket/data/\.lock"):
        run(write(), memory, resume=True)


def test_an_unknown_kind_of_url_is_the_users_mistake(memory: str) -> None:
    with pytest.raises(InputError, match="nonsense://x"):
        place("nonsense://x")


# --- disasters -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def processes() -> ForkServerContext:
    """Processes that start with everything imported, so that a kill strikes work and not imports."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["springline.runner.cli.commands.batch", "springline.runner.sweep.running"])
    return context


def start(processes: ForkServerContext, sweep: Path, folder: Path) -> Any:
    arguments = {"output": str(folder), "jobs": 2, "resume": True, "plot": False}
    process = processes.Process(target=batch, args=(str(sweep),), kwargs=arguments)
    process.start()
    return process


def killed_again_and_again(processes: ForkServerContext, sweep: Path, folder: Path, kills: int, parts: int) -> int:
    """SIGKILL at random moments between the first part and the last; how often it struck a sweep that was at work."""
    moments = random.Random(7)  # noqa: S311 - no secret
    struck = 0
    for _ in range(kills):
        process = start(processes, sweep, folder)
        target = min(len(list(folder.glob("part-*"))) + moments.randrange(1, max(2, parts // kills)), parts - 1)
        while process.is_alive() and len(list(folder.glob("part-*"))) < target:
            time.sleep(0.001)
        time.sleep(0.02 * moments.random())
        struck += process.is_alive()
        os.kill(process.pid, signal.SIGKILL)
        process.join()
    return struck


def killed_like_undisturbed(
    write: Callable[..., Path], tmp_path: Path, processes: ForkServerContext, samples: int, chunk: int, kills: int
) -> None:
    sweep, folder = write(samples, chunk), tmp_path / "killed"
    parts = -(-samples // chunk)
    assert killed_again_and_again(processes, sweep, folder, kills, parts) >= kills // 2
    before = content(folder)
    assert len(before) < parts + 1
    tally = run(sweep, folder, resume=True)
    assert tally.found + tally.done == samples
    run(sweep, tmp_path / "undisturbed")
    assert content(folder) == content(tmp_path / "undisturbed")
    # What was there after the last kill was whole: nothing of it has been done again.
    assert tally.found == sum(min(chunk, samples - chunk * int(name[5:11])) for name in before if name[:5] == "part-")


def test_kills_lose_nothing(write: Callable[..., Path], tmp_path: Path, processes: ForkServerContext) -> None:
    killed_like_undisturbed(write, tmp_path, processes, samples=6_144, chunk=64, kills=3)


@pytest.mark.full
def test_twenty_kills_of_50000_runs_lose_nothing(
    write: Callable[..., Path], tmp_path: Path, processes: ForkServerContext
) -> None:
    killed_like_undisturbed(write, tmp_path, processes, samples=50_000, chunk=64, kills=20)


def test_of_two_processes_that_resume_at_once_one_refuses(
    write: Callable[..., Path], tmp_path: Path, processes: ForkServerContext
) -> None:
    sweep, folder = write(8_000, 64), tmp_path / "data"
    process = start(processes, sweep, folder)
    while not list(folder.glob("part-*")):
        time.sleep(0.002)
    with pytest.raises(InputError, match=f"is being written by process {process.pid} on"):
        run(sweep, folder, resume=True)
    os.kill(process.pid, signal.SIGKILL)  # the system drops the lock with the process
    process.join()
    tally = run(sweep, folder, resume=True)
    assert tally.left == 0


def test_a_full_disk_is_told_and_what_is_there_stays_sound(
    write: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a disk that has room for three parts; the real thing is the next test."""
    monkeypatch.setattr(import_module("springline.runner.sweep.running"), "_PAUSE", 0.0)
    genuine, room = atomic._write_through, [3]

    def full(path: Path, data: bytes) -> None:
        if room[0] == 0 and path.name.startswith(TEMPORARY):
            path.write_bytes(data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device", str(path))
        room[0] -= data[:4] == b"PAR1"
        genuine(path, data)

    monkeypatch.setattr(atomic, "_write_through", full)
    tally = run(write(), tmp_path / "data")
    assert (tally.done, tally.failed) == (96, 96)
    assert "No space left on device" in tally.failures[0]
    assert sorted(content(tmp_path / "data")) == [*(f"part-{k:06d}.parquet" for k in range(3)), "sweep.json"]
    monkeypatch.setattr(atomic, "_write_through", genuine)
    assert run(write(), tmp_path / "data", resume=True).done == 204
    run(write(), tmp_path / "other")
    assert content(tmp_path / "data") == content(tmp_path / "other")


SMALL_DISK = """
import subprocess, sys
from typer.testing import CliRunner
from springline.runner.cli import app
from springline.runner.sweep.places import Folder
sweep, disk = sys.argv[1:]
def call(*more):
    done = CliRunner().invoke(app, ["batch", sweep, "-o", disk + "/data", "--no-plot", *more])
    print(done.exit_code, done.stderr.replace(chr(10), " "))
subprocess.run(["mount", "-t", "tmpfs", "-o", "size=40k", "tmpfs", disk], check=True)
call()
subprocess.run(["mount", "-o", "remount,size=120k", disk], check=True)
known, Folder.free = Folder.free, lambda self: None
call()
Folder.free = known
subprocess.run(["mount", "-o", "remount,size=20m", disk], check=True)
call("--resume")
subprocess.run(["cp", "-r", disk + "/data", disk + "-copy"], check=True)
"""


def test_a_tmpfs_that_is_full(write: Callable[..., Path], tmp_path: Path, require_tool: Callable[..., str]) -> None:
    namespace = [require_tool("unshare"), "--user", "--map-root-user", "--mount"]
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = [*namespace, "mount", "-t", "tmpfs", "tmpfs", disk]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("this system lets users mount no tmpfs of their own")
    sweep = write()
    script = [*namespace, sys.executable, "-c", SMALL_DISK, sweep, disk]
    done = subprocess.run(script, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    refused, first, second = done.stdout.splitlines()
    assert re.match(r"2 Error: .*has [\d,]+ bytes free, and the dataset takes about [\d,]+: choose another", refused)
    assert first.startswith("1 ")
    assert "No space left on device" in first
    assert "--resume" in first
    assert second.startswith("0 ")
    run(sweep, tmp_path / "other")
    assert content(tmp_path / "disk-copy") == content(tmp_path / "other")


@pytest.mark.parametrize("name", ["sweep.json", "part-000000.parquet"])
def test_a_pipe_in_a_dataset_is_not_waited_for(name: str, write: Callable[..., Path], tmp_path: Path) -> None:
    data = tmp_path / "data"
    run(write(40), data)
    (data / name).unlink()
    os.mkfifo(data / name)
    words = ["replay", str(data), "0", "-o", str(tmp_path / "run"), "--no-plot"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    assert "a pipe or a device" in done.stderr


@pytest.mark.parametrize("twin", [1, 2])
def test_a_dataset_that_has_a_run_twice_is_not_read(twin: int, write: Callable[..., Path], tmp_path: Path) -> None:
    """One part copied over another, or besides all others."""
    data = tmp_path / "data"
    run(write(64), data)
    assert len(read_dataset(data)) == 64
    shutil.copy(data / "part-000000.parquet", data / f"part-00000{twin}.parquet")
    with pytest.raises(InputError, match=f"part-00000{twin}.parquet: holds runs that an earlier part has"):
        read_dataset(data)
