"""Where a dataset lies: a folder of this machine, locked while somebody writes, or a store elsewhere.

The place is a local folder or any URL that fsspec knows ("s3://bucket/name", "memory://name").
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import shutil
import socket
import stat
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

from springline.codegen.files import write_file
from springline.runner.files import InputError, Problem
from springline.runner.scenario import FOLDER as TABLES

LOCK_FILE = ".lock"


_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)
_FULL = (errno.ENOSPC, errno.EDQUOT)


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
            lock = (self._path / LOCK_FILE).open("a+")
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
        if LOCK_FILE in self.names():
            owner = self.read(LOCK_FILE).decode(errors="replace").strip()
            if not _is_gone(owner):
                hint = f"; if that process is gone, remove {self._url.rstrip('/')}/{LOCK_FILE}"
                raise _in_use(self.name, owner, hint)
        self.write(LOCK_FILE, _owner().encode())
        try:
            yield
        finally:
            self.remove(LOCK_FILE)


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
