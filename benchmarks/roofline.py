"""What one core could do at most, and what springline's kernel asks of it.

The roof is the throughput of fused multiply-adds, two floating-point operations each. The kernel's operations are
counted in the machine code of one evaluation of control and plant, which has no branches: every addition,
subtraction, multiplication, division, square root, minimum and maximum on double precision vectors counts one for
each lane, a fused multiply-add two, elementary functions with all that they are made of. Not counted: comparisons,
selections, conversions, bit operations, loads, and all that is not in the evaluation (the RK4 update, the metrics,
what depends on time only). springline multiplies and adds separately, so that every machine gives the same bits:
half the roof is the most it could reach.
"""

from __future__ import annotations

import ctypes
import math
import re
import shutil
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from springline.codegen.kernel import Kernel, KernelOptions, toolchain

EVALUATIONS = KernelOptions(span="evaluation", packs=1)
"""Of a kernel whose operations can be counted: an evaluation is a function of its own."""

_CHAINS = 12
_ROUNDS = 2_000_000
_SOURCE = Path(__file__).with_name("roofline.c")
_OPERATION = re.compile(r"v?(add|sub|mul|div|sqrt|min|max|fn?m(?:add|sub)\d*)pd\s")
_REGISTER_LANES = {"x": 2, "y": 4, "z": 8}
_EVALUATION = re.compile(
    r"<kernel_closed_0(?:\.(?:isra|constprop|part)\.\d+)*>:"
)  # not its rare paths, nor .cold parts


def build() -> Callable[[int], float]:
    """A function that measures once and returns GFLOP/s of so many threads: of one, by the processor's time."""
    compiler = toolchain.find_compiler()
    width = toolchain.native_vector_width(compiler)
    flags = ("-O3", "-std=gnu99", "-ffp-contract=fast", f"-DWIDTH={width}", *toolchain.native_flags(compiler))
    library = toolchain.build_library({_SOURCE.name: _SOURCE.read_text()}, main=_SOURCE.name, flags=flags)
    spin = toolchain.load(library).spin
    spin.argtypes, spin.restype = [ctypes.c_int64, ctypes.c_double, ctypes.c_double], ctypes.c_double

    def measure(threads: int) -> float:
        clock = time.process_time if threads == 1 else time.perf_counter
        start = clock()
        if threads == 1:
            spin(_ROUNDS, 0.999, 0.5)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(lambda rounds: spin(rounds, 0.999, 0.5), [_ROUNDS] * threads))
        return 2.0 * _CHAINS * width * _ROUNDS * threads / (clock() - start) / 1e9

    return measure


def flops_per_evaluation(kernel: Kernel) -> float:
    """Floating-point operations of one evaluation of one run, in a kernel of one pack whose blocks are evaluations.

    NaN where the machine code cannot be read: no objdump, no x86-64, or a compiler that leaves no function of its own
    for the evaluation.
    """
    objdump = shutil.which("objdump")
    if objdump is None:
        return math.nan
    listing = subprocess.run(
        [objdump, "-d", "--no-show-raw-insn", kernel.library], capture_output=True, text=True, check=True
    ).stdout
    total, inside = 0, False
    for line in listing.splitlines():
        if line.endswith(">:"):
            inside = _EVALUATION.search(line) is not None
        elif inside and (found := _OPERATION.search(line)):
            register = re.search(r"%([xyz])mm", line)
            lanes = _REGISTER_LANES[register[1]] if register else 0
            total += lanes * (2 if found[1].startswith("f") else 1)
    return total / kernel.width if total else math.nan
