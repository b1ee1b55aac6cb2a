"""Sums and products put together anew: the same value, nothing later, nothing more to compute, names as they were."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from springline.model.structure import SignalShape, Structure
from springline.model.symbolic import as_written, associated
from springline.model.symbolic.association import LATE, latency
from springline.model.system import System

P, W, X, U = (ca.SX.sym(name, 3) for name in "pwxu")
KNOWN = [P, W]
LEAVES = [*ca.vertsplit(P), *ca.vertsplit(W), *ca.vertsplit(X), *ca.vertsplit(U)]
INPUTS = [P, W, X, U]

UNARY = [lambda a: -a, lambda a: 2 * a, lambda a: a / 4, ca.sin, ca.fabs, lambda a: a**2, lambda a: a]
BINARY = [
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: -a - b,
    lambda a, b: a * b,
    lambda a, b: -a * b,
    lambda a, b: a / (1 + b**2),
    lambda a, b: ca.if_else(a < b, a, 2 * b),
    ca.fmin,
]


@st.composite
def expressions(draw: st.DrawFn) -> list[ca.SX]:
    """Results of a random graph over parameters, signals, state and command; some of its values are used often."""
    pool = [*LEAVES, ca.SX(3), ca.SX(-0.5)]
    for _ in range(draw(st.integers(1, 40))):
        # What has just been made is used more often than the rest: so sums and products get long.
        near = st.integers(max(0, len(pool) - 4), len(pool) - 1)
        a, b = (pool[draw(near | st.integers(0, len(pool) - 1))] for _ in range(2))
        with as_written():
            if draw(st.booleans()):
                pool.append(draw(st.sampled_from(BINARY))(a, b))
            else:
                pool.append(draw(st.sampled_from(UNARY))(a))
    return [ca.vertcat(*pool[-draw(st.integers(1, 3)) :]), pool[-1]]


def walked(results: list[ca.SX]) -> ca.Function:
    with as_written():
        return ca.Function("f", INPUTS, [ca.cse(ca.vertcat(*(ca.vec(ca.densify(item)) for item in results)))])


def cost_and_depth(results: list[ca.SX]) -> tuple[int, list[int]]:
    """Operations that depend on the state, and when each entry is there."""
    f = walked(results)
    depth: dict[int, int | None] = {}  # None: does not depend on the state
    found, count = [0] * f.numel_out(0), 0
    for k in range(f.n_instructions()):
        op, into, source = f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)
        if op == ca.OP_OUTPUT:
            found[into[1]] = depth[source[0]] or 0
        elif op == ca.OP_INPUT:
            depth[into[0]] = {2: 0, 3: LATE}.get(source[0])
        elif op == ca.OP_CONST:
            depth[into[0]] = None
        else:
            late = [d for d in (depth[i] for i in source) if d is not None]
            depth[into[0]] = max(late) + latency(op) if late else None
            count += bool(late)
    return count, found


@given(results=expressions(), seed=st.integers(0, 2**31))
def test_the_value_is_the_same_but_for_rounding(results: list[ca.SX], seed: int) -> None:
    rng = np.random.default_rng(seed)
    before, after = walked(results), walked(associated(results, KNOWN, U))
    for _ in range(3):
        at = [rng.normal(size=3) for _ in INPUTS]
        wanted, got = np.array(before(*at)).ravel(), np.array(after(*at)).ravel()
        with np.errstate(over="ignore"):
            scale = largest(before, at)
        if np.isfinite(scale) and scale < 1e6:  # sin of much more than that is another number altogether
            np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-7 * max(scale, 1.0))


@cache
def operation(op: int, arguments: int) -> ca.Function:
    """An operation by itself."""
    given = [ca.SX.sym(f"a{k}") for k in range(arguments)]
    return ca.Function("g", given, [(ca.SX.unary if arguments == 1 else ca.SX.binary)(op, *given)])


def largest(f: ca.Function, at: list[np.ndarray]) -> float:
    """The largest value on the way."""
    work: dict[int, float] = {}
    every = []
    for k in range(f.n_instructions()):
        op, into, source = f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)
        if op == ca.OP_INPUT:
            work[into[0]] = at[source[0]][source[1]]
        elif op == ca.OP_CONST:
            work[into[0]] = f.instruction_constant(k)
        elif op != ca.OP_OUTPUT:
            work[into[0]] = float(operation(op, len(source))(*(work[i] for i in source)))
        every.append(abs(work[into[0]]) if op != ca.OP_OUTPUT else 0.0)
    return max(every)


@given(results=expressions())
def test_nothing_is_there_later_and_nothing_costs_more(results: list[ca.SX]) -> None:
    count, depths = cost_and_depth(results)
    new_count, new_depths = cost_and_depth(associated(results, KNOWN, U))
    assert new_count <= count
    assert all(new <= old for new, old in zip(new_depths, depths, strict=True)), (new_depths, depths)


@given(results=expressions())
def test_nothing_else_is_read_and_twice_is_once(results: list[ca.SX]) -> None:
    once = associated(results, KNOWN, U)
    before = {str(symbol) for item in results for symbol in ca.symvar(item)}
    assert {str(symbol) for item in once for symbol in ca.symvar(item)} <= before
    assert [item.shape for item in once] == [item.shape for item in results]
    again = associated(results, KNOWN, U)
    assert [str(item) for item in once] == [str(item) for item in again]


def sx(text: str) -> ca.SX:
    """An expression of p, q (parameters), w, v (time), x, y, z (state) and u (late), as it is written."""
    names = dict(zip("pqwvxyz", (P[0], P[1], W[0], W[1], X[0], X[1], X[2]), strict=True))
    with as_written():
        return ca.SX(eval(text, {"sin": ca.sin, "if_else": ca.if_else, "u": U[0]} | names))  # noqa: S307 - our own text


@pytest.mark.parametrize(
    ("written", "wanted"),
    [
        ("x + p + q", "(x_0+(p_0+p_1))"),
        ("x + (p + w) + q", "(x_0+((p_0+w_0)+p_1))"),  # p + w is known early, and stays as it is written
        ("(u + x) + y", "(u_0+(x_0+x_1))"),
        ("sin(x) + y - z", "(sin(x_0)+(x_1-x_2))"),
        ("x + y + z + sin(x)", "(((x_0+x_1)+x_2)+sin(x_0))"),
        ("-(x * p) - y", "((x_0*(-p_0))-x_1)"),
        ("p * (x * q)", "((p_0*p_1)*x_0)"),
        ("x * w * p", "(x_0*(p_0*w_0))"),
        ("x / p * q", "(((1/p_0)*p_1)*x_0)"),
        ("sin(x) * y * p", "((x_1*p_0)*sin(x_0))"),
        ("-x * (-y)", "(x_0*x_1)"),
        ("if_else(x < y, x, y) + p", "@1=(x_0<x_1), (((@1?x_0:0)+((!@1)?x_1:0))+p_0)"),
    ],
)
def test_how_it_is_put_together(written: str, wanted: str) -> None:
    assert str(associated([sx(written)], KNOWN, U)[0]) == wanted


def test_what_is_a_result_stays_one() -> None:
    """A name is a result beside the others: it is neither opened nor copied."""
    part = sx("p * x + y")
    with as_written():
        whole = part + sx("q * z") + sx("w")
    apart, kept = associated([whole, part], KNOWN, U)
    assert (
        ca.Function("f", INPUTS, [apart, kept]).n_instructions()
        == ca.Function("f", INPUTS, [ca.cse(ca.vertcat(apart, kept))]).n_instructions()
    )
    assert str(kept) in str(apart)


@pytest.mark.parametrize("law", ["variable_power_log", "double_power", "power"])
def test_the_names_of_the_law_are_values_of_it(law: str) -> None:
    """What a reader of the law looks for is computed on the way to the command, and not beside it."""
    system = System(Structure(law=law, base_motion=SignalShape("sine", (1, 0, 0))))
    control, named = system.function("control"), system.function("control_terms")
    symbols = [ca.SX.sym(control.name_in(i), control.size_in(i)) for i in range(control.n_in())]
    with as_written():
        terms = zip(system.terms("control"), named(*symbols), strict=True)
        wanted = {"e", "de", "sigma", "size", "a_law", "a", "rate_factor", "dsurface", "u_e", "ddq", "u_s", "u_f"}
        shown = {term.name: value for term, value in terms if term.name in wanted}
        assert shown.keys() == wanted
        whole = list(control(*symbols))

    def arithmetic(results: list[ca.SX]) -> int:
        with as_written():
            f = ca.Function("f", symbols, [ca.cse(ca.vertcat(*(ca.vec(item) for item in results)))])
        free = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST}
        return sum(f.instruction_id(k) not in free for k in range(f.n_instructions()))

    assert arithmetic([*whole, *shown.values()]) == arithmetic(whole) > 50
