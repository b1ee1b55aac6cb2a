"""What a user gets: sdist and wheel are built from a copy of the tree, without network, and looked into."""

import configparser
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Callable
from email.parser import Parser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("benchmarks", "codegen", "generated", "model", "runner")
FACE = {"__init__.py", "__init__.pyi", "py.typed"}
CARRIED = (*PACKAGES, "docs", "examples", "springline", "tests")
Once = Callable[[str, Callable[[Path], object]], Path]
PYTHON = [sys.executable, "-I"]  # isolated: neither the current folder nor PYTHONPATH may help


def tree(*folders: str, suffixes: tuple[str, ...] = ()) -> set[str]:
    """The project's files below `folders`, relative to its root; those with a suffix given, or all."""
    found = (path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file())
    return {
        path.relative_to(ROOT).as_posix()
        for path in found
        if "__pycache__" not in path.parts and (not suffixes or path.suffix in suffixes)
    }


def run(*command: str, cwd: Path) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


@pytest.fixture(scope="module")
def dist(once: Once, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the sdist, and the wheel built from that sdist.

    Built from a copy: setuptools leaves build/ and *.egg-info behind, which the next wheel would pick up.
    """

    def make(out: Path) -> None:
        source = tmp_path_factory.mktemp("source")
        for folder in CARRIED:
            if (ROOT / folder).exists():
                shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__"))
        for file in ROOT.iterdir():
            if file.is_file():
                shutil.copy(file, source)
        run(*PYTHON, "-m", "build", "--no-isolation", "--outdir", str(out), cwd=source)

    return once("dist", make)


@pytest.fixture(scope="module")
def wheel(dist: Path) -> set[str]:
    (path,) = dist.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        return set(archive.namelist())


@pytest.fixture(scope="module")
def sdist(dist: Path) -> set[str]:
    (path,) = dist.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        return {member.name.partition("/")[2] for member in archive if member.isfile()}


@pytest.fixture(scope="module")
def installed(dist: Path, once: Once) -> Path:
    """A folder that the wheel is installed into; dependencies come from the running interpreter."""
    (path,) = dist.glob("*.whl")

    def make(target: Path) -> None:
        pip = [*PYTHON, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--target", str(target)]
        run(*pip, str(path), cwd=dist)

    return once("installed", make)


def test_wheel_holds_springline_and_nothing_else(wheel: set[str]) -> None:
    tops = {name.split("/")[0] for name in wheel}
    assert len(tops) == 2
    assert tops - {"springline"} == {top for top in tops if top.endswith(".dist-info")}
    assert {name.split("/")[1] for name in wheel if name.startswith("springline/")} == {*PACKAGES, *FACE}


def test_wheel_carries_every_shipped_file(wheel: set[str]) -> None:
    """Python, C, scenarios and generated files, each where its package expects it; no file is forgotten."""
    shipped = {name.removeprefix("springline/") for name in wheel if name.startswith("springline/")}
    assert shipped == tree(*PACKAGES) | FACE
    for needed in (
        "codegen/runtime/loop.c",
        "codegen/export/c/templates/springline.h.j2",
        "codegen/export/fmu/templates/index.html.j2",
        "runner/report/templates/report.html.j2",
        "runner/scenarios/paper/nominal.toml",
        "generated/manifest.json",
    ):
        assert needed in shipped
    assert {f"{package}/py.typed" for package in PACKAGES if package != "generated"} <= shipped


def test_a_new_folder_is_shipped_with_its_templates_and_without_what_is_not_ours(tmp_path: Path) -> None:
    """Found, not listed: an export target is a folder and nothing else."""
    for folder in (*PACKAGES, "springline"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / file, tmp_path)
    target = tmp_path / "codegen/export/constants"
    ours = {"__init__.py", "__init__.pyi", "files.py", "templates/constants.toml.j2"}
    for name in (*ours, "__pycache__/files.cpython-311.pyc", ".files.py.swp"):
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        (target / name).touch()
    run(*PYTHON, "setup.py", "--quiet", "build_py", "--build-lib", "built", cwd=tmp_path)
    built = tmp_path / "built/springline/codegen/export/constants"
    assert {path.relative_to(built).as_posix() for path in built.rglob("*") if path.is_file()} == ours


def test_wheel_metadata(dist: Path, wheel: set[str]) -> None:
    (path,) = dist.glob("*.whl")
    with zipfile.ZipFile(path) as archive:
        (folder,) = {name.split("/")[0] for name in wheel if ".dist-info/" in name}
        metadata = Parser().parsestr(archive.read(f"{folder}/METADATA").decode())
        scripts = configparser.ConfigParser()
        scripts.read_string(archive.read(f"{folder}/entry_points.txt").decode())
    assert path.name.endswith("-py3-none-any.whl")
    assert (metadata["Name"], metadata["License-Expression"]) == ("springline", "MIT")
    assert scripts["console_scripts"]["springline"] == "springline.runner.cli:main"
    assert dict(scripts["springline.commands"]) == {"bench": "springline.benchmarks.command:bench"}
    assert f"{folder}/licenses/LICENSE" in wheel
    required = {re.split(r"[^\w-]", line)[0] for line in metadata.get_all("Requires-Dist", ())}
    needed = {"casadi", "jinja2", "lazy_loader", "matplotlib", "numpy", "pyarrow", "pydantic", "scipy", "typer"}
    assert needed <= required
    assert set(metadata.get_all("Provides-Extra", ())) == {
        "bench",
        "compiler",
        "dev",
        "distributed",
        "docs",
        "fmu",
        "verify",
    }


def test_sdist_can_be_built_and_tested_from(sdist: set[str]) -> None:
    assert tree(*CARRIED) <= sdist
    assert {"CHANGELOG.md", "LICENSE", "Makefile", "README.md", "pyproject.toml", "setup.py"} <= sdist
    assert not {name for name in sdist if name.endswith((".pyc", ".so"))}


def test_installed_package_finds_its_data(installed: Path, tmp_path: Path) -> None:
    """Through importlib.resources, as the code does, and with no way back to the source tree."""
    script = f"""
import sys
sys.path.insert(0, {os.fspath(installed)!r})
import importlib.resources, json
import springline.codegen, springline.generated, springline.model, springline.runner
files = {{
    package: [str(path) for path in importlib.resources.files("springline." + package).iterdir()]
    for package in {PACKAGES!r}
}}
manifest = importlib.resources.files("springline.generated").joinpath("manifest.json").read_text()
print(json.dumps([files, json.loads(manifest)]))
"""
    files, manifest = json.loads(run(*PYTHON, "-c", script, cwd=tmp_path))
    for package in PACKAGES:
        assert files[package]
        assert all(path.startswith(str(installed / "springline" / package)) for path in files[package])
    assert manifest == json.loads((ROOT / "generated/manifest.json").read_bytes())


def test_installed_command(installed: Path, tmp_path: Path) -> None:
    """The command works from the wheel alone and knows the packaged scenarios."""
    script = installed / "bin" / "springline"
    assert script.exists()
    call = f"import sys; sys.path.insert(0, {os.fspath(installed)!r}); from springline.runner.cli import main"
    version = run(*PYTHON, "-c", f"{call}; sys.argv[1:] = ['--version']; main()", cwd=tmp_path)
    assert "0.1.0" in version
    face = "import springline as sl; print(sl.__version__, sl.batch)"
    place = f"import sys; sys.path.insert(0, {os.fspath(installed)!r}); "
    assert run(*PYTHON, "-c", place + face, cwd=tmp_path).startswith("0.1.0 <function batch")
    listing = f"{call}; sys.argv[1:] = ['list', 'scenarios', '--json']; main()"
    assert "paper/nominal" in run(*PYTHON, "-c", listing, cwd=tmp_path)
