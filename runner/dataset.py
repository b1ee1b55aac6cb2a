"""A dataset: sweep.json, which says what the runs are, and part-*.parquet, one for each chunk of them.

A part is there if its chunk is done, so a kill at any moment loses no more than the chunks in flight. Parts come into
being whole, and their content follows from sweep.json alone: two processes that write the same part, or a write that
is repeated, do no harm. The lock saves double work; it is not what keeps a dataset sound. What happens to parts later
is seen by their seals: one that is damaged, or of other runs, is made again.

tables/ holds the CSV files that the runs read, so that a dataset can be replayed wherever it lies.

The place is a local folder or any URL that fsspec knows ("s3://bucket/name", "memory://name").
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import re
import shutil
import socket
import stat
import tempfile
import tomllib
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from functools import cached_property
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from springline.codegen.atomic import TEMPORARY, write_file
from springline.codegen.manifest import canonical_json
from springline.runner.errors import InputError, Problem, unknown
from springline.runner.plan import FORMAT, Chunk, Plan
from springline.runner.records import FOLDER as TABLES
from springline.runner.seal import Opened, Seal
from springline.runner.simulate import trajectory_schema
from springline.runner.toml_text import read_toml, value_text

DESCRIPTION = "sweep.json"
TRAJECTORIES = "trajectories"

_LOCK = ".lock"
_PART = "part-{:06d}.parquet"
_PART_NAME = re.compile(r"part-\d{6}\.parquet")
_TRAJECTORY = "run-{:09d}.parquet"
# What may differ between the process that began a dataset and the one that resumes it.
_FREE = ("springline", "versions")
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)
_FULL = (errno.ENOSPC, errno.EDQUOT)


Tell = Callable[[str], None]
Tick = Callable[[int, int], None]


class Place(Protocol):
    """Where files lie; names have slashes."""

    @property
    def name(self) -> str:
        """The place as the user calls it."""
        ...

    def names(self, folder: str = "") -> list[str]:
        """Names of the files in a folder, sorted; none if there is no such folder."""
        ...

    def folders(self, folder: str = "") -> list[str]:
        """Names of the folders in a folder, where there are folders."""
        ...

    def free(self) -> int | None:
        """Bytes that can still be written there, None if nobody can say."""
        ...

    def local(self) -> Path:
        """A local folder with the files of `tables`; it lasts as long as the Place."""
        ...

    def read(self, name: str) -> bytes:
        """Content of a file. Raises FileNotFoundError."""
        ...

    def open(self, name: str) -> Any:
        """A file to read parts of."""
        ...

    def write(self, name: str, content: bytes) -> None:
        """Write a file whole, or leave what no reader takes for whole. Raises OSError if the place refuses."""
        ...

    def remove(self, name: str) -> None:
        """Remove a file if it is there."""
        ...

    def locked(self) -> contextlib.AbstractContextManager[None]:
        """Hold the place's lock. Raises InputError if another process has it."""
        ...


def place(destination: str | Path) -> Place:
    """The Place of a folder's path or a URL. Raises InputError for a URL that nothing installed can handle."""
    text = str(destination)
    if "\0" in text:
        raise InputError(Problem(repr(text), "", "no file or folder can have this name"))
    if "://" not in text or text.startswith("file://"):
        return Folder(Path(text.removeprefix("file://")))
    try:
        fsspec: Any = import_module("fsspec")
    except ImportError as error:
        hint = "a URL needs fsspec: pip install 'springline[distributed]'"
        raise InputError(Problem(text, "", hint)) from error
    try:
        files, root = fsspec.url_to_fs(text)
    except (ValueError, ImportError) as error:
        raise InputError(Problem(text, "", f"no place that can be written to ({error})")) from error
    return Remote(text, files, root)


class Folder:
    """A local folder."""

    def __init__(self, path: Path) -> None:
        self._path = path

    @property
    def name(self) -> str:
        """The path or URL."""
        return str(self._path)

    def names(self, folder: str = "") -> list[str]:
        """Names of the files in the folder, sorted; none if there is no such folder."""
        try:
            return sorted(item.name for item in os.scandir(self._path / folder) if item.is_file())
        except FileNotFoundError:
            return []
        except NotADirectoryError as error:
            raise InputError(Problem(self.name, "", "is a file: expected a folder for the dataset")) from error
        except OSError as error:
            raise _unusable(self.name, error) from error

    def folders(self, folder: str = "") -> list[str]:
        """Names of the folders in the folder."""
        path = self._path / folder
        return sorted(item.name for item in path.iterdir() if item.is_dir()) if path.is_dir() else []

    def free(self) -> int | None:
        """Bytes that are free in the file system of the folder, or of the one that it will be made in."""
        path = self._path.absolute()
        try:
            usage = shutil.disk_usage(next(folder for folder in (path, *path.parents) if folder.is_dir()))
        except OSError:
            return None
        return usage.free if usage.total else None  # file systems without a size of their own have no room either

    def local(self) -> Path:
        """The folder itself."""
        return Path(os.path.realpath(self._path))  # resolve() breaks on links in a circle

    def read(self, name: str) -> bytes:
        """Content of a file."""
        return self._regular(name).read_bytes()

    def open(self, name: str) -> Any:
        """A file to read from."""
        return self._regular(name).open("rb")

    def _regular(self, name: str) -> Path:
        """The path of a file that ends, as pipes and devices need not. Raises OSError for these."""
        path = self._path / name
        mode = path.stat().st_mode
        if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
            raise OSError(errno.EINVAL, "a pipe or a device: expected a regular file", str(path))
        return path

    def write(self, name: str, content: bytes) -> None:
        """Write a file, whole or not at all."""
        target = self._path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        write_file(target, content)

    def remove(self, name: str) -> None:
        """Remove a file if it is there."""
        (self._path / name).unlink(missing_ok=True)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Hold the folder's lock, which the system drops with the process.

        Raises InputError if another has it or the folder cannot be written to, OSError if the disk is full.
        """
        try:
            self._path.mkdir(parents=True, exist_ok=True)
            lock = (self._path / _LOCK).open("a+")
        except OSError as error:
            if error.errno in _FULL:
                raise
            raise _unusable(self.name, error) from error
        with lock as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                file.seek(0)
                raise _in_use(self.name, file.read().strip()) from error
            except OSError as error:
                if error.errno not in _NO_LOCKS:
                    raise
            file.truncate(0)
            file.write(_owner())
            file.flush()
            yield


class Remote:
    """A folder of an fsspec file system."""

    def __init__(self, url: str, files: Any, root: str) -> None:
        self._url = url
        self._files = files
        self._root = root.rstrip("/")
        self._copy: tempfile.TemporaryDirectory[str] | None = None

    @property
    def name(self) -> str:
        """The path or URL."""
        return self._url

    def _at(self, name: str) -> str:
        return f"{self._root}/{name}" if name else self._root

    def names(self, folder: str = "") -> list[str]:
        """Names of the files in the folder, sorted; none if there is no such folder."""
        self._files.invalidate_cache()
        try:
            items = self._files.ls(self._at(folder), detail=True)
        except FileNotFoundError:
            return []
        return sorted(item["name"].rstrip("/").rpartition("/")[2] for item in items if item["type"] == "file")

    def folders(self, folder: str = "") -> list[str]:
        """None: object stores have no folders, and what stands in for them is in nobody's way."""
        return []

    def free(self) -> int | None:
        """Nobody can say."""
        return None

    def local(self) -> Path:
        """A copy of the tables, in a folder that goes with this object."""
        if self._copy is None:
            self._copy = tempfile.TemporaryDirectory(prefix="springline-")
            folder = Path(self._copy.name, TABLES)
            folder.mkdir()
            for name in self.names(TABLES):
                (folder / name).write_bytes(self.read(f"{TABLES}/{name}"))
        return Path(self._copy.name)

    def read(self, name: str) -> bytes:
        """Content of a file."""
        return bytes(self._files.cat_file(self._at(name)))

    def open(self, name: str) -> Any:
        """A file to read from."""
        return self._files.open(self._at(name), "rb")

    def write(self, name: str, content: bytes) -> None:
        """Write a file; object stores do so whole or not at all, and half a Parquet file has no footer."""
        self._files.makedirs(self._at(name).rpartition("/")[0], exist_ok=True)
        self._files.pipe_file(self._at(name), content)

    def remove(self, name: str) -> None:
        """Remove a file if it is there."""
        with contextlib.suppress(FileNotFoundError):
            self._files.rm_file(self._at(name))

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Leave a lock file while working. Raises InputError if there is one of a process that may still live."""
        if _LOCK in self.names():
            owner = self.read(_LOCK).decode(errors="replace").strip()
            if not _is_gone(owner):
                hint = f"; if that process is gone, remove {self._url.rstrip('/')}/{_LOCK}"
                raise _in_use(self.name, owner, hint)
        self.write(_LOCK, _owner().encode())
        try:
            yield
        finally:
            self.remove(_LOCK)


def _owner() -> str:
    return f"process {os.getpid()} on {socket.gethostname()}"


def _is_gone(owner: str) -> bool:
    """Whether a lock's owner is known to have ended: only a process of this machine can be."""
    words = owner.split()
    if len(words) != 4 or words[3] != socket.gethostname() or not words[1].isdecimal():
        return False
    try:
        os.kill(int(words[1]), 0)
    except ProcessLookupError:
        return True
    except PermissionError:
        return False
    return False


def _unusable(name: str, error: OSError) -> InputError:
    text = f"cannot hold a dataset ({error.strerror}): -o must name a folder that can be made and written to"
    return InputError(Problem(name, "", text))


def _in_use(name: str, owner: str, hint: str = "") -> InputError:
    return InputError(Problem(name, "", f"is being written by {owner or 'another process'}{hint}"))


class Dataset:
    """The runs of a sweep at a Place."""

    def __init__(self, where: Place) -> None:
        self.place = where

    # Beginning

    def is_begun(self, *, resume: bool) -> bool:
        """Whether the place holds a dataset. Raises InputError if it holds something that may not be continued."""
        there = [name for name in self.place.names() if name != _LOCK and not name.startswith(TEMPORARY)]
        if DESCRIPTION not in there and there:
            raise InputError(Problem(self.place.name, "", "is not empty and holds no dataset", there[0]))
        if there and not resume:
            text = "holds a dataset already: --resume continues it, another -o begins a new one"
            raise InputError(Problem(self.place.name, "", text))
        return bool(there)

    def begin(self, plan: Plan, versions: Mapping[str, Any], *, resume: bool) -> Plan:
        """Make the place ready for the runs of `plan`, or of its rest, and return the plan that holds there.

        A resumed dataset keeps its chunk size. Raises InputError if it holds anything that `plan` would not continue.
        """
        if not self.is_begun(resume=resume):
            self._keep_tables(plan)
            self.place.write(DESCRIPTION, canonical_json({**versions, **plan.as_json()}))
            return plan
        stored = self.description()
        self.expect_format(stored)
        chunk = stored.get("chunk")
        if isinstance(chunk, int) and chunk > 0 and plan.sweep.chunk in (0, chunk):
            plan = Plan(plan.sweep, chunk)
        new = json.loads(canonical_json(plan.as_json()))
        try:
            changed = list(changes(_as_written(stored), _as_written(new)))
        except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
            raise self.damaged(error) from error
        if changed:
            shown = "\n  ".join(changed[:20])
            text = f"cannot be resumed, for what it holds is not what the sweep asks for now:\n  {shown}"
            raise InputError(Problem(self.place.name, "", text))
        for folder in ("", TRAJECTORIES, TABLES):
            for name in self.place.names(folder):
                if name.startswith(TEMPORARY):
                    self.place.remove(f"{folder}/{name}" if folder else name)
        self._keep_tables(plan)
        return plan

    def _keep_tables(self, plan: Plan) -> None:
        """Copy the CSV files that the runs read, those that are not there as they should be."""
        there = self.place.names(TABLES)
        for name, kept in plan.tables.items():
            path = f"{TABLES}/{name}"
            if name not in there or self.place.read(path) != kept.record.content:
                self.place.write(path, kept.record.content)

    def description(self) -> dict[str, Any]:
        """Content of sweep.json. Raises InputError if there is none, or it is none."""
        try:
            content = json.loads(self.place.read(DESCRIPTION))
        except (FileNotFoundError, NotADirectoryError) as error:
            raise InputError(Problem(self.place.name, "", f"holds no dataset: there is no {DESCRIPTION}")) from error
        except (ValueError, OSError, RecursionError) as error:
            raise self.damaged(error) from error
        if not isinstance(content, dict):
            raise self.damaged(TypeError())
        return content

    @cached_property
    def identity(self) -> str:
        """Hash of what sweep.json says of the runs: all that decides them, and not what made them."""
        told = {key: value for key, value in self.description().items() if key not in _FREE}
        return sha256(canonical_json(told)).hexdigest()

    def damaged(self, error: Exception) -> InputError:
        """The error of a description that cannot be what was written, as reading it has shown."""
        match error:
            case KeyError():
                how = f"there is no {error.args[0]!r}"
            case RecursionError():
                how = "brackets in brackets without end"
            case json.JSONDecodeError() | tomllib.TOMLDecodeError() | OSError():
                how = str(error)
            case _:
                how = "an entry is not what is written there"
        remedy = "bring it back from a copy, or begin the dataset anew with another -o"
        return InputError(Problem(f"{self.place.name}/{DESCRIPTION}", "", f"is damaged ({how}): {remedy}"))

    def expect_format(self, stored: Mapping[str, Any]) -> None:
        """Raise InputError unless the dataset was begun by a version that describes and seals it as this one does."""
        given = stored.get("format", 1)
        if given != FORMAT:
            text = (
                f"was begun by {'an earlier' if given == 1 else 'another'} version of springline "
                f"({str(stored.get('springline', 'unknown'))[:20]}), whose parts this one cannot check: it can be read "
                "(read_dataset), but neither continued nor replayed; begin a new one with another -o"
            )
            raise InputError(Problem(self.place.name, "", text))

    # Parts

    def done(self, plan: Plan, tell: Tell = lambda line: None, checked: Tick = lambda done, of: None) -> set[int]:
        """Numbers of the chunks that are stored: part and kept trajectories are there and whole.

        Each file is read once. One that is whole but not written as this version would is written anew.

        tell     called with a line about each part that is there and not whole
        checked  called with the number of parts that were checked, and how many there are
        Raises InputError if a folder is in the way of a part.
        """
        blocked = [name for name in self.place.folders() if _PART_NAME.fullmatch(name)]
        blocked += [f"{TRAJECTORIES}/{name}" for name in self.place.folders(TRAJECTORIES)]
        if blocked:
            text = "is a folder where a file of the dataset belongs: move it away"
            raise InputError(Problem(f"{self.place.name}/{blocked[0]}", "", text))
        there = set(self.place.names())
        trajectories = set(self.place.names(TRAJECTORIES)) if plan.sweep.keep else set()
        numbers = [number for number in range(plan.chunks) if _PART.format(number) in there]
        whole = set()
        for count, number in enumerate(numbers):
            checked(count, len(numbers))
            flaw = self._flaw(plan, number, trajectories)
            if flaw:
                tell(f"{flaw}: its runs are simulated again")
            else:
                whole.add(number)
        return whole

    def _flaw(self, plan: Plan, number: int, trajectories: Container[str]) -> str:
        """What is wrong with a chunk's files, "" if nothing is."""
        chunk = plan.chunk(number)
        name = _PART.format(number)
        part = self.read_sealed(plan, chunk)
        flaw = part.flaw
        if not flaw and part.better:
            self.place.write(name, part.better)
        for index in plan.kept(chunk) if not flaw else ():
            run = chunk.first + index
            name = f"{TRAJECTORIES}/{_TRAJECTORY.format(run)}"
            if _TRAJECTORY.format(run) not in trajectories:
                return f"{name} is missing"
            opened = self._opened(name, Seal(self.identity, (run, run)), trajectory_schema(chunk.group.work.system))
            if opened.flaw:
                flaw = opened.flaw
                break
            if opened.better:
                self.place.write(name, opened.better)
        return f"{name} {flaw}" if flaw else ""

    def read_sealed(self, plan: Plan, chunk: Chunk) -> Opened:
        """The part of a chunk, with what is wrong with it. Raises FileNotFoundError if it is not there."""
        name, last = _PART.format(chunk.number), chunk.first + chunk.runs - 1
        opened = self._opened(name, Seal(self.identity, (chunk.first, last)), plan.schema, chunk.runs)
        if opened.table is not None and not np.array_equal(opened.table["run"], np.arange(chunk.first, last + 1)):
            return Opened(None, "holds other runs")
        return opened

    def _opened(self, name: str, seal: Seal, schema: pa.Schema, rows: int | None = None) -> Opened:
        try:
            with self.place.open(name) as file:
                return seal.open(file, schema, rows)
        except FileNotFoundError:
            raise
        except OSError as error:
            return Opened(None, f"cannot be read ({error.strerror or error})")

    def write_part(self, chunk: Chunk, table: pa.Table, trajectories: Mapping[int, pa.Table]) -> None:
        """Store the runs of a chunk, and kept trajectories by run. Raises OSError if the place refuses."""
        for run, trajectory in trajectories.items():
            seal = Seal(self.identity, (run, run))
            self.place.write(f"{TRAJECTORIES}/{_TRAJECTORY.format(run)}", seal.close(trajectory))
        seal = Seal(self.identity, (chunk.first, chunk.first + chunk.runs - 1))
        self.place.write(_PART.format(chunk.number), seal.close(table))

    def part_name(self, number: int) -> str:
        """File name of a chunk's part."""
        return _PART.format(number)

    def parts(self) -> list[str]:
        """Names of the parts, in the order of the runs."""
        return [name for name in self.place.names() if _PART_NAME.fullmatch(name)]

    def read_part(self, name: str, columns: Sequence[str] | None = None) -> pa.Table:
        """The table of one part, or some columns of it; its seal is not looked at.

        Raises InputError if it is no table with these columns.
        """
        where = f"{self.place.name}/{name}"
        try:
            with self.place.open(name) as file:
                there = parquet.read_schema(file)
                missing = [column for column in columns or () if column not in there.names]
                if missing:
                    raise InputError(*(unknown(where, "", "column", column, there.names) for column in missing))
                file.seek(0)
                # One thread: a column of a part is too little for more, and each would keep memory of its own.
                table = parquet.read_table(file, columns=columns, use_threads=False)
        except InputError:
            raise
        except (pa.ArrowException, ValueError) as error:
            text = f"is damaged ({str(error).splitlines()[0]}): springline batch --resume makes it again"
            raise InputError(Problem(where, "", text)) from error
        return table.replace_schema_metadata(None)


def read_dataset(destination: str | Path, columns: Sequence[str] | None = None) -> pa.Table:
    """All runs of a dataset, or some columns of them, as one table with units, in the order of the runs.

    destination  the folder or URL that `springline batch` wrote
    Raises InputError if it holds no dataset, no runs yet, a part that is none of its own, and for unknown columns.
    """
    dataset = Dataset(place(destination))
    dataset.description()
    tables = [dataset.read_part(name, columns) for name in dataset.parts()]
    if not tables:
        raise InputError(Problem(dataset.place.name, "", "holds no runs yet: springline batch --resume does them"))
    for name, table in zip(dataset.parts(), tables, strict=True):
        if table.schema != tables[0].schema:
            text = "has other columns than the first part: springline batch --resume makes what is not whole again"
            raise InputError(Problem(f"{dataset.place.name}/{name}", "", text))
    if columns is None or "run" in columns:
        _expect_each_run_once(dataset, tables)
    return pa.concat_tables(tables)


def _expect_each_run_once(dataset: Dataset, tables: Sequence[pa.Table]) -> None:
    """Raise InputError for a part that holds runs that an earlier one has: a copy in another's place, or a surplus."""
    last = -1
    for name, table in zip(dataset.parts(), tables, strict=True):
        runs = table["run"].to_numpy()
        if len(runs) and (runs[0] <= last or np.any(np.diff(runs) <= 0)):
            text = (
                "holds runs that an earlier part has: springline batch --resume makes a part of the sweep again; one "
                "that is none of its parts is to be removed"
            )
            raise InputError(Problem(f"{dataset.place.name}/{name}", "", text))
        last = int(runs[-1]) if len(runs) else last


def _as_written(description: Mapping[str, Any]) -> dict[str, Any]:
    """What sweep.json says, by the keys of a sweep and a scenario file; what follows from them last.

    Raises KeyError, TypeError, AttributeError or ValueError if that cannot be told.
    """
    sweep = dict(description["sweep"])
    vary = [{"key": axis["key"], **read_toml(f"axis = {axis['axis']}")["axis"]} for axis in sweep.pop("vary")]
    scenario = read_toml(description["scenario"])
    rest = {key: value for key, value in description.items() if key not in ("sweep", "scenario", *_FREE)}
    return {**sweep, "vary": vary, **scenario, **rest}


def changes(old: Any, new: Any, where: str = "") -> Iterator[str]:
    """How plain data differ, a line for each place, values in TOML: "vary.control.delta.uniform: [0, 1] -> [0, 2]"."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys([*old, *new]):
            yield from changes(old.get(key, _MISSING), new.get(key, _MISSING), f"{where}.{key}" if where else key)
    elif _is_keyed(old) and _is_keyed(new):
        yield from changes(_by_key(old), _by_key(new), where)
        before, now = ([item["key"] for item in items] for items in (old, new))
        if before != now and set(before) == set(now):
            yield f"{where}, order: {_shown(before)} -> {_shown(now)}"
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new) and any(map(_is_table, old)):
        for i, (a, b) in enumerate(zip(old, new, strict=True)):
            yield from changes(a, b, f"{where}.{i}")
    elif old != new or type(old) is not type(new):  # true is no 1
        yield f"{where}: {_shown(old)} -> {_shown(new)}"


_MISSING = object()  # stands for what is not there


def _is_table(value: object) -> bool:
    return isinstance(value, dict)


def _is_keyed(value: object) -> bool:
    """Whether a value is a list of tables that name themselves."""
    return isinstance(value, list) and bool(value) and all(isinstance(item, dict) and "key" in item for item in value)


def _by_key(items: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    return {item["key"]: {name: value for name, value in item.items() if name != "key"} for item in items}


def _shown(value: object) -> str:
    text = "nothing" if value is _MISSING or value is None else value_text(value)
    return text if len(text) <= 100 else f"{text[:97]}..."
