"""Where scenarios, sweeps and CSV files are, in the user's folders or packaged with springline, and which is which."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Literal

from springline.runner import schema
from springline.runner.errors import InputError, Problem, unknown
from springline.runner.toml_text import read_toml

PACKAGED = "springline:"
"""A path that begins so is that of a file beside the packaged scenarios: "springline:data/vessel_orcaflex_10hz.csv"."""


def packaged_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with springline, sorted."""
    return tuple(sorted(name for name in _packaged(scenarios_folder(), ".toml") if not name.startswith("sweeps/")))


def scenarios_folder() -> Traversable:
    """The folder of the packaged scenarios."""
    return resources.files("springline.runner") / "scenarios"


def _packaged_file(name: str) -> Traversable:
    return scenarios_folder().joinpath(*name.split("/"))


def _packaged(folder: Traversable, suffix: str, prefix: str = "") -> Iterator[str]:
    """Names of the packaged files below `folder`, with slashes; without the suffix if it is ".toml"."""
    for item in folder.iterdir():
        if item.is_dir():
            yield from _packaged(item, suffix, f"{prefix}{item.name}/")
        elif item.name.endswith(suffix):
            yield prefix + (item.name.removesuffix(suffix) if suffix == ".toml" else item.name)


def packaged_sweeps() -> tuple[str, ...]:
    """Names of the sweeps that come with springline, sorted."""
    return tuple(sorted(_packaged(scenarios_folder() / "sweeps", ".toml")))


def expect_kind(wanted: Literal["scenario", "sweep", "dataset"], source: str | Path) -> None:
    """Raise InputError, with the command that takes it, for an input of another kind than a command wants.

    source  what the user gave: a packaged name, a file, or a folder
    What is of no kind that can be told passes, for whoever reads it to say what is wrong with it.
    """
    name = str(source)
    found = _packaged_kind(name) or _kind_at(Path(name))
    if not found or found == wanted:
        return
    quoted = shlex.quote(name)
    commands = {
        "scenario": f"springline run {quoted}",
        "sweep": f"springline batch {quoted}",
        "dataset": f"springline replay {quoted} RUN, or springline batch SWEEP -o {quoted} --resume",
        "folder of a run": f"springline run {shlex.quote(str(Path(name, 'scenario.toml')))}",
    }
    raise InputError(Problem(name, "", f"is a {found}, expected a {wanted}: {commands[found]}"))


def _packaged_kind(name: str) -> str:
    if name in packaged_scenarios():
        return "scenario"
    return "sweep" if name in packaged_sweeps() else ""


def _kind_at(path: Path) -> str:
    """What a folder is by the files that our commands leave in it, and a file by its text."""
    try:
        if not path.is_dir():
            return _text_kind(path.read_text("utf-8-sig")) if path.is_file() else ""
        if (path / "sweep.json").exists():
            return "dataset"
        return "folder of a run" if (path / "scenario.toml").exists() else ""
    except (OSError, ValueError):
        return ""


def _text_kind(text: str) -> str:
    """What a TOML text is by its tables: only a sweep has [vary], and it has none of a scenario's own."""
    try:
        keys = read_toml(text).keys()
    except ValueError:
        return ""
    if "vary" in keys or {"scenario", "samples"} <= keys:
        return "sweep"
    return "scenario" if keys & set(schema.TABLES) else ""


def read_scenario(source: str | Path) -> tuple[str, Path]:
    """Text of a scenario (a file, or a packaged one by name), and the folder that its relative paths refer to.

    Raises InputError if there is none.
    """
    name = str(source) or "."
    if not isinstance(source, Path) and name in packaged_scenarios():
        file = _packaged_file(f"{name}.toml")
        return file.read_text("utf-8"), Path(str(file)).parent
    path = Path(source)
    try:
        return path.read_text("utf-8-sig"), path.resolve().parent
    except (FileNotFoundError, NotADirectoryError) as error:
        if path.suffix == ".toml" and path.parent.is_dir():
            there = tuple(sorted(item.name for item in path.parent.glob("*.toml")))
            raise InputError(Problem(name, "", "there is no such file", "", path.name, there)) from error
        raise InputError(unknown(name, "", "file or packaged scenario", name, packaged_scenarios())) from error
    except IsADirectoryError as error:
        text = "is a folder: expected a TOML file or the name of a packaged scenario"
        raise InputError(Problem(name, "", text)) from error
    except (OSError, ValueError) as error:  # no UTF-8, and names that no file can have
        raise InputError(Problem(name, "", f"cannot be read as a text file in UTF-8 ({error})")) from error


def canonical_path(path: str, folder: Path) -> str:
    """A path as it means the same from every folder."""
    return path if path.startswith(PACKAGED) else str((folder / path).resolve())


def read_signal_file(path: str, where: str, key: str) -> bytes:
    """Contents of a CSV file, given by its canonical path.

    where, key  what refers to it, for messages
    Raises InputError if it cannot be read.
    """
    if path.startswith(PACKAGED):
        name = path.removeprefix(PACKAGED)
        names = sorted(_packaged(scenarios_folder(), ".csv"))
        if name not in names:
            raise InputError(unknown(where, key, "packaged file", path, [PACKAGED + n for n in names]))
        return _packaged_file(name).read_bytes()
    file = Path(path)
    try:
        return file.read_bytes()
    except FileNotFoundError as error:
        there = tuple(sorted(item.name for item in file.parent.glob("*.csv")))
        raise InputError(Problem(where, key, f"there is no file {path}", "", file.name, there)) from error
    except OSError as error:
        raise InputError(Problem(where, key, f"{path} cannot be read ({error.strerror})")) from error
