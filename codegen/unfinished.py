"""Where files lie until they are whole, and how those of a process that was killed are found and removed.

What is unfinished is held by a lock, which the system drops with the process. So whatever can be locked is left over.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

TEMPORARY = ".springline-"
"""How the names of unfinished files and folders begin; whoever reads a folder passes them over."""

_NAME = re.compile(re.escape(TEMPORARY) + r"([0-9a-f]{16}|[a-z0-9_]{8})")  # the shorter ones are of version 0.1


def temporary(folder: Path) -> Path:
    """A new name in `folder`. Beside the target, for only there is a rename sure to stay in one file system."""
    return folder / f"{TEMPORARY}{secrets.token_hex(8)}"


@contextlib.contextmanager
def workplace(folder: Path) -> Iterator[Path]:
    """A new folder in `folder`, removed at the end unless it was given another name by then.

    What processes that were killed have left in `folder` is removed too. Raises OSError if the disk refuses.
    """
    remove_leftovers(folder)
    while True:
        work = temporary(folder)
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
