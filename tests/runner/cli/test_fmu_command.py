"""`springline export fmu2` and `fmu3`, and the example that couples what they write with a plant of its own."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from springline.codegen.kernel import toolchain
from springline.runner.cli import app

EXAMPLE = Path(__file__).parents[3] / "examples" / "fmu_coupling.py"


def springline(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="springline")


def refused(*arguments: str | Path) -> str:
    result = springline(*arguments)
    assert result.exit_code == 2, (result.exit_code, result.stderr, result.exception)
    return result.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A controller of each version of FMI, side by side."""
    folder = tmp_path_factory.mktemp("fmu")
    for version in (2, 3):
        result = springline("export", f"fmu{version}", "paper/nominal", "--part", "controller", "-o", folder)
        assert result.exit_code == 0, result.stderr
        assert f"nominal_controller_fmi{version}.fmu: FMI {version}.0" in result.stdout
    return folder


def test_exports_share_a_folder(folder: Path) -> None:
    names = ["nominal_controller_fmi2.fmu", "nominal_controller_fmi3.fmu"]
    assert sorted(path.name for path in folder.iterdir()) == ["manifest.json", *names]
    manifest = json.loads((folder / "manifest.json").read_text())
    assert [entry["path"] for entry in manifest["files"]] == names
    assert [entry["fmi"] for entry in manifest["fmus"]] == ["2.0", "3.0"]


def test_same_export_changes_nothing(folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.iterdir()}
    result = springline("export", "fmu3", "paper/nominal", "--part", "controller", "-o", folder, "--json")
    assert json.loads(result.stdout)["rows"] == [{"path": "nominal_controller_fmi3.fmu", "change": "unchanged"}]
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize("name", ["loop", "Stepping", "fmu_model", "math", "float"])
def test_a_model_identifier_that_takes_a_file_or_a_name_is_refused(name: str, tmp_path: Path) -> None:
    message = refused("export", "fmu2", "paper/nominal", "--part", "loop", "--name", name, "-o", tmp_path / "fmu")
    assert "choose another" in message
    assert not (tmp_path / "fmu").exists()


def test_scenario_file_name_and_tunable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    binary = tmp_path / "library.so"
    binary.write_bytes(b"not built: only the description is looked at")
    monkeypatch.setattr(toolchain, "build_library", lambda *_, **__: binary)
    scenario = tmp_path / "2nd arm.toml"
    scenario.write_text('[control]\nmode = "sampled"\nperiod = 2e-3\n[simulation]\nduration = 3.0\n')
    arguments = ("--part", "controller", "--tunable", "control.mu,control.delta", "-o", tmp_path / "out")
    result = springline("export", "fmu3", scenario, *arguments)
    assert result.exit_code == 0, result.stderr
    with zipfile.ZipFile(tmp_path / "out" / "scenario_2nd_arm_controller_fmi3.fmu") as archive:
        text = archive.read("modelDescription.xml").decode()
    shown = re.findall(r'name="([^"]*)" valueReference="\d+" description="[^"]*" causality="parameter"', text)
    assert shown == ["control.mu.0", "control.mu.1", "control.delta"]
    assert '<DefaultExperiment startTime="0.0" stopTime="3.0" stepSize="0.0001" />' in text


def test_the_part_is_the_loop_unless_another_is_asked_for(tmp_path: Path) -> None:
    result = springline("export", "fmu2", "paper/nominal", "-o", tmp_path, "--json")
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["rows"] == [{"path": "nominal_loop_fmi2.fmu", "change": "written"}]


def test_wrong_input(tmp_path: Path, folder: Path) -> None:
    export = ("export", "fmu3", "paper/nominal")
    assert "--part" in refused(*export, "--part")
    assert "nobody" in refused(*export, "--part", "nobody")
    out = ("--part", "plant", "-o", tmp_path / "out")
    assert "the nearest name is 'control.delta'" in refused(*export, *out, "--tunable", "control.dleta")
    assert "no C identifier" in refused(*export, *out, "--name", "two words")
    assert not (tmp_path / "out").exists()
    (tmp_path / "manifest.json").write_text('{"files": [], "functions": []}')
    assert "manifest.json: lists what another command wrote here" in refused(*export, "--part", "plant", "-o", tmp_path)


def test_an_edited_fmu_is_never_lost(folder: Path, tmp_path: Path) -> None:
    for path in folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    edited = tmp_path / "nominal_controller_fmi2.fmu"
    edited.write_bytes(b"mine")
    export = ("export", "fmu3", "paper/nominal", "--part", "controller", "-o", tmp_path)
    assert "nominal_controller_fmi2.fmu: edited since springline wrote it" in refused(*export)
    assert springline(*export, "--force").exit_code == 0
    assert edited.read_bytes() == b"mine"


def test_coupled_with_a_plant_that_is_not_ours(folder: Path) -> None:
    if importlib.util.find_spec("fmpy") is None:
        reason = "fmpy is not installed: pip install 'springline[fmu]'"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    for version in (2, 3):
        command = [sys.executable, str(EXAMPLE), str(folder / f"nominal_controller_fmi{version}.fmu")]
        printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        worst = float(printed.rpartition("last second: ")[2])
        assert 1e-4 < worst < 1e-2  # m, rad: friction and lag that the controller does not know leave something


@pytest.mark.parametrize("fmus", ["", ', "fmus": 3', ', "fmus": [{}]', ', "fmus": [{"name": 3}]'])
def test_a_manifest_that_does_not_say_its_fmus_is_told_and_nothing_is_lost(fmus: str, tmp_path: Path) -> None:
    digest = hashlib.sha256(b"kept").hexdigest()
    (tmp_path / "old.fmu").write_bytes(b"kept")
    listed = f'{{"path": "old.fmu", "sha256": "{digest}"}}'
    (tmp_path / "manifest.json").write_text(f'{{"kind": "fmu", "files": [{listed}]{fmus}}}')
    message = refused("export", "fmu2", "paper/nominal", "-o", tmp_path)
    assert "manifest.json: fmus: does not say which FMUs it lists" in message
    assert (tmp_path / "old.fmu").read_bytes() == b"kept"
