"""A target is a folder of codegen/export/: found by its door, written like every other folder of generated files."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import springline.codegen.export as package
from springline.codegen.export import targets
from springline.runner.cli import app
from springline.runner.cli.application import export
from springline.runner.cli.commands.target import target_command

DOOR = '''"""Write the gains as text.

More.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
'''
WORK = """
def target_files(export):
    return {"gains/k1.txt": f"{export.value('control.k1')} {export.period}".encode()}
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
    monkeypatch.setattr(export, "registered_commands", list(export.registered_commands))
    for name, description in targets().items():
        export.command(name)(target_command(name, description))
    yield
    for name in [name for name in sys.modules if name.startswith("springline.codegen.export.gains")]:
        del sys.modules[name]


def springline(*arguments: str) -> Result:
    return CliRunner().invoke(app, ["export", *arguments], prog_name="springline")


def test_the_packaged_targets_have_commands_of_their_own() -> None:
    assert targets() == {}
    assert [command.name for command in export.registered_commands] == ["c", "fmu2", "fmu3"]


@pytest.mark.usefixtures("gains")
def test_a_folder_is_a_target_and_its_docstring_the_help() -> None:
    assert targets() == {"gains": "Write the gains as text."}
    assert "gains  Write the gains as text." in springline("--help").output
    shown = springline("gains", "--help").output
    assert all(option in shown for option in ("--output", "--set", "--no-code", "--force", "--json"))


@pytest.mark.usefixtures("gains")
def test_it_is_written_whole_and_edited_files_are_kept() -> None:
    sampled = ["--set", "control.mode=sampled", "--set", "control.period=0.002"]
    first = springline("gains", "paper/nominal", "--set", "control.k1=3.5", *sampled)
    assert first.exit_code == 0, first.output
    file = Path("gains/gains/k1.txt")
    assert file.read_text() == "3.5 0.002"
    manifest = json.loads(Path("gains/manifest.json").read_bytes())
    assert manifest["kind"] == "gains" and [entry["path"] for entry in manifest["files"]] == ["gains/k1.txt"]

    again = springline("gains", "paper/nominal", "--set", "control.k1=3.5", *sampled, "--json")
    assert json.loads(again.output)["rows"] == [{"path": "gains/k1.txt", "change": "unchanged"}]
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
