"""What a user gets: sdist and wheel are built from a copy of the tree, without network, and looked into."""

import configparser
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import venv
import zipfile
from collections.abc import Callable
from email.parser import Parser
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
EXTRAS = {"bench", "compiler", "dev", "distributed", "docs", "fmu", "notebook", "verify"}
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


def run(*command: str, cwd: Path, **more: str) -> str:
    """What a command says, with `more` in its environment."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, env=os.environ | more)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


def built(source: Path, out: Path, umask: int) -> None:
    """Sdist, and the wheel from it, of a copy of the tree in `source`.

    From a copy: setuptools leaves build/ and *.egg-info behind, which the next wheel would pick up.
    """
    source.mkdir(exist_ok=True)
    for folder in CARRIED:
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ROOT.iterdir():
        if file.is_file():
            shutil.copyfile(file, source / file.name)
    environment = {name: value for name, value in os.environ.items() if name != "SOURCE_DATE_EPOCH"}
    build = [*PYTHON, "-m", "build", "--no-isolation", "--outdir", str(out)]
    done = subprocess.run(build, cwd=source, capture_output=True, text=True, check=False, env=environment, umask=umask)
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]


@pytest.fixture(scope="module")
def dist(once: Once, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the sdist, and the wheel built from that sdist."""

    def make(out: Path) -> None:
        built(tmp_path_factory.mktemp("source"), out, 0o022)

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
        "runner/cli/templates/notebook.ipynb",
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
    assert set(metadata.get_all("Provides-Extra", ())) == EXTRAS


def test_sdist_can_be_built_and_tested_from(sdist: set[str]) -> None:
    """All of the project and nothing else; what setuptools adds is named."""
    top = {"CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "MANIFEST.in", "Makefile", "README.md"}
    added = {"PKG-INFO", "setup.cfg"} | {name for name in sdist if name.startswith("springline.egg-info/")}
    assert sdist - added == tree(*CARRIED) | top | {"pyproject.toml", "setup.py"}


def test_archives_carry_nothing_by_accident(dist: Path) -> None:
    """No trace of who built them and where, no cache, no build, nothing but files that a user is meant to have."""
    (sdist,), (wheel,) = dist.glob("*.tar.gz"), dist.glob("*.whl")
    with tarfile.open(sdist) as archive:
        members = archive.getmembers()
        sources = {member.name: archive.extractfile(member).read() for member in members if member.isfile()}  # type: ignore[union-attr]
    with zipfile.ZipFile(wheel) as archive:
        shipped = {name: archive.read(name) for name in archive.namelist()}
        modes = {entry.external_attr >> 16 & 0o777 for entry in archive.infolist()}
    assert all(member.isfile() or member.isdir() for member in members)
    assert {(member.uid, member.gid, member.uname, member.gname) for member in members} == {(0, 0, "", "")}
    assert {member.mode for member in members} <= {0o644, 0o755} and modes <= {0o644, 0o664, 0o755}
    unwanted = re.compile(
        r"(^|/)(\.[^/]+|__pycache__|build|dist|results|reproduction)(/|$)|\.(py[cod]|so|o|whl|log|orig)$|~$"
    )
    assert not [name for name in (*sources, *shipped) if unwanted.search(name)]
    assert not [name for name in shipped if re.search(r"(^|/)(tests/|test_[^/]*\.py$|conftest)", name)]
    places = {os.fspath(ROOT), os.fspath(Path.home()), os.fspath(dist), platform.node()} - {
        "/",
        "/root",
        "localhost",
        "",
    }
    here = [place.encode() for place in places if len(place) > 4]
    assert here
    assert not [name for name, data in (sources | shipped).items() if any(place in data for place in here)]


def test_archives_are_the_same_bytes_each_time(dist: Path, tmp_path: Path) -> None:
    """From another folder, with files of other times, and under another umask."""
    built(tmp_path / "elsewhere", tmp_path / "again", 0o077)
    again = {path.name: path.read_bytes() for path in (tmp_path / "again").iterdir()}
    assert again == {path.name: path.read_bytes() for path in dist.iterdir()}


def test_archives_pass_the_index_check(dist: Path) -> None:
    said = run(*PYTHON, "-m", "twine", "check", "--strict", *map(str, sorted(dist.iterdir())), cwd=dist, NO_COLOR="1")
    assert said.count("PASSED") == 2


def test_citation_says_what_the_project_says() -> None:
    """Version, licence and the paper's identifier; its schema is checked by cffconvert where one changes the file."""
    said = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {VERSION}\n" in said and "\nlicense: MIT\n" in said
    (doi,) = re.findall(r"doi: (\S+)", said)
    assert f"doi {doi}" in (ROOT / "docs/paper.md").read_text()
    assert f"\n## {VERSION}\n" in (ROOT / "CHANGELOG.md").read_text()


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
    assert version == f"springline {VERSION}\n"
    face = "import springline as sl; print(sl.__version__, sl.batch)"
    place = f"import sys; sys.path.insert(0, {os.fspath(installed)!r}); "
    assert run(*PYTHON, "-c", place + face, cwd=tmp_path).startswith(f"{VERSION} <function batch")
    listing = f"{call}; sys.argv[1:] = ['list', 'scenarios', '--json']; main()"
    assert "paper/nominal" in run(*PYTHON, "-c", listing, cwd=tmp_path)


class Links(HTMLParser):
    """Where a page leads, what it loads and which places in it can be led to."""

    def __init__(self) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.anchors: set[str] = set()
        self.images = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.images += tag in ("img", "svg")
        for name, value in attrs:
            if name == "id":
                self.anchors.add(value or "")
            elif name in ("href", "src", "xlink:href"):
                self.targets.append(value or "")


@pytest.mark.full
def test_a_strangers_way(dist: Path, tmp_path: Path) -> None:
    """The wheel in a fresh environment, dependencies from the index, first files, runs: no warning, whole reports."""
    venv.create(tmp_path / "fresh", with_pip=True)
    place = tmp_path / "fresh/bin"
    (wheel,) = dist.glob("*.whl")
    run(str(place / "python"), "-m", "pip", "install", "--quiet", str(wheel), cwd=tmp_path)
    for command in (
        ["doctor"],
        ["run", "paper/nominal", "-o", "nominal"],
        ["init", "-o", "mine"],
        ["run", "mine/scenario.toml", "-o", "first"],
    ):
        strict = [str(place / "python"), "-I", "-W", "error", str(place / "springline"), *command]
        done = subprocess.run(strict, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    for folder in ("nominal", "first"):
        page = Links()
        page.feed((tmp_path / folder / "report.html").read_text())
        assert page.images > 3
        for target in page.targets:
            if target.startswith("#"):
                assert target[1:] in page.anchors, target
            elif not target.startswith("data:"):
                assert not re.match(r"(\w+:)?//", target), target
                assert (tmp_path / folder / target).is_file(), target
