"""Compiled C against CasADi's own evaluation of the same Functions."""

import ctypes
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from springline.codegen import toolchain
from springline.codegen.casadi_c import print_functions
from springline.codegen.kernel_source import runtime_sources
from springline.codegen.program import Program

Values = Callable[..., NDArray[np.float64]]
EXPORTED = (
    "mass_matrix",
    "coriolis",
    "gravity",
    "base_disturbance",
    "plant",
    "slow_dynamics",
    "fast_dynamics",
    "quasi_steady_force",
    "slow_control",
    "fast_control",
    "control",
    "law_variable_power_log",
)


def compiled(functions: list[ca.Function], *flags: str) -> ctypes.CDLL:
    sources = {**runtime_sources(), "functions.c": print_functions(functions, "functions")}
    flags = (*flags, "-Wno-unused-parameter", "-O2")
    return toolchain.load(toolchain.build_library(sources, main="functions.c", flags=flags))


def call(library: ctypes.CDLL, function: ca.Function, inputs: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """One call through CasADi's C interface."""
    pointer = ctypes.POINTER(ctypes.c_double)
    outputs = [np.zeros(function.numel_out(i)) for i in range(function.n_out())]
    arg = (pointer * max(function.sz_arg(), 1))(*(a.ctypes.data_as(pointer) for a in inputs))
    res = (pointer * max(function.sz_res(), 1))(*(o.ctypes.data_as(pointer) for o in outputs))
    work, integers = (ctypes.c_double * max(function.sz_w(), 1))(), (ctypes.c_int * max(function.sz_iw(), 1))()
    assert getattr(library, function.name())(arg, res, integers, work, 0) == 0
    return outputs


def inputs_of(function: ca.Function, p: NDArray[np.float64], rng: np.random.Generator) -> list[NDArray[np.float64]]:
    """Random inputs, p within 20 % of the nominal values."""
    return [
        p * rng.uniform(0.8, 1.2, len(p)) if function.name_in(i) == "p" else rng.normal(size=function.numel_in(i))
        for i in range(function.n_in())
    ]


def largest_intermediates(function: ca.Function, inputs: list[NDArray[np.float64]]) -> float:
    """Largest finite absolute value that any instruction of an SX Function computes."""
    work: dict[int, float] = {}
    largest = 0.0
    symbol = [ca.SX.sym("a"), ca.SX.sym("b")]
    for k in range(function.n_instructions()):
        op, into, source = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            continue
        if op == ca.OP_INPUT:
            value = float(inputs[source[0]][source[1]])
        elif op == ca.OP_CONST:
            value = function.instruction_constant(k)
        else:
            value = float(evaluate(op, symbol)(*(work[i] for i in source)))
        work[into[0]] = value
        if np.isfinite(value):
            largest = max(largest, abs(value))
    return largest


_OPERATIONS: dict[int, ca.Function] = {}


def evaluate(op: int, symbol: list[ca.SX]) -> ca.Function:
    if op not in _OPERATIONS:
        a, b = symbol
        table = {
            ca.OP_ADD: a + b,
            ca.OP_SUB: a - b,
            ca.OP_MUL: a * b,
            ca.OP_DIV: a / b,
            ca.OP_NEG: -a,
            ca.OP_SQ: a**2,
            ca.OP_TWICE: 2 * a,
            ca.OP_INV: 1 / a,
            ca.OP_SQRT: ca.sqrt(a),
            ca.OP_EXP: ca.exp(a),
            ca.OP_LOG: ca.log(a),
            ca.OP_LOG1P: ca.log1p(a),
            ca.OP_SIN: ca.sin(a),
            ca.OP_COS: ca.cos(a),
            ca.OP_POW: a**b,
            ca.OP_CONSTPOW: a**b,
            ca.OP_FABS: ca.fabs(a),
            ca.OP_SIGN: ca.sign(a),
            ca.OP_FMIN: ca.fmin(a, b),
            ca.OP_FMAX: ca.fmax(a, b),
        }
        unary = {
            ca.OP_NEG,
            ca.OP_SQ,
            ca.OP_TWICE,
            ca.OP_INV,
            ca.OP_SQRT,
            ca.OP_EXP,
            ca.OP_LOG,
            ca.OP_LOG1P,
            ca.OP_SIN,
            ca.OP_COS,
            ca.OP_FABS,
            ca.OP_SIGN,
        }
        _OPERATIONS[op] = ca.Function("op", [a] if op in unary else [a, b], [table[op]])
    return _OPERATIONS[op]


@pytest.fixture(scope="module")
def functions(shaken: Program) -> list[ca.Function]:
    return [shaken.system.function(name) for name in EXPORTED] + list(shaken.functions.values())


def test_host_libm_gives_casadis_bits(functions: list[ca.Function], shaken: Program, values_of: Values) -> None:
    """With the host's mathematics and no contraction, 1000 random inputs of every Function: equal bits."""
    library = compiled(functions, "-DSL_HOST_LIBM", "-lm")
    rng = np.random.default_rng(1)
    p = values_of(shaken)
    for function in functions:
        for _ in range(1000):
            inputs = inputs_of(function, p, rng)
            expected = function.call([ca.DM(a) for a in inputs])
            for actual, value in zip(call(library, function, inputs), expected, strict=True):
                reference = np.array(value).ravel(order="F")
                assert ((actual == reference) | (np.isnan(actual) & np.isnan(reference))).all(), function.name()


def test_own_mathematics_stay_within_rounding(functions: list[ca.Function], shaken: Program, values_of: Values) -> None:
    """With sl_math the difference is bounded by 64 ulp of the largest intermediate value.

    An elementary function is at most 2 ulp off and the host's at most 1; a power of four and cancelling sums amplify
    that by small numbers, and each output is a sum of at most a few dozen such terms.
    """
    library = compiled(functions)
    rng = np.random.default_rng(2)
    p = values_of(shaken, {"control.a_max.0": 1e9, "control.a_max.1": 1e9})
    worst = 0.0
    for function in functions:
        for _ in range(1000):
            inputs = inputs_of(function, p, rng)
            expected = function.call([ca.DM(a) for a in inputs])
            scale = None
            for actual, value in zip(call(library, function, inputs), expected, strict=True):
                reference = np.array(value).ravel(order="F")
                differ = (actual != reference) & ~(np.isnan(actual) & np.isnan(reference))
                difference = np.abs(actual[differ] - reference[differ]).max(initial=0.0)
                if difference > 0.0:
                    scale = largest_intermediates(function, inputs) if scale is None else scale
                    worst = max(worst, difference / (scale * np.finfo(float).eps))
    assert worst < 64.0, worst
    assert worst > 0.0, "the two mathematics never differ: the test compares a library with itself"
