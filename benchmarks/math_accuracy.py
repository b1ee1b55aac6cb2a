"""Largest errors of sl_math.h against mpmath, over the whole double range and where it is hard.

    python -m benchmarks.math_accuracy [--samples N] [--seed N] [--write]

Prints one row per function and range: largest error in units in the last place of the exact result, and where it was
seen. --write puts the table into docs/math.md. The arguments are drawn at random from a seed; the same seed gives the
same table on every machine, because the functions give the same bits there.
"""

from __future__ import annotations

import argparse
import ctypes
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from springline.codegen.elementary import math_header
from springline.codegen.kernel import toolchain
from springline.runner.report import put

Floats = NDArray[np.float64]
Sampler = Callable[[np.random.Generator, int], tuple[Floats, ...]]

DOCUMENT = Path(__file__).parent.parent / "docs" / "math.md"
PRECISION = 160  # bits of the reference; a result can cancel, never this much

TINY, SMALLEST_NORMAL, LARGEST = math.ulp(0.0), sys.float_info.min, sys.float_info.max
LOG_LARGEST = math.log(LARGEST)


@dataclass(frozen=True, slots=True)
class Case:
    """A function on a range of arguments: C name, the range in words, arguments, and the exact function."""

    function: str
    range: str
    sample: Sampler
    exact: Callable[..., Any]


@dataclass(frozen=True, slots=True)
class Row:
    """Largest error (ulp) of one case and the arguments where it was seen."""

    case: Case
    error: float
    where: tuple[float, ...]


def uniform(low: float, high: float) -> Sampler:
    """Evenly between two numbers."""
    return lambda rng, n: (rng.uniform(low, high, n),)


def logarithmic(low: float, high: float, signs: bool = False) -> Sampler:
    """Magnitudes evenly on a logarithmic scale, denormals included; of both signs where asked for."""
    first, last = math.log2(low), math.log2(high)

    def draw(rng: np.random.Generator, n: int) -> tuple[Floats, ...]:
        exponent = rng.uniform(first, last, n)
        size = np.clip(np.ldexp(np.exp2(exponent % 1.0), np.floor(exponent).astype(int)), low, high)
        return (size * rng.choice([-1.0, 1.0], n) if signs else size,)

    return draw


def near(center: float, low: float, high: float) -> Sampler:
    """center (1 + d), d of both signs, its magnitude evenly on a logarithmic scale."""
    offset = logarithmic(low, high, signs=True)
    return lambda rng, n: (center * (1.0 + offset(rng, n)[0]),)


def below_one(rng: np.random.Generator, n: int) -> tuple[Floats, ...]:
    """Magnitudes 1 - d, d evenly on a logarithmic scale, of both signs."""
    return ((1.0 - logarithmic(1e-16, 0.5)(rng, n)[0]) * rng.choice([-1.0, 1.0], n),)


def both(x: Sampler, y: Sampler) -> Sampler:
    """Two independent arguments."""
    return lambda rng, n: (*x(rng, n), *y(rng, n))


def multiples_of_half_pi(largest: int) -> Sampler:
    """The doubles next to random multiples of pi/2, where the reduction cancels most."""

    def draw(rng: np.random.Generator, n: int) -> tuple[Floats, ...]:
        with mpmath.workprec(PRECISION):
            x = np.array([float(int(k) * mpmath.pi / 2) for k in rng.integers(1, largest, n)])
        return (np.where(rng.random(n) < 0.5, x, np.nextafter(x, rng.choice([-np.inf, np.inf], n))),)

    return draw


def powers(x: Sampler, low: float, high: float) -> Sampler:
    """x, and y such that y log x lies between low and high: near overflow or underflow for every x."""

    def draw(rng: np.random.Generator, n: int) -> tuple[Floats, ...]:
        (base,) = x(rng, n)
        base = np.where(base == 1.0, 2.0, base)
        return base, rng.uniform(low, high, n) / np.log(base)

    return draw


def own_exponent(x: Sampler, zeta: float) -> Sampler:
    """x and zeta max(1, x), the power that the paper's reaching law takes (equation 19)."""

    def draw(rng: np.random.Generator, n: int) -> tuple[Floats, ...]:
        (base,) = x(rng, n)
        return base, zeta * np.maximum(1.0, base)

    return draw


def integer_powers(rng: np.random.Generator, n: int) -> tuple[Floats, ...]:
    """Negative x and integers y."""
    return -rng.uniform(0.0, 20.0, n), rng.integers(-40, 40, n).astype(float)


def _cube_root(x: Any) -> Any:
    return mpmath.sign(x) * mpmath.cbrt(abs(x))


POSITIVE = logarithmic(TINY, LARGEST)
ANY = logarithmic(TINY, LARGEST, signs=True)
DENORMAL = logarithmic(TINY, SMALLEST_NORMAL)

CASES: tuple[Case, ...] = (
    Case("sqrt", "all", POSITIVE, mpmath.sqrt),
    Case("sqrt_soft", "all", POSITIVE, mpmath.sqrt),
    Case("exp", "-745 .. 710", uniform(-745.2, 709.78), mpmath.exp),
    Case("exp", "-1 .. 1", uniform(-1.0, 1.0), mpmath.exp),
    Case("exp", "denormal results", uniform(-745.2, -708.0), mpmath.exp),
    Case("exp", "all", ANY, mpmath.exp),
    Case("expm1", "-40 .. 710", uniform(-40.0, 709.78), mpmath.expm1),
    Case("expm1", "-2 .. 2", uniform(-2.0, 2.0), mpmath.expm1),
    Case("expm1", "all", ANY, mpmath.expm1),
    Case("sinh", "-2 .. 2", uniform(-2.0, 2.0), mpmath.sinh),
    Case("sinh", "all below overflow", uniform(-710.47, 710.47), mpmath.sinh),
    Case("sinh", "all", ANY, mpmath.sinh),
    Case("cosh", "-2 .. 2", uniform(-2.0, 2.0), mpmath.cosh),
    Case("cosh", "all below overflow", uniform(-710.47, 710.47), mpmath.cosh),
    Case("tanh", "-2 .. 2", uniform(-2.0, 2.0), mpmath.tanh),
    Case("tanh", "-30 .. 30", uniform(-30.0, 30.0), mpmath.tanh),
    Case("tanh", "all", ANY, mpmath.tanh),
    Case("log", "all", POSITIVE, mpmath.log),
    Case("log", "1/2 .. 2", uniform(0.5, 2.0), mpmath.log),
    Case("log", "next to 1", near(1.0, 1e-16, 0.1), mpmath.log),
    Case("log", "denormal", DENORMAL, mpmath.log),
    Case("log1p", "-1 .. 2", uniform(-1.0, 2.0), mpmath.log1p),
    Case("log1p", "0.3 .. 0.6", uniform(0.3, 0.6), mpmath.log1p),
    Case("log1p", "all above -1", logarithmic(TINY, LARGEST), mpmath.log1p),
    Case("sin", "-10 .. 10", uniform(-10.0, 10.0), mpmath.sin),
    Case("sin", "-1e5 .. 1e5", uniform(-1e5, 1e5), mpmath.sin),
    Case("sin", "next to multiples of pi/2", multiples_of_half_pi(10**6), mpmath.sin),
    Case("sin", "all", ANY, mpmath.sin),
    Case("cos", "-10 .. 10", uniform(-10.0, 10.0), mpmath.cos),
    Case("cos", "-1e5 .. 1e5", uniform(-1e5, 1e5), mpmath.cos),
    Case("cos", "next to multiples of pi/2", multiples_of_half_pi(10**6), mpmath.cos),
    Case("cos", "all", ANY, mpmath.cos),
    Case("tan", "-10 .. 10", uniform(-10.0, 10.0), mpmath.tan),
    Case("tan", "next to multiples of pi/2", multiples_of_half_pi(10**6), mpmath.tan),
    Case("tan", "all", ANY, mpmath.tan),
    Case("atan", "-5 .. 5", uniform(-5.0, 5.0), mpmath.atan),
    Case("atan", "all", ANY, mpmath.atan),
    Case("atan2", "-2 .. 2", both(uniform(-2.0, 2.0), uniform(-2.0, 2.0)), mpmath.atan2),
    Case("atan2", "all", both(ANY, ANY), mpmath.atan2),
    Case("asin", "-1 .. 1", uniform(-1.0, 1.0), mpmath.asin),
    Case("asin", "next to 1", below_one, mpmath.asin),
    Case("asin", "all", logarithmic(TINY, 1.0, signs=True), mpmath.asin),
    Case("acos", "-1 .. 1", uniform(-1.0, 1.0), mpmath.acos),
    Case("acos", "next to 1", below_one, mpmath.acos),
    Case("acos", "all", logarithmic(TINY, 1.0, signs=True), mpmath.acos),
    Case("cbrt", "all", ANY, _cube_root),
    Case("cbrt", "1 .. 8", uniform(1.0, 8.0), _cube_root),
    Case("hypot", "all", both(ANY, ANY), lambda x, y: mpmath.sqrt(x * x + y * y)),
    Case("hypot", "-2 .. 2", both(uniform(-2.0, 2.0), uniform(-2.0, 2.0)), lambda x, y: mpmath.sqrt(x * x + y * y)),
    Case("pow", "x all, y -3 .. 3", both(POSITIVE, uniform(-3.0, 3.0)), mpmath.power),
    Case("pow", "x 0 .. 10, y 0 .. 9", both(uniform(0.0, 10.0), uniform(0.0, 9.0)), mpmath.power),
    Case("pow", "x, 0.9 max(1, x)", own_exponent(logarithmic(1e-10, 1e2), 0.9), mpmath.power),
    Case("pow", "x all, result all", powers(POSITIVE, -745.0, LOG_LARGEST), mpmath.power),
    Case("pow", "x all, denormal results", powers(POSITIVE, -745.0, -708.0), mpmath.power),
    Case("pow", "x 0.9 .. 1.1, result all", powers(uniform(0.9, 1.1), -745.0, LOG_LARGEST), mpmath.power),
    Case("pow", "x 1/2 .. 2, next to overflow", powers(uniform(0.5, 2.0), 700.0, LOG_LARGEST), mpmath.power),
    Case("pow", "x next to 1, next to overflow", powers(near(1.0, 1e-15, 1e-2), 700.0, LOG_LARGEST), mpmath.power),
    Case("pow", "x denormal, y -1 .. 1", both(DENORMAL, uniform(-1.0, 1.0)), mpmath.power),
    Case("pow", "x negative, y integer", integer_powers, mpmath.power),
    Case("pow_p1_3", "all", POSITIVE, mpmath.cbrt),
    Case("pow_m1_3", "all", POSITIVE, lambda x: 1 / mpmath.cbrt(x)),
    Case("pow_p2_3", "all", POSITIVE, lambda x: mpmath.cbrt(x) ** 2),
    Case("pow_m2_3", "all", POSITIVE, lambda x: 1 / mpmath.cbrt(x) ** 2),
    Case("pow_p1_2", "all", POSITIVE, mpmath.sqrt),
    Case("pow_m1_2", "all", POSITIVE, lambda x: 1 / mpmath.sqrt(x)),
    Case("pow_p3_2", "all", POSITIVE, lambda x: x * mpmath.sqrt(x)),
    Case("pow_m1", "all", ANY, lambda x: 1 / x),
    Case("pow_p2", "all", ANY, lambda x: x * x),
    Case("pow_p3", "all", ANY, lambda x: x**3),
)


PAIRS = ("pow", "hypot", "atan2")


def library() -> ctypes.CDLL:
    """array_<name>(x, y, r, n) for every function of CASES, compiled from sl_math.h."""
    lines = ['#include "sl_math.h"']
    for name in sorted({case.function for case in CASES}):
        call = f"sl_{name}(x[i], y[i])" if name in PAIRS else f"sl_{name}(x[i])"
        lines.append(f"void array_{name}(const double *x, const double *y, double *r, int n);")
        lines.append(f"void array_{name}(const double *x, const double *y, double *r, int n) {{")
        lines.append(f"  for (int i = 0; i < n; i++) r[i] = {call};\n  (void)y;\n}}")
    sources = {"sl_math.h": math_header(), "math_accuracy.c": "\n".join(lines) + "\n"}
    return toolchain.load(toolchain.build_library(sources, main="math_accuracy.c"))


def call(functions: ctypes.CDLL, name: str, arguments: tuple[Floats, ...]) -> Floats:
    """The C function's results at `arguments`, arrays of one length."""
    x, y = (np.ascontiguousarray(argument) for argument in (arguments if len(arguments) == 2 else arguments * 2))
    result = np.empty_like(x)
    pointers = (ctypes.c_void_p(array.ctypes.data) for array in (x, y, result))
    getattr(functions, f"array_{name}")(*pointers, ctypes.c_int(x.size))
    return result


def ulps(result: float, exact: Any) -> float:
    """Distance in units in the last place of the exact value; an overflow must give inf, a denormal has ulp 2^-1074."""
    if exact == 0:
        return abs(result) / TINY
    if abs(exact) > LARGEST * (1 + mpmath.mpf(2) ** -54):
        return 0.0 if result == math.copysign(math.inf, float(mpmath.sign(exact))) else math.inf
    if not math.isfinite(result):
        return math.inf
    exponent = max(int(mpmath.frexp(exact)[1]), -1021)
    return float(abs(result - exact) * mpmath.mpf(2) ** (53 - exponent))


def measure(samples: int, seed: int, cases: tuple[Case, ...] = CASES) -> Iterator[Row]:
    """One Row per case, from `samples` random arguments each."""
    functions = library()
    for index, case in enumerate(cases):
        arguments = case.sample(np.random.default_rng([seed, index]), samples)
        results = call(functions, case.function, arguments)
        worst = Row(case, 0.0, tuple(float(argument[0]) for argument in arguments))
        with mpmath.workprec(PRECISION):
            for result, *point in zip(results, *arguments, strict=True):
                error = ulps(float(result), case.exact(*(mpmath.mpf(float(value)) for value in point)))
                if error > worst.error:
                    worst = Row(case, error, tuple(float(value) for value in point))
        yield worst


def table(rows: list[Row], samples: int) -> str:
    """The rows in Markdown."""
    lines = ["| function | arguments | largest error (ulp) | seen at |", "|---|---|---|---|"]
    for row in rows:
        where = ", ".join(f"`{value.hex()}`" for value in row.where)
        lines.append(f"| {row.case.function} | {row.case.range} | {row.error:.2f} | {where} |")
    return "\n".join([*lines, "", f"{samples} arguments a row.", ""])


def main() -> int:
    """Command line; the exit code is 1 if an error exceeds 2 ulp."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--samples", type=int, default=20_000, help="arguments a row")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--write", action="store_true", help="put the table into docs/math.md")
    options = parser.parse_args()
    rows = []
    for row in measure(options.samples, options.seed):
        rows.append(row)
        where = ", ".join(value.hex() for value in row.where)
        sys.stdout.write(f"{row.case.function:10} {row.case.range:32} {row.error:6.3f}  {where}\n")
        sys.stdout.flush()
    if options.write:
        DOCUMENT.write_text(put(DOCUMENT.read_text(), "table", table(rows, options.samples)))
    return int(max(row.error for row in rows) > 2.0)


if __name__ == "__main__":
    sys.exit(main())
