"""Compiled C against CasADi's own evaluation of the same Functions."""

import ctypes
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from springline.codegen.kernel import runtime_sources, toolchain
from springline.codegen.program import Program, print_functions

Values = Callable[..., NDArray[np.float64]]
SAMPLES = 1000
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
    """The outputs, (SAMPLES, numbers) each, through CasADi's C interface."""
    results = [np.zeros((SAMPLES, function.numel_out(i))) for i in range(function.n_out())]
    arg = (ctypes.c_void_p * max(function.sz_arg(), 1))()
    res = (ctypes.c_void_p * max(function.sz_res(), 1))()
    work, integers = (ctypes.c_double * max(function.sz_w(), 1))(), (ctypes.c_int * max(function.sz_iw(), 1))()
    for sample in range(SAMPLES):
        for pointers, arrays in ((arg, inputs), (res, results)):
            pointers[: len(arrays)] = [a.ctypes.data + sample * a.strides[0] for a in arrays]
        assert getattr(library, function.name())(arg, res, integers, work, 0) == 0
    return results


def inputs_of(
    function: ca.Function, shaken: Program, p: NDArray[np.float64], rng: np.random.Generator
) -> list[NDArray[np.float64]]:
    """Random inputs, (SAMPLES, numbers) each; p within 20 % of the nominal values, r and s what follows from them."""
    given = {"p": p * rng.uniform(0.8, 1.2, (SAMPLES, len(p)))}
    for name in ("r", "s", *(function.name_in(i) for i in range(function.n_in()))):
        source = {"r": "run", "s": "time"}.get(name)
        if source in shaken.functions:
            stage = shaken.functions[source]
            names = [stage.name_in(i) for i in range(stage.n_in())]
            for missing in (item for item in names if item not in given):
                given[missing] = rng.normal(size=(SAMPLES, shaken.size(missing)))
            given.setdefault(name, by_casadi(stage, [given[item] for item in names])[0])
        elif name not in given:
            given[name] = rng.normal(size=(SAMPLES, function.numel_in(function.index_in(name))))
    return [np.ascontiguousarray(given[function.name_in(i)]) for i in range(function.n_in())]


def by_casadi(function: ca.Function, inputs: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """The outputs, (SAMPLES, numbers) each, by CasADi's own evaluation."""
    side_by_side = function.map(SAMPLES).call([ca.DM(a.T) for a in inputs])
    return [np.array(value).ravel(order="F").reshape(SAMPLES, -1) for value in side_by_side]


def largest_intermediates(function: ca.Function, inputs: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Largest finite absolute value that any instruction of an SX Function computes; `inputs` and it by sample."""
    work: dict[int, NDArray[np.float64]] = {}
    largest = np.zeros(SAMPLES)
    for k in range(function.n_instructions()):
        op, into, source = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            continue
        if op == ca.OP_INPUT:
            value = inputs[source[0]][:, source[1]]
        elif op == ca.OP_CONST:
            value = np.full(SAMPLES, function.instruction_constant(k))
        else:
            value = OPERATIONS[op](*(work[i] for i in source))
        work[into[0]] = value
        largest = np.fmax(largest, np.where(np.isfinite(value), np.abs(value), 0.0))
    return largest


OPERATIONS: dict[int, Callable[..., NDArray[np.float64]]] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_SQ: np.square,
    ca.OP_TWICE: lambda a: 2 * a,
    ca.OP_INV: np.reciprocal,
    ca.OP_SQRT: np.sqrt,
    ca.OP_EXP: np.exp,
    ca.OP_LOG: np.log,
    ca.OP_LOG1P: np.log1p,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_FABS: np.abs,
    ca.OP_SIGN: np.sign,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
}


@pytest.fixture(scope="module")
def functions(shaken: Program) -> list[ca.Function]:
    return [shaken.system.function(name) for name in EXPORTED] + list(shaken.functions.values())


def test_host_libm_gives_casadis_bits(functions: list[ca.Function], shaken: Program, values_of: Values) -> None:
    """With the host's mathematics and no contraction, SAMPLES random inputs of every Function: equal bits."""
    library = compiled(functions, "-DSL_HOST_LIBM", "-lm")
    rng = np.random.default_rng(1)
    p = values_of(shaken)
    for function in functions:
        inputs = inputs_of(function, shaken, p, rng)
        for actual, reference in zip(call(library, function, inputs), by_casadi(function, inputs), strict=True):
            assert ((actual == reference) | (np.isnan(actual) & np.isnan(reference))).all(), function.name()


def test_own_mathematics_stay_within_rounding(functions: list[ca.Function], shaken: Program, values_of: Values) -> None:
    """With sl_math the difference is bounded by 64 ulp of the largest intermediate value.

    An elementary function is at most 2 ulp off and the host's at most 1; a power of four and cancelling sums amplify
    that by small numbers, and each output is a sum of at most a few dozen such terms. exp amplifies it by its exponent,
    of which a_max lets only the small ones through: the law before a_max is compared up to there, for beyond it the
    loop asks only whether it is finite.
    """
    library = compiled(functions)
    rng = np.random.default_rng(2)
    a_max = 1e9
    p = values_of(shaken, {"control.a_max.0": a_max, "control.a_max.1": a_max})
    worst, laws = 0.0, 0
    for function in functions:
        inputs = inputs_of(function, shaken, p, rng)
        scale = largest_intermediates(function, inputs)[:, np.newaxis]
        results = zip(function.name_out(), call(library, function, inputs), by_casadi(function, inputs), strict=True)
        for name, *values in results:
            laws += name == "a_law"
            actual, reference = (np.clip(value, -a_max, a_max) for value in values) if name == "a_law" else values
            differ = (actual != reference) & ~(np.isnan(actual) & np.isnan(reference))
            error = np.abs(actual[differ] - reference[differ]) / np.broadcast_to(scale, actual.shape)[differ]
            worst = max(worst, error.max(initial=0.0) / np.finfo(float).eps)
    assert worst < 64.0, worst
    assert worst > 0.0, "the two mathematics never differ: the test compares a library with itself"
    assert laws == 1, "which output the law before a_max is"
