"""Largest errors of the elementary functions that are not proved, at many arguments, evenly among the doubles.

    python -m benchmarks.math_dense [--count N] [--write]

Prints one row per function and range: the largest error in units in the last place, and where it was seen. --write puts
the table into docs/math.md. The reference is the host's long double.
"""

from __future__ import annotations

import argparse
import ctypes
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from springline.codegen.elementary import math_header
from springline.codegen.kernel import toolchain
from springline.runner.report import put

DOCUMENT = Path(__file__).parent.parent / "docs" / "math.md"
COUNT = 2**26


@dataclass(frozen=True, slots=True)
class Case:
    """A function (C name), the reference as C, and a range of arguments of one sign."""

    function: str
    exact: str
    low: float
    high: float
    range: str


CASES = (
    Case("log", "logl(x)", 2.0**-1022, 2.0**1023, "all normal numbers"),
    Case("log", "logl(x)", 0.5, 2.0, "1/2 .. 2"),
    Case("log1p", "log1pl(x)", 2.0**-60, 2.0**1023, "2^-60 .. 2^1023"),
    Case("log1p", "log1pl(x)", 2.0**-4, 4.0, "1/16 .. 4"),
    Case("log1p", "log1pl(x)", -(2.0**-60), -1.0 + 2.0**-53, "-1 .. -2^-60"),
    Case("pow_m1_3", "1 / cbrtl(x)", 1.0, 8.0, "1 .. 8, a period"),
    Case("pow_p1_3", "cbrtl(x)", 1.0, 8.0, "1 .. 8, a period"),
    Case("pow_m2_3", "1 / (cbrtl(x) * cbrtl(x))", 1.0, 8.0, "1 .. 8, a period"),
)


def _bits(x: float) -> int:
    return int(struct.unpack("Q", struct.pack("d", x))[0])


def measure(count: int = COUNT) -> Iterator[tuple[Case, float, float]]:
    """Largest error (ulp) of each case at `count` arguments, and where it was seen. Raises ToolchainError."""
    source = (resources.files("springline.benchmarks") / "math_dense.c").read_text()
    for case in CASES:
        text = f"#define FUNCTION sl_{case.function}\n#define EXACT(x) ({case.exact})\n{source}"
        library = toolchain.build_library(
            {"math_dense.c": text, "sl_math.h": math_header()}, main="math_dense.c", flags=("-O2", "-std=c99", "-lm")
        )
        worst = toolchain.load(library).worst
        worst.restype = ctypes.c_double
        first, last = _bits(case.low), _bits(case.high)
        where = ctypes.c_double()
        stride = ((last - first) // count - 1) | 1  # odd, so that no bit stays as it is
        error = worst(ctypes.c_uint64(first), ctypes.c_uint64(stride), ctypes.c_int64(count), ctypes.byref(where))
        yield case, float(error), where.value


def table(rows: list[tuple[Case, float, float]], count: int) -> list[str]:
    """The rows in Markdown."""
    head = ["| function | arguments | largest error (ulp) | seen at |", "|---|---|---|---|"]
    cells = [f"| {case.function} | {case.range} | {error:.2f} | `{where.hex()}` |" for case, error, where in rows]
    return [*head, *cells, "", f"{count} arguments a row, evenly among the doubles."]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.math_dense", description=__doc__)
    parser.add_argument("--count", type=int, default=COUNT, help=f"arguments of each row (default {COUNT})")
    parser.add_argument("--write", action="store_true", help="put the table into docs/math.md")
    chosen = parser.parse_args()
    lines = table(list(measure(chosen.count)), chosen.count)
    sys.stdout.write("\n".join(lines) + "\n")
    if chosen.write:
        DOCUMENT.write_text(put(DOCUMENT.read_text(), "dense", "".join(f"{line}\n" for line in lines)))


if __name__ == "__main__":
    main()
