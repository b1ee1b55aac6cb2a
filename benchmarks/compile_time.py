"""What a user waits for before the first result: generation and compilation, cold and with everything cached.

Each is measured in a process of its own, because a process compiles only once: `python -m
springline.benchmarks.compile_time TITLE` prints the seconds. Imports are not counted.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from importlib import import_module

from springline.benchmarks import problem
from springline.benchmarks.contenders import CONTENDERS


def compile_times(contender: problem.Contender) -> tuple[float, float]:
    """Seconds until a contender can run, with empty caches and again with what that left in them."""
    with tempfile.TemporaryDirectory(prefix="springline-bench-") as folder:
        caches = {
            "SPRINGLINE_CACHE": folder,
            "NUMBA_CACHE_DIR": folder,
            "JAX_COMPILATION_CACHE_DIR": folder,
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
            "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
        }
        command = [sys.executable, "-m", __spec__.name, contender.title]
        cold, cached = (
            float(subprocess.run(command, env=os.environ | caches, stdout=subprocess.PIPE, check=True).stdout)
            for _ in range(2)
        )
    return cold, cached


def measure(contender: problem.Contender) -> float:
    """Seconds of building and a first short call, less those of a second one."""
    for module in contender.modules:
        import_module(module)
    delta = problem.deltas(contender.batch)
    start = time.perf_counter()
    run = contender.build()
    run(delta, problem.QUANTUM)
    first = time.perf_counter()
    run(delta, problem.QUANTUM)
    return max(2 * first - start - time.perf_counter(), 0.0)


if __name__ == "__main__":
    chosen = next(contender for contender in CONTENDERS if contender.title == sys.argv[1])
    sys.stdout.write(f"{measure(chosen)}\n")
