"""The contenders, one file for each way to do the work. A new one is a file with CONTENDERS, named here."""

from __future__ import annotations

from springline.benchmarks.contenders import (
    casadi_c,
    casadi_vm,
    handwritten_c,
    jax_vmap,
    numba_loop,
    numpy_batch,
    ours,
    scipy_ivp,
)
from springline.benchmarks.problem import Contender

CONTENDERS: tuple[Contender, ...] = (
    *ours.CONTENDERS,
    *handwritten_c.CONTENDERS,
    *numba_loop.CONTENDERS,
    *casadi_c.CONTENDERS,
    *numpy_batch.CONTENDERS,
    *jax_vmap.CONTENDERS,
    *casadi_vm.CONTENDERS,
    *scipy_ivp.CONTENDERS,
)
"""All of them; the first of each control mode is springline's default, to which ratios refer."""
