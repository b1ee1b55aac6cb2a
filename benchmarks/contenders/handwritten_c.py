"""Scalar C written by hand (handwritten.c), with the host's libm."""

from __future__ import annotations

import ctypes
from functools import partial
from pathlib import Path

import numpy as np

from springline.benchmarks import problem
from springline.codegen.kernel import toolchain

SOURCE = Path(__file__).with_name("handwritten.c")
FLAGS = ("-O3", "-std=gnu99", "-ffp-contract=fast", "-fno-trapping-math", "-lm")


def build(mode: problem.Control, extra: tuple[str, ...]) -> problem.Runner:
    """Compile it; a call does a whole batch, one run after the other."""
    flags = (*FLAGS, *toolchain.native_flags(toolchain.find_compiler()), *extra)
    library = toolchain.build_library({SOURCE.name: SOURCE.read_text()}, main=SOURCE.name, flags=flags)
    simulate = toolchain.load(library).simulate
    simulate.argtypes = [
        ctypes.c_int64,
        ctypes.c_int64,
        ctypes.c_double,
        ctypes.c_int,
        ctypes.c_void_p,
        ctypes.c_void_p,
    ]

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        delta, final = np.ascontiguousarray(delta), np.empty((delta.size, 8))
        failed = simulate(delta.size, steps, problem.STEP, int(mode == "sampled"), delta.ctypes.data, final.ctypes.data)
        if failed:
            raise MemoryError(f"no memory for the signals of {steps} steps")
        return final

    return run


CONTENDERS = tuple(
    problem.Contender(
        f"handwritten C{note}",
        variant,
        mode,
        partial(build, mode, extra),
        batch=batch,
        compiles=batch > 1,
    )
    for note, extra in (("", ()), (", -ffast-math", problem.FAST_MATH))
    for mode in problem.MODES
    for variant, batch in ((mode, 8), (f"{mode}, one run", 1))
)
