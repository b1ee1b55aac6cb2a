"""A process from its start to its end, and what it took.

Only the standard library: whoever measures stays small.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from resource import struct_rusage


class Ended(NamedTuple):
    """A process that has ended: wall-clock time, s, and what the system says of it."""

    wall: float
    usage: struct_rusage


def run_to_end(words: Sequence[str], environment: Mapping[str, str] | None = None) -> Ended:
    """Run a program, its output kept in a file. Raises RuntimeError, with the output, if it fails."""
    with tempfile.TemporaryFile("w+") as output:
        start = time.perf_counter()
        child = subprocess.Popen(words, stdout=output, stderr=subprocess.STDOUT, env=environment)
        _, status, usage = os.wait4(child.pid, 0)
        wall = time.perf_counter() - start
        child.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0)
        if child.returncode:
            raise RuntimeError(f"exit code {child.returncode} of {' '.join(words[1:])}:\n{output.read()}")
    return Ended(wall, usage)
