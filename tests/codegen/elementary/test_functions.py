"""The programs of the elementary functions: the C printed from them has their bits, their polynomials are the best."""

from __future__ import annotations

import ctypes
import importlib.util
import math
import re
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from springline.codegen.elementary import Op, Procedure, coefficients, math_header, procedure
from springline.codegen.elementary.functions import FUNCTIONS
from springline.codegen.kernel import toolchain

ROOT = Path(__file__).parents[3]
QUARTERS = ("sincos", "sin", "cos", "tan")


def evaluated(program: Procedure, *inputs: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Results of a program, step by step on arrays, and where it vouches for them."""
    values: list[Any] = []
    unsigned = np.uint64

    def step(op: Op, a: list[Any], number: Any) -> Any:
        match op:
            case Op.INPUT:
                return inputs[number]
            case Op.REAL_CONSTANT:
                return np.full_like(inputs[0], number)
            case Op.BITS_CONSTANT:
                return np.full(inputs[0].shape, number, unsigned)
            case Op.SHIFT_LEFT:
                return a[0] << unsigned(number)
            case Op.SHIFT_RIGHT:
                return a[0] >> unsigned(number)
            case Op.BELOW:
                return a[0] < unsigned(number)
            case Op.REAL:
                return a[0].view(np.float64)
            case Op.BITS:
                return a[0].view(unsigned)
            case Op.PICK:
                return np.where(a[0] >> unsigned(63) != 0, a[2], a[1])
            case Op.SELECT:
                return np.where(a[0], a[1], a[2])
            case Op.IF:
                return np.where(a[0], a[1], 0.0)
            case Op.TRUE:
                return np.where(a[0], 1.0, 0.0)
            case Op.FMIN:
                return np.where(a[0] < a[1], a[0], a[1])
            case Op.FMAX:
                return np.where(a[0] > a[1], a[0], a[1])
        return {
            Op.ADD: np.add, Op.SUB: np.subtract, Op.MUL: np.multiply, Op.DIV: np.divide, Op.NEG: np.negative,
            Op.SQRT: np.sqrt, Op.BIT_AND: np.bitwise_and, Op.BIT_OR: np.bitwise_or, Op.BIT_XOR: np.bitwise_xor,
            Op.BIT_ADD: np.add, Op.BIT_SUB: np.subtract, Op.LT: np.less, Op.LE: np.less_equal, Op.EQ: np.equal,
            Op.NE: np.not_equal, Op.AND: np.logical_and, Op.OR: np.logical_or, Op.NOT: np.logical_not,
        }[op](*a)  # fmt: skip

    with np.errstate(all="ignore"):
        for each in program.steps:
            values.append(step(each.op, [values[i] for i in each.arguments], each.number))
    fine = np.ones(inputs[0].shape, bool) if program.fine is None else values[program.fine]
    return [values[i] for i in program.results], fine


@pytest.fixture(scope="module")
def compiled() -> ctypes.CDLL:
    """many_<name>(x, y, r, n) for every function."""
    lines = ['#include "sl_math.h"', "#define ARRAYS const double *x, const double *y, double *r, int n"]
    for name, (_, inputs) in FUNCTIONS.items():
        if name == "sincos":
            body = "double c; sl_sincos(x[i], &r[i], &c);"
        else:
            body = f"r[i] = sl_{name}({', '.join(['x[i]', 'y[i]'][:inputs])});"
        lines.append(f"void many_{name}(ARRAYS);")
        lines.append(f"void many_{name}(ARRAYS) {{ (void)y; for (int i = 0; i < n; i++) {{ {body} }} }}")
    sources = {"sl_math.h": math_header(), "many.c": "\n".join(lines) + "\n"}
    return toolchain.load(toolchain.build_library(sources, main="many.c", flags=("-O1",)))


def called(library: ctypes.CDLL, name: str, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    result = np.empty_like(x)
    pointers = (ctypes.c_void_p(array.ctypes.data) for array in (x, y, result))
    getattr(library, f"many_{name}")(*pointers, ctypes.c_int(x.size))
    return result


def same(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Where the bits are equal, every NaN the same."""
    a, b = (np.where(np.isnan(each), np.nan, each).view(np.uint64) for each in (a, b))
    return a == b


@pytest.fixture(scope="module")
def arguments() -> tuple[np.ndarray, np.ndarray]:
    """Any bit pattern, and where the functions work."""
    rng = np.random.default_rng(3)
    n = 4000
    pattern = [rng.integers(0, 2**64, n, np.uint64).view(np.float64) for _ in range(2)]
    x = [pattern[0], rng.uniform(-800, 800, n), np.exp(rng.uniform(-40, 40, n)), rng.uniform(-2, 2, n)]
    y = [pattern[1], rng.uniform(-3, 3, n), rng.uniform(-8, 8, n), rng.uniform(-2, 2, n)]
    edges = [0.0, -0.0, math.inf, -math.inf, math.nan, 5e-324, sys.float_info.min, sys.float_info.max, 1.0, -1.0]
    return np.concatenate([*x, edges]), np.concatenate([*y, edges[::-1]])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_printed_c_has_the_bits_of_the_program(
    compiled: ctypes.CDLL, arguments: tuple[np.ndarray, np.ndarray], name: str
) -> None:
    x, y = arguments
    (result, *_), fine = evaluated(procedure(name), *arguments[: FUNCTIONS[name][1]])
    assert np.all(same(result, called(compiled, name, x, y))[fine])
    assert fine.sum() > x.size / 8


# The last argument that the fast path takes, and the next one.
EDGES = {
    "exp": (math.nextafter(708.0, 0.0), 708.0),
    "expm1": (math.nextafter(708.0, 0.0), 708.0),
    "cosh": (math.nextafter(708.0, 0.0), 708.0),
    "sinh": (math.nextafter(708.0, 0.0), 708.0),
    "log": (sys.float_info.min, math.nextafter(sys.float_info.min, 0.0)),
    "log1p": (math.nextafter(2.0**1001, 0.0), 2.0**1001),
    "sin": (math.nextafter(2.0**17, 0.0), 2.0**17),
    "cos": (math.nextafter(2.0**17, 0.0), 2.0**17),
    "tan": (math.nextafter(2.0**17, 0.0), 2.0**17),
    "pow_m1_3": (math.nextafter(2.0**1000, 0.0), 2.0**1000),
    "pow_m2_3": (2.0**-1000, math.nextafter(2.0**-1000, 0.0)),
    "pow_p1_3": (2.0**-1000, math.nextafter(2.0**-1000, 0.0)),
    "pow_p2_3": (math.nextafter(2.0**1000, 0.0), 2.0**1000),
}


@pytest.mark.parametrize("name", EDGES)
def test_the_fast_path_ends_where_it_should(compiled: ctypes.CDLL, name: str) -> None:
    """Both sides of the edge are equally good, so that nobody sees it."""
    x = np.array([*EDGES[name], math.nan, math.inf, -math.inf])
    _, fine = evaluated(procedure(name), x)
    assert fine.tolist() == [True, False, False, False, False]
    inside, outside = called(compiled, name, x, x)[:2]
    assert inside == pytest.approx(outside, rel=1e-9 if name in {"sin", "cos", "tan"} else 3e-12)


@pytest.mark.parametrize("name", ["sin", "tan", "sinh", "tanh", "atan", "asin", "cbrt", "sign"])
def test_odd_functions_are_odd_to_the_bit(
    compiled: ctypes.CDLL, arguments: tuple[np.ndarray, np.ndarray], name: str
) -> None:
    x = arguments[0]
    assert np.all(same(called(compiled, name, -x, x), -called(compiled, name, x, x)))


@pytest.mark.parametrize("name", ["cos", "cosh", "fabs"])
def test_even_functions_are_even_to_the_bit(
    compiled: ctypes.CDLL, arguments: tuple[np.ndarray, np.ndarray], name: str
) -> None:
    x = arguments[0]
    assert np.all(same(called(compiled, name, -x, x), called(compiled, name, x, x)))


OPERATIONS = {
    "exp": 27, "log": 26, "log1p": 29, "sincos": 38, "pow_p1_3": 21, "pow_m1_3": 21, "pow_p2_3": 21, "pow_m2_3": 22,
    "expm1": 34, "tan": 54,
}  # fmt: skip
FLOATING = {Op.ADD, Op.SUB, Op.MUL, Op.DIV, Op.NEG, Op.SQRT, Op.FMIN, Op.FMAX}


@pytest.mark.parametrize("name", OPERATIONS)
def test_a_function_costs_what_the_documentation_says(name: str) -> None:
    count = Counter(step.op in FLOATING for step in procedure(name).steps)[True]
    assert count == OPERATIONS[name]
    table = (ROOT / "docs" / "math.md").read_text()
    assert re.search(rf"^\| [^|]*\b{name}\b[^|]* \| {count} \|", table, re.MULTILINE), f"docs/math.md: {name} {count}"


def test_every_line_of_c_is_one_named_value() -> None:
    text = math_header()
    exp = text[text.index("static inline SL_F SL_CHECKED(exp)(") :].partition("\n}\n")[0]
    names = re.findall(r"^  const SL_F (\w+) =", exp, re.MULTILINE)
    assert names == ["t", "n", "r", "r2", "r4", "p03", "p47", "root", "s"]
    assert "SL_ROUND" in exp and "SL_LN2" not in exp  # half of ln 2


# --- polynomials ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def script() -> ModuleType:
    path = ROOT / "benchmarks" / "math_coefficients.py"
    spec = importlib.util.spec_from_file_location("math_coefficients", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


LONG = ("TAN", "ATAN", "ASIN")


def found(script: ModuleType) -> dict[str, Any]:
    with script.mp.workprec(script.PRECISION):
        return {each.name: each for each in (*script.polynomials(), script.START)}


def test_coefficients_are_those_of_the_script(script: ModuleType) -> None:
    for name, polynomial in found(script).items():
        if name not in LONG:
            assert script.coefficients(polynomial) == getattr(coefficients, name), name


@pytest.mark.full
@pytest.mark.parametrize("name", LONG)
def test_long_polynomials_are_those_of_the_script(script: ModuleType, name: str) -> None:
    assert script.coefficients(found(script)[name]) == getattr(coefficients, name)


def test_no_other_polynomial_stands_there(script: ModuleType) -> None:
    assert {name for name in vars(coefficients) if name.isupper()} == set(found(script))


def test_cube_roots_start_within_the_range_of_their_polynomial(script: ModuleType) -> None:
    """x y^3 repeats with every factor of 8."""
    program = procedure("pow_m1_3")
    (place,) = (place for place, name in program.names.items() if name == "u")
    inner = Procedure(program.steps, (place,), None, 1)
    (u,), _ = evaluated(inner, np.linspace(1.0, 8.0, 100_001))
    assert float(script.START.low) < u.min() < 2.67 and 3.15 < u.max() < float(script.START.high)
