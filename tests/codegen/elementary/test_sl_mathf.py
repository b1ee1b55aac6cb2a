"""sl_mathf.h: accuracy over the float range, special values of C99 Annex F, the same bits from every compiler."""

import ctypes
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from springline.codegen.elementary import float_header
from springline.codegen.elementary.functions import FUNCTIONS
from springline.codegen.kernel import toolchain

ROOT = Path(__file__).parents[3]
ROOTS = ("sqrt", "sqrt_soft", "pow_p1_3", "pow_m1_3", "pow_p2_3", "pow_m2_3", "pow_p1_2", "pow_m1_2")
ARCS = {"atan": "arctan", "asin": "arcsin", "acos": "arccos"}
ONE = ("exp", "expm1", "sinh", "cosh", "tanh", "log", "log1p", "sin", "cos", "tan", *ARCS, "floor", "ceil", "cbrt")
ONE += ROOTS
EVERYWHERE = (*ONE, "pow_p3_2", "pow_m1", "pow_p2", "pow_p3")
TWO = ("pow", "hypot", "atan2", "fmin", "fmax", "copysign")
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
    **{name: getattr(np, numpys) for name, numpys in ARCS.items()},
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
    if name in ("asin", "acos"):
        x = np.concatenate([x, np.random.default_rng(9).uniform(-1, 1, 200_000).astype(np.float32)])
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


@pytest.mark.parametrize(("name", "exact"), [("hypot", np.hypot), ("atan2", np.arctan2)])
def test_accuracy_of_pairs(name: str, exact: Callable[..., np.ndarray], functions: Functions) -> None:
    random = np.random.default_rng(6)
    parts = ((every(200_000, 10), every(200_000, 11)), random.uniform(-2, 2, (2, 200_000)).astype(np.float32))
    for first, second in parts:
        count = min(len(first), len(second))
        x, y = first[:count], second[:count]
        with np.errstate(all="ignore"):
            wanted = exact(x.astype(float), y.astype(float))
        assert errors_in_ulp(functions(name, x, y), wanted).max() <= 1.6


# --- every float -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("float_accuracy", ROOT / "benchmarks" / "float_accuracy.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def documented(row: tuple[str, ...]) -> bool:
    table = (ROOT / "docs" / "math.md").read_text().partition("<!-- floats: begin -->")[2]
    return f"| {' | '.join(row)} |" in table


@pytest.mark.full
@pytest.mark.parametrize("name", EVERYWHERE)
def test_the_error_at_every_float_is_the_documented_one(script: ModuleType, name: str) -> None:
    row = script.at_every_float(name)
    print(*row.cells())
    assert row.error <= 1.6
    assert documented(row.cells()), f"docs/math.md: {row.cells()}"


@pytest.mark.full
def test_the_errors_at_many_pairs_are_the_documented_ones(script: ModuleType) -> None:
    for index in range(len(script.TWO)):
        row = script.at_pairs(index)
        assert row.error <= 1.6 and documented(row.cells()), f"docs/math.md: {row.cells()}"


def test_every_function_of_one_argument_is_measured(script: ModuleType) -> None:
    """But for those whose program is a single exact operation."""
    trivial = {"fabs", "sign", "sq", "sincos", "pow_p1"}
    one = {name for name, (_, inputs) in FUNCTIONS.items() if inputs == 1} - trivial
    assert one | {"sqrt", "sqrt_soft"} == set(script.ONE) == set(EVERYWHERE)


def test_the_measurement_sees_what_is_wrong(script: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """A coefficient changed in its last digits; the sign of a zero; a NaN too many."""
    header = float_header()
    exp = header.index("static inline float slf_exp(")
    for old, new in (
        ("0x1.555554p-3f", "0x1.5555f4p-3f"),
        ("return result;", "return (x == 0.5f) ? SLF_NAN : result;"),
        ("return result;", "return (x < -200.0f) ? -0.0f : result;"),
    ):
        changed = header[:exp] + header[exp:].replace(old, new, 1)
        monkeypatch.setattr(script, "float_header", lambda changed=changed: changed)
        monkeypatch.setattr(script, "CHUNK", 2**26)
        assert script.at_every_float("exp", 2**26 * 14, 2**26 * 20).error > 0.9, new


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
        ("sinh", [0.0, -0.0, INF, -INF, 100.0, -100.0, NAN], [0.0, -0.0, INF, -INF, INF, -INF, NAN]),
        ("cosh", [0.0, -0.0, INF, -INF, 100.0, NAN], [1, 1, INF, INF, INF, NAN]),
        ("tanh", [0.0, -0.0, INF, -INF, NAN], [0.0, -0.0, 1, -1, NAN]),
        ("atan", [0.0, -0.0, INF, -INF, NAN], [0.0, -0.0, np.pi / 2, -np.pi / 2, NAN]),
        ("asin", [0.0, -0.0, 1.0, -1.0, 1.5, INF, NAN], [0.0, -0.0, np.pi / 2, -np.pi / 2, NAN, NAN, NAN]),
        ("acos", [1.0, -1.0, 0.0, -1.5, INF, NAN], [0.0, np.pi, np.pi / 2, NAN, NAN, NAN]),
        ("cbrt", [0.0, -0.0, -8.0, INF, -INF, NAN], [0.0, -0.0, -2, INF, -INF, NAN]),
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


@pytest.mark.parametrize(("name", "exact"), [("atan2", np.arctan2), ("hypot", np.hypot)])
def test_special_values_of_pairs_are_those_of_c(
    name: str, exact: Callable[..., np.ndarray], functions: Functions
) -> None:
    special = np.array([0.0, -0.0, 1.0, -1.0, INF, -INF, NAN, 1e38, -1e38, 1e-42, -1e-42])
    x, y = (part.ravel().astype(np.float32) for part in np.meshgrid(special, special))
    with np.errstate(all="ignore"):
        wanted = exact(x.astype(float), y.astype(float))
        zeros = wanted.astype(np.float32) == 0
    got = functions(name, x, y)
    assert errors_in_ulp(got, wanted).max() <= 1.6
    np.testing.assert_array_equal(np.signbit(got[zeros]), np.signbit(wanted[zeros]))


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
