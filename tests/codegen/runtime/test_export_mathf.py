"""sl_mathf.h: accuracy over the float range, special values of C99 Annex F, the same bits from every compiler."""

import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from springline.codegen.elementary import float_header
from springline.codegen.kernel import toolchain

ROOTS = ("sqrt", "sqrt_soft", "pow_p1_3", "pow_m1_3", "pow_p2_3", "pow_m2_3", "pow_p1_2", "pow_m1_2")
ONE = ("exp", "expm1", "log", "log1p", "sin", "cos", "tan", "floor", "ceil", *ROOTS)
TWO = ("pow", "hypot", "fmin", "fmax", "copysign")
LOOP = """
void v_{name}({arguments}, float *r, int n);
void v_{name}({arguments}, float *r, int n) {{
  int i;
  for (i = 0; i < n; i++) r[i] = slf_{name}({operands});
}}
"""
SOURCE = '#include "sl_mathf.h"\n' + "".join(
    [LOOP.format(name=name, arguments="const float *x", operands="x[i]") for name in ONE]
    + [LOOP.format(name=name, arguments="const float *x, const float *y", operands="x[i], y[i]") for name in TWO]
)
REFERENCE: dict[str, Callable[..., np.ndarray]] = {
    "sqrt_soft": np.sqrt,
    "pow_p1_3": np.cbrt,
    "pow_m1_3": lambda x: 1 / np.cbrt(x),
    "pow_p2_3": lambda x: np.cbrt(x) ** 2,
    "pow_m2_3": lambda x: np.cbrt(x) ** -2,
    "pow_p1_2": np.sqrt,
    "pow_m1_2": lambda x: 1 / np.sqrt(x),
    "pow": np.power,
}
BOUNDS = {"sqrt": 0.5, "sqrt_soft": 0.5, "pow_p1_2": 0.5, "floor": 0.0, "ceil": 0.0}


class Functions:
    def __init__(self, *flags: str, compiler: toolchain.Compiler | None = None) -> None:
        sources = {"v.c": SOURCE, "sl_mathf.h": float_header()}
        self._library = toolchain.load(toolchain.build_library(sources, main="v.c", flags=flags, compiler=compiler))

    def __call__(self, name: str, *arguments: np.ndarray) -> np.ndarray:
        arrays = [np.ascontiguousarray(x, np.float32) for x in arguments]
        result = np.empty_like(arrays[0])
        pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*arrays, result)]
        self._library[f"v_{name}"](*pointers, len(result))
        return result


@pytest.fixture(scope="module")
def functions() -> Functions:
    return Functions()


def every(count: int, seed: int = 1) -> np.ndarray:
    """Floats of every size: uniform in their bits."""
    bits = np.random.default_rng(seed).integers(0, 2**32, count, dtype=np.uint32)
    x = bits.view(np.float32)
    return x[np.isfinite(x)]


def errors_in_ulp(got: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """Of finite results; a result that should be NaN or infinite and is not counts as infinite error."""
    with np.errstate(all="ignore"):
        single = exact.astype(np.float32)
        size = np.spacing(np.maximum(np.abs(single), np.float32(2.0**-126))).astype(float)
        error = np.abs(got.astype(float) - exact) / size
    same = (np.isnan(got) & np.isnan(exact)) | (got == single)
    overflow = np.isinf(got) & (np.abs(exact) > 3.4028e38)
    return np.where(same | overflow, np.where(np.isfinite(error), np.minimum(error, 0.5), 0.0), error)


@pytest.mark.parametrize("name", ONE)
def test_accuracy(name: str, functions: Functions) -> None:
    x = np.concatenate([every(400_000), np.random.default_rng(2).normal(size=200_000).astype(np.float32)])
    if name.startswith("pow"):
        x = np.abs(x)
    with np.errstate(all="ignore"):
        exact = REFERENCE.get(name, getattr(np, name, None))(x.astype(float))
    error = errors_in_ulp(functions(name, x), exact)
    assert error.max() <= BOUNDS.get(name, 1.5), (x[error.argmax()], error.max())


def test_accuracy_of_pow(functions: Functions) -> None:
    random = np.random.default_rng(3)
    x = np.concatenate([np.abs(every(400_000, 4)), random.uniform(0.5, 2, 200_000)]).astype(np.float32)
    y = np.concatenate([random.normal(size=len(x) // 2) * 4, every(len(x), 5)])[: len(x)].astype(np.float32)
    with np.errstate(all="ignore"):
        exact = np.power(x.astype(float), y.astype(float))
    listed = np.abs(np.abs(y) - np.float32(1 / 3)) == 0
    error = errors_in_ulp(functions("pow", x, y), exact)[~listed]
    assert error.max() <= 1.5


# Every float, against the C library's double: 2^31 of them where the other sign says nothing new.
EVERYWHERE = {
    "exp": ("exp(x)", 2**32), "expm1": ("expm1(x)", 2**32), "log": ("log(x)", 2**31), "log1p": ("log1p(x)", 2**32),
    "sin": ("sin(x)", 2**31), "cos": ("cos(x)", 2**31), "tan": ("tan(x)", 2**31), "pow_p1_3": ("cbrt(x)", 2**31),
    "pow_m1_3": ("1.0 / cbrt(x)", 2**31), "pow_p2_3": ("cbrt(x) * cbrt(x)", 2**31),
    "pow_m2_3": ("1.0 / (cbrt(x) * cbrt(x))", 2**31), "pow_m1_2": ("1.0 / sqrt(x)", 2**31),
}  # fmt: skip
WORST = """
#include "sl_mathf.h"
#include <math.h>
#include <string.h>

/* The largest error in units in the last place of {exact}, and where; what is rounded correctly counts as none. */
double worst(uint64_t count, uint32_t *where);
double worst(uint64_t count, uint32_t *where) {{
  double most = 0.0;
  uint64_t i;
  for (i = 0; i < count; i++) {{
    const float argument = slf_real((uint32_t)i), got = slf_{name}(argument);
    const double x = argument, exact = {exact};
    double error = HUGE_VAL, unit;
    uint64_t bits;
    if (got == (float)exact || (got != got && exact != exact)) continue;
    memcpy(&bits, &exact, sizeof bits);
    bits = (bits >> 52) & 0x7ff;
    bits = (2069 - (bits < 897 ? 897 : bits)) << 52;
    memcpy(&unit, &bits, sizeof unit); /* one over the last place of a float so large */
    if (got - got == 0.0f && fabs(exact) < 0x1.ffffffp127) error = fabs(got - exact) * unit;
    if (error > most) {{
      most = error;
      *where = (uint32_t)i;
    }}
  }}
  return most;
}}
"""


@pytest.mark.full
@pytest.mark.parametrize("name", EVERYWHERE)
def test_the_error_at_every_float(name: str) -> None:
    exact, count = EVERYWHERE[name]
    sources = {"worst.c": WORST.format(name=name, exact=exact), "sl_mathf.h": float_header()}
    library = toolchain.load(toolchain.build_library(sources, main="worst.c", flags=("-std=gnu99", "-O2", "-lm")))
    library.worst.restype, where = ctypes.c_double, ctypes.c_uint32()
    error = library.worst(ctypes.c_uint64(count), ctypes.byref(where))
    print(f"{name}: {error:.3f} ulp at {where.value:#010x}")
    assert error <= 2.0


INF, NAN = np.inf, np.nan


@pytest.mark.parametrize(
    ("name", "x", "expected"),
    [
        ("exp", [0.0, -0.0, INF, -INF, 200.0, -200.0, NAN], [1, 1, INF, 0, INF, 0, NAN]),
        ("expm1", [0.0, -0.0, INF, -INF, NAN], [0.0, -0.0, INF, -1, NAN]),
        ("log", [1.0, 0.0, -0.0, -1.0, INF, NAN], [0.0, -INF, -INF, NAN, INF, NAN]),
        ("log1p", [0.0, -0.0, -1.0, -2.0, INF, NAN], [0.0, -0.0, -INF, NAN, INF, NAN]),
        ("sin", [0.0, -0.0, INF, NAN], [0.0, -0.0, NAN, NAN]),
        ("cos", [0.0, INF, NAN], [1, NAN, NAN]),
        ("tan", [0.0, -0.0, INF], [0.0, -0.0, NAN]),
        ("sqrt", [0.0, -0.0, -1.0, INF, NAN], [0.0, -0.0, NAN, INF, NAN]),
        ("sqrt_soft", [0.0, -0.0, -1.0, INF, NAN], [0.0, -0.0, NAN, INF, NAN]),
        ("floor", [-0.0, -0.5, 2.5, INF, NAN], [-0.0, -1, 2, INF, NAN]),
        ("ceil", [-0.0, -0.5, 2.5, INF, NAN], [-0.0, -0.0, 3, INF, NAN]),
        ("pow_p1_3", [0.0, 8.0, INF, -1.0, NAN], [0, 2, INF, NAN, NAN]),
        ("pow_m1_3", [0.0, 8.0, INF, -1.0], [INF, 0.5, 0, NAN]),
        ("pow_p2_3", [0.0, 8.0, INF], [0, 4, INF]),
        ("pow_m2_3", [0.0, 8.0, INF], [INF, 0.25, 0]),
        ("pow_p1_2", [-0.0, -INF, 4.0], [0.0, INF, 2]),
    ],
)
def test_special_values(name: str, x: list[float], expected: list[float], functions: Functions) -> None:
    got, wanted = functions(name, np.array(x)), np.array(expected, np.float32)
    np.testing.assert_array_equal(got, wanted)
    zeros = wanted == 0
    np.testing.assert_array_equal(np.signbit(got[zeros]), np.signbit(wanted[zeros]))


def test_special_values_of_pow_are_those_of_c(functions: Functions) -> None:
    special = np.array([0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 2.0, -2.0, 3.0, -3.0, 2.5, INF, -INF, NAN, 1e30, 1e-42, 7.0])
    x, y = (part.ravel().astype(np.float32) for part in np.meshgrid(special, special))
    with np.errstate(all="ignore"):
        exact = np.power(x.astype(float), y.astype(float))  # NumPy's is C's
        zeros = exact.astype(np.float32) == 0
    got = functions("pow", x, y)
    assert errors_in_ulp(got, exact).max() <= 1.5
    np.testing.assert_array_equal(np.signbit(got[zeros]), np.signbit(exact[zeros]))


def test_minimum_and_maximum_take_the_second_of_what_cannot_be_compared(functions: Functions) -> None:
    x, y = np.array([NAN, 1.0, 0.0, -0.0]), np.array([2.0, NAN, -0.0, 0.0])
    for name in ("fmin", "fmax"):
        np.testing.assert_array_equal(functions(name, x, y), y.astype(np.float32))


def test_the_same_bits_from_every_compiler(functions: Functions, require_tool: Callable[..., str]) -> None:
    clang = toolchain.probe_compiler([require_tool("clang")])
    others = [Functions("-O0"), Functions("-O3", "-march=native"), Functions("-O2", "-DSL_SOFT_SQRT")]
    others.append(Functions("-O3", compiler=clang))
    x, y = every(100_000, 7), every(100_000, 8)
    count = min(len(x), len(y))
    for name in (*ONE, *TWO):
        arguments = (x[:count],) if name in ONE else (x[:count], y[:count])
        expected = functions(name, *arguments)
        for other in others:
            got = other(name, *arguments)
            both_nan = np.isnan(got) & np.isnan(expected)
            assert (both_nan | (got.view(np.uint32) == expected.view(np.uint32))).all(), name
