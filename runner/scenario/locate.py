"""Where scenarios, sweeps and CSV files are, in the user's folders or packaged with springline, and which is which."""

from __future__ import annotations

import errno
import os
import shlex
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from springline.runner.files import InputError, Problem, read_toml, unknown
from springline.runner.scenario import schema
from springline.runner.scenario.packaged import (
    packaged_file,
    packaged_names,
    packaged_scenarios,
    packaged_sweeps,
    scenarios_folder,
)

PACKAGED = "springline:"
"""A path that begins so is that of a file beside the packaged scenarios: "springline:data/vessel_orcaflex_10hz.csv"."""

# What is larger would fill the memory before anything could be said of it.
_LARGEST_SCENARIO = 2**24
_LARGEST_SIGNAL_FILE = 2**30


Kind = Literal["scenario", "sweep", "dataset", "file of a dataset", "folder of a run", "folder of an export", "FMU", ""]
"""What a user may give to a command; "" for what is of no kind that can be told."""

# Files that our commands leave in a folder, and what that makes it.
_SIGNS: dict[str, Kind] = {
    "sweep.json": "dataset",
    "scenario.toml": "folder of a run",
    "self_check.c": "folder of an export",
}
_RESULTS = (".json", ".parquet")
_SWEEPS_OWN = ("scenario", "vary", "method", "samples", "keep")


def kind_of(document: Mapping[str, object]) -> Kind:
    """What a TOML document is, by the keys at its top: a sweep varies a scenario that it names."""
    if any(key in document for key in _SWEEPS_OWN):
        return "sweep"
    return "scenario" if any(key in document for key in schema.TABLES) else ""


def expect_kind(wanted: Kind, source: str | Path, document: Mapping[str, object] | None = None) -> None:
    """Raise InputError, with the command that takes it, for an input of another kind than a command wants.

    source    what the user gave: a packaged name, a file, or a folder
    document  what is in it, where it has been read
    What is of no kind that can be told passes, for whoever reads it to say what is wrong with it.
    """
    name = str(source)
    found = kind_of(document) if document is not None else _packaged_kind(name) or _kind_at(Path(name))
    if not found or found == wanted:
        return
    quoted = shlex.quote(name)
    commands = {
        "scenario": f"springline run {quoted}",
        "sweep": f"springline batch {quoted}",
        "dataset": f"springline replay {quoted} RUN, or springline batch SWEEP -o {quoted} --resume",
        "file of a dataset": f"springline replay {shlex.quote(str(Path(name).parent))} RUN",
        "folder of a run": f"its scenario is {Path(name, 'scenario.toml')}",
        "folder of an export": "it was made from a scenario, which is what commands take",
        "FMU": "other simulators load it; it was made from a scenario, which is what commands take",
    }
    raise InputError(Problem(name, "", f"this is {'an' if found == 'FMU' else 'a'} {found}: {commands[found]}"))


def _packaged_kind(name: str) -> Kind:
    if name in packaged_scenarios():
        return "scenario"
    return "sweep" if name in packaged_sweeps() else ""


def _kind_at(path: Path) -> Kind:
    """What a folder is by the files that our commands leave in it, and a file by its text."""
    try:
        if path.is_dir():
            return next((kind for file, kind in _SIGNS.items() if (path / file).exists()), "")
        if path.suffix in _RESULTS and (path.parent / "sweep.json").exists():
            return "file of a dataset"
        return "FMU" if path.suffix == ".fmu" else kind_of(read_toml(file_text(path)))
    except (OSError, ValueError):
        return ""


def read_scenario(source: str | Path) -> tuple[str, Path]:
    """Text of a scenario (a file, or a packaged one by name), and the folder that its relative paths refer to.

    Raises InputError if there is none.
    """
    name = str(source) or "."
    if not isinstance(source, Path) and name in packaged_scenarios():
        file = packaged_file(f"{name}.toml")
        return file.read_text("utf-8"), Path(str(file)).parent
    path = Path(source)
    if os.path.exists(path) and path.suffix != ".toml":  # Path.exists raises for names that no file can have
        expect_kind("scenario", source)
    try:
        return file_text(path), Path(os.path.realpath(path)).parent
    except (FileNotFoundError, NotADirectoryError) as error:
        if path.suffix == ".toml" and path.parent.is_dir():
            there = tuple(sorted(item.name for item in path.parent.glob("*.toml")))
            raise InputError(Problem(name, "", "there is no such file", "", path.name, there)) from error
        expect_kind("scenario", source)
        raise InputError(unknown(name, "", "file or packaged scenario", name, packaged_scenarios())) from error
    except IsADirectoryError as error:
        expect_kind("scenario", source)
        text = "is a folder: expected a TOML file or the name of a packaged scenario"
        raise InputError(Problem(name, "", text)) from error
    except (OSError, ValueError) as error:  # no UTF-8, and names that no file can have
        raise InputError(Problem(name, "", f"cannot be read as a text file in UTF-8 ({reason(error)})")) from error


def read_sweep(source: str | Path) -> tuple[str, Path]:
    """Text of a sweep (a file, or a packaged one by name), and the folder that its scenario's path refers to.

    Raises InputError if there is none.
    """
    name = str(source)
    if not isinstance(source, Path) and name in packaged_sweeps():
        folder = scenarios_folder() / "sweeps"
        return (folder / f"{name}.toml").read_text("utf-8"), Path(str(folder))
    expect_kind("sweep", source)
    path = Path(source)
    try:
        return file_text(path), Path(os.path.realpath(path)).parent
    except (FileNotFoundError, NotADirectoryError) as error:
        there = sorted(str(path.parent / item.name) for item in path.parent.glob("*.toml"))
        raise InputError(unknown(name, "", "file or packaged sweep", name, [*packaged_sweeps(), *there])) from error
    except (OSError, ValueError) as error:  # no UTF-8, and names that no file can have
        raise InputError(Problem(name, "", f"cannot be read as a text file in UTF-8 ({reason(error)})")) from error


def file_text(path: Path) -> str:
    """Text of a scenario's or a sweep's file. Raises OSError and ValueError for what cannot be one."""
    return _contents(path, _LARGEST_SCENARIO).decode("utf-8-sig")


def file_bytes(path: Path) -> bytes:
    """Contents of a file of a user's code. Raises OSError and ValueError for what cannot be one."""
    return _contents(path, _LARGEST_SCENARIO)


def reason(error: Exception) -> object:
    """What the system says of a failure, without the path."""
    return error.strerror if isinstance(error, OSError) and error.strerror else error


def _contents(path: Path, largest: int) -> bytes:
    """Contents of a regular file.

    Raises OSError if it is none (a pipe or a device need not end), or has more than `largest` bytes; ValueError for a
    name that no file can have.
    """
    found = path.stat()
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "a pipe or a device: expected a regular file", str(path))
    if found.st_size > largest:
        raise OSError(errno.EFBIG, f"more than {largest >> 20} MiB", str(path))
    return path.read_bytes()


def canonical_path(path: str, folder: Path, where: str, key: str) -> str:
    """A path as it means the same from every folder.

    where, key  what it stands in, for messages
    Raises InputError for a path that no file can have.
    """
    if path.startswith(PACKAGED):
        return path
    try:
        found = os.path.realpath(folder / path)
        found.encode()
        return found
    except (OSError, ValueError) as error:  # a NUL, a working directory that is gone, a name that no TOML can hold
        raise InputError(Problem(where, key, f"is no path of a file ({error})", repr(path))) from error


def relative_path(path: str, folder: Path) -> str:
    """A canonical path as it reads in a file in `folder`, where there is a way from here to there."""
    if path.startswith(PACKAGED):
        return path
    try:
        return os.path.relpath(path, os.path.realpath(folder))
    except ValueError:  # on another drive
        return path


def read_signal_file(path: str, where: str, key: str) -> bytes:
    """Contents of a CSV file, given by its canonical path.

    where, key  what refers to it, for messages
    Raises InputError if it cannot be read.
    """
    if path.startswith(PACKAGED):
        name = path.removeprefix(PACKAGED)
        names = sorted(packaged_names(scenarios_folder(), ".csv"))
        if name not in names:
            raise InputError(unknown(where, key, "packaged file", path, [PACKAGED + n for n in names]))
        return packaged_file(name).read_bytes()
    file = Path(path)
    try:
        return _contents(file, _LARGEST_SIGNAL_FILE)
    except FileNotFoundError as error:
        there = tuple(sorted(item.name for item in file.parent.glob("*.csv")))
        raise InputError(Problem(where, key, f"there is no file {path}", "", file.name, there)) from error
    except (OSError, ValueError) as error:
        raise InputError(Problem(where, key, f"{path} cannot be read ({reason(error)})")) from error
