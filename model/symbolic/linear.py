"""Quotients and the solution of small linear systems, with reciprocals that stand by themselves."""

from __future__ import annotations

from springline.model import lazy_casadi as ca
from springline.model.symbolic.derivation import as_written


def over(a: ca.SX, b: ca.SX) -> ca.SX:
    """a * (1/b), elementwise: the reciprocal stands by itself, so it is computed when b is known and not later."""
    with as_written():
        return a * (1 / b)


def solve_spd(matrix: ca.SX, rhs: ca.SX) -> ca.SX:
    """Solve A x = b for A (n x n) symmetric positive definite, b (n x k), by A = L D L' without pivoting.

    Pivots are inverted once and multiplied by: one that depends only on parameters costs the time loop nothing.
    """
    n, columns = matrix.shape[0], rhs.shape[1]
    pivot: list[ca.SX] = []
    lower: dict[tuple[int, int], ca.SX] = {}
    scaled: dict[tuple[int, int], ca.SX] = {}  # L D
    for j in range(n):
        for i in range(j, n):
            entry = matrix[i, j]
            for k in range(j):
                entry = entry - scaled[i, k] * lower[j, k]
            scaled[i, j] = entry
        pivot.append(scaled[j, j])
        for i in range(j + 1, n):
            lower[i, j] = over(scaled[i, j], pivot[j])
    x = [[rhs[i, c] for c in range(columns)] for i in range(n)]
    for c in range(columns):
        for i in range(n):
            for k in range(i):
                x[i][c] = x[i][c] - lower[i, k] * x[k][c]
        for i in range(n):
            x[i][c] = over(x[i][c], pivot[i])
        for i in reversed(range(n)):
            for k in range(i + 1, n):
                x[i][c] = x[i][c] - lower[k, i] * x[k][c]
    return ca.vertcat(*(ca.horzcat(*row) for row in x))
