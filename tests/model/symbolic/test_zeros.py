"""What is zero is left out, and what is left has the bits of the whole at zero."""

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from springline.model.structure import SignalShape, Structure
from springline.model.symbolic import as_written, operations, without
from springline.model.system import System

X, Z = ca.SX.sym("x", 3), ca.SX.sym("z", 3)
OPERATIONS = [
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: a * b,
    lambda a, b: a / (1 + b**2),
    lambda a, b: ca.sin(a) - b,
    lambda a, b: b * ca.cos(a),
    lambda a, b: ca.fmax(a, -b),
    lambda a, b: ca.if_else(a < b, a, 2 * b),
]


@st.composite
def results(draw: st.DrawFn) -> ca.SX:
    pool = [*ca.vertsplit(X), *ca.vertsplit(Z), ca.SX(1), ca.SX(-2)]
    with as_written():
        for _ in range(draw(st.integers(1, 25))):
            a, b = (pool[draw(st.integers(0, len(pool) - 1))] for _ in range(2))
            pool.append(draw(st.sampled_from(OPERATIONS))(a, b))
    return ca.vertcat(*pool[-3:])


@given(result=results(), seed=st.integers(0, 2**31))
def test_the_rest_has_the_same_bits(result: ca.SX, seed: int) -> None:
    [left] = without([result], Z)
    assert not ca.depends_on(left, Z)
    with as_written():
        whole, rest = ca.Function("whole", [X, Z], [result]), ca.Function("rest", [X], [left])
    assert rest.n_instructions() <= whole.n_instructions() + 3  # a constant for each result
    x = np.random.default_rng(seed).normal(size=3)
    wanted, got = np.array(whole(x, np.zeros(3))), np.array(rest(x))
    finite = np.isfinite(wanted)  # infinity times zero is nothing here
    assert (got[finite] == wanted[finite]).all()


@pytest.mark.parametrize(("terms", "fewer"), [((0, 0, 0), 20), ((1, 0, 0), 20), ((1, 1, 0), 5), ((1, 1, 1), 0)])
def test_a_base_that_does_not_roll_costs_no_roll(terms: tuple[int, ...], fewer: int) -> None:
    """Of the loop's plant, which knows what moves; who calls the exported plant may move the base as he likes."""
    system = System(Structure(base_motion=SignalShape("sine", terms)))
    known = ca.vertcat(system.w, system.p)
    symbols = ca.vertcat(known, system.x, system.u)
    changing = ca.vertcat(system.x, system.u)
    n = system.n
    base = ca.vertsplit(system.w[3 * n :], 3)
    whole = operations(system.function("plant")(*base, system.x, system.u, system.p), symbols, changing)
    loop = operations(system.function("loop_plant")(system.w, system.x, system.u, system.p), symbols, changing)
    assert whole - loop >= fewer
    assert (loop == whole) == (terms == (1, 1, 1))
