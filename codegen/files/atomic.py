"""Files that come whole or not at all, in a folder whose other files stay as they are.

What is written lies under a temporary name until it is whole and on the disk. A process that is killed leaves such
names behind, and files that are old or new as a whole. Workplaces are held by a lock, which the system drops with the
process: whatever can be locked is left over, and goes with the next write.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import re
import shutil
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path, PurePosixPath

TEMPORARY = ".springline-"
"""How the names of unfinished files and folders begin; whoever reads a folder passes them over."""

_NAME = re.compile(re.escape(TEMPORARY) + r"([0-9a-f]{16}|[a-z0-9_]{8})")  # the shorter ones are of version 0.1


def write_file(path: Path, content: bytes) -> None:
    """Write one file whole or not at all: for a folder of very many files, which is not looked through for leftovers.

    The folder must exist. A process that is killed on the way leaves what was there before, and perhaps a file
    whose name begins with `TEMPORARY`. Raises OSError if the disk refuses.
    """
    unfinished = _temporary(path.parent)
    try:
        _write_through(unfinished, content)
        os.replace(unfinished, path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise
    _sync(path.parent)


def change_folder(folder: Path, writes: Mapping[str, bytes], removals: Collection[str] = ()) -> None:
    """Put files into a folder and take others out, or leave all as it was.

    writes    path inside the folder (``/`` between parts) -> content, in the order in which they come into place
    removals  paths of files that go; so do folders that they leave empty

    Everything is on the disk before the first file is seen. A folder that does not exist comes into being complete, in
    one rename; in one that does, every file is replaced in one. What processes that were killed have left goes too.
    Raises OSError if the disk refuses, or where a folder stands in the place of a file.
    """
    folder = folder.resolve()
    fresh = not folder.exists()
    with contextlib.ExitStack() as undo:
        for place in reversed(folder.parents):
            _make_folder(place, undo)
        # Inside a folder that there is, for only there is it surely the same file system (the folder may be a mount).
        with workplace(folder.parent if fresh else folder) as work:
            prepared, replaced = (work, work) if fresh else (work / "new", work / "old")
            for path, content in writes.items():
                (prepared / path).parent.mkdir(parents=True, exist_ok=True)
                _write_through(prepared / path, content)
            if fresh:
                os.replace(work, folder)
            else:
                with contextlib.ExitStack() as moves:
                    for path in (*removals, *writes):
                        _move(folder, path, prepared if path in writes else None, replaced, moves)
                    moves.pop_all()
        undo.pop_all()
    _remove_empty_folders(folder, removals)
    for place in {folder, folder.parent, *((folder / path).parent for path in (*writes, *removals))}:
        _sync(place)


def remove_leftovers(folder: Path) -> None:
    """Remove the workplaces in `folder` that no living process holds."""
    for place in folder.iterdir():
        if _NAME.fullmatch(place.name) and place.is_dir() and not place.is_symlink():
            with contextlib.suppress(OSError):  # in use, without locks, of another user: it stays
                handle = os.open(place, os.O_RDONLY)
                try:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(place, ignore_errors=True)
                finally:
                    os.close(handle)


@contextlib.contextmanager
def workplace(folder: Path) -> Iterator[Path]:
    """A new folder in `folder`, removed at the end unless it was given another name by then.

    What processes that were killed have left in `folder` is removed too. Raises OSError if the disk refuses.
    """
    remove_leftovers(folder)
    while True:
        work = _temporary(folder)
        work.mkdir()
        handle = os.open(work, os.O_RDONLY)
        with contextlib.suppress(OSError):  # a file system without locks; nobody else can tell it for left over either
            fcntl.flock(handle, fcntl.LOCK_EX)
        if work.exists():  # else it was taken for left over, before it was locked
            break
        os.close(handle)
    try:
        yield work
    finally:
        shutil.rmtree(work, ignore_errors=True)
        os.close(handle)


def _temporary(folder: Path) -> Path:
    """A new name in `folder`. Beside the target, for only there is a rename sure to stay in one file system."""
    return folder / f"{TEMPORARY}{os.urandom(8).hex()}"


def _move(folder: Path, path: str, prepared: Path | None, replaced: Path, undo: contextlib.ExitStack) -> None:
    """Bring one file in from `prepared`, or out if that is None; what was there is kept under `replaced`."""
    target, old = folder / path, replaced / path
    for inner in reversed(PurePosixPath(path).parents):
        _make_folder(folder / inner, undo)
    if target.is_dir() and not target.is_symlink():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(target))
    there = os.path.lexists(target)
    if there:
        old.parent.mkdir(parents=True, exist_ok=True)
        _keep(target, old, stays=prepared is not None)
        undo.callback(os.replace, old, target)
    if prepared is not None:
        os.replace(prepared / path, target)
        if not there:
            undo.callback(target.unlink)


def _keep(target: Path, old: Path, *, stays: bool) -> None:
    """Give a file a second name, so that there is none missing while it is replaced, or another one."""
    if stays:
        with contextlib.suppress(OSError, NotImplementedError):  # a file system without hard links
            os.link(target, old, follow_symlinks=False)
            return
    os.replace(target, old)


def _make_folder(place: Path, undo: contextlib.ExitStack) -> None:
    if not place.is_dir():
        place.mkdir()
        undo.callback(place.rmdir)


def _remove_empty_folders(folder: Path, removals: Collection[str]) -> None:
    for path in removals:
        for inner in PurePosixPath(path).parents[:-1]:
            place = folder / inner
            if place.is_dir() and not any(place.iterdir()):
                place.rmdir()


def _write_through(path: Path, content: bytes) -> None:
    with path.open("xb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


def _sync(folder: Path) -> None:
    """Make renames in `folder` last through a power cut, where the file system can."""
    with contextlib.suppress(OSError):  # some network file systems sync no folder; one that was empty is gone
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
