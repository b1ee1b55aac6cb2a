"""A target is a folder of codegen/export/: found by its door, written like every other folder of generated files."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.main import get_command
from typer.testing import CliRunner, Result

import springline.codegen.export as package
from springline.codegen.export import Target, targets
from springline.runner.cli import app

DOOR = '''"""Write the gains as text.

More.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
options = ("prefix",)
'''
WORK = """
def target_files(export):
    free = [slot.key for slot in export.tunable_slots]
    return {"gains/k1.txt": f"{export.value('control.k1')} {export.period} {free} {export.prefix}".encode()}
"""


@pytest.fixture
def gains(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A folder `gains` beside the packaged targets, with its command; the test runs in an empty folder."""
    folder = tmp_path / "more" / "gains"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text(DOOR)
    (folder / "__init__.pyi").write_text("from .work import target_files as target_files\n")
    (folder / "work.py").write_text(WORK)
    (tmp_path / "cwd").mkdir()
    monkeypatch.chdir(tmp_path / "cwd")
    monkeypatch.setattr(package, "__path__", [*package.__path__, str(folder.parent)])
    yield
    for name in [name for name in sys.modules if name.startswith("springline.codegen.export.gains")]:
        del sys.modules[name]


def springline(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["export", *arguments], prog_name="springline")


def test_the_packaged_targets_have_commands_of_their_own() -> None:
    assert targets() == {}
    assert list(get_command(app).commands["export"].commands) == ["c", "fmu2", "fmu3"]  # type: ignore[attr-defined]


@pytest.mark.usefixtures("gains")
def test_a_folder_is_a_target_and_its_docstring_the_help() -> None:
    assert targets() == {"gains": Target("Write the gains as text.", ("prefix",))}
    assert "gains  Write the gains as text." in springline("--help").output


@pytest.mark.usefixtures("gains")
def test_it_has_the_options_of_c_but_for_what_its_door_does_not_name() -> None:
    """--real alone is missing; --output has another default."""
    options = {
        target: set(re.findall(r"^  (?:-o, )?(--[a-z-]+)", springline(target, "--help").output, re.MULTILINE))
        for target in ("c", "gains")
    }
    assert options["c"] - options["gains"] == {"--real"} and options["gains"] < options["c"]
    assert {"--tunable", "--check", "--prefix", "--set"} <= options["gains"]
    assert springline("gains", "paper/nominal", "--real", "float").exit_code == 2


@pytest.mark.usefixtures("gains")
def test_parameters_stay_variables_and_a_stale_folder_is_told() -> None:
    options = ["--tunable", "control.k1,control.k2", "--prefix", "arm"]
    assert springline("gains", "paper/nominal", *options).exit_code == 0
    file = Path("gains/gains/k1.txt")
    assert file.read_text() == "3.0 0.0001 ['control.k1', 'control.k2'] arm"
    assert springline("gains", "paper/nominal", *options, "--check").exit_code == 0
    stale = springline("gains", "paper/nominal", "--check")
    assert stale.exit_code == 1 and "changed gains/k1.txt" in stale.output
    assert "it was made with --tunable control.k1,control.k2 --prefix arm: check it with the same" in stale.output
    assert file.read_text().endswith("arm")
    for option, value in (("--tunable", "control.kk"), ("--prefix", "float")):
        refused = springline("gains", "paper/nominal", option, value)
        assert refused.exit_code == 2 and value in refused.output


@pytest.mark.usefixtures("gains")
def test_it_is_written_whole_and_edited_files_are_kept() -> None:
    sampled = ["--set", "control.mode=sampled", "--set", "control.period=0.002"]
    first = springline("gains", "paper/nominal", "--set", "control.k1=3.5", *sampled)
    assert first.exit_code == 0, first.output
    file = Path("gains/gains/k1.txt")
    assert file.read_text() == "3.5 0.002 [] springline"
    manifest = json.loads(Path("gains/manifest.json").read_bytes())
    assert manifest["kind"] == "gains" and [entry["path"] for entry in manifest["files"]] == ["gains/k1.txt"]

    again = springline("gains", "paper/nominal", "--set", "control.k1=3.5", *sampled, "--json")
    rows = [{"path": path, "change": "unchanged"} for path in ("gains/k1.txt", "manifest.json")]
    assert json.loads(again.output)["rows"] == rows
    file.write_text("mine")
    refused = springline("gains", "paper/nominal")
    assert refused.exit_code == 2 and file.read_text() == "mine"
    assert springline("gains", "paper/nominal", "--force").exit_code == 0
    assert file.read_text().startswith("3.0 ")
    assert springline("c", "paper/nominal", "-o", "gains").exit_code == 2  # another command's folder


@pytest.mark.usefixtures("gains")
def test_a_mistake_in_the_scenario_is_told() -> None:
    result = springline("gains", "paper/nominal", "--set", "control.kk=1")
    assert result.exit_code == 2 and "unknown key" in result.output
    assert not Path("gains").exists()
