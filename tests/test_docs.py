"""Every command and snippet that the documentation shows is run, as it stands there, in the order of the page.

Simulations are made short behind the text's back. What cannot be run here is listed with the reason in ELSEWHERE.
Commands within the text are checked against the options that the command line has.
"""

from __future__ import annotations

import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from springline.codegen.kernel import toolchain
from springline.runner.cli import app
from springline.runner.scenario import Scenario, load_scenario
from springline.runner.sweep import load_sweep

ROOT = Path(__file__).parent.parent
OTHERS = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "examples/README.md")]
PAGES = [*OTHERS, *sorted((ROOT / "docs").glob("*.md"))]
# Show what is printed, and so have a test of their own.
SHOWING = (ROOT / "README.md", ROOT / "docs/setup.md", ROOT / "docs/tutorial.md")
HOUSE = ROOT / "docs/architecture.md"  # changes springline itself, and so has a test of its own
PROGRAMS = ("springline", "make", "pip", "python", "fmpy")
STEPS = 100  # of every documented run

ELSEWHERE = {
    "springline --install-completion": "changes a shell; tests/runner/cli/test_completion.py types in one",
    "make reproduce": "minutes; tests/runner/paper/test_paper.py reproduces a group",
    "make test": "this very test among them",
    "python examples/identify_table4.py --heave 0.64 --step 4e-4 --seeds 1 --population 128 --generations 250": (
        "minutes; tests/test_examples.py searches for shorter"
    ),
    "make -C examples/equal_bits host": "tests/runner/test_reproducible_chatter.py does",
    "make -C examples/equal_bits aarch64 SAMPLES=10000": "tests/runner/test_reproducible_chatter.py does",
    "make -C ../cortex_m m7 EXPORT=$PWD/adrc_c BUILD=$PWD/adrc_m7": "tests/test_examples.py runs the README",
}
"""Commands that are not run here, and why not."""

EMPTY = b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"/>'
"""In place of a figure, for what is not about figures."""


@dataclass(frozen=True)
class Block:
    """A piece of code in a page; line counts from 1."""

    page: Path
    line: int
    language: str
    text: str

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks(page: Path) -> Iterator[Block]:
    """Fenced blocks but for formulas, and indented ones that begin with a command."""
    lines = page.read_text(encoding="utf-8").splitlines()
    k = 0
    while k < len(lines):
        fence = re.fullmatch(r"```(\w*)", lines[k])
        indented = re.match(rf"    ({'|'.join(PROGRAMS)}) ", lines[k])
        if fence:
            end = lines.index("```", k + 1)
            if fence[1] != "math":  # tests/test_site.py sets them
                yield Block(page, k + 1, fence[1], "\n".join(lines[k + 1 : end]))
            k = end
        elif indented:
            end = next((i for i in range(k, len(lines)) if not lines[i].startswith("    ")), len(lines))
            yield Block(page, k + 1, "sh", "\n".join(line.strip() for line in lines[k:end]))
            k = end
        k += 1


def commands(text: str) -> list[str]:
    """The commands of a shell block, without comments and without the words that explain them in a second column."""
    lines = re.sub(r"\s*\\\n\s*", " ", text).splitlines()
    plain = (re.split(r"\s{2,}|\s#", line)[0].strip() for line in lines if not line.startswith("#"))
    return [line for line in plain if line]


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with what the pages take for granted: a user's scenarios, a checkout's generated/, two examples."""
    for name in ("my_arm.toml", "my_scenario.toml"):
        (tmp_path / name).touch()
    shutil.copytree(ROOT / "generated", tmp_path / "generated")
    for example in ("own_mechanism", "own_controller"):
        for path in (ROOT / "examples" / example).iterdir():
            if path.is_file():
                shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    shorten(monkeypatch)
    return tmp_path


def shorten(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the commands simulate for some steps only."""

    def short(scenario: Scenario) -> Scenario:
        return scenario.with_overrides({"simulation.duration": STEPS * scenario.step})

    def loaded(*arguments: Any, **options: Any) -> Scenario:
        return short(load_scenario(*arguments, **options))

    def swept(*arguments: Any, **options: Any) -> Any:
        whole = load_sweep(*arguments, **options)
        return replace(whole, scenario=short(whole.scenario))

    # tests/runner/run/test_plots.py looks at the figures, whose drawing would take most of the time.
    def files(name: str, _: Figure) -> dict[str, bytes]:
        return {f"{name}.png": b"", f"{name}.svg": EMPTY}

    monkeypatch.setattr("springline.runner.report.figure_files", files)
    monkeypatch.setattr("springline.runner.sweep.load_sweep", swept)
    for face in ("springline", "springline.runner", "springline.runner.scenario"):
        monkeypatch.setattr(f"{face}.load_scenario", loaded)


def run_shell(block: Block) -> None:
    for line in commands(block.text):
        program, *arguments = shlex.split(line)
        if line in ELSEWHERE:
            continue
        assert program == "springline", f"{block}: no way to run this here: {line}"
        result = CliRunner().invoke(app, arguments, prog_name="springline")
        assert result.exit_code == 0, f"{block}: {line}\n{result.output}{result.exception!r}"


def shown_file(block: Block) -> Path | None:
    """The file that a block is the content of, if it begins with its name: "# my_arm.py"."""
    name = re.match(r"# ([\w-]+\.\w+)$", block.text, re.MULTILINE)
    return Path(name[1]) if name else None


def run_python(block: Block) -> None:
    file = shown_file(block)
    if file:
        file.write_text(block.text, encoding="utf-8")
        return
    if "pandas" in block.text:
        pytest.importorskip("pandas")
    try:
        exec(compile("\n" * block.line + block.text, str(block.page), "exec"), {})  # noqa: S102
    except Exception as error:
        raise AssertionError(f"{block}: {error!r}") from error


def run_toml(block: Block) -> None:
    """A scenario or a sweep; records that it names are made up for it."""
    document = tomllib.loads(block.text)
    for table in document.values():
        if isinstance(table, dict) and table.get("kind") == "table":
            write_record(Path(table["path"]), list(table["columns"].values()), float(table.get("t0", 0.0)))
    file = shown_file(block) or Path("documented.toml")
    file.write_text(block.text, encoding="utf-8")
    try:
        if "vary" in document:
            load_sweep(file)
        else:
            load_scenario(file)
    except Exception as error:
        raise AssertionError(f"{block}: {error!r}") from error


def write_record(path: Path, columns: list[str], t0: float) -> None:
    """A smooth record in which the first column is time, from a second before `t0` on."""
    rows = [[t0 - 1.0 + 0.1 * k, *(0.01 * math.sin(0.3 * k + i) for i in range(1, len(columns)))] for k in range(200)]
    path.write_text("\n".join([",".join(columns), *(",".join(f"{x:.6f}" for x in row) for row in rows)]) + "\n")


C_AROUND = """
#include "springline.h"
static springline_controller controller;
static int status;
static void log(const char *text) {{ (void)text; }}
void documented(void);
void documented(void) {{
    (void)controller; (void)status; (void)log;
{text}
}}
"""


def run_c(block: Block) -> None:
    """A piece of a function around a controller whose gains are tunable."""
    made = CliRunner().invoke(app, ["export", "c", "paper/nominal", "-o", "documented", "--tunable", "control"])
    assert made.exit_code == 0, made.output
    flags = ["-std=c99", "-Wall", "-Werror", "-fno-builtin", "-fsyntax-only", "-Idocumented/include", "-x", "c", "-"]
    done = subprocess.run(
        [*toolchain.find_compiler().argv, *flags],
        input=C_AROUND.format(text=block.text),
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, f"{block}: {done.stderr}"


RUNNERS: dict[str, Callable[[Block], None]] = {"sh": run_shell, "python": run_python, "toml": run_toml, "c": run_c}


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page not in {HOUSE, *SHOWING} and any(blocks(page))], ids=lambda page: page.name
)
@pytest.mark.usefixtures("place")
def test_every_block_of_a_page_works(page: Path) -> None:
    for block in blocks(page):
        assert block.language in RUNNERS, f"{block}: no way to run a block in {block.language or 'no language'}"
        RUNNERS[block.language](block)


def test_what_is_run_elsewhere_is_documented() -> None:
    shown = {
        line for page in PAGES for block in blocks(page) if block.language == "sh" for line in commands(block.text)
    }
    assert set(ELSEWHERE) <= shown


# --- pages that show what is printed -----------------------------------------------------------------------


def output_of(block: Block) -> str:
    """Run a shell block, in the working directory; what its commands print."""
    printed = ""
    for line in (line for line in commands(block.text) if line not in ELSEWHERE):
        program, *arguments = shlex.split(line)
        if program == "springline":
            result = CliRunner().invoke(app, arguments, prog_name="springline")
            code, output = result.exit_code, result.output
        else:
            done = subprocess.run(["sh", "-c", line], check=False, capture_output=True, text=True)
            code, output = done.returncode, done.stdout + done.stderr
        assert code == 0, f"{block}: {line}\n{output}"
        printed += output
    return printed


def expect_shown(block: Block, printed: str) -> None:
    """Each line of the block must have been printed, in this order; … stands for anything, blanks do not count."""
    rest = " ".join(printed.split())
    for line in block.text.splitlines():
        parts = [r"\s*".join(map(re.escape, part.split())) for part in line.split("…")]
        found = re.search(".*?".join(parts), rest)
        assert found, f"{block}: not printed: {line}\n{printed}"
        rest = rest[found.end() :]


@pytest.mark.full
@pytest.mark.parametrize("page", SHOWING, ids=lambda page: page.name)
def test_a_page_s_commands_print_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, require_tool: Callable[..., str]
) -> None:
    """With its runs in full length; the figures alone are not drawn."""
    require_tool("cc")
    monkeypatch.chdir(tmp_path)
    if "springline cache clear" in page.read_text("utf-8"):
        monkeypatch.setenv("SPRINGLINE_CACHE", str(tmp_path / "cache"))  # not the one that all tests share
    monkeypatch.setattr(
        "springline.runner.report.figure_files", lambda name, _: {f"{name}.png": b"", f"{name}.svg": EMPTY}
    )
    printed = ""
    for block in blocks(page):
        match block.language:
            case "python":
                run_python(block)
            case "sh":
                printed = output_of(block)
            case "text":
                expect_shown(block, printed)
            case _:
                name = re.match(r"(?:#|/\*) ([\w-]+\.\w+)", block.text)
                assert name, f"{block}: whose content is this?"
                Path(name[1]).write_text(block.text + "\n", encoding="utf-8")


# --- how-tos that change springline itself ---------------------------------------------------------------


def headings(page: Path) -> list[tuple[int, str]]:
    """Line and text of the headings of a page, code aside."""
    code = {k for block in blocks(page) for k in range(block.line, block.line + block.text.count("\n") + 2)}
    lines = enumerate(page.read_text(encoding="utf-8").splitlines(), start=1)
    return [(k, line.lstrip("# ")) for k, line in lines if line.startswith("#") and k not in code]


def sections(page: Path) -> dict[str, list[Block]]:
    """The blocks of a page by the heading that they stand under."""
    found: dict[str, list[Block]] = {}
    for block in blocks(page):
        found.setdefault([text for line, text in headings(page) if line < block.line][-1], []).append(block)
    return found


def changed(content: str, changes: str) -> str:
    """A file after the changes of a block: each hunk must fit at one place."""
    for hunk in changes.split("\n@@\n"):
        lines = hunk.splitlines()
        assert all(line[:1] in {" ", "+", "-"} for line in lines), hunk
        old, new = ("\n".join(["", *(line[1:] for line in lines if line[0] in kept), ""]) for kept in (" -", " +"))
        assert content.count(old) == 1, f"fits at {content.count(old)} places: {hunk}"
        content = content.replace(old, new)
    return content


def run_in(copy: Path, work: Path, block: Block) -> None:
    """Do what a block of HOUSE shows: change or write a file of the copy, run commands or a script beside it."""
    first, _, rest = block.text.partition("\n")
    file = first.removeprefix("# ")
    if block.language == "diff":
        path = copy / file
        path.write_text(changed(path.read_text("utf-8"), rest), encoding="utf-8")
        return
    if re.fullmatch(r"# [\w./]+/[\w.]+", first):
        path = copy / file
        assert not path.exists(), f"{block}: {file} is there"
        path.parent.mkdir(exist_ok=True)
        path.write_text(rest, encoding="utf-8")
        return
    assert block.language in {"sh", "python"}, f"{block}: no way to run this here"
    main = "import sys; from springline.runner.cli import main; sys.argv[1:] = {!r}; main()"
    scripts = [block.text]
    if block.language == "sh":
        called = [shlex.split(line) for line in commands(block.text)]
        assert all(program == "springline" for program, *_ in called), str(block)
        scripts = [main.format(arguments) for _, *arguments in called]
    for script in scripts:
        done = subprocess.run(
            [sys.executable, "-c", f"import springline\nassert {str(copy)!r} in springline.__file__\n{script}"],
            cwd=work,
            env={**os.environ, "PYTHONPATH": str(copy.parent)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, f"{block}: {done.stdout}{done.stderr}"


@pytest.mark.parametrize("heading", sections(HOUSE))
def test_every_how_to_works_in_a_copy_of_springline(heading: str, tmp_path: Path) -> None:
    copy, work = tmp_path / "springline", tmp_path / "work"
    work.mkdir()
    shutil.copytree(ROOT / "springline", copy, ignore=shutil.ignore_patterns("__pycache__"))
    for package in ("model", "codegen", "runner", "benchmarks", "generated"):
        shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", copy)
    for block in sections(HOUSE)[heading]:
        run_in(copy, work, block)


def test_the_files_that_the_pages_for_contributors_name_are_there() -> None:
    named = [
        name
        for page in (HOUSE, ROOT / "CONTRIBUTING.md", ROOT / "codegen/export/README.md")
        for name in re.findall(r"`((?:model|codegen|runner|benchmarks|tests|docs)/[\w/.]*)`", page.read_text("utf-8"))
    ]
    assert len(named) > 30
    assert not [name for name in named if not (ROOT / name).exists()]


# --- commands within the text ----------------------------------------------------------------------------

INLINE = [
    pytest.param(code, id=f"{page.name}: {code}")
    for page in PAGES
    for code in dict.fromkeys(re.findall(rf"(?<!`)`((?:{'|'.join(PROGRAMS)})\s[^`]+)`", page.read_text("utf-8")))
]
# Words that stand for something; whatever else is written large is a command's own word.
PLACEHOLDERS = {
    "SCENARIO": "paper/nominal",
    "DIR": "out",
    "SWEEP": "gains",
    "N": "1",
    "NAMES": "all",
    "NAME": "arm",
    "FILE": "law.py",
}


@pytest.mark.parametrize("code", INLINE)
def test_commands_within_the_text_exist_with_their_options(code: str) -> None:
    program, *arguments = [PLACEHOLDERS.get(word, word) for word in shlex.split(code)]
    match program:
        case "springline":
            result = CliRunner().invoke(app, [*arguments, "--help"], prog_name="springline")
            assert result.exit_code == 0, result.output
        case "make":
            folder = ROOT / "examples" / arguments[1] if arguments[0] == "-C" else ROOT
            assert re.search(rf"^{arguments[-1]}:", (folder / "Makefile").read_text(), re.MULTILINE)
        case "python":
            module = arguments[1].replace(".", "/") + ".py" if arguments[0] == "-m" else f"examples/{arguments[0]}"
            assert (ROOT / module).is_file()
        case "fmpy":
            shown = subprocess.run(
                [Path(sys.executable).with_name("fmpy"), arguments[0], "--help"],
                check=True,
                capture_output=True,
                text=True,
            ).stdout
            assert all(option in shown for option in arguments if option.startswith("--"))
        case "pip":
            (wanted,) = (word for word in arguments if word.startswith((".", "springline")))
            extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
            assert set(re.findall(r"\[(\w+)\]", wanted)) <= set(extras)
        case _:
            pytest.fail(f"no way to check {code}")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_code_fits_80_columns(page: Path) -> None:
    wide = [str(block) for block in blocks(page) if max(map(len, block.text.splitlines()), default=0) > 80]
    assert not wide
