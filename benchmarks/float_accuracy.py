"""Largest errors of sl_mathf.h: at every float, and of two arguments at many pairs.

    python -m benchmarks.float_accuracy [--only NAME ...] [--write]

Prints one row per function: the largest error in units in the last place of the exact result, and where it was seen.
A function takes a minute or two on one core. --write puts the table into docs/math.md; tests hold it there.
"""

from __future__ import annotations

import argparse
import ctypes
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import mpmath
import numpy as np
from numpy.typing import NDArray

from springline.codegen.elementary import float_header, math_header
from springline.codegen.kernel import toolchain
from springline.runner.report import put

Floats = NDArray[np.float32]

DOCUMENT = Path(__file__).parent.parent / "docs" / "math.md"
SOURCE = Path(__file__).with_suffix(".c")
CHUNK = 2**23
EVERY = "every float"
PAIRS = 10**7
LARGEST = float(np.finfo(np.float32).max)

SYMMETRY = {
    **dict.fromkeys(("sin", "tan", "sinh", "tanh", "atan", "asin", "cbrt", "pow_m1", "pow_p3"), -1),
    **dict.fromkeys(("cos", "cosh"), 1),
}
"""Of functions whose reference at -x is that at x, or less that."""
ONE = (
    "exp", "expm1", "sinh", "cosh", "tanh", "log", "log1p", "sin", "cos", "tan", "atan", "asin",
    "acos", "cbrt", "pow_p1_3", "pow_m1_3", "pow_p2_3", "pow_m2_3", "pow_p1_2", "pow_m1_2", "pow_p3_2", "pow_m1",
    "pow_p2", "pow_p3", "floor", "ceil", "sqrt", "sqrt_soft",
)  # fmt: skip
QUARTERS = {"sin": "sign * s", "cos": "sign * c", "tan": "s / c"}
FIRST_TURNS = 127 + 17  # exponent field: from 2^17 on sl_math.h takes the slow way


@dataclass(frozen=True, slots=True)
class Row:
    """Largest error (ulp) of a function over some arguments, and where it was seen."""

    function: str
    arguments: str
    error: float
    where: tuple[float, ...]

    def cells(self) -> tuple[str, str, str, str]:
        """As a row of a table."""
        where = ", ".join(f"`{np.float32(x).astype(float).hex()}`" for x in self.where)
        return self.function, self.arguments, f"{self.error:.2f}", where.replace("0000000p", "p")


def _turns() -> str:
    """C of 2^e / (2 pi) modulo 1, 128 bits in two words, for the last place of floats with each exponent."""
    with mpmath.workprec(400):
        turn = [int(mpmath.floor((mpmath.ldexp(1, e - 150) / (2 * mpmath.pi) % 1) * 2**128)) for e in range(144, 255)]
    return ", ".join(f"{{UINT64_C({each >> 64}), UINT64_C({each % 2**64})}}" for each in turn)


def _usual() -> str:
    """sl_mathf.h with another prefix, in which what is rare is only noted."""
    text = re.sub(r"if \(!SLF_LIKELY\(usual\)\) \*?\w+ = slf_\w+_rare\(.*\);", "seen_rare |= !usual;", float_header())
    return text.replace("slf_", "usual_").replace("SLF_", "USUAL_").replace("SL_MATHF_H", "USUAL_H")


def _library(name: str, defined: dict[str, object]) -> ctypes.CDLL:
    runtime = resources.files("springline.codegen") / "runtime"
    names = {"NAME": name, "REFERENCE": "sqrt" if name == "sqrt_soft" else name, **defined}
    if name in QUARTERS:
        names |= {"TURNS": _turns(), "FIRST_TURNS": FIRST_TURNS, "QUARTERS": QUARTERS[name]}
    sources = {
        "sl_math.h": math_header(),
        "sl_mathf.h": float_header(),
        "usual.h": _usual(),
        "sl_lanes.h": (runtime / "sl_lanes.h").read_text(),
        SOURCE.name: "".join(f"#define {key} {value}\n" for key, value in names.items()) + SOURCE.read_text(),
    }
    flags = ("-std=gnu99", "-O3", "-march=native", "-fno-trapping-math")
    library = toolchain.load(toolchain.build_library(sources, main=SOURCE.name, flags=flags))
    library.worst.restype = ctypes.c_double
    return library


def at_every_float(name: str, low: int = 0, high: int = 2**31) -> Row:
    """The largest error of a function of one argument, of both signs; `low` and `high` are bits, for less than all."""
    library, where = _library(name, {"SYMMETRY": SYMMETRY.get(name, 0)}), ctypes.c_float()
    worst = Row(name, EVERY, -1.0, ())
    for first in range(low, high, CHUNK):
        error = library.worst(ctypes.c_uint32(first), ctypes.c_uint32(CHUNK), ctypes.byref(where))
        if error > worst.error:
            worst = Row(name, EVERY, error, (where.value,))
    return worst


Sampler = Callable[[np.random.Generator, int], tuple[NDArray[np.float64], NDArray[np.float64]]]


def _any(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """Uniform in their bits, NaN and infinities among them."""
    return rng.integers(0, 2**32, n, dtype=np.uint32).view(np.float32).astype(float)


def _positive(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    return np.abs(_any(rng, n))


def _result(low: float, high: float, x: Callable[[np.random.Generator, int], NDArray[np.float64]]) -> Sampler:
    """y such that y log x is in a range."""

    def draw(rng: np.random.Generator, n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        base = x(rng, n).astype(np.float32).astype(float)
        return base, rng.uniform(low, high, n) / np.log(base)

    return draw


def _uniform(low: float, high: float) -> Callable[[np.random.Generator, int], NDArray[np.float64]]:
    return lambda rng, n: rng.uniform(low, high, n)


def _next_to_one(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    return 1.0 + rng.choice([-1.0, 1.0], n) * np.exp2(rng.uniform(-23.0, -4.0, n))


TWO: tuple[tuple[str, str, Sampler], ...] = (
    ("pow", "x and y all", lambda rng, n: (_any(rng, n), _any(rng, n))),
    ("pow", "x all, y -3 .. 3", lambda rng, n: (_positive(rng, n), rng.uniform(-3.0, 3.0, n))),
    ("pow", "x 0 .. 10, y 0 .. 9", lambda rng, n: (rng.uniform(0.0, 10.0, n), rng.uniform(0.0, 9.0, n))),
    ("pow", "x all, result all", _result(-104.0, 88.8, _positive)),
    ("pow", "x all, denormal results", _result(-104.0, -87.0, _positive)),
    ("pow", "x 0.9 .. 1.1, result all", _result(-104.0, 88.8, _uniform(0.9, 1.1))),
    ("pow", "x 1/2 .. 2, next to overflow", _result(80.0, 88.8, _uniform(0.5, 2.0))),
    ("pow", "x next to 1, next to overflow", _result(80.0, 88.8, _next_to_one)),
    ("pow", "x denormal, y -1 .. 1", lambda rng, n: (rng.uniform(0.0, 2.0**-126, n), rng.uniform(-1.0, 1.0, n))),
    (
        "pow",
        "x negative, y integer",
        lambda rng, n: (-rng.uniform(0.0, 20.0, n), rng.integers(-30, 30, n).astype(float)),
    ),
    ("hypot", "all", lambda rng, n: (_any(rng, n), _any(rng, n))),
    ("hypot", "-2 .. 2", lambda rng, n: (rng.uniform(-2.0, 2.0, n), rng.uniform(-2.0, 2.0, n))),
    ("atan2", "all", lambda rng, n: (_any(rng, n), _any(rng, n))),
    ("atan2", "-2 .. 2", lambda rng, n: (rng.uniform(-2.0, 2.0, n), rng.uniform(-2.0, 2.0, n))),
)
THIRDS = tuple(np.float32(third) for third in (1 / 3, -1 / 3, 2 / 3, -2 / 3))
"""Exponents at which pow is another function of doubles: the double of that name is not the float's."""


def at_pairs(index: int, count: int = PAIRS) -> Row:
    """The largest error of a case of TWO."""
    name, arguments, sample = TWO[index]
    library = _library(name, {"PAIRS": 1})
    with np.errstate(all="ignore"):
        drawn = sample(np.random.default_rng([1, index]), count)
        x, y = (np.ascontiguousarray(each, np.float32) for each in drawn)
    if name == "pow":
        y[np.isin(y, THIRDS)] = 1.0
    where = ctypes.c_uint32()
    pointers = (ctypes.c_void_p(each.ctypes.data) for each in (x, y))
    error = library.worst(*pointers, ctypes.c_uint32(count), ctypes.byref(where))
    return Row(name, arguments, error, (float(x[where.value]), float(y[where.value])))


def measure(only: tuple[str, ...] = ()) -> Iterator[Row]:
    """A row per function of one argument, and per case of two."""
    for name in ONE:
        if not only or name in only:
            yield at_every_float(name)
    for index, (name, _, _) in enumerate(TWO):
        if not only or name in only:
            yield at_pairs(index)


def table(rows: list[Row]) -> str:
    """The rows in Markdown."""
    lines = ["| function | arguments | largest error (ulp) | seen at |", "|---|---|---|---|"]
    lines += [f"| {' | '.join(row.cells())} |" for row in rows]
    return "\n".join([*lines, "", f"{PAIRS} pairs a row.", ""])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", default=(), help="these functions")
    parser.add_argument("--write", action="store_true", help="put the table into docs/math.md")
    options = parser.parse_args()
    if options.write and options.only:
        parser.error("--write takes all functions")
    rows = []
    for row in measure(tuple(options.only)):
        rows.append(row)
        sys.stdout.write("{:10} {:30} {:>6}  {}\n".format(*row.cells()))
        sys.stdout.flush()
    if options.write:
        DOCUMENT.write_text(put(DOCUMENT.read_text(), "floats", table(rows)))


if __name__ == "__main__":
    main()
