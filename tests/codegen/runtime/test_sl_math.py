"""sl_math.h and sl_lanes.h: special values, errors, and the same bits from every build."""

from __future__ import annotations

import ctypes
import importlib.util
import itertools
import math
import subprocess
import sys
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from springline.codegen.elementary import math_header

Floats = NDArray[np.float64]
Bits = NDArray[np.uint64]
RequireTool = Callable[..., str]

RUNTIME = Path(str(resources.files("springline.codegen"))) / "runtime"
ROOT = Path(__file__).parents[3]

THIRD = 1.0 / 3.0
LISTED = {
    "p1_3": THIRD,
    "m1_3": -THIRD,
    "p2_3": 2.0 * THIRD,
    "m2_3": -2.0 * THIRD,
    "p1_2": 0.5,
    "m1_2": -0.5,
    "p3_2": 1.5,
    "p1": 1.0,
    "m1": -1.0,
    "p2": 2.0,
    "p3": 3.0,
}
CHECKED = ["exp", "expm1", "sinh", "cosh", "log", "log1p", "sin", "cos", "tan", "cbrt"]
CHECKED += [f"pow_{name}" for name in ("p1_3", "m1_3", "p2_3", "m2_3", "p1_2", "m1_2", "p3_2")]
PLAIN = [
    "tanh",
    "atan",
    "asin",
    "acos",
    "sqrt",
    "fabs",
    "sign",
    "floor",
    "ceil",
    "sq",
    "pow_p1",
    "pow_m1",
    "pow_p2",
    "pow_p3",
]
CLOSE = ["exp", "log", "log1p", "sin", "cos", "pow_p1_3", "pow_m1_3", "pow_p2_3"]
CHECKED_PAIRS = ["pow", "hypot", "atan2"]
PLAIN_PAIRS = ["fmin", "fmax", "copysign"]
ONE, TWO = [*CHECKED, *PLAIN], [*CHECKED_PAIRS, *PLAIN_PAIRS]

WARNINGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Wdouble-promotion", "-Werror"]


def source() -> str:
    """s_name and v_name work through arrays with sl_name and slv_name, f_name with slv_name_fast and reports ok."""
    text = ['#include "sl_lanes.h"', "#define ARRAYS const double *x, const double *y, double *r, double *ok, int n"]
    scalar_loop = "(void)y, (void)ok; for (int i = 0; i < n; i++)"
    vector_loop = "(void)y, (void)ok; for (int i = 0; i < n; i += SL_W)"
    for name in [*ONE, *TWO, "sqrt_soft"]:
        scalar = "x[i], y[i]" if name in TWO else "x[i]"
        vector = "slv_load(x + i), slv_load(y + i)" if name in TWO else "slv_load(x + i)"
        text.append(f"void s_{name}(ARRAYS) {{ {scalar_loop} r[i] = sl_{name}({scalar}); }}")
        if name in ONE + TWO:
            text.append(f"void v_{name}(ARRAYS) {{ {vector_loop} slv_store(r + i, slv_{name}({vector})); }}")
        if name in CHECKED + CHECKED_PAIRS:
            text.append(f"void f_{name}(ARRAYS) {{ {vector_loop} {{ sl_m m = slv_yes();")
            text.append(f"  slv_store(r + i, slv_{name}_fast({vector}, &m)); slv_store(ok + i, slv_true(m)); }} }}")
    return "\n".join(text) + "\n"


def compile_library(compiler: str, flags: list[str], folder: Path) -> Path:
    """The functions of source(), in a library of its own that refers to no symbol of another."""
    (folder / "api.c").write_text(source())
    (folder / "sl_math.h").write_text(math_header())
    output = folder / f"{Path(compiler).name}{''.join(flags)}.so".replace("=", "_")
    fixed = ["-std=gnu99", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-Wno-psabi", "-fPIC", "-shared"]
    command = [
        compiler,
        *fixed,
        *flags,
        f"-I{RUNTIME}",
        "-nostdlib",
        "-Wl,-z,defs",
        f"-I{folder}",
        str(folder / "api.c"),
    ]
    done = subprocess.run([*command, "-o", str(output)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return output


def call(library: ctypes.CDLL, name: str, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Results and ok of one array function; lengths are a multiple of 16."""
    result, ok = np.zeros_like(x), np.ones_like(x)
    arrays = (ctypes.c_void_p(np.ascontiguousarray(a).ctypes.data) for a in (x, y, result, ok))
    getattr(library, name)(*arrays, ctypes.c_int(x.size))
    return result, ok


def bits(values: Floats) -> Bits:
    """The bits, every NaN the same: sign and payload of a NaN are not promised."""
    return np.where(np.isnan(values), np.nan, values).view(np.uint64)


def padded(values: list[float]) -> Floats:
    return np.array(values + [1.0] * (-len(values) % 16))


SPECIAL = [0.0, math.inf, math.nan, 1.0, 2.0, 3.0, 0.5, 1.5, THIRD, 2 * THIRD, 5e-324, sys.float_info.min]
SPECIAL += [sys.float_info.max, 0.75, 8.0, 709.0, 710.0, 746.0, 1e5, 131072.0, 1e22, 2.0**53 - 1, 2.0**53, 1e-30]
SPECIAL += [math.pi / 2, 0.9, math.nextafter(1, 2), math.nextafter(1, 0), math.nextafter(THIRD, 1), 1e-310]
SPECIAL += [-value for value in SPECIAL]


@pytest.fixture(scope="module")
def arguments() -> tuple[Floats, Floats]:
    """Every pair of special values, any bit pattern, and the ranges where the functions work."""
    rng = np.random.default_rng(11)
    n = 2048
    pairs = np.array(list(itertools.product(SPECIAL, SPECIAL)))
    x = [pairs[:, 0], rng.integers(0, 2**64, n, np.uint64).view(np.float64), rng.uniform(-10, 10, n)]
    y = [pairs[:, 1], rng.integers(0, 2**64, n, np.uint64).view(np.float64), rng.uniform(-10, 10, n)]
    x += [np.exp(rng.uniform(-40, 40, n)), rng.uniform(-800, 800, n), rng.uniform(-2e5, 2e5, n)]
    y += [rng.uniform(-8, 8, n), rng.choice(SPECIAL, n), rng.choice(list(LISTED.values()), n)]
    length = sum(len(part) for part in x) // 16 * 16
    return np.concatenate(x)[:length], np.concatenate(y)[:length]


@pytest.fixture(scope="module")
def reference(require_tool: RequireTool, once: Callable[[str, Callable[[Path], object]], Path]) -> ctypes.CDLL:
    gcc = require_tool("gcc")

    def make(folder: Path) -> None:
        folder.mkdir()
        compile_library(gcc, ["-O2", "-DSL_W=4"], folder)

    (library,) = once("sl_math", make).glob("*.so")
    return ctypes.CDLL(str(library))


@pytest.fixture(scope="module")
def expected(reference: ctypes.CDLL, arguments: tuple[Floats, Floats]) -> dict[str, Bits]:
    """The scalar functions' results, as bits."""
    return {name: bits(call(reference, f"s_{name}", *arguments)[0]) for name in ONE + TWO}


# --- special values: C99 Annex F ---------------------------------------------------------------------------

INF, NAN, MAX = math.inf, math.nan, sys.float_info.max
ZEROS = (0.0, -0.0)
ODD = ("sqrt", "sin", "tan", "expm1", "log1p", "cbrt", "floor", "ceil", "sinh", "tanh", "atan", "asin")
PI = math.pi

ANNEX_F_ONE: list[tuple[str, float, float]] = [
    *((name, zero, zero) for name in ODD for zero in ZEROS),
    *((name, INF, INF) for name in ("sqrt", "exp", "expm1", "log", "log1p", "cbrt", "floor", "ceil", "fabs")),
    *((name, NAN, NAN) for name in ONE),
    *((name, -INF, -INF) for name in ("cbrt", "floor", "ceil")),
    *((name, x, NAN) for name in ("sin", "cos", "tan") for x in (INF, -INF)),
    *((name, x, NAN) for name in ("sqrt", "log") for x in (-1.0, -5e-324, -INF)),
    *(("cos", zero, 1.0) for zero in ZEROS),
    *(("exp", zero, 1.0) for zero in ZEROS),
    *((name, x, NAN) for name in ("asin", "acos") for x in (1.5, -math.nextafter(1, 2), INF, -INF)),
    *(("cosh", x, INF) for x in (INF, -INF, 711.0)),
    ("cosh", -0.0, 1.0),
    *(("sinh", x, x) for x in (INF, -INF, 5e-324, -1e-310)),
    ("sinh", -711.0, -INF),
    *(("tanh", x, math.copysign(1.0, x)) for x in (INF, -INF, 1e300, -40.0)),
    ("tanh", -5e-324, -5e-324),
    *(("atan", x, math.copysign(PI / 2, x)) for x in (INF, -INF, 1e300, -1e17)),
    ("atan", 1.0, PI / 4),
    ("asin", 1.0, PI / 2),
    ("asin", -1.0, -PI / 2),
    ("acos", 1.0, 0.0),
    ("acos", 0.0, PI / 2),
    ("acos", -1.0, PI),
    ("exp", -INF, 0.0),
    ("exp", 710.0, INF),
    ("exp", -746.0, 0.0),
    ("exp", -745.0, 5e-324),
    ("expm1", -INF, -1.0),
    ("expm1", -800.0, -1.0),
    ("expm1", 5e-324, 5e-324),
    ("log", 1.0, 0.0),
    ("log", 0.0, -INF),
    ("log", -0.0, -INF),
    ("log1p", -1.0, -INF),
    ("log1p", -1.5, NAN),
    ("log1p", -INF, NAN),
    ("log1p", -5e-324, -5e-324),
    ("cbrt", -8.0, -2.0),
    ("cbrt", -27.0, -3.0),
    ("fabs", -0.0, 0.0),
    ("fabs", -INF, INF),
    ("sign", -0.0, -0.0),
    ("sign", -5e-324, -1.0),
    ("sign", INF, 1.0),
    ("floor", -0.5, -1.0),
    ("floor", 0.5, 0.0),
    ("floor", 2.0**52 + 1.0, 2.0**52 + 1.0),
    ("floor", 2.5, 2.0),
    ("ceil", -0.5, -0.0),
    ("ceil", 2.5, 3.0),
    ("ceil", -(2.0**51) - 0.5, -(2.0**51)),
]

ANNEX_F_TWO: list[tuple[str, float, float, float]] = [
    *(("pow", zero, y, math.copysign(INF, zero)) for zero in ZEROS for y in (-1.0, -3.0, -5.0)),
    *(("pow", zero, y, INF) for zero in ZEROS for y in (-2.0, -0.5, -THIRD, -2.0 * THIRD, -1.7, -1e300, -INF)),
    *(("pow", zero, y, zero) for zero in ZEROS for y in (1.0, 3.0, 5.0)),
    *(("pow", zero, y, 0.0) for zero in ZEROS for y in (2.0, 0.5, 1.5, THIRD, 2.0 * THIRD, 0.3, 1e300, INF)),
    *(("pow", -1.0, y, 1.0) for y in (INF, -INF)),
    *(("pow", 1.0, y, 1.0) for y in (0.0, INF, -INF, NAN, 0.5, THIRD, -2.5, 1e300)),
    *(("pow", x, zero, 1.0) for x in (0.0, -0.0, INF, -INF, NAN, -3.0, 5e-324) for zero in ZEROS),
    *(("pow", x, y, NAN) for x in (-2.0, -5e-324, -MAX) for y in (0.5, 1.5, THIRD, -2.0 * THIRD, 2.5, -0.1)),
    *(("pow", x, -INF, INF) for x in (0.5, -0.5, 0.0)),
    *(("pow", x, -INF, 0.0) for x in (2.0, -2.0, INF, -INF)),
    *(("pow", x, INF, 0.0) for x in (0.5, -0.5, 0.0)),
    *(("pow", x, INF, INF) for x in (2.0, -2.0, INF, -INF)),
    *(("pow", -INF, y, -0.0) for y in (-1.0, -3.0, -5.0)),
    *(("pow", -INF, y, 0.0) for y in (-2.0, -0.5, -THIRD, -2.0 * THIRD, -2.5)),
    *(("pow", -INF, y, -INF) for y in (1.0, 3.0, 5.0)),
    *(("pow", -INF, y, INF) for y in (2.0, 0.5, 1.5, THIRD, 2.0 * THIRD, 2.5)),
    *(("pow", INF, y, 0.0) for y in (-1.0, -0.5, -THIRD, -2.5)),
    *(("pow", INF, y, INF) for y in (1.0, 0.5, 1.5, THIRD, 2.5)),
    *(("pow", NAN, y, NAN) for y in (1.0, 0.5, THIRD, 2.5, INF)),
    *(("pow", x, NAN, NAN) for x in (0.0, -1.0, 2.0, INF)),
    ("pow", -8.0, 5.0, -32768.0),
    ("pow", -2.0, 4.0, 16.0),
    ("pow", -2.0, 2.0**53 - 1, -INF),
    ("pow", -2.0, 2.0**53, INF),
    ("pow", -0.5, 1e300, 0.0),
    ("pow", 2.0, -1074.0, 5e-324),
    ("pow", 2.0, -1080.0, 0.0),
    ("pow", 2.0, 1023.0, 2.0**1023),
    ("pow", 2.0, 1024.0, INF),
    ("pow", 5e-324, 0.5, 2.0**-537),
    ("pow", 10.0, 2.0, 100.0),
    *(("hypot", x, y, INF) for x in (INF, -INF) for y in (NAN, 0.0, 1.0, -INF)),
    *(("atan2", zero, x, zero) for zero in ZEROS for x in (0.0, 5e-324, 2.0, INF)),
    *(("atan2", zero, x, math.copysign(PI, zero)) for zero in ZEROS for x in (-0.0, -5e-324, -2.0, -INF)),
    *(("atan2", y, zero, math.copysign(PI / 2, y)) for y in (5e-324, -3.0, INF, -INF) for zero in ZEROS),
    *(("atan2", y, -INF, math.copysign(PI, y)) for y in (2.0, -MAX)),
    *(("atan2", y, INF, math.copysign(0.0, y)) for y in (2.0, -MAX)),
    *(("atan2", y, x, math.copysign(PI / 2, y)) for y in (INF, -INF) for x in (1.0, -MAX)),
    *(("atan2", y, INF, math.copysign(PI / 4, y)) for y in (INF, -INF)),
    *(("atan2", y, -INF, math.copysign(0.75 * PI, y)) for y in (INF, -INF)),
    *(("atan2", y, x, NAN) for y, x in ((NAN, 1.0), (0.0, NAN), (INF, NAN))),
    ("atan2", 5e-324, 5e-324, PI / 4),
    ("atan2", MAX, -MAX, 0.75 * PI),
    ("atan2", 5e-324, MAX, 0.0),
    ("hypot", NAN, 1.0, NAN),
    ("hypot", -0.0, 0.0, 0.0),
    ("hypot", 3e300, 4e300, 5e300),
    ("hypot", MAX, MAX, INF),
    ("fmin", NAN, 1.0, 1.0),
    ("fmin", 1.0, NAN, NAN),
    ("fmax", NAN, 1.0, 1.0),
    ("fmax", 1.0, NAN, NAN),
    ("fmin", 0.0, -0.0, -0.0),
    ("fmax", -0.0, 0.0, 0.0),
    ("copysign", 3.0, -0.0, -3.0),
]


@pytest.mark.parametrize("kind", ["s", "v"])
@pytest.mark.parametrize("name", sorted({row[0] for row in ANNEX_F_ONE + ANNEX_F_TWO}))
def test_special_values(reference: ctypes.CDLL, kind: str, name: str) -> None:
    cases = [(x, 0.0, r) for n, x, r in ANNEX_F_ONE if n == name] + [row[1:] for row in ANNEX_F_TWO if row[0] == name]
    x, y, wanted = (padded([case[k] for case in cases]) for k in range(3))
    result = call(reference, f"{kind}_{name}", x, y)[0]
    wrong = np.flatnonzero(bits(result)[: len(cases)] != bits(wanted)[: len(cases)])
    assert [(cases[i], float(result[i])) for i in wrong] == []


def test_software_root_is_the_instructions(reference: ctypes.CDLL, arguments: tuple[Floats, Floats]) -> None:
    x = np.concatenate([arguments[0], np.abs(arguments[0])])
    assert np.array_equal(*(bits(call(reference, f"s_{name}", x, x)[0]) for name in ("sqrt", "sqrt_soft")))
    with np.errstate(invalid="ignore"):
        assert np.array_equal(bits(call(reference, "s_sqrt", x, x)[0]), bits(np.sqrt(x)))


# --- errors ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def accuracy() -> ModuleType:
    spec = importlib.util.spec_from_file_location("math_accuracy", ROOT / "benchmarks" / "math_accuracy.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_errors_stay_below_what_the_documentation_promises(accuracy: ModuleType) -> None:
    rows = list(accuracy.measure(samples=400, seed=5))
    assert {row.case.function for row in rows} >= {*CHECKED, *CHECKED_PAIRS, "tanh", "atan", "asin", "acos"}
    assert [row for row in rows if not row.error <= (1.6 if row.case.function in CLOSE else 2.0)] == []


def test_an_error_would_be_seen(accuracy: ModuleType) -> None:
    def wrong(x: Any) -> Any:
        return accuracy.mpmath.exp(x) * (1 + 2**-50)

    case = accuracy.Case("exp", "off by 2^-50", accuracy.uniform(0.0, 1.0), wrong)
    (row,) = accuracy.measure(samples=100, seed=1, cases=(case,))
    assert row.error > 2.0


# --- the rule for pow --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["s", "v"])
@pytest.mark.parametrize("name", LISTED)
def test_pow_is_its_listed_kernel(
    reference: ctypes.CDLL, arguments: tuple[Floats, Floats], name: str, kind: str
) -> None:
    x = arguments[0]
    y = np.full_like(x, LISTED[name])
    by_exponent, by_name = (bits(call(reference, f"{kind}_{f}", x, y)[0]) for f in ("pow", f"pow_{name}"))
    assert np.array_equal(by_exponent, by_name)


# --- equal bits --------------------------------------------------------------------------------------------

MACHINE = ["-march=native"] if sys.platform.startswith("linux") else []
BUILDS = [
    ("gcc", ["-O0", "-DSL_W=1"]),
    ("gcc", ["-O3", "-DSL_W=1", *MACHINE]),
    ("gcc", ["-O0", "-DSL_W=4", *MACHINE]),
    ("gcc", ["-O3", "-DSL_W=4", *MACHINE, "-fschedule-insns", "-fsched-pressure"]),
    ("gcc", ["-O1", "-DSL_W=16", *MACHINE]),
    ("gcc", ["-O2", "-DSL_W=2", "-DSL_SOFT_SQRT"]),
    ("clang", ["-O0", "-DSL_W=2"]),
    ("clang", ["-O3", "-DSL_W=4", *MACHINE]),
    ("clang", ["-O1", "-DSL_W=8", *MACHINE]),
]
ALL_BUILDS = [
    (compiler, [level, f"-DSL_W={width}", *machine])
    for compiler in ("gcc", "clang")
    for level in ("-O0", "-O1", "-O2", "-O3")
    for width in (1, 2, 4, 8, 16)
    for machine in ([], MACHINE, ["-msse4.1"], ["-mavx"])
]


def assert_equal_bits(
    compiler: str, flags: list[str], folder: Path, arguments: tuple[Floats, Floats], expected: dict[str, Bits]
) -> None:
    """Scalar and vector functions give the expected bits, and the fast ones wherever they say ok."""
    library = ctypes.CDLL(str(compile_library(compiler, flags, folder)))
    for name, wanted in expected.items():
        for kind in ("s", "v"):
            differing = np.flatnonzero(bits(call(library, f"{kind}_{name}", *arguments)[0]) != wanted)
            assert differing.size == 0, (name, kind, *(float(a[differing[0]]).hex() for a in arguments))
        if name in CHECKED + CHECKED_PAIRS:
            result, ok = call(library, f"f_{name}", *arguments)
            assert np.array_equal(bits(result)[ok == 1.0], wanted[ok == 1.0]), name


@pytest.mark.parametrize(("compiler", "flags"), BUILDS, ids="".join)
def test_equal_bits(
    compiler: str,
    flags: list[str],
    require_tool: RequireTool,
    tmp_path: Path,
    arguments: tuple[Floats, Floats],
    expected: dict[str, Bits],
) -> None:
    assert_equal_bits(require_tool(compiler), flags, tmp_path, arguments, expected)


@pytest.mark.full
@pytest.mark.parametrize(("compiler", "flags"), ALL_BUILDS, ids="".join)
def test_equal_bits_of_all_builds(
    compiler: str,
    flags: list[str],
    require_tool: RequireTool,
    tmp_path: Path,
    arguments: tuple[Floats, Floats],
    expected: dict[str, Bits],
) -> None:
    assert_equal_bits(require_tool(compiler), flags, tmp_path, arguments, expected)


def test_fast_functions_vouch_for_the_common_case(reference: ctypes.CDLL) -> None:
    rng = np.random.default_rng(3)
    x, y = np.exp(rng.uniform(-20, 6, 4096)), rng.uniform(0.2, 3.0, 4096)
    for name in CHECKED + CHECKED_PAIRS:
        assert np.all(call(reference, f"f_{name}", x, y)[1] == 1.0), name


def test_a_rare_lane_leaves_its_neighbours_alone(reference: ctypes.CDLL, arguments: tuple[Floats, Floats]) -> None:
    rng = np.random.default_rng(4)
    x, y = (rng.permutation(argument) for argument in arguments)
    for name in ONE + TWO:
        assert np.array_equal(*(bits(call(reference, f"{kind}_{name}", x, y)[0]) for kind in ("s", "v"))), name


# --- the headers as C --------------------------------------------------------------------------------------


def scalar_use() -> str:
    """A strictly conforming file that calls everything in sl_math.h."""
    calls = [f"sl_{name}(x)" for name in ONE] + [f"sl_{name}(x, y)" for name in TWO]
    calls += ["sl_sqrt_soft(x)", "sl_true(sl_isfinite(x))", "sl_if(x < y, x)", "s", "c"]
    body = "double s, c;\n  sl_sincos(x, &s, &c);\n  return " + " +\n    ".join(calls) + ";"
    return f'#include "sl_math.h"\ndouble use(double x, double y);\ndouble use(double x, double y) {{\n  {body}\n}}\n'


@pytest.mark.parametrize("level", ["-O0", "-O1", "-O2", "-O3"])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_scalar_header_is_clean_and_needs_no_library(
    compiler: str, level: str, require_tool: RequireTool, tmp_path: Path
) -> None:
    (tmp_path / "use.c").write_text(scalar_use())
    (tmp_path / "sl_math.h").write_text(math_header())
    command = [require_tool(compiler), *WARNINGS, level, "-ffp-contract=off", "-c", "use.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    symbols = subprocess.run([require_tool("nm"), "use.o"], cwd=tmp_path, capture_output=True, text=True, check=True)
    outside = [line.split()[-1] for line in symbols.stdout.splitlines() if line.split()[-2] in "UBDCG"]
    assert outside == []


@pytest.mark.parametrize("flags", [["-ffast-math"], ["-m32", "-mfpmath=387", "-std=c99"]], ids=["fast-math", "x87"])
def test_arithmetic_that_is_not_ieee_double_is_refused(
    flags: list[str], require_tool: RequireTool, tmp_path: Path
) -> None:
    (tmp_path / "use.c").write_text('#include "sl_math.h"\n')
    (tmp_path / "sl_math.h").write_text(math_header())
    command = [require_tool("gcc"), "-fsyntax-only", "-ffreestanding", *flags, "use.c"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "sl_math.h needs" in done.stderr
