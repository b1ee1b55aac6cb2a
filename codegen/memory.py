"""How much memory there is, for those who would rather say that it does not suffice than be ended for it."""

from __future__ import annotations

import os
import resource
from contextlib import suppress
from pathlib import Path

_GROUP_LIMIT = Path("/sys/fs/cgroup/memory.max")  # a container's


def memory() -> int:
    """Bytes of memory that this process may hope for: the machine's, or less where it has been given a limit."""
    limits = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft != resource.RLIM_INFINITY:
        limits.append(soft)
    with suppress(OSError, ValueError):  # there is no such file, or it reads "max"
        limits.append(int(_GROUP_LIMIT.read_text()))
    return min(limits)
