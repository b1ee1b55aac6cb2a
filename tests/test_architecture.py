"""Rooms: which may import which, through doors alone, and without a circle."""

from __future__ import annotations

import ast
import functools
import graphlib
import importlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("model", "codegen", "runner", "benchmarks")

# Arrows point to what is imported; a package's own rooms stand in the order in which they build on each other.
LAYERS = {
    "model": ("model.symbolic", "model.mechanisms", "model.control", "model.structure", "model.system"),
    "codegen": ("codegen.files", "codegen.elementary", "codegen.program", "codegen.kernel.toolchain", "codegen.kernel",
                "codegen.export", "codegen.export.c", "codegen.export.fmu"),
    "runner": ("runner.files", "runner.scenario", "runner.report", "runner.run", "runner.sweep",
               "runner.analysis", "runner.paper", "runner.cli"),
}  # fmt: skip
STRANGERS = {
    "model": {"numpy", "lazy_loader"},  # CasADi comes from lazy_casadi.py, for lists of laws do not wait for it
    "codegen": {"casadi", "jinja2", "numpy", "lazy_loader"},
}
"""What is not of the standard library and may be imported, where that is not everything."""

PAST_THE_DOOR = {
    "codegen/test_generated_text.py": {"codegen.export.c", "codegen.export.fmu", "codegen.files"},
    "codegen/test_loads.py": {"codegen.export.fmu"},
    # These have FMUs compiled without optimisation.
    "codegen/test_one_loop.py": {"codegen.export.fmu"},
    "codegen/test_sensors.py": {"codegen.export.fmu"},
    "codegen/test_actuators.py": {"codegen.export.fmu"},
    "codegen/test_differenced_rates.py": {"codegen.export.fmu"},
    "codegen/test_drawn_loops.py": {"codegen.export.fmu"},
    "runner/conftest.py": {"codegen.kernel", "codegen.export.c"},  # saves work that other tests look at
    "runner/cli/test_cli.py": {"runner.paper"},  # makes up what a reproduction returns
    "runner/test_any_arm.py": {"codegen.kernel"},  # has kernels of many joints compiled without optimisation
    "runner/test_six_degrees.py": {"runner.report"},
    "runner/sweep/test_dataset.py": {"codegen.files", "runner.cli"},  # fills a disk; calls a command, to kill it
}
"""Tests that need internals of another room than their own."""


class Import(NamedTuple):
    """`name` is imported from `module` by a line of a file."""

    file: Path
    line: int
    module: str
    name: str

    def __str__(self) -> str:
        return f"{self.file.relative_to(ROOT)}:{self.line}: from {self.module} import {self.name}"


def sources(package: str) -> list[Path]:
    """Every file but the doors."""
    return sorted(path for path in (ROOT / package).rglob("*.py") if not path.with_suffix(".pyi").exists())


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def folder(module: str) -> Path:
    return ROOT.joinpath(*module.split("."))


def room_of(module: str) -> str:
    """The folder with a door that a module stands in, or the module itself where that is a package's own."""
    room = module if (folder(module) / "__init__.pyi").exists() else module.rpartition(".")[0]
    while room.count(".") and not (folder(room) / "__init__.pyi").exists():
        room = room.rpartition(".")[0]
    return room if room.count(".") else module


@functools.cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text("utf-8"))


def imports(path: Path) -> Iterator[Import]:
    """Everything of ours that a file imports, wherever in it."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "springline":
            assert node.level == 0
            for alias in node.names:
                yield Import(path, node.lineno, node.module or "", alias.name)


def strangers(path: Path) -> Iterator[str]:
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield (node.module or "").split(".")[0]


def home(package: str, name: str) -> str:
    """The module that a name of a package comes from, as its door says; the module `name` itself if it is one."""
    if folder(f"{package}.{name}").with_suffix(".py").exists() or folder(f"{package}.{name}").is_dir():
        return f"{package}.{name}"
    if not (folder(package) / "__init__.pyi").exists():
        return package
    for file, listed_name in listed(package):
        if listed_name == name:
            inner = f"{package}.{file}"
            return home(inner, name) if folder(inner).is_dir() else inner
    raise AssertionError(f"springline.{package} has no {name}")


def listed(room: str) -> list[tuple[str, str]]:
    """What the door of a room lists: where in it a name comes from, and the name."""
    imported = [node for node in ast.walk(tree(folder(room) / "__init__.pyi")) if isinstance(node, ast.ImportFrom)]
    return [(node.module or "", alias.name) for node in imported for alias in node.names]


def attributes(found: Import) -> Iterator[str]:
    """What a file takes from an import that is a room, as `room.name`."""
    room = f"{found.module}.{found.name}".removeprefix("springline.")
    if (folder(room) / "__init__.pyi").exists():
        for node in ast.walk(tree(found.file)):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == found.name:
                yield node.attr


def target(found: Import) -> str:
    """The module that is imported from, without `springline.`; "" for the face of all."""
    module = found.module.removeprefix("springline").removeprefix(".")
    if not module:
        return ""
    return home(module, found.name) if folder(module).is_dir() else module


def mirrored(test: Path) -> str:
    """The room, or package, that the folder of a test is named after."""
    return ".".join(test.parent.relative_to(ROOT / "tests").parts)


ALL = [found for package in PACKAGES for path in sources(package) for found in imports(path)]
TESTS = [found for path in sorted((ROOT / "tests").rglob("*.py")) for found in imports(path)]


def test_packages_import_downwards() -> None:
    for found in ALL:
        importer, imported = module_of(found.file).split(".")[0], target(found).split(".")[0]
        assert PACKAGES.index(imported) <= PACKAGES.index(importer), str(found)


@pytest.mark.parametrize("package", LAYERS)
def test_rooms_import_downwards(package: str) -> None:
    order = LAYERS[package]
    for found in ALL:
        importer, imported = room_of(module_of(found.file)), room_of(target(found))
        if importer in order and imported in order:
            assert order.index(imported) <= order.index(importer), str(found)


@pytest.mark.parametrize("package", STRANGERS)
def test_what_is_below_knows_little_of_the_world(package: str) -> None:
    allowed = STRANGERS[package] | set(sys.stdlib_module_names) | {"springline"}
    for path in sources(package):
        assert set(strangers(path)) <= allowed, path


def past_the_door(found: Import) -> str:
    """The room that is entered by another way than its door, "" if there is none."""
    module = found.module.removeprefix("springline").removeprefix(".")
    if not module or module in PACKAGES:  # whose own files are no room's
        return ""
    if (folder(module) / "__init__.pyi").exists():
        shown = (folder(module) / found.name).is_dir() or found.name in {name for _, name in listed(module)}
        return "" if shown else module
    return "" if room_of(module) == module else room_of(module)


def test_a_room_is_entered_by_its_door() -> None:
    """What is outside of a folder imports what its door lists, and nothing from a file in it."""
    for found in ALL:
        assert past_the_door(found) in ("", room_of(module_of(found.file))), str(found)


def test_tests_of_a_rooms_internals_stand_in_its_folder() -> None:
    """tests/ mirrors the rooms: whoever does not stand in a room's folder there enters the room by its door."""
    needed: dict[str, set[str]] = {}
    for found in TESTS:
        room, own = past_the_door(found), mirrored(found.file)
        if room and not f"{own}.".startswith(f"{room}."):
            name = found.file.relative_to(ROOT / "tests").as_posix()
            assert room in PAST_THE_DOOR.get(name, set()), str(found)
            needed.setdefault(name, set()).add(room)
    assert needed == PAST_THE_DOOR


def test_every_folder_of_tests_mirrors_one_of_ours() -> None:
    for path in (ROOT / "tests").rglob("test_*.py"):
        assert folder(mirrored(path)).is_dir(), path


def test_no_circle_of_files() -> None:
    graph: dict[str, set[str]] = {}
    for found in ALL:
        graph.setdefault(module_of(found.file), set()).add(target(found))
    assert len(graph) > 100
    graphlib.TopologicalSorter(graph).prepare()


def test_no_circle_of_rooms() -> None:
    graph: dict[str, set[str]] = {}
    for found in ALL:
        importer, imported = room_of(module_of(found.file)), room_of(target(found))
        if importer != imported:
            graph.setdefault(importer, set()).add(imported)
    graphlib.TopologicalSorter(graph).prepare()


def doors() -> list[str]:
    return [
        ".".join(path.parent.relative_to(ROOT).parts)
        for package in ("springline", *PACKAGES)
        for path in sorted((ROOT / package).rglob("__init__.pyi"))
    ]


@pytest.mark.parametrize("room", [*doors(), "codegen"])
def test_a_door_shows_its_public_names_alone(room: str) -> None:
    package = importlib.import_module("springline" if room == "springline" else f"springline.{room}")
    names = dir(package)
    assert names and names == sorted(set(names))
    for name in names:
        assert getattr(package, name) is not None
        assert not name.startswith("_") or name == "__version__"
    with pytest.raises(AttributeError):
        _ = package.no_such_name


def test_a_package_of_rooms_shows_its_rooms_and_nothing_else() -> None:
    rooms = {room.split(".")[1] for room in doors() if room.startswith("codegen.")}
    assert set(dir(importlib.import_module("springline.codegen"))) == rooms
    assert dir(importlib.import_module("springline.benchmarks")) == []


def test_every_name_of_a_door_is_wanted_outside() -> None:
    """A door is no list of all there is: what nobody else imports, its own tests aside, is a room's own affair."""
    public = {"springline", "model", "runner", "runner.cli"}
    docs = "\n".join(path.read_text("utf-8") for path in [*(ROOT / "docs").glob("*.md"), ROOT / "README.md"])
    strange = [found for found in TESTS if not f"springline.{mirrored(found.file)}.".startswith(f"{found.module}.")]
    wanted = {(found.module, found.name) for found in [*ALL, *strange]}
    wanted |= {(f"{found.module}.{found.name}", name) for found in [*ALL, *strange] for name in attributes(found)}
    wanted |= {
        (f"springline.{room}.{file}", name) for room in set(doors()) - {"springline"} for file, name in listed(room)
    }
    for room in set(doors()) - public:
        for name in dir(importlib.import_module(f"springline.{room}")):
            told = f"from springline.{room} import" in docs and name in docs
            assert (f"springline.{room}", name) in wanted or told, f"{room}: {name}"


FACE = """
import springline as sl
scenario = sl.load_scenario("paper/nominal", {"simulation.duration": 0.01})
print(sl.__version__, sl.simulate(scenario).status, sl.__file__)
import springline.model, springline.codegen.program
"""


def test_the_face_works_in_the_checkout_and_elsewhere(tmp_path: Path) -> None:
    """There Python finds the folder springline/ before the installed package."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    files = []
    for place in (ROOT, tmp_path):
        done = subprocess.run(
            [sys.executable, "-c", FACE], cwd=place, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        version, status, file = done.stdout.split()
        assert version != "unknown" and status == "ok"
        files.append(Path(file).parent)
    assert files[0] == ROOT / "springline" and files[1] != files[0]
