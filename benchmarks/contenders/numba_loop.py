"""Numba: the whole loop compiled, one run after the other; constants are globals, so that they are folded."""

from __future__ import annotations

from functools import partial

import numpy as np

from springline.benchmarks import problem


def build(mode: problem.Control) -> problem.Runner:
    """Compiled at the first call, as Numba does, and kept in its cache."""
    from springline.benchmarks.contenders.numba_kernel import loop

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        final = np.empty((delta.size, 8))
        loop(np.ascontiguousarray(delta), steps, mode == "sampled", final)
        return final

    return run


CONTENDERS = tuple(
    problem.Contender("Numba", mode, mode, partial(build, mode), batch=8, modules=("numba",), compiles=True)
    for mode in problem.MODES
)
