"""What shells complete, asked as they ask: by environment variables; and by keys, in a bash that somebody types in."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from springline.runner.cli import app
from springline.runner.cli.shell_words import prepare

SETUP = Path(__file__).parents[3] / "docs/setup.md"
MAIN = "from springline.runner.cli import main; main()"
OWN_ARM = """
from pathlib import Path
Path("ran").touch()
"""


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def asked(**environment: str) -> str:
    """What the program prints, in this process, as `main` has it; nothing may be said to the user meanwhile."""
    assert prepare(environment)
    done = CliRunner().invoke(app, [], prog_name="springline", env=environment)
    assert (done.exit_code, done.stderr) == (0, "")
    return done.stdout


def in_a_process(program: str = MAIN, **environment: str) -> subprocess.CompletedProcess[str]:
    """The same in a process of its own."""
    command = [sys.executable, "-c", program]
    return subprocess.run(command, check=False, env=os.environ | environment, capture_output=True, text=True)


def in_bash(line: str) -> list[str]:
    """Candidates as bash asks for them: "=" is a word, and so is what stands between two."""
    words = [part for word in line.split(" ") for part in (re.findall("=|[^=]+", word) or [""])]
    return asked(
        _SPRINGLINE_COMPLETE="complete_bash", COMP_WORDS="\n".join(words), COMP_CWORD=str(len(words) - 1)
    ).split()


def in_zsh(line: str) -> dict[str, str]:
    """Candidates with what zsh shows beside them."""
    shown = asked(_SPRINGLINE_COMPLETE="complete_zsh", _TYPER_COMPLETE_ARGS=line)
    return dict(re.findall(r'^(?:_arguments .*\(\()?"(.*?)"(?::"(.*?)")?(?:\)\)\')?$', shown, re.MULTILINE))


def in_fish(line: str) -> dict[str, str]:
    """Candidates with what fish shows beside them."""
    shown = asked(
        _SPRINGLINE_COMPLETE="complete_fish", _TYPER_COMPLETE_ARGS=line, _TYPER_COMPLETE_FISH_ACTION="get-args"
    )
    return {value: said for value, _, said in (row.partition("\t") for row in shown.splitlines())}


RUN = "springline run paper/nominal --set "


def test_keys_and_values_in_bash() -> None:
    assert in_bash(f"{RUN}control.la") == ["control.law=", "control.lambda="]
    assert in_bash(f"{RUN}control.law=") == ["variable_power_log", "double_power", "power"]
    assert in_bash(f"{RUN}control.law=p") == ["power"]
    assert in_bash(f"{RUN}control.fast=") == ["true", "false"]
    # With the number that is there, or bash would end the word where a number is to follow.
    assert in_bash(f"{RUN}control.del") == ["control.delta=", "control.delta=0.05"]
    assert in_bash(f"{RUN}control.delta=") == ["0.05"]
    assert in_bash("springline run paper/nominal --set=control.mod") == [
        "control.mode=continuous",
        "control.mode=sampled",
    ]
    assert in_bash("springline run paper/nominal --set=control.mode=s") == ["sampled"]
    # Behind a blank a word begins, whatever stands before it.
    assert in_bash("springline run --set control.delta= ")[0].startswith("controllers/")
    assert in_bash(f"{RUN}nothing") == in_bash(f"{RUN}nothing=") == []


def test_keys_and_values_in_zsh_with_what_they_mean() -> None:
    assert in_zsh(f"{RUN}control.la") == {
        "control.law=": "variable_power_log, double_power, power",
        "control.lambda=": "a number > 0 (1/s)",
    }
    assert list(in_zsh(f"{RUN}control.law=p")) == ["control.law=power"]
    assert in_zsh(f"{RUN}mechanism.m3") == {
        "mechanism.m3=": "a number > 0 (kg)",
        "mechanism.m3=40.0": "as it is",
    }


def test_keys_and_values_in_fish() -> None:
    assert in_fish(f"{RUN}control.law=p") == {"control.law=power": ""}
    assert in_fish(f"{RUN}simulation.step") == {
        "simulation.step=": "a number > 0 (s)",
        "simulation.step=0.0001": "as it is",
    }


def test_the_keys_are_those_of_the_scenario_as_it_is_changed_before() -> None:
    ship = in_bash("springline run ship/vessel_10hz --set base_motion.co")
    assert ship[:2] == ["base_motion.columns.t=", "base_motion.columns.heave="]
    assert in_bash(f"{RUN}base_motion.he") == []
    moved = in_bash(f"{RUN}base_motion.kind=sine --set base_motion.he")
    assert moved == ["base_motion.heave="]
    assert in_bash(f"{RUN}control.super") == []
    table = in_bash(f"{RUN}control.controller=super_twisting --set control.super_twisting.sl")
    assert table[0] == "control.super_twisting.slope="
    # What cannot be on its own, for its period is missing, leaves the keys as they are.
    assert "control.period=" in in_bash(f"{RUN}control.mode=sampled --set control.p")


def test_every_command_with_a_scenario_has_them(elsewhere: Path) -> None:
    (elsewhere / "planar.toml").write_text('[mechanism]\nname = "planar_arm"\n')
    for command in ("run", "analyze", "generate", "export c", "export fmu3", "list parameters"):
        assert "mechanism.n=" in in_bash(f"springline {command} planar.toml --set mechanism.n"), command
    (elsewhere / "sweep.toml").write_text('scenario = "planar.toml"\nmethod = "grid"\n[vary]\n')
    assert "mechanism.n=" in in_bash("springline batch sweep.toml --set mechanism.n")
    assert in_bash("springline reproduce --set control.del")[0] == "control.delta="


def test_asking_runs_no_file_of_a_user_s(elsewhere: Path) -> None:
    """Its keys are those that stand in the scenario, and those that no class could change."""
    (elsewhere / "arm.py").write_text(OWN_ARM)
    (elsewhere / "mine.toml").write_text('[mechanism]\nname = "arm.py:Arm"\nsize = 2.0\n[control]\nk1 = 4.0\n')
    mine = "springline run mine.toml --set "
    assert in_bash(f"{mine}mechanism.s") == ["mechanism.size=", "mechanism.size=2.0"]
    assert in_bash(f"{mine}mechanism.m3") == in_bash(f"{mine}control.mu.0") == []
    assert in_bash(f"{mine}control.k1=") == ["4.0"]
    assert in_bash(f"{mine}mechanism.name=") == ["transfer_manipulator", "planar_arm"]
    assert not (elsewhere / "ran").exists()


@pytest.mark.parametrize("text", ["a = [", "\x00", "[mechanism]\nm3 = -1.0\n", '[vary]\nx = "'])
def test_a_scenario_with_mistakes_is_no_reason_to_say_anything(elsewhere: Path, text: str) -> None:
    (elsewhere / "wrong.toml").write_text(text)
    for command in ("run", "batch"):
        assert in_bash(f"springline {command} wrong.toml --set control.del")[0] == "control.delta="
    assert in_bash("springline run nowhere.toml --set control.del")[0] == "control.delta="


def test_a_fault_is_silent_unless_it_is_asked_for() -> None:
    broken = "import springline.runner.cli.overrides as o; o.overrides = None\n" + MAIN
    line = {"_SPRINGLINE_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": f"{RUN}control."}
    done = in_a_process(broken, **line)
    assert (done.stdout, done.stderr) == ("", "")
    assert "TypeError" in in_a_process(broken, **line, SPRINGLINE_TRACEBACK="1").stderr


@pytest.mark.parametrize(
    "environment",
    [
        {
            "_SPRINGLINE_COMPLETE": "complete_bash",
            "COMP_WORDS": "springline\nrun\n--set\nplant.m3.s",
            "COMP_CWORD": "3",
        },
        {"_SPRINGLINE_COMPLETE": "complete_zsh", "_TYPER_COMPLETE_ARGS": "springline run --set plant.m3.s"},
    ],
    ids=["bash", "zsh"],
)
def test_the_program_answers_as_its_parts_do(environment: dict[str, str]) -> None:
    done = in_a_process(**environment)
    assert (done.returncode, done.stderr) == (0, "")
    assert re.findall(r"plant[\w.=]+", done.stdout) == ["plant.m3.scale=", "plant.m3.scale=1.0"]


@pytest.mark.parametrize("words", ["", "springline", "springline\nrun\n=", "=\n=\n=", "springline\n\n\n"])
@pytest.mark.parametrize("at", ["", "x", "0", "2", "9"])
def test_odd_words_are_no_reason_to_say_anything_either(words: str, at: str) -> None:
    environment = {"_SPRINGLINE_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": at}
    assert prepare(environment)
    assert not prepare({}) and not prepare({"_SPRINGLINE_COMPLETE": "source_bash"})


def test_a_bash_without_gaps_at_equals_signs_gets_whole_words() -> None:
    """Who takes "=" out of COMP_WORDBREAKS sends the word as it is typed, and wants it whole."""
    words = f"{RUN}control.law=p".split(" ")
    shown = asked(_SPRINGLINE_COMPLETE="complete_bash", COMP_WORDS="\n".join(words), COMP_CWORD="4")
    assert shown.split() == ["control.law=power"]


def test_what_the_documentation_shows_is_offered() -> None:
    rows = re.findall(r"^\| `([^`]+)` \| (`[^|]+`) \|$", SETUP.read_text("utf-8").partition("TAB key")[2], re.MULTILINE)
    assert len(rows) > 5
    for typed, offered in rows:
        assert in_bash(f"springline {typed}") == re.findall("`([^`]+)`", offered), typed


class Terminal:
    """A bash that somebody types in."""

    def __init__(self, folder: Path) -> None:
        program = folder / "springline"
        program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{MAIN}" "$@"\n')
        program.chmod(0o755)
        plain = {"TERM": "dumb", "PS1": "> ", "PROMPT_COMMAND": "", "INPUTRC": os.devnull}
        environment = {**os.environ, **plain, "PATH": f"{folder}:{os.environ['PATH']}"}
        self._screen, inside = pty.openpty()
        self._bash = subprocess.Popen(
            ["bash", "--norc", "--noprofile", "-i"],
            env=environment,
            stdin=inside,
            stdout=inside,
            stderr=inside,
            start_new_session=True,
        )
        os.close(inside)

    def types(self, keys: str, until: str) -> str:
        """Type, and read what comes onto the screen, without bells, until something stands there."""
        os.write(self._screen, keys.encode())
        seen, last = "", time.monotonic() + 60
        while until not in seen and time.monotonic() < last:
            if select.select([self._screen], [], [], 1.0)[0]:
                seen += os.read(self._screen, 4096).decode().replace("\a", "")
        assert until in seen, seen
        return seen

    def ends(self) -> None:
        """Close it."""
        self._bash.kill()
        self._bash.wait()
        os.close(self._screen)


@pytest.fixture
def bash(elsewhere: Path, require_tool: Callable[..., str]) -> Iterator[Terminal]:
    require_tool("bash")
    terminal = Terminal(elsewhere)
    yield terminal
    terminal.ends()


def test_typing_in_a_bash(bash: Terminal) -> None:
    """Readline's own words, and what it does with the candidates; the line fits 80 columns, lest it be scrolled."""
    bash.types('eval "$(springline --show-completion bash)"; echo rea""dy\n', "ready\r\n> ")
    bash.types("springline run --set control.del\t", "control.delta=")
    bash.types("\t", "0.05 ")
    bash.types("--set control.law=do\t", "control.law=double_power ")
