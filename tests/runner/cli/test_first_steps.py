"""What a newcomer meets first: files to start from, an example below every help, the cache, what doctor finds."""

from __future__ import annotations

import fcntl
import json
import shlex
import subprocess
import sys
from importlib.metadata import EntryPoint, requires
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command
from typer.testing import CliRunner, Result

from springline.codegen.kernel import toolchain
from springline.runner.cli import app
from springline.runner.cli.commands import doctor
from springline.runner.cli.commands.init import Kind

BRIEF = ["--set", "simulation.duration=0.02"]


def springline(*arguments: str | Path) -> Result:
    """Run a command in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="springline")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


# --- init --------------------------------------------------------------------------------------------------


def brief(command: str) -> list[str]:
    """A command that is printed as the next one, shortened."""
    program, name, *rest = shlex.split(command)
    assert program == "springline"
    more = {
        "run": [*BRIEF, "--no-plot"],
        "batch": [*BRIEF, "--set", "simulation.output_every=10", "--no-plot"],
        "analyze": [],
    }
    return [name, *rest, *more[name]]


@pytest.mark.parametrize("kind", [kind for kind in Kind if kind is not Kind.notebook])  # test_notebook.py
def test_what_init_writes_works_at_first_try(kind: Kind) -> None:
    first = springline("init", kind.value, "-o", "a b")
    assert first.exit_code == 0, first.output
    *wrote, said = first.stdout.splitlines()
    assert [line.split(maxsplit=1)[1] for line in wrote] == [str(path) for path in map(Path, sorted_names(kind))]
    following = springline(*brief(said.removeprefix("next: ")))
    assert following.exit_code == 0 and following.stderr == "", following.output
    run = springline("run", "a b/scenario.toml", *BRIEF, "--no-plot", "-o", "out")
    assert run.exit_code == 0 and run.stderr == "", run.output
    assert "done: 0.02 s" in run.stdout


def sorted_names(kind: Kind) -> list[str]:
    own = {"scenario": [], "arm": ["arm.py"], "controller": ["controller.py"], "sweep": ["sweep.toml"]}[kind.value]
    return [f"a b/{name}" for name in (*own, "scenario.toml")]


@pytest.mark.parametrize("kind", [Kind.arm, Kind.controller])
def test_c_is_generated_of_an_own_class(kind: Kind) -> None:
    assert springline("init", kind.value).exit_code == 0
    made = springline("generate", "scenario.toml", "-o", "c")
    assert made.exit_code == 0 and made.stderr == "", made.output
    assert "up to date" in made.stdout


def test_init_replaces_nothing_unless_forced(elsewhere: Path) -> None:
    mine = elsewhere / "scenario.toml"
    mine.write_text("# mine\n")
    refused = springline("init", "arm")
    assert refused.exit_code == 2 and "scenario.toml: is there already" in refused.stderr
    assert mine.read_text() == "# mine\n" and [path.name for path in elsewhere.iterdir()] == ["scenario.toml"]
    assert springline("init", "arm", "--force").exit_code == 0
    assert mine.read_text() != "# mine\n" and (elsewhere / "arm.py").is_file()


def test_init_takes_the_place_of_no_folder_and_no_link(elsewhere: Path) -> None:
    (elsewhere / "one" / "scenario.toml").mkdir(parents=True)
    (elsewhere / "two").mkdir()
    (elsewhere / "two" / "scenario.toml").symlink_to("nowhere")
    for folder, force in (("one", ["--force"]), ("two", [])):
        refused = springline("init", "-o", folder, *force)
        assert refused.exit_code == 2 and "is there already" in refused.stderr, refused.output


# --- examples ----------------------------------------------------------------------------------------------


def every_command() -> dict[str, Any]:
    """All commands by what is typed, groups among them."""
    root: Any = get_command(app)
    found = {"": root, **dict(root.commands)}
    return found | {f"export {name}": command for name, command in root.commands["export"].commands.items()}


COMMANDS = every_command()


@pytest.mark.parametrize("name", COMMANDS)
def test_every_help_ends_with_an_example_that_can_be_parsed(name: str) -> None:
    shown = springline(*name.split(), "--help").stdout.rstrip().splitlines()
    assert shown[-2].strip() == "Example:"
    program, *words = shlex.split(shown[-1])
    assert program == "springline"
    if name and name != "export":
        assert words[: len(name.split())] == name.split()
    command: Any = COMMANDS[""]
    while hasattr(command, "commands"):
        command = command.commands[words.pop(0)]
    command.make_context(command.name, words)  # raises a UsageError for what is not taken


EXECUTED = ["list", "doctor", "cache", "init", "run", "generate", "export c", "export fmu2", "export fmu3"]


@pytest.mark.parametrize("name", EXECUTED)
def test_examples_do_what_they_say(name: str) -> None:
    example = springline(*name.split(), "--help").stdout.rstrip().splitlines()[-1]
    shortened = [*BRIEF, "--no-plot"] if name == "run" else []
    done = springline(*shlex.split(example)[1:], *shortened)
    assert done.exit_code == 0, done.output


# --- start-up ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "heavy"),
    [
        (["--help"], {"casadi", "numpy", "matplotlib", "pyarrow", "scipy", "pydantic", "rich", "hashlib", "tomllib"}),
        (["--version"], {"casadi", "numpy", "pydantic", "rich", "springline.runner.cli.options"}),
        (["run", "--help"], {"casadi", "numpy", "matplotlib", "pyarrow", "scipy"}),
        (["list", "scenarios"], {"casadi", "numpy", "matplotlib", "pyarrow", "scipy"}),
        (["list", "sweeps"], {"casadi", "numpy", "matplotlib", "pyarrow", "scipy"}),
        (["list", "laws"], {"casadi", "numpy", "matplotlib", "pyarrow", "scipy", "springline.runner.scenario"}),
        (["list", "controllers"], {"casadi", "numpy", "matplotlib", "pyarrow", "scipy", "springline.runner.scenario"}),
        (["list", "mechanisms"], {"casadi", "numpy", "matplotlib", "pyarrow", "scipy", "springline.runner.scenario"}),
        (["cache", "show"], {"casadi", "numpy", "matplotlib", "pyarrow", "scipy"}),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_command_imports_nothing_that_it_does_not_use(words: list[str], heavy: set[str]) -> None:
    code = (
        "import sys; from springline.runner.cli import app\n"
        f"try: app({words!r})\n"
        "except SystemExit: pass\n"
        "print(*sys.modules)"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not heavy & set(shown.splitlines()[-1].split())


def test_the_help_looks_for_commands_of_other_packages_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Which takes longer than to import all commands of this one; a command of this one does not look for others."""
    asked: list[str] = []

    def found(*, group: str) -> list[EntryPoint]:
        asked.append(group)
        return [EntryPoint("another", f"{doctor.__name__}:doctor", group)]

    monkeypatch.setattr("importlib.metadata.entry_points", found)
    assert "  another " in springline("--help").stdout
    assert asked == ["springline.commands"]
    assert springline("cache", "show").exit_code == 0
    assert asked == ["springline.commands"]


# --- cache and doctor --------------------------------------------------------------------------------------


def test_the_cache_is_shown_and_cleared(elsewhere: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPRINGLINE_CACHE", str(elsewhere / "cache"))
    assert springline("cache", "show").stdout == f"{elsewhere / 'cache'}: 0 kernels, 0 B\n"
    libraries = []
    for value in (1, 2):
        source = f"int f(void);\nint f(void) {{ return {value}; }}\n"
        libraries.append(toolchain.build_library({"a.c": source}, main="a.c"))
    loaded = toolchain.load(libraries[0])
    size = sum(library.stat().st_size for library in libraries)
    row = json.loads(springline("cache", "show", "--json").stdout)["rows"][0]
    assert row == {"folder": str(elsewhere / "cache"), "kernels": 2, "bytes": size, "busy": 0}
    foreign = elsewhere / "cache" / "notes"
    foreign.mkdir()
    with (libraries[1].parent / "lock").open("a") as held:  # as a process that is building it
        fcntl.flock(held, fcntl.LOCK_EX)
        cleared = springline("cache", "clear").stdout
    assert "removed 1 kernel, " in cleared and "1 being compiled at this moment: left there" in cleared
    assert [library.exists() for library in libraries] == [False, True] and foreign.is_dir()
    assert loaded.f() == 1
    assert (libraries[0].parent / "lock").exists(), "who waits for it must meet those who come later"
    again = toolchain.build_library({"a.c": "int f(void);\nint f(void) { return 1; }\n"}, main="a.c")
    assert again == libraries[0] and again.exists()


def test_doctor_says_what_each_use_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nonexistent")
    rows = {row.name: row for row in (doctor._programs(*program) for program in doctor._PROGRAMS)}
    assert {row.ok for row in rows.values()} == {None}
    assert rows["proofs of rounding errors"].value == "missing gappa: apt-get install gappa (Debian, Ubuntu)"
    monkeypatch.setattr(doctor, "_version", lambda name: None if name in {"fmpy", "casadi"} else "1")
    core, extras = doctor._packages()
    assert [row.value for row in core if not row.ok] == ["is not installed: pip install casadi"]
    named = {text.split(";")[0] for text in requires("springline") or () if "extra ==" not in text}
    assert len(core) == len(named)
    assert [row.value for row in extras if not row.ok] == ["missing fmpy: pip install 'springline[fmu]'"]
