"""Many runs of a Function have the numbers of single ones."""

from __future__ import annotations

import casadi as ca
import numpy as np

from springline.model.symbolic import over_runs

A, B, T = ca.SX.sym("a", 2), ca.SX.sym("b", 3), ca.SX.sym("t")
MATRIX = ca.blockcat([[ca.sin(A[0]) * B[0], 0], [B[1] ** 2, T], [A[1], 3.0]])
FUNCTION = ca.Function("f", [T, ca.SX.sym("none", 0), A, B], [ca.sparsify(MATRIX), A[0] * B[0]])


def test_every_run_has_the_bits_of_one() -> None:
    random = np.random.default_rng(1)
    t, none, a, b = random.normal(size=(1, 5)), np.zeros((0, 5)), random.normal(size=(2, 5)), random.normal(size=(3, 5))
    matrices, products = over_runs(FUNCTION, t, none, a, b)
    assert matrices.shape == (5, 3, 2) and products.shape == (5, 1, 1)
    for k in range(5):
        matrix, product = FUNCTION(t[:, k], none[:, k], a[:, k], b[:, k])
        assert np.array_equal(matrices[k], matrix.full()) and float(product) == products[k, 0, 0]


def test_what_the_outputs_do_not_depend_on_makes_no_run_another() -> None:
    """The last entry of b is read by none; with the one before it there are as many evaluations as runs."""
    evaluated = []

    class Counted:
        def __getattr__(self, name: str) -> object:
            return getattr(FUNCTION, name)

        def buffer(self) -> tuple[object, object]:
            buffer, evaluate = FUNCTION.buffer()
            return buffer, lambda: (evaluated.append(1), evaluate())

    ones, b = np.ones((2, 4)), np.ones((3, 4))
    b[2] = np.arange(4.0)
    for column, count in ((b, 1), (b[[0, 2, 1]], 4)):
        evaluated.clear()
        matrices, _ = over_runs(Counted(), ones[:1], np.zeros((0, 4)), ones, column)  # type: ignore[arg-type]
        assert len(evaluated) == count and len(matrices) == 4
        assert matrices[:, 1, 0].tolist() == (column[1] ** 2).tolist()
