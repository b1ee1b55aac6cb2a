"""C that CasADi generates for a fold of steps, compiled with the host's libm."""

from __future__ import annotations

import ctypes
from functools import partial

import casadi as ca
import numpy as np

from springline.benchmarks import problem
from springline.benchmarks.contenders import casadi_model
from springline.codegen.kernel import toolchain

FLAGS = ("-O3", "-std=gnu99", "-ffp-contract=fast", "-Wno-unused-parameter", "-lm")


def build(mode: problem.Control, extra: tuple[str, ...]) -> problem.Runner:
    """QUANTUM steps a call, through CasADi's C interface."""
    fold = casadi_model.step_function(mode).fold(problem.QUANTUM)
    generator = ca.CodeGenerator("fold.c", {"casadi_int": "long long int"})
    generator.add(fold)
    flags = (*FLAGS, *toolchain.native_flags(toolchain.find_compiler()), *extra)
    library = toolchain.load(toolchain.build_library({"fold.c": generator.dump()}, main="fold.c", flags=flags))
    call = getattr(library, fold.name())

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        state, after, parameter = np.empty(9), np.empty(9), np.empty(problem.QUANTUM)  # delta again for every step
        integers, work = np.empty(max(fold.sz_iw(), 1), np.int64), np.empty(max(fold.sz_w(), 1))
        arguments = (ctypes.c_void_p * max(fold.sz_arg(), 2))(state.ctypes.data, parameter.ctypes.data)
        results = (ctypes.c_void_p * max(fold.sz_res(), 1))(after.ctypes.data)
        pointers = arguments, results, ctypes.c_void_p(integers.ctypes.data), ctypes.c_void_p(work.ctypes.data), 0
        final = np.empty((delta.size, 8))
        for i, d in enumerate(delta):
            state[:8], state[8], parameter[:] = problem.INITIAL_STATE, 0.0, d
            for _ in range(steps // problem.QUANTUM):
                call(*pointers)
                state[:] = after
            final[i] = state[:8]
        return final

    return run


CONTENDERS = tuple(
    problem.Contender(name, mode, mode, partial(build, mode, extra), batch=4, compiles=True)
    for name, extra in (("CasADi C", ()), ("CasADi C, -ffast-math", problem.FAST_MATH))
    for mode in problem.MODES
)
