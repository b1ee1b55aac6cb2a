"""Arithmetic as written, and the symbolic solution of linear systems."""

import casadi as ca
import numpy as np
import pytest

from springline.model.symbolic import as_written, over, solve_spd


@pytest.mark.parametrize("n", [1, 2, 3, 6])
@pytest.mark.parametrize("columns", [1, 3])
def test_solve_spd_against_numpy(n, columns, rng):
    matrix, rhs = ca.SX.sym("A", n, n), ca.SX.sym("b", n, columns)
    solve = ca.Function("solve", [matrix, rhs], [solve_spd(matrix, rhs)])
    for _ in range(100):
        root = rng.normal(size=(n, n))
        a, b = root @ root.T + 1e-3 * np.eye(n), rng.normal(size=(n, columns))
        expected = np.linalg.solve(a, b)
        error = np.abs(np.array(solve(a, b)) - expected)
        assert np.max(error) < 1e-14 * np.linalg.cond(a) * np.max(np.abs(expected))


def test_solve_spd_reads_the_lower_triangle_only():
    """The mass matrix is symmetric: what stands above the diagonal is neither read nor computed."""
    matrix, rhs = ca.SX.sym("A", 3, 3), ca.SX.sym("b", 3)
    x = solve_spd(matrix, rhs)
    assert not any(ca.depends_on(x, matrix[i, j]) for i in range(3) for j in range(i + 1, 3))


def test_a_pivot_of_parameters_is_inverted_apart():
    """1/d stands by itself, so that it can be computed when d is known; x/d would wait for x."""
    d, x = ca.SX.sym("d"), ca.SX.sym("x")
    rest, _, parts = ca.extract_parametric(over(x, d), d, {})
    assert len(parts) == 1
    inverse = ca.Function("inverse", [d], [parts[0]])
    assert float(inverse(3.0)) == 1 / 3
    assert "/" not in str(rest)


def test_over_rounds_twice():
    d, x = ca.SX.sym("d"), ca.SX.sym("x")
    f = ca.Function("f", [x, d], [over(x, d)])
    assert float(f(5.0, 49.0)) == 5.0 * (1 / 49.0)


def test_as_written_keeps_the_form_and_ends():
    x = ca.SX.sym("x")
    with as_written():
        kept = (x + 0) * 1
    assert kept.n_dep() == 2
    assert ((x + 0) * 1).n_dep() == 0


def test_as_written_may_be_nested_and_survives_an_error():
    x = ca.SX.sym("x")
    with as_written():
        over(x, x)
        assert (x * 1).n_dep() == 2
    with pytest.raises(RuntimeError, match="inside"), as_written():
        raise RuntimeError("inside")
    assert (x * 1).n_dep() == 0
