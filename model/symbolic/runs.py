"""A Function's numbers for many runs, each with values of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springline.model import lazy_casadi as ca

Floats = NDArray[np.float64]


def over_runs(function: ca.Function, *inputs: Floats) -> list[Floats]:
    """Outputs of a Function whose inputs are columns, (runs, rows, columns) each.

    inputs  (entries, runs) each
    CasADi's own call with many columns takes some 20 us a run to turn them into its matrices; this takes what the
    operations do. Runs that differ in nothing that the outputs depend on are evaluated once.
    """
    runs = inputs[0].shape[1]
    count = runs if _differ(function, inputs) else 1
    rows = [np.ascontiguousarray(given.T) for given in inputs]
    taken = [row[0].copy() for row in rows]
    given = [np.empty(function.nnz_out(i)) for i in range(function.n_out())]
    # What CasADi's stub says of its buffers is not what they take.
    bound: tuple[Any, Callable[[], None]] = function.buffer()
    buffer, evaluate = bound
    for i, numbers in enumerate(taken):
        if numbers.size:
            buffer.set_arg(i, numbers.data)
    for i, numbers in enumerate(given):
        if numbers.size:
            buffer.set_res(i, numbers.data)
    found = [np.empty((count, len(numbers))) for numbers in given]
    for k in range(count):
        for numbers, row in zip(taken, rows, strict=True):
            numbers[:] = row[k]
        evaluate()
        for result, numbers in zip(found, given, strict=True):
            result[k] = numbers
    results = []
    for i, numbers in enumerate(found):
        at, into = function.sparsity_out(i).get_triplet()
        whole = np.zeros((count, function.size1_out(i), function.size2_out(i)))
        whole[:, at, into] = numbers
        results.append(np.broadcast_to(whole, (runs, *whole.shape[1:])))
    return results


def _differ(function: ca.Function, inputs: tuple[Floats, ...]) -> bool:
    """Whether an entry that any output depends on is not the same in all runs."""
    for i, given in enumerate(inputs):
        varies = np.flatnonzero((given != given[:, :1]).any(axis=1))
        for output in range(function.n_out()) if varies.size else ():
            _, read = function.jac_sparsity(output, i).get_triplet()
            if not set(varies.tolist()).isdisjoint(read):
                return True
    return False
