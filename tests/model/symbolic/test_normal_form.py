"""Collecting terms changes the form of an expression, never its value; cancellation is exact."""

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from springline.model.symbolic import collect

SYMBOLS = ca.SX.sym("v", 5)
FAST, SLOW = SYMBOLS[:2], SYMBOLS[2:4]


@dataclass(frozen=True)
class Term:
    """An expression, its value at a point, and a bound on the numbers met on the way (the size of rounding)."""

    sx: ca.SX
    value: float
    size: float


POINT = np.array([0.7, -1.3, 0.4, 2.1, -0.6])
VARIABLES = st.integers(0, 4).map(lambda i: Term(SYMBOLS[i], POINT[i], abs(POINT[i])))


def constants(*values):
    return st.sampled_from(values).map(lambda c: Term(ca.SX(c), c, abs(c)))


# functions with their values and how much they amplify an error of their argument, for arguments of any size
UNARY = {
    "sin": (ca.sin, math.sin, lambda t: 1 + t.size),
    "cos": (ca.cos, math.cos, lambda t: 1 + t.size),
    "tanh": (ca.tanh, math.tanh, lambda t: 1 + t.size),
    "fabs": (ca.fabs, abs, lambda t: t.size),
    "root": (lambda x: ca.sqrt(1 + x**2), lambda x: math.hypot(1, x), lambda t: 1 + t.size**2),
    "neg": (lambda x: -x, lambda x: -x, lambda t: t.size),
    "twice": (lambda x: 2 * x, lambda x: 2 * x, lambda t: 2 * t.size),
    "square": (lambda x: x**2, lambda x: x * x, lambda t: t.size**2),
    "seventh": (lambda x: x / 7, lambda x: x / 7, lambda t: t.size),
}
BINARY = {
    "add": (lambda a, b: a + b, lambda s, t: s.size + t.size),
    "sub": (lambda a, b: a - b, lambda s, t: s.size + t.size),
    "mul": (lambda a, b: a * b, lambda s, t: s.size * t.size),
}


def expressions(leaves, functions):
    """Random expressions over `leaves` and the named UNARY functions, of at most 8 leaves."""

    def unary(name, t):
        sx, value, size = UNARY[name]
        return Term(sx(t.sx), value(t.value), size(t))

    def binary(name, s, t):
        operation, size = BINARY[name]
        return Term(operation(s.sx, t.sx), operation(s.value, t.value), size(s, t))

    def grow(children):
        return st.one_of(
            st.builds(unary, st.sampled_from(functions), children),
            st.builds(binary, st.sampled_from(sorted(BINARY)), children, children),
        )

    return st.recursive(leaves, grow, max_leaves=8).filter(lambda t: t.size < 1e4)


ANY = expressions(st.one_of(VARIABLES, constants(-3.0, -0.5, 0.0, 1.0, 2.0, 0.1)), sorted(UNARY))


def adds_up_exactly(term):
    """Whether every number in it is a multiple of 1/2 (the sine of a number is none)."""
    f = ca.Function("f", [SYMBOLS], [term.sx])
    numbers = [f.instruction_constant(k) for k in range(f.n_instructions()) if f.instruction_id(k) == ca.OP_CONST]
    return all((2 * number).is_integer() for number in numbers)


# no function whose square CasADi itself rewrites (sqrt, fabs)
EXACT = expressions(
    st.one_of(VARIABLES, constants(-3.0, -0.5, 1.0, 2.0)), ["sin", "cos", "tanh", "neg", "twice", "square"]
).filter(adds_up_exactly)


def value_of(expression):
    return np.array(ca.Function("f", [SYMBOLS], [expression])(POINT))


@given(ANY, st.sampled_from([[], [FAST], [FAST, SLOW], [ca.vertcat(FAST, SLOW)]]))
def test_collecting_keeps_the_value(term, levels):
    found = float(value_of(collect(term.sx, SYMBOLS, levels))[0, 0])
    assert found == pytest.approx(term.value, abs=1e-13 * (1 + term.size))


@given(EXACT, EXACT)
def test_what_is_equal_cancels_exactly(a, b):
    """The binomial formula has no term left."""
    expression = (a.sx + b.sx) ** 2 - a.sx**2 - 2 * a.sx * b.sx - b.sx**2
    assert collect(expression, SYMBOLS, [FAST]).is_zero()


def test_sine_and_cosine_add_up():
    x, y = SYMBOLS[0], SYMBOLS[1]
    one = ca.sin(x + y) ** 2 + ca.cos(x + y) ** 2
    assert collect(one - 1, SYMBOLS, []).is_zero()
    assert collect(ca.sin(x) ** 4 - (1 - ca.cos(x) ** 2) ** 2, SYMBOLS, []).is_zero()
    assert collect(ca.sin(x + y) - ca.sin(y + x), SYMBOLS, []).is_zero()


def test_shape_is_kept():
    matrix = ca.blockcat([[SYMBOLS[0], 0, 1], [SYMBOLS[1] * SYMBOLS[2], -SYMBOLS[0], 2]])
    found = collect(matrix, SYMBOLS, [FAST])
    assert found.shape == (2, 3)
    np.testing.assert_array_equal(value_of(found), value_of(matrix))


def test_rotation_of_the_paper_feels_no_centripetal_force(model):
    """(C dq1)[1] cancels in the derivation and is nowhere computed, and M1[0, 0] is a mere parameter."""
    f = model.system.function("coriolis")
    coriolis = f.call(f.sx_in())[0]
    assert coriolis[1].is_zero()
    assert not coriolis[0].is_zero()
    f = model.system.function("mass_matrix")
    q, p = f.sx_in()
    mass = f(q, p)
    assert not ca.depends_on(mass[0, 0], q)
    assert not ca.depends_on(mass[1, 1], q)


def test_terms_of_a_fast_variable_share_their_coefficient():
    """One coefficient for each of 1, x and x y: 2 b, a b + 3 c, and the symbol c."""
    x, y, a, b, c = ca.vertsplit(SYMBOLS)
    expression = (x + a) * (b + c * y) + b * x - c * (a * y) + 3 * c
    rest, _, coefficients = ca.extract_parametric(collect(expression, SYMBOLS, [FAST]), SYMBOLS[2:], {})
    assert len(coefficients) == 2
    counted = ca.Function("rest", ca.symvar(rest), [rest])
    operations = [counted.instruction_id(k) for k in range(counted.n_instructions())]
    assert operations.count(ca.OP_MUL) == 3
    assert operations.count(ca.OP_ADD) == 2


@pytest.mark.parametrize(
    ("operation", "name"),
    [
        (lambda x: ca.atan2(x, 2), "OP_ATAN2"),
        (lambda x: ca.if_else(x > 0, x, 1), "OP_LT"),
        (ca.erf, "OP_ERF"),
        (ca.floor, "OP_FLOOR"),
        (ca.acos, "OP_ACOS"),
    ],
)
def test_an_operation_that_cannot_be_rebuilt_is_named(operation, name):
    with pytest.raises(ValueError, match=rf"may not contain the operation {name}; write it with"):
        collect(SYMBOLS[1] + operation(SYMBOLS[0]), SYMBOLS, [FAST])


PASSED_THROUGH = [
    *(ca.sqrt, ca.exp, ca.log, ca.tan, ca.tanh, ca.fabs, ca.sign),
    *(lambda x: x**0.3, lambda x: x**-3, lambda x: x**x, lambda x: 2**x, lambda x: 1 / x, lambda x: (1 + x) / (2 + x)),
    *(lambda x: ca.fmin(x, 0.5), lambda x: ca.fmax(x, 0.5)),
]


@pytest.mark.parametrize("operation", PASSED_THROUGH)
def test_other_operations_pass_through(operation):
    expression = SYMBOLS[2] * operation(SYMBOLS[0] + SYMBOLS[2]) - operation(SYMBOLS[0] + SYMBOLS[2])
    found = collect(expression, SYMBOLS, [FAST])
    np.testing.assert_allclose(value_of(found), value_of(expression), rtol=1e-14)
