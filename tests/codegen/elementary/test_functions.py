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

from springline.codegen.elementary import Op, Procedure, coefficients, float_header, math_header, procedure
from springline.codegen.elementary.functions import FUNCTIONS
from springline.codegen.elementary.words import DOUBLE, SINGLE, Both, Format
from springline.codegen.kernel import toolchain

ROOT = Path(__file__).parents[3]
FORMATS = pytest.mark.parametrize("fmt", [DOUBLE, SINGLE], ids=lambda fmt: fmt.name)
REALS, PATTERNS = {DOUBLE: np.float64, SINGLE: np.float32}, {DOUBLE: np.uint64, SINGLE: np.uint32}


def evaluated(program: Procedure, *inputs: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Results of a program, step by step on arrays, and where it vouches for them."""
    values: list[Any] = []
    unsigned, floating = PATTERNS[program.format], REALS[program.format]

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
                return a[0].view(floating)
            case Op.BITS:
                return a[0].view(unsigned)
            case Op.PICK:
                return np.where(a[0] >> unsigned(program.format.width - 1) != 0, a[2], a[1])
            case Op.SELECT:
                return np.where(a[0], a[1], a[2])
            case Op.IF:
                return np.where(a[0], a[1], floating(0.0))
            case Op.TRUE:
                return np.where(a[0], floating(1.0), floating(0.0))
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
def compiled() -> dict[Format, ctypes.CDLL]:
    """many_<name>(x, y, r, n) for every function."""
    libraries = {}
    for fmt, prefix, header, text in (
        (DOUBLE, "sl", "sl_math.h", math_header()),
        (SINGLE, "slf", "sl_mathf.h", float_header()),
    ):
        real = fmt.name
        lines = [f'#include "{header}"', f"#define ARRAYS const {real} *x, const {real} *y, {real} *r, int n"]
        for name, (_, inputs) in FUNCTIONS.items():
            if name == "sincos":
                body = f"{real} c; {prefix}_sincos(x[i], &r[i], &c);"
            else:
                body = f"r[i] = {prefix}_{name}({', '.join(['x[i]', 'y[i]'][:inputs])});"
            lines.append(f"void many_{name}(ARRAYS);")
            lines.append(f"void many_{name}(ARRAYS) {{ (void)y; for (int i = 0; i < n; i++) {{ {body} }} }}")
        sources = {header: text, "many.c": "\n".join(lines) + "\n"}
        libraries[fmt] = toolchain.load(toolchain.build_library(sources, main="many.c", flags=("-O1",)))
    return libraries


def called(libraries: dict[Format, ctypes.CDLL], name: str, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    result = np.empty_like(x)
    library = libraries[DOUBLE if x.dtype == np.float64 else SINGLE]
    pointers = (ctypes.c_void_p(array.ctypes.data) for array in (x, y, result))
    getattr(library, f"many_{name}")(*pointers, ctypes.c_int(x.size))
    return result


def same(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Where the bits are equal, every NaN the same."""
    assert a.dtype == b.dtype
    return (a == b) & (np.signbit(a) == np.signbit(b)) | np.isnan(a) & np.isnan(b)


Arguments = dict[Format, tuple[np.ndarray, np.ndarray]]


@pytest.fixture(scope="module")
def arguments() -> Arguments:
    """Any bit pattern, and where the functions work."""
    rng = np.random.default_rng(3)
    n = 4000
    drawn = {}
    for fmt, pattern in PATTERNS.items():
        real, largest = REALS[fmt], {DOUBLE: 800.0, SINGLE: 100.0}[fmt]
        bits = [rng.integers(0, 2**fmt.width, n, pattern).view(real) for _ in range(2)]
        x = [bits[0], rng.uniform(-largest, largest, n), np.exp(rng.uniform(-40, 40, n)), rng.uniform(-2, 2, n)]
        y = [bits[1], rng.uniform(-3, 3, n), rng.uniform(-8, 8, n), rng.uniform(-2, 2, n)]
        limits = np.finfo(real)
        edges = [
            0.0,
            -0.0,
            math.inf,
            -math.inf,
            math.nan,
            limits.smallest_subnormal,
            limits.tiny,
            limits.max,
            1.0,
            -1.0,
        ]
        drawn[fmt] = tuple(
            np.concatenate([each.astype(real) for each in (*parts, np.array(ends))])
            for parts, ends in ((x, edges), (y, edges[::-1]))
        )
    return drawn


@FORMATS
@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_printed_c_has_the_bits_of_the_program(
    compiled: dict[Format, ctypes.CDLL], arguments: Arguments, name: str, fmt: Format
) -> None:
    x, y = arguments[fmt]
    program = procedure(name, fmt)
    (result, *_), fine = evaluated(program, *arguments[fmt][: program.inputs])
    assert np.all(same(result, called(compiled, name, x, y))[fine])
    assert fine.sum() > x.size / 8


# The last argument that the fast path takes, and the next one.
EDGES = {
    DOUBLE: {
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
    },
    SINGLE: {
        **dict.fromkeys(("exp", "expm1", "cosh", "sinh"), (np.nextafter(np.float32(87), np.float32(0)), 87.0)),
        "log": (2.0**-126, 2.0**-126 - 2.0**-149),
        "log1p": (2.0**100 - 2.0**76, 2.0**100),
        **dict.fromkeys(("sin", "cos", "tan"), (2.0**13 - 2.0**-11, 2.0**13)),
        **dict.fromkeys(("pow_m1_3", "pow_p2_3"), (2.0**100 - 2.0**76, 2.0**100)),
        **dict.fromkeys(("pow_m2_3", "pow_p1_3"), (2.0**-100, 2.0**-100 - 2.0**-124)),
    },
}
CLOSE = {DOUBLE: (3e-12, 1e-9), SINGLE: (1e-5, 2e-2)}
"""How near the results on both sides of an edge are: what the functions do in between, and of large angles."""


@FORMATS
@pytest.mark.parametrize("name", EDGES[DOUBLE])
def test_the_fast_path_ends_where_it_should(compiled: dict[Format, ctypes.CDLL], name: str, fmt: Format) -> None:
    """Both sides of the edge are equally good, so that nobody sees it."""
    x = np.array([*EDGES[fmt][name], math.nan, math.inf, -math.inf], REALS[fmt])
    _, fine = evaluated(procedure(name, fmt), x)
    assert fine.tolist() == [True, False, False, False, False]
    inside, outside = called(compiled, name, x, x)[:2]
    close, of_angles = CLOSE[fmt]
    assert inside == pytest.approx(outside, rel=of_angles if name in {"sin", "cos", "tan"} else close)


@FORMATS
@pytest.mark.parametrize("name", ["sin", "tan", "sinh", "tanh", "atan", "asin", "cbrt", "sign"])
def test_odd_functions_are_odd_to_the_bit(
    compiled: dict[Format, ctypes.CDLL], arguments: Arguments, name: str, fmt: Format
) -> None:
    x = arguments[fmt][0]
    assert np.all(same(called(compiled, name, -x, x), -called(compiled, name, x, x)))


@FORMATS
@pytest.mark.parametrize("name", ["cos", "cosh", "fabs"])
def test_even_functions_are_even_to_the_bit(
    compiled: dict[Format, ctypes.CDLL], arguments: Arguments, name: str, fmt: Format
) -> None:
    x = arguments[fmt][0]
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


def both(script: ModuleType, polynomial: Any) -> tuple[Any, Any]:
    return script.coefficients(polynomial), script.coefficients(polynomial, single=True)


def printed(name: str) -> tuple[Any, Any]:
    """Those of doubles and those of floats; () where a format does without."""
    found = getattr(coefficients, name)
    if isinstance(found, Both):
        return found.double, found.single
    return ((), found) if all(map(SINGLE.holds, found)) else (found, ())


def test_coefficients_are_those_of_the_script(script: ModuleType) -> None:
    for name, polynomial in found(script).items():
        if name not in LONG:
            assert both(script, polynomial) == printed(name), name


@pytest.mark.full
@pytest.mark.parametrize("name", LONG)
def test_long_polynomials_are_those_of_the_script(script: ModuleType, name: str) -> None:
    assert both(script, found(script)[name]) == printed(name)


def test_no_other_polynomial_stands_there(script: ModuleType) -> None:
    assert {name for name in vars(coefficients) if name.isupper()} == set(found(script))


@FORMATS
def test_cube_roots_start_within_the_range_of_their_polynomial(script: ModuleType, fmt: Format) -> None:
    """x y^3 repeats with every factor of 8. Floats overshoot by what the digits that they keep do not show."""
    program = procedure("pow_m1_3", fmt)
    (place,) = (place for place, name in program.names.items() if name == "u")
    inner = Procedure(program.steps, (place,), None, 1, format=fmt)
    (u,), _ = evaluated(inner, np.linspace(1.0, 8.0, 100_001, dtype=REALS[fmt]))
    margin = 0.0 if fmt is DOUBLE else 2e-4
    assert float(script.START.low) - margin < u.min() < 2.67 and 3.15 < u.max() < float(script.START.high) + margin


def test_floats_round_the_start_of_a_cube_root_to_few_digits() -> None:
    """So that its cube is exact, which the error of the float functions rests on."""
    program = procedure("pow_m1_3", SINGLE)
    (place,) = (place for place, name in program.names.items() if name == "short_y")
    x = np.exp(np.random.default_rng(5).uniform(-60, 60, 20_000)).astype(np.float32)
    (y,), _ = evaluated(Procedure(program.steps, (place,), None, 1, format=SINGLE), x)
    assert np.all(y * y * y == y.astype(float) ** 3)
    h = 1.0 - x.astype(float) * y.astype(float) ** 3
    assert 1.15e-2 < np.abs(h).max() < 1.18e-2


def test_a_float_takes_no_constant_that_it_cannot_hold() -> None:
    assert SINGLE.holds(0.5) and not SINGLE.holds(0.1) and DOUBLE.holds(0.1)
    for name in FUNCTIONS:
        for step in procedure(name, SINGLE).steps:
            assert step.op is not Op.REAL_CONSTANT or np.isinf(step.number) or SINGLE.holds(step.number), name
            assert step.op is not Op.BITS_CONSTANT or 0 <= step.number < 2**32, name
