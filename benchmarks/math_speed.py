"""How fast the elementary functions are: `python -m benchmarks.math_speed`.

Nanoseconds a value, on independent arguments that lie in the cache: on lanes as the batch kernel calls them, as scalar
functions, and those of the C library. The best of many short samples counts.

Below the table stands what this says of the batch kernel: how long the functions of one evaluation of the reference
paper's control and plant take by themselves. No order of its instructions makes an evaluation faster than that.
"""

from __future__ import annotations

import argparse
import ctypes
import itertools
import json
import re
import time
from collections import Counter
from collections.abc import Callable, Collection
from pathlib import Path

from springline.benchmarks.contenders import ours
from springline.codegen.kernel import best_flags, lanes, runtime_sources, toolchain
from springline.codegen.program import program

_SOURCE = Path(__file__).with_name("math_speed.c")
_ROUNDS = 400
_CALL = re.compile(r"slv_(\w+)\(")

WAYS = {"lanes": (0, 1, 2), "scalar": (3,), "C library": (4,)}
"""Column -> ways of `evaluate` in math_speed.c of which the fastest counts."""

Times = dict[str, dict[str, float]]
"""Function -> column -> ns a value."""


def measure(samples: int) -> Times:
    """Time every function, in turn, `samples` times. Raises ToolchainError without a C compiler."""
    compiler = toolchain.find_compiler()
    files = {**runtime_sources(), _SOURCE.name: _SOURCE.read_text()}
    width = toolchain.native_vector_width(compiler)
    flags = (*best_flags(compiler), "-std=gnu99", f"-DWIDTH={width}", "-Wno-psabi", "-lm")
    library = toolchain.load(toolchain.build_library(files, main=_SOURCE.name, flags=flags))
    library.function_name.restype = ctypes.c_char_p
    library.evaluate.argtypes, library.evaluate.restype = [ctypes.c_int, ctypes.c_int, ctypes.c_int64], None
    names = list(itertools.takewhile(bool, map(library.function_name, itertools.count())))
    best: dict[tuple[int, int], float] = {}
    for _ in range(samples):
        for function in range(len(names)):
            for way in itertools.chain(*WAYS.values()):
                found = _seconds(library.evaluate, function, way)
                best[function, way] = min(found, best.get((function, way), found))
    value = 1e9 / (_ROUNDS * library.values())
    return {
        name.decode(): {column: value * min(best[i, way] for way in ways) for column, ways in WAYS.items()}
        for i, name in enumerate(names)
    }


def _seconds(evaluate: Callable[[int, int, int], None], function: int, way: int) -> float:
    start = time.process_time()
    evaluate(function, way, _ROUNDS)
    return time.process_time() - start


def calls(names: Collection[str]) -> Counter[str]:
    """Which of these functions one evaluation with continuous control calls, with how often."""
    text = lanes.emit(program(ours.STRUCTURE), ours.DEFAULT["continuous"].constants).text
    start = text.index("void kernel_closed(")
    found = _CALL.findall(text[start : text.index("\n}\n", start)])
    return Counter(name for name in found if name in names)


def main() -> None:
    """Print the table, or with --json one object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.math_speed", description=__doc__)
    parser.add_argument("--samples", type=int, default=100)
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args()
    times = measure(chosen.samples)
    called = calls(times)
    alone = sum(count * times[name]["lanes"] for name, count in called.items())
    if chosen.json:
        print(json.dumps({"ns_per_value": times, "calls": called, "ns_per_evaluation": alone}, indent=2))
        return
    print(f"{'ns a value':<12}" + "".join(f"{column:>12}" for column in WAYS))
    for name, row in times.items():
        print(f"{name:<12}" + "".join(f"{row[column]:>12.2f}" for column in WAYS))
    listed = ", ".join(f"{count} {name}" for name, count in sorted(called.items()))
    print(f"one evaluation calls {listed}: {alone:.1f} ns by themselves")


if __name__ == "__main__":
    main()
