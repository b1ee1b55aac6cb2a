"""The command line as its users meet it: outputs, messages, exit codes, and what is never written."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from stored import read_table
from typer.testing import CliRunner, Result

from springline import __version__
from springline.benchmarks import command as bench
from springline.benchmarks.contenders import CONTENDERS
from springline.codegen.files import Changes, write_tree
from springline.codegen.kernel import kernel
from springline.model.control import LAWS
from springline.model.drive import FRICTION
from springline.model.hardware import EFFECTS
from springline.runner.cli import app, terminal
from springline.runner.cli.commands import run as run_command
from springline.runner.cli.overrides import parse_set
from springline.runner.files import InputError, units
from springline.runner.paper import reproduction
from springline.runner.paper.evidence import Check, Finding
from springline.runner.run import simulate
from springline.runner.scenario import load_scenario, packaged_scenarios, packaged_sweeps

MAIN = "from springline.runner.cli import main; main()"
FIGURES = {"tracking", "error", "phase_plane", "sliding", "force", "springs", "base_motion", "tip"}
SHORT = """\
[base_motion]
kind = "sine"
shake = [{ amplitude = 0.1, omega = 10.0 }]

[simulation]
duration = 0.5
output_every = 100
"""


SWEEP = """\
scenario = "paper/nominal"
[vary]
control.delta = { uniform = [0.02, 0.1] }
"""


def springline(*arguments: str | Path) -> Result:
    """Run a command in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="springline")


def done(*arguments: str | Path) -> str:
    """What a command that must succeed prints."""
    result = springline(*arguments)
    assert result.exit_code == 0, result.stderr
    return result.stdout


def refused(*arguments: str | Path, code: int = 2) -> str:
    """What a command that must fail tells the user."""
    result = springline(*arguments)
    assert result.exit_code == code, (result.exit_code, result.stderr, result.exception)
    assert isinstance(result.exception, SystemExit)
    assert "Traceback" not in result.output
    assert result.stdout == ""
    return result.stderr


def contents(folder: Path) -> dict[str, str]:
    """Every file below `folder` -> its hash."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A current folder of the test's own, with a short scenario in it."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(SHORT, encoding="utf-8")
    return tmp_path


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of short.toml, figures included."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "short.toml").write_text(SHORT, encoding="utf-8")
    done("run", folder / "short.toml", "-o", folder / "out")
    return folder / "out"


# --- run -------------------------------------------------------------------------------------------------


def test_run_writes_scenario_tables_and_figures(results: Path) -> None:
    figures = {f"figures/{name}.{form}" for name in FIGURES for form in ("png", "svg")}
    always = {"report.html", "scenario.toml", "trajectory.parquet", "metrics.parquet"}
    assert set(contents(results)) == always | figures


def test_run_stores_what_simulate_gives_with_units(results: Path) -> None:
    expected = simulate(load_scenario("short.toml"))
    for name, table in (("trajectory", expected.trajectory), ("metrics", expected.metrics)):
        stored = read_table(results / f"{name}.parquet")
        assert stored.equals(table)
        assert units(stored) == units(table)
    assert units(read_table(results / "trajectory.parquet"))["U_rotation"] == "N m"


def test_run_writes_a_scenario_that_repeats_it(results: Path) -> None:
    assert load_scenario(results / "scenario.toml") == load_scenario("short.toml")


def test_another_process_writes_the_same_bytes(results: Path) -> None:
    subprocess.run(
        [sys.executable, "-c", MAIN, "run", "short.toml", "-o", "again"],
        env=os.environ | {"PYTHONHASHSEED": "1", "COLUMNS": "40"},
        capture_output=True,
        check=True,
    )
    assert contents(Path("again")) == contents(results)


def test_the_engines_write_the_same_bytes(results: Path) -> None:
    done("run", "short.toml", "-o", "casadi", "--engine", "casadi", "--no-plot")
    written = contents(Path("casadi"))
    assert set(written) == {"report.html", "scenario.toml", "trajectory.parquet", "metrics.parquet"}
    assert "<img" not in Path("casadi/report.html").read_text(encoding="utf-8")
    del written["report.html"]
    assert written.items() <= contents(results).items()


def stored_hash(path: Path) -> str:
    """SHA-256 of the columns of doubles in a stored table, one after the other, null a quiet NaN."""
    table = read_table(path)
    columns = [table[field.name].to_pylist() for field in table.schema if field.type == "double"]
    quiet = bytes.fromhex("7ff8000000000000")[::-1]
    data = [quiet if value is None else struct.pack("<d", value) for column in columns for value in column]
    assert len(data) == table.num_rows * table.num_columns > 0
    return hashlib.sha256(b"".join(data)).hexdigest()


@pytest.mark.parametrize("engine", ["lanes", "casadi"])
def test_run_prints_a_hash_of_the_trajectory_last(results: Path, engine: str) -> None:
    wanted = stored_hash(results / "trajectory.parquet")
    options = ("run", "short.toml", "-o", "out", "--no-plot", "--engine", engine, "--hash")
    assert done(*options).splitlines()[-1] == f"sha256 {wanted}"
    answer = json.loads(done(*options, "--force", "--json"))
    assert answer["sha256"] == wanted
    changed = done(*options, "--force", "--set", "control.delta=0.03").splitlines()[-1]
    assert changed == f"sha256 {stored_hash(Path('out/trajectory.parquet'))}" != f"sha256 {wanted}"


def test_run_shows_metrics_with_units_and_where_the_results_are() -> None:
    shown = done("run", "short.toml", "-o", "out", "--no-plot")
    assert re.search(r"settling time +0\.2\d* s +0\.2\d* s", shown)
    assert re.search(r"U max +\d+ N +\d+ N m", shown)
    assert "done: 0.5 s in 5000 steps" in shown
    assert "results: out" in shown


@pytest.mark.parametrize(
    ("scenario", "folder"), [("short.toml", "results/short"), ("paper/nominal", "results/paper/nominal")]
)
def test_results_have_a_folder_by_default(scenario: str, folder: str) -> None:
    done("run", scenario, "--no-plot", "--set", "simulation.duration=0.01")
    assert Path(folder, "metrics.parquet").exists()


def test_set_overrides_the_scenario() -> None:
    done(
        "run", "short.toml", "-o", "out", "--no-plot", "--set", "control.mu=[10.0, 4.0]", "--set", 'control.law="power"'
    )
    used = load_scenario(Path("out/scenario.toml"))
    assert used.document["control"]["mu"] == [10.0, 4.0]
    assert used.structure().law == "power"


def test_csv_has_the_same_numbers_and_units_beside_it(results: Path) -> None:
    done("run", "short.toml", "-o", "out", "--no-plot", "--format", "csv")
    tables = {f"{name}.{end}" for name in ("trajectory", "metrics") for end in ("csv", "units.json")}
    assert set(contents(Path("out"))) == {"report.html", "scenario.toml"} | tables
    for name in ("trajectory", "metrics"):
        read, expected = read_table(Path("out", f"{name}.csv")), read_table(results / f"{name}.parquet")
        assert read.equals(expected)
        assert units(read) == units(expected)


def test_run_prints_json_and_nothing_else() -> None:
    answer = json.loads(done("run", "short.toml", "-o", "out", "--no-plot", "--json"))
    assert list(answer) == ["command", "version", "status", "rows", "units"]
    assert (answer["command"], answer["status"], answer["version"]) == ("run", "ok", __version__)
    metrics = read_table(Path("out/metrics.parquet"))
    assert answer["rows"] == metrics.to_pylist()
    assert answer["units"] == units(metrics)


def test_a_run_that_diverges_is_a_result() -> None:
    without_fast = ("run", "paper/nominal", "--no-plot", "--set", "control.fast=false")
    shown = done(*without_fast, "-o", "out")
    (row,) = read_table(Path("out/metrics.parquet")).to_pylist()
    assert row["status"] == "out_of_bounds"
    assert row["settling_time_lift"] is None
    assert re.search(rf"dq2_rotation left its bound .* results end at t = {row['t_end']:g} s", shown)
    assert re.search(r"settling time +– +–", shown)
    answer = json.loads(done(*without_fast, "-o", "again", "--json"))
    assert answer["status"] == answer["rows"][0]["status"] == "out_of_bounds"


# --- what the user got wrong -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nowhere.toml"], "nowhere.toml"),
        (["paper/group1_shak"], "did you mean 'paper/group1_shake'?"),
        (
            ["short.toml", "--set", "control.delt=0.1"],
            "override of short.toml: control.delt: unknown key, got 'delt'; ",
        ),
        (["short.toml", "--set", "control.delta"], "override of short.toml: expected --set KEY=VALUE"),
        (["short.toml", "--set", "control.law=pow er"], "override of short.toml: control.law: expected a TOML value"),
        (["short.toml", "--set", "control.delta=0,03"], "override of short.toml: control.delta: expected a TOML value"),
        (["short.toml", "--set", "control.law=powr"], "did you mean 'power'?"),
        (["sweep.toml"], "sweep.toml: this is a sweep: springline batch sweep.toml"),
        (["stability_map"], "stability_map: this is a sweep: springline batch stability_map"),
        (["short.toml", "--set", "mechanism.m3=-1.0"], "mechanism.m3: expected a number > 0 [kg]"),
        (["short.toml", "--set", "simulation.duration=0.50005"], "whole multiple"),
        (["short.toml", "--format", "xlsx"], "xlsx"),
        (["short.toml", "--engine", "fortran"], "fortran"),
        (["short.toml", "--stiff"], "--stiff"),
        ([], "scenario"),
        (["short.toml", "-o", "short.toml"], "is a file"),
        (["short.toml", "-o", "short.toml/out"], "short.toml: is a file"),
    ],
)
def test_wrong_input_is_explained_and_nothing_written(elsewhere: Path, arguments: list[str], told: str) -> None:
    (elsewhere / "sweep.toml").write_text(SWEEP, encoding="utf-8")
    assert told.lower() in refused("run", *arguments).lower()
    assert set(contents(elsewhere)) == {"short.toml", "sweep.toml"}


def test_every_mistake_of_a_file_is_told_at_once(elsewhere: Path) -> None:
    Path("bad.toml").write_text("[control]\nl = 2\nk1 = nan\n[drive]\nk_s2 = 'stiff'\n", encoding="utf-8")
    told = refused("run", "bad.toml")
    assert all(f"bad.toml: {key}: expected" in told for key in ("control.l", "control.k1", "drive.k_s2"))
    assert set(contents(elsewhere)) == {"short.toml", "bad.toml"}


def test_a_folder_that_holds_something_is_refused() -> None:
    Path("out").mkdir()
    Path("out/notes.txt").write_text("mine", encoding="utf-8")
    assert "--force" in refused("run", "short.toml", "-o", "out")
    assert list(contents(Path("out"))) == ["notes.txt"]


def test_force_replaces_results_and_only_results(results: Path) -> None:
    shutil.copytree(results, "out")
    Path("out/notes.txt").write_text("mine", encoding="utf-8")
    done("run", "short.toml", "-o", "out", "--no-plot", "--format", "csv", "--force")
    left = {
        "notes.txt",
        "scenario.toml",
        "trajectory.csv",
        "trajectory.units.json",
        "metrics.csv",
        "metrics.units.json",
        "report.html",
    }
    assert set(contents(Path("out"))) == left
    assert not Path("out/figures").exists()


def test_force_does_not_replace_what_the_run_reads() -> None:
    done("run", "short.toml", "-o", "out", "--no-plot")
    before = contents(Path("out"))
    changed = ("--set", "control.delta=0.1", "--no-plot", "--force")
    assert "scenario.toml" in refused("run", "out/scenario.toml", "-o", "out", *changed)
    assert contents(Path("out")) == before


def test_force_does_not_replace_a_record_that_the_run_reads() -> None:
    Path("out").mkdir()
    record = "\n".join(["t,y", *(f"{0.1 * k:.1f},{0.01 * k}" for k in range(10))])
    Path("out/trajectory.csv").write_text(record, encoding="utf-8")
    moving = (
        'base_motion={ kind = "table", path = "out/trajectory.csv", columns = { t = "t", shake = "y" }, ends = "hold" }'
    )
    told = refused("run", "short.toml", "-o", "out", "--force", "--set", moving)
    assert "trajectory.csv" in told
    assert Path("out/trajectory.csv").read_text(encoding="utf-8") == record


# --- other commands, hostile arguments -------------------------------------------------------------------

EVERY = {
    "run": ["run", "short.toml"],
    "generate": ["generate"],
    "export c": ["export", "c", "short.toml"],
    "export fmu2": ["export", "fmu2", "short.toml", "--part", "loop"],
    "export fmu3": ["export", "fmu3", "short.toml", "--part", "plant"],
    "reproduce": ["reproduce"],
    "bench": ["bench"],
}
"""Every command that writes a folder, but for batch and replay (tests/runner/sweep/test_dataset.py)."""


@pytest.mark.parametrize("command", EVERY.values(), ids=EVERY.keys())
def test_a_folder_that_cannot_be_is_refused_before_anything_is_done(command: list[str], elsewhere: Path) -> None:
    (elsewhere / "a").symlink_to("b")
    (elsewhere / "b").symlink_to("a")
    (elsewhere / "nothing").symlink_to("nowhere")
    before = sorted(elsewhere.iterdir())
    for folder in ("a", "a/x", "x" * 300, "deep/" + "x" * 300, "short.toml", "short.toml/x", "nothing"):
        assert refused(*command, "-o", folder).endswith("; choose another with -o\n")
    for folder in ("nul\0", "nul\0/x"):
        assert "null byte" in refused(*command, "-o", folder)
    assert sorted(elsewhere.iterdir()) == before


@pytest.mark.parametrize("command", EVERY.values(), ids=EVERY.keys())
def test_a_folder_that_cannot_be_written_to_is_refused(
    command: list[str], elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (elsewhere / "locked").mkdir(mode=0o555)
    monkeypatch.setattr(os, "access", lambda place, _: place.stat().st_mode & 0o200 != 0)  # root may write anywhere
    assert "locked: cannot be written to; choose another with -o" in refused(*command, "-o", "locked/out")


@pytest.mark.parametrize("command", [EVERY[name] for name in ("generate", "export c", "export fmu2", "reproduce")])
@pytest.mark.parametrize("file", ["trajectory.parquet", "trajectory.csv", "sweep.json", "bench.json"])
def test_the_results_of_another_command_are_not_mixed_with(command: list[str], file: str) -> None:
    Path("out").mkdir()
    Path("out", file).touch()
    assert f"out: holds the results of springline {WHOSE[file]} ({file})" in refused(*command, "-o", "out", "--force")
    assert list(contents(Path("out"))) == [file]


WHOSE = {"trajectory.parquet": "run", "trajectory.csv": "run", "sweep.json": "batch", "bench.json": "bench"}


@pytest.mark.parametrize("command", ["generate", "export c", "export fmu2", "export fmu3"])
def test_a_sweep_is_told_by_every_command_that_reads_a_scenario(command: str, elsewhere: Path) -> None:
    (elsewhere / "my sweep.toml").write_text(SWEEP, encoding="utf-8")
    part = ["--part", "loop"] if "fmu" in command else []
    told = refused(*command.split(), "my sweep.toml", *part)
    assert told == "Error: my sweep.toml: this is a sweep: springline batch 'my sweep.toml'\n"


def test_a_folder_of_results_is_told_what_to_do_with(results: Path) -> None:
    shutil.copytree(results, "out")
    assert "its scenario is out/scenario.toml" in refused("run", "out")
    Path("out/sweep.json").touch()
    assert "this is a dataset: springline replay out RUN" in refused("generate", "out")


@pytest.mark.parametrize("command", ["generate", "export c"])
def test_set_changes_what_is_exported(command: str) -> None:
    changes = ("--set", "plant.m3={ scale = 1.5 }", "--set", "control.law=double_power", "--set", "control.k2=7.5")
    done(*command.split(), "short.toml", "-o", "c", *changes)
    listed = json.loads(Path("c/manifest.json").read_bytes())["parameters"]
    values = {entry["name"]: entry["value"] for entry in listed}
    expected = load_scenario("short.toml", {"plant.m3.scale": 1.5, "control.law": "double_power", "control.k2": 7.5})
    assert values["plant.m3"] == 1.5 * values["mechanism.m3"] == expected.value_of("plant.m3")
    assert values["control.k2"] == 7.5
    assert "up to date" in done(*command.split(), "short.toml", "-o", "c", *changes, "--check")
    assert springline(*command.split(), "short.toml", "-o", "c", *changes[:-2], "--check").exit_code == 1


@pytest.mark.parametrize("version", ["fmu2", "fmu3"])
def test_set_changes_what_an_fmu_starts_with(version: str) -> None:
    done("export", version, "short.toml", "--part", "controller", "-o", "fmu", "--set", "control.k1=3.25")
    (file,) = Path("fmu").glob("*.fmu")
    description = zipfile.ZipFile(file).read("modelDescription.xml").decode()
    assert re.search(r'name="control\.k1"[^/]*start="3\.25"', description, re.DOTALL)
    assert "unknown key" in refused("export", version, "short.toml", "--part", "loop", "--set", "control.q=1")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("power", "power"),
        (" power ", "power"),
        ('"power"', "power"),
        ("rk4", "rk4"),
        ("my/record-10hz.csv", "my/record-10hz.csv"),
        ("../record.csv", "../record.csv"),
        ("/data/record.csv", "/data/record.csv"),
        ("größe", "größe"),
        ("true", True),
        ("inf", math.inf),
        ("-inf", -math.inf),
        ("0.5", 0.5),
        ("1_000", 1000),
        ("[1, 2]", [1, 2]),
    ],
)
def test_a_bare_word_is_text_and_a_toml_value_is_what_it_is(text: str, value: object) -> None:
    assert parse_set(f"control.law={text}", "x.toml") == ("control.law", value)


@pytest.mark.parametrize("text", ["", "two words", "0,5", "03", "5e", '"open', "a\x1b", "[" * 3000, "a\nb = 1"])
def test_what_is_neither_a_toml_value_nor_a_word_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="expected"):
        parse_set(f"control.law={text}", "x.toml")


def test_set_is_a_key_and_a_toml_value() -> None:
    assert parse_set("control.delta=0.02", "s") == ("control.delta", 0.02)
    assert parse_set(' control.law = "power"', "s") == ("control.law", "power")
    assert parse_set("control.law=power", "s") == ("control.law", "power")
    assert parse_set("plant.m3={ scale = 1.2 }", "s") == ("plant.m3", {"scale": 1.2})
    assert parse_set("control.U_max=[inf, 3]", "s") == ("control.U_max", [math.inf, 3])


@pytest.mark.parametrize("text", ["control.delta", "=3", "control.law=double power", "a=1\nb=2", "a="])
def test_what_is_no_set_is_told(text: str) -> None:
    with pytest.raises(InputError, match=r"^override of paper/nominal: .*expected"):
        parse_set(text, "paper/nominal")


# --- what reaches the terminal ---------------------------------------------------------------------------

STEERING = "\x1b]0;owned\x07\x1b[31m"


def test_no_text_of_a_user_steers_the_terminal(elsewhere: Path) -> None:
    escaped = json.dumps(STEERING)
    Path("bad.toml").write_text(f"[control]\n{escaped} = 1\nlaw = {escaped}\n[{escaped}]\n", encoding="utf-8")
    Path(f"{STEERING}\x9b\u202e.toml").write_text("[control]\nq = 1\n", encoding="utf-8")
    said = [
        refused("run", "bad.toml"),
        refused("run", f"{STEERING}\x9b\u202e.toml"),
        refused("run", "short.toml", "--set", f"control.{STEERING}=1"),
        refused("run", "short.toml", "--set", f"control.law={STEERING}"),
        refused("run", STEERING),
        refused("run", "short.toml", "-o", f"short.toml/{STEERING}"),
        done("run", "short.toml", "-o", STEERING, "--no-plot"),
        refused("list", STEERING),
        refused(STEERING),
    ]
    for text in said:
        assert r"\x1b]0;owned" in text or "short.toml: is a file" in text
        assert not set(text) & set("\x1b\x07\x9b\u202e")


def test_json_is_the_same_text_for_programs_and_safe_to_look_at(capsys: pytest.CaptureFixture[str]) -> None:
    row = {"text": "δ – \x1b[31m \x7f \x9b \u202e \udcff \U000e0001", "n": [1.5, None]}
    terminal.print_json("x", [row], {})
    shown = capsys.readouterr().out
    assert json.loads(shown)["rows"] == [row]
    assert "δ –" in shown
    assert terminal.printable(shown) == shown


def test_what_is_said_is_written_as_it_is(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Not folded, no mark-up, no :names: of pictures: keys and paths look like that."""
    monkeypatch.setenv("COLUMNS", "20")
    text = "[bold]a/:smile:/b[/bold]\tand words beyond twenty columns "
    terminal.say(text)
    terminal.complain(text)
    assert capsys.readouterr() == (f"{text}\n", f"{text}\n")


def shown_in(width: int, monkeypatch: pytest.MonkeyPatch, *arguments: str) -> str:
    monkeypatch.setenv("COLUMNS", str(width))
    result = springline(*arguments)
    assert result.exit_code == 0, result.stderr
    return result.stdout


TABLES = (
    *(["list", what] for what in ("parameters", "scenarios", "sweeps", "laws", "mechanisms")),
    ["doctor"],
)


@pytest.mark.parametrize("width", [40, 80, 100])
@pytest.mark.parametrize("command", TABLES, ids=" ".join)
def test_tables_fit_and_no_word_is_cut(command: list[str], width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = shown_in(1000, monkeypatch, *command)
    shown = shown_in(width, monkeypatch, *command)
    paths = {word for word in whole.split() if "/" in word}  # they have no place to break at
    assert max(len(line) for line in shown.splitlines() if not any(path[:20] in line for path in paths)) <= width
    assert not [line for line in shown.splitlines() if line != line.rstrip()]
    assert {word for word in whole.split() if "─" not in word} - paths <= set(shown.split())


def test_a_table_of_long_words_becomes_blocks(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    terminal.print_table(
        ["name", "where", "how much"], [["a" * 30, "b" * 28, "1.5 m"], ["c", "d", "-"]], right=["how much"]
    )
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:4] == [f"name       {'a' * 30}", f"where      {'b' * 28}", "how much   1.5 m"]


def test_a_number_stays_with_its_unit(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    terminal.print_table(["what it is", "value"], [["a long text of many words", "1.5 N m s/rad"]], right=["value"])
    assert re.search(r" 1\.5 N m s/rad$", capsys.readouterr().out, re.MULTILINE)


@pytest.mark.parametrize(
    "command", [[], ["export"], *(name.split() for name in EVERY), ["batch"], ["replay"], ["list"]], ids=" ".join
)
def test_help_fits_80_columns_and_says_all(command: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    lines = shown_in(80, monkeypatch, *command, "--help").splitlines()
    assert max(map(len, lines)) <= 80
    assert not [line for line in lines[1:] if line.endswith(("...", "…"))]  # the first names the arguments


# --- the environment -------------------------------------------------------------------------------------


def in_a_process(*arguments: str, shell: str = "", **environment: str | None) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own; `shell`: what is done with the streams; None takes a variable away."""
    values = {name: value for name, value in (os.environ | environment).items() if value is not None}
    program = [sys.executable, "-c", MAIN, *arguments]
    if shell:
        program = ["sh", "-c", f'"$@" {shell}', "sh", *program]
    return subprocess.run(program, check=False, env=values, capture_output=True, text=True)


@pytest.mark.parametrize(
    "environment",
    [
        {"COLUMNS": "²", "LINES": "x"},
        {"HOME": None, "TERM": None, "LANG": None},
        {"HOME": "/nonexistent", "TMPDIR": "/nonexistent", "MPLBACKEND": "nonsense"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "ascii", "CC": 'gcc "x'},
    ],
    ids=str,
)
def test_a_list_needs_nothing_of_the_environment(environment: dict[str, str | None]) -> None:
    result = in_a_process("list", "laws", **environment)
    assert (result.returncode, result.stderr) == (0, "")
    assert "variable_power_log" in result.stdout


def test_names_that_the_locale_cannot_spell_are_written_and_shown(elsewhere: Path) -> None:
    short = ("--set", "simulation.duration=0.001", "--set", "simulation.output_every=1", "--no-plot")
    result = in_a_process(
        "run", "short.toml", "-o", "größe", *short, LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0"
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert "results: gr" in result.stdout
    assert (elsewhere / "größe/metrics.parquet").exists()


@pytest.mark.parametrize(
    ("shell", "code", "said"),
    [
        (">&-", 0, ""),
        ("<&- >&- 2>&-", 0, ""),
        (">/dev/full", 1, "No space left on device"),
    ],
)
@pytest.mark.parametrize(
    "command", [["list", "laws"], ["list", "laws", "--json"], ["--help"], ["--version"]], ids=" ".join
)
def test_streams_that_are_closed_or_full(command: list[str], shell: str, code: int, said: str) -> None:
    result = in_a_process(*command, shell=shell)
    assert result.returncode == code
    assert said in result.stderr
    assert result.stderr.count("\n") == (1 if said else 0)


@pytest.mark.parametrize("shell", ["2>/dev/full", "2>&-"])
@pytest.mark.parametrize("unbuffered", [None, "1"])
def test_wrong_input_has_its_code_though_nobody_can_be_told(shell: str, unbuffered: str | None) -> None:
    assert in_a_process("run", "nowhere", shell=shell, PYTHONUNBUFFERED=unbuffered).returncode == 2


def test_a_fault_of_springline_is_one_line_and_its_traceback_can_be_had(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: str) -> dict[str, object]:
        raise KeyError("nobody expected this")

    monkeypatch.setattr("springline.runner.cli.commands.run.overrides", lambda *_: fail("x"))
    told = refused("run", "short.toml", code=1)
    assert re.fullmatch(r"Error: a fault of springline itself: KeyError: .*test_cli\.py, line \d+\).*\n", told)
    monkeypatch.setenv("SPRINGLINE_TRACEBACK", "1")
    assert isinstance(springline("run", "short.toml").exception, KeyError)


# --- failures that are not the user's fault --------------------------------------------------------------


@pytest.fixture
def no_compiler(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A machine on which the compiler does not work."""
    kernel.cache_clear()
    monkeypatch.setenv("CC", "/nowhere/cc")
    yield
    kernel.cache_clear()


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_one_sentence_says_so() -> None:
    told = refused("run", "short.toml", "-o", "out", code=1)
    assert told.count("\n") == 1
    assert "/nowhere/cc" in told
    assert not Path("out").exists()


def test_a_full_disk_is_one_sentence_and_no_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    done("run", "short.toml", "-o", "before", "--no-plot")  # its kernel is there, which a full disk would not hold
    monkeypatch.setattr(os, "fsync", full)
    assert (
        refused("run", "short.toml", "-o", "out", "--no-plot", code=1) == "Error: [Errno 28] No space left on device\n"
    )
    assert not Path("out").exists()


def test_ctrl_c_ends_a_run_at_once_and_writes_nothing(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    @contextlib.contextmanager
    def interrupted(text: str, *, quiet: bool = False) -> Iterator[Callable[[float], None]]:
        yield lambda share: signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(run_command, "progress", interrupted)
    start = time.monotonic()
    assert refused("run", "short.toml", "--set", "simulation.duration=500.0", code=130) == "stopped\n"
    assert time.monotonic() - start < 10.0  # the whole run takes longer
    assert list(contents(elsewhere)) == ["short.toml"]


# --- progress --------------------------------------------------------------------------------------------


class Screen(io.StringIO):
    """A terminal."""

    def isatty(self) -> bool:
        return True


def watched(stream: io.StringIO, monkeypatch: pytest.MonkeyPatch, patience: float) -> str:
    """What appears on stdout during work of some tenths of a second."""
    monkeypatch.setattr(terminal, "_PATIENCE", patience)
    monkeypatch.setattr(sys, "stdout", stream)
    monkeypatch.setenv("TERM", "xterm")
    with terminal.progress("simulating") as report:
        for share in (0.2, 0.4, 0.6):
            time.sleep(0.1)
            report(share)
    return stream.getvalue()


def test_a_bar_appears_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    assert "simulating" in watched(Screen(), monkeypatch, 0.05)


def test_no_bar_for_what_is_quick(monkeypatch: pytest.MonkeyPatch) -> None:
    assert watched(Screen(), monkeypatch, 60.0) == ""


def test_no_bar_in_a_pipe(monkeypatch: pytest.MonkeyPatch) -> None:
    assert watched(io.StringIO(), monkeypatch, 0.0) == ""


# --- generate, export ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("generated") / "c"
    done("generate", "-o", folder)
    return folder


def test_generate_writes_what_its_manifest_lists(generated: Path) -> None:
    manifest = json.loads((generated / "manifest.json").read_bytes())
    listed = {entry["path"]: entry["sha256"] for entry in manifest["files"]}
    written = contents(generated)
    assert written.pop("manifest.json")
    assert written == listed
    assert "src/springline_model.c" in written


def test_generate_is_for_the_nominal_scenario_and_export_writes_the_same(generated: Path) -> None:
    done("export", "c", "paper/nominal", "-o", "c")
    assert contents(Path("c")) == contents(generated)


def test_check_finds_an_up_to_date_folder_so(generated: Path) -> None:
    assert "up to date" in done("generate", "-o", generated, "--check")


def test_check_names_what_is_stale_and_writes_nothing(generated: Path) -> None:
    before = contents(generated)
    stale = springline("generate", "paper/group2_power", "-o", generated, "--check")
    assert stale.exit_code == 1
    assert re.search(r"changed +src/springline_model\.c: \d+ of \d+ lines are new, \d+ go", stale.stdout)
    as_json = springline("generate", "paper/group2_power", "-o", generated, "--check", "--json")
    assert as_json.exit_code == 1
    answer = json.loads(as_json.stdout)
    assert answer["status"] == "stale"
    assert ("src/springline_model.c", "changed") in [(row["path"], row["kind"]) for row in answer["rows"]]
    assert contents(generated) == before


@pytest.mark.parametrize(
    "made",
    [["--tunable", "control.k1,control.k2"], ["--tunable", "all"], ["--prefix", "arm"], ["--real", "float"]],
    ids=" ".join,
)
def test_check_names_the_options_that_a_folder_was_made_with(made: list[str]) -> None:
    done("generate", "-o", "c", *made)
    stale = springline("generate", "-o", "c", "--check")
    assert stale.exit_code == 1
    assert stale.stdout.endswith(f"it was made with {' '.join(made)}: check it with the same\n")
    assert "up to date" in done("generate", "-o", "c", "--check", *made)


def test_check_of_a_folder_without_generated_files_is_one_sentence(elsewhere: Path) -> None:
    result = springline("generate", "--check")
    assert result.exit_code == 1
    assert result.stdout == "generated holds no generated files: the same command without --check writes them\n"
    rows = json.loads(springline("generate", "--check", "--json").stdout)["rows"]
    assert {row["kind"] for row in rows} == {"missing"}
    assert list(contents(elsewhere)) == ["short.toml"]


@pytest.mark.parametrize("options", [[], ["--check"], ["--force"]])
def test_generate_leaves_the_folder_of_another_command_alone(options: list[str]) -> None:
    write_tree(Path("out"), {"report.md": b"# numbers"}, {"kind": "reproduction"})
    before = contents(Path("out"))
    assert "manifest.json: lists what another command wrote" in refused("generate", "-o", "out", *options)
    assert contents(Path("out")) == before


def test_generate_replaces_its_own_files_only() -> None:
    rows = json.loads(done("generate", "-o", "c", "--json"))["rows"]
    assert {row["change"] for row in rows} == {"written"}
    edited = Path("c/src/springline_model.c")
    edited.write_text("mine", encoding="utf-8")
    told = refused("generate", "paper/group2_power", "-o", "c")
    assert "src/springline_model.c: edited since springline wrote it" in told
    assert edited.read_text(encoding="utf-8") == "mine"
    done("generate", "paper/group2_power", "-o", "c", "--force")
    assert "power" in edited.read_text(encoding="utf-8")
    assert "up to date" in done("generate", "paper/group2_power", "-o", "c", "--check")


def test_generate_renames_and_frees_what_it_is_told_to() -> None:
    done("generate", "-o", "c", "--prefix", "arm", "--tunable", "control.k1, control.mu")
    manifest = json.loads(Path("c/manifest.json").read_bytes())
    free = [entry["name"] for entry in manifest["parameters"] if entry["binding"] == "run"]
    assert free == ["control.k1", "control.mu.0", "control.mu.1"]
    assert Path("c/src/arm_model.c").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--tunable", "control.kk"], "no parameter 'control.kk'"),
        (["--prefix", "9lives"], "9lives"),
        (["--real", "half"], "half"),
        (["nowhere"], "nowhere"),
        (["-o", "short.toml"], "is a file"),
    ],
)
def test_generate_refuses_wrong_input(elsewhere: Path, arguments: list[str], told: str) -> None:
    assert told in refused("generate", *arguments)
    assert list(contents(elsewhere)) == ["short.toml"]


# --- bench -----------------------------------------------------------------------------------------------


def test_bench_says_which_contenders_there_are(elsewhere: Path) -> None:
    told = refused("bench", "--only", "numba, nobody, nemo")
    listed = re.findall(r"--only: expected a contender's name, or a part of it, got '(\w+)' \(valid: (.+)\)", told)
    assert [word for word, _ in listed] == ["nobody", "nemo"]
    names = listed[0][1].split(", ")
    assert len(names) == len(set(names)) > 5
    for name in names:  # each may be given as it stands there
        assert any(name in contender.name for contender in bench._chosen(name, CONTENDERS))
    assert list(contents(elsewhere)) == ["short.toml"]


# --- reproduce -------------------------------------------------------------------------------------------


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """A paper that is reproduced at once (paper/test_paper.py has the real one); what the command asked for."""
    seen: list[object] = []
    row = {"group": 2, "case": "power", "joint": "lift", "measure": "settling_time", "unit": "s"}

    def reproduce(
        folder: Path,
        groups: list[int] | None = None,
        *,
        inputs: str,
        overrides: dict[str, object] | None = None,
        force: bool = False,
        progress: object = None,
    ) -> reproduction.Reproduction:
        seen.extend([folder, groups, overrides, force])
        finding = Finding(3, "the new law is the fastest", (Check("yes", True),), ())
        return reproduction.Reproduction(
            folder, (finding,), ({**row, "printed": 0.76, "value": None, "change": None},), Changes((), ("a.png",))
        )

    monkeypatch.setattr("springline.runner.paper.reproduce", reproduce)
    return seen


def test_reproduce_shows_the_paper_beside_ours_and_verdicts(asked: list[object]) -> None:
    shown = done("reproduce", "-o", "report", "--group", "2", "--group", "4")
    assert re.search(r"2 power +lift +settling time +0\.76 s +–", shown)
    assert re.search(r"3 +the new law is the fastest +holds", shown)
    assert "report: report/report.html" in shown
    assert "removed: 1 files of the earlier reproduction" in shown
    assert asked == [Path("report"), [2, 4], {}, False]


def test_reproduce_prints_json(asked: list[object]) -> None:
    answer = json.loads(done("reproduce", "--json", "--force", "--set", "control.law=power", "--set", "plant.m3=5"))
    assert (answer["command"], answer["status"]) == ("reproduce", "ok")
    assert answer["rows"][0]["value"] is None
    assert asked == [Path("reproduction"), None, {"control.law": "power", "plant.m3": 5}, True]


def test_reproduce_refuses_wrong_input(elsewhere: Path) -> None:
    assert "'7' (valid: 1, 2, 3, 4)" in refused("reproduce", "--group", "7")
    assert "is a file" in refused("reproduce", "-o", "short.toml")
    assert list(contents(elsewhere)) == ["short.toml"]


# --- list, doctor, and the rest --------------------------------------------------------------------------


def rows_of(what: str) -> list[dict[str, object]]:
    answer = json.loads(done("list", what, "--json"))
    assert list(answer) == ["command", "version", "status", "rows", "units"]
    rows: list[dict[str, object]] = answer["rows"]
    shown = done("list", what)
    first = next(iter(rows[0]))
    assert all(str(row[first]) in shown for row in rows)
    return rows


def test_list_controllers_tells_observers_too() -> None:
    kinds = {row["name"]: row["kind"] for row in rows_of("controllers")}
    assert kinds["super_twisting"] == "controller" and kinds["extended_state"] == "observer"


def test_list_parameters_of_a_scenario_tells_its_own() -> None:
    """An arm of a user's, which no other list has, on either drive; and what --set makes of it."""
    arm = Path(__file__).parents[3] / "examples" / "own_mechanism" / "deck.toml"
    listed = json.loads(done("list", "parameters", str(arm), "--json"))["rows"]
    rows = {row["key"]: row for row in listed}
    assert rows["mechanism.m2"] == {
        "key": "mechanism.m2",
        "value": 56.5,
        "unit": "kg",
        "default": 56.5,
        "bounds": "a finite number",
        "meaning": "mass of the upper arm",
    }
    assert len(rows) == len(listed) and len(rows["control.mu"]["value"]) == 3
    assert not any(key.startswith(("plant.", "base_motion.")) for key in rows)
    changes = ["plant.m2={ scale = 1.5 }", "plant.k1=3e5", "drive.link_viscous=2.0", "mechanism.m3=20"]
    changed = [word for change in changes for word in ("--set", change)]
    shown = done("list", "parameters", str(arm), *changed)
    assert "{ scale = 1.5 }" in shown
    own = {row["key"]: row for row in json.loads(done("list", "parameters", str(arm), *changed, "--json"))["rows"]}
    assert own.keys() - rows.keys() == {"plant.m2", "plant.k1"}
    assert own["plant.k1"]["value"] == 3e5 and own["plant.k1"]["bounds"] == "a number > 0"
    assert own["mechanism.m3"]["value"] == 20.0 and own["mechanism.m3"]["default"] == 26.4
    assert own["drive.link_viscous"]["value"] == [2.0, 2.0, 2.0]
    rigid = json.loads(done("list", "parameters", str(arm), "--set", "drive.kind=rigid", "--json"))["rows"]
    gone = rows.keys() - {row["key"] for row in rigid}
    assert {"drive.k1", "drive.spring_damping", "drive.epsilon", "control.K_f"} <= gone


def test_list_parameters_of_a_scenario_has_those_of_its_classes(elsewhere: Path) -> None:
    (elsewhere / "own.py").write_text(OWN_CLASSES)
    (elsewhere / "own.toml").write_text(
        '[control]\ncontroller = "own.py:Proportional"\n[control.proportional]\nslope = [2.0, 3.0]\n'
        '[base_motion]\nkind = "own.py:Ramp"\nspeed = 0.25\n'
    )
    rows = {row["key"]: row for row in json.loads(done("list", "parameters", "own.toml", "--json"))["rows"]}
    assert rows["control.proportional.slope"]["value"] == [2.0, 3.0]
    assert rows["control.proportional.slope"]["unit"] == ["N/m", "N m/rad"]
    assert rows["base_motion.speed"]["value"] == 0.25 and rows["base_motion.speed"]["default"] == 0.1
    every = load_scenario("own.toml").numeric_keys()
    split = [key.rpartition(".") for key in every]
    missing = {stem if last.isdigit() else f"{stem}.{last}" for stem, _, last in split} - rows.keys()
    assert all(key.startswith(("plant.", "reference.", "initial.", "simulation.")) for key in missing), missing
    assert "--no-code refuses that" in refused("list", "parameters", "own.toml", "--no-code")


def test_list_of_anything_else_takes_no_scenario() -> None:
    assert "only goes with springline list parameters" in refused("list", "laws", "paper/nominal")
    assert "--set goes with a scenario" in refused("list", "parameters", "--set", "mechanism.m3=2")
    assert "mechanism.m33" in refused("list", "parameters", "paper/nominal", "--set", "mechanism.m33=2")


OWN_CLASSES = """
from springline.model import BaseMotion, Control, Controller, Parameter

class Proportional(Controller):
    parameters = (Parameter("slope", "{F}/{q}", 1.0, "of the command over the error", per_joint=True),)

    def control(self, r, y, z, model, p):
        error = r.q - y.q1
        return Control(p.slope * error, error)

class Ramp(BaseMotion):
    parameters = (Parameter("speed", "m/s", 0.1, "forward"),)

    def motion(self, t, p):
        return [p.speed * t, 0, 0, 0, 0, 0]
"""


def test_list_parameters_tells_all_that_the_model_declares() -> None:
    listed = rows_of("parameters")
    rows = {row["key"]: row for row in listed if row["mechanism"] in ("", "transfer_manipulator")}
    assert {row["mechanism"] for row in listed} == {"", "transfer_manipulator", "planar_arm"}
    assert [row["default"] for row in listed if row["key"] == "mechanism.length"] == [[0.5, 0.5]]
    assert all(row["unit"] and row["meaning"] and row["bounds"] for row in rows.values())
    assert rows["control.U_max"]["default"] == ["inf", "inf"]
    assert rows["control.K_f"]["unit"] == ["N s/m", "N m s/rad"]
    assert rows["control.delta"]["unit"] == "m or rad"
    present = {f"drive.{item.name}": 1.0 for item in FRICTION}  # what is zero is no slot
    present |= {f"{effect.table}.{item.name}": 1.0 for effect in EFFECTS.values() for item in effect.parameters}
    slots = (
        load_scenario("paper/nominal", {**present, "control.mode": "sampled", "control.period": 1e-3}).system().slots
    )
    tables = {"mechanism", "drive", "control", "sensor", "actuator"}
    numbered = {slot.key for slot in slots if slot.key.partition(".")[0] in tables}
    assert {re.sub(r"\.\d$", "", key) for key in numbered} == set(rows)


def test_list_laws_and_mechanisms() -> None:
    assert {row["name"] for row in rows_of("laws")} == set(LAWS)
    assert [row["name"] for row in rows_of("mechanisms")] == ["transfer_manipulator", "planar_arm"]


@pytest.mark.parametrize(("what", "names"), [("scenarios", packaged_scenarios()), ("sweeps", packaged_sweeps())])
def test_list_has_a_title_for_each_packaged_file(what: str, names: tuple[str, ...]) -> None:
    rows = {row["name"]: row["title"] for row in rows_of(what)}
    assert list(rows) == list(names)
    assert all(rows.values())


def test_doctor_finds_this_machine_well() -> None:
    assert "lanes and casadi give the same bits" in done("doctor")


@pytest.mark.usefixtures("no_compiler")
def test_doctor_says_what_is_missing() -> None:
    sick = springline("doctor", "--json")
    assert sick.exit_code == 1
    answer = json.loads(sick.stdout)
    assert answer["status"] == "failed"
    assert [row["name"] for row in answer["rows"] if row["ok"] is False] == ["C compiler"]


def test_version_and_help() -> None:
    assert done("--version") == f"springline {__version__}\n"
    shown = done("--help")
    assert all(f"  {command} " in shown for command in ("run", "generate", "export", "reproduce", "list", "doctor"))


def test_commands_wait_for_no_library_that_they_do_not_use(elsewhere: Path) -> None:
    """Arrow would ask pandas of every column and number that is given to it, and pandas takes longer than a run.

    Metrics that do not exist after so short a time are null, which has a way of its own to NumPy.
    """
    pytest.importorskip("pandas")
    code = "import sys; from springline.runner.cli import app; app(standalone_mode=False); print(*sys.modules)"
    sweep = SWEEP.replace("[vary]", "samples = 20\n[set]\nsimulation.duration = 0.01\n[vary]")
    (elsewhere / "sweep.toml").write_text(sweep)
    brief = ["paper/nominal", "--set", "simulation.duration=0.01", "-o"]
    for words, drawn in (
        (["run", *brief, "plain", "--no-plot"], False),
        (["run", *brief, "drawn", "--hash"], True),
        (["batch", "sweep.toml", "-o", "data", "--no-plot"], False),
        (["batch", "sweep.toml", "-o", "data", "--resume"], True),
        (["replay", "data", "3", "-o", "again"], True),
        (["analyze", *brief, "analysis"], True),
    ):
        shown = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True).stdout
        modules = set(shown.splitlines()[-1].split())
        assert "springline.runner.cli" in modules, words
        assert not ({"pandas", "scipy"} if drawn else {"pandas", "scipy", "matplotlib"}) & modules, words


def test_default_folder_stays_below_results(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A packaged scenario's folder has its name; a file's has the file's own, wherever that lies."""
    (elsewhere / "deep").mkdir()
    text = "[simulation]\nduration = 0.01\n"
    (elsewhere / "near.toml").write_text(text)
    monkeypatch.chdir(elsewhere / "deep")
    done("run", "../near.toml", "--no-plot")
    assert (elsewhere / "deep" / "results" / "near" / "metrics.parquet").is_file()


def test_a_trajectory_beyond_memory_is_refused(elsewhere: Path) -> None:
    """The remedy names the key and a value that works."""
    message = refused("run", "paper/nominal", "--set", "simulation.duration=1e5", "-o", "out", code=2)
    assert "simulation.output_every" in message
    assert "expected at least 101" in message
    assert not Path("out").exists()


def test_a_working_directory_that_was_deleted_is_told(tmp_path: Path) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    tool = Path(sys.executable).with_name("springline")
    command = f"cd {gone} && rmdir {gone} && {tool} list laws"
    done = subprocess.run(["sh", "-c", command], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("Error: the working directory cannot be used")
    assert done.stderr.count("\n") == 1


def test_a_dataset_behind_links_in_a_circle_is_the_users_mistake(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    result = springline("replay", tmp_path / "a", "0")
    assert result.exit_code == 2
    assert "symbolic links" in result.stderr
