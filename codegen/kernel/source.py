"""The C of a kernel: the loop's fixed sources and the printed kernel.h, with the flags that compile them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import resources

from springline.codegen.elementary import math_header
from springline.codegen.kernel import lanes, toolchain
from springline.codegen.kernel.job import job_header
from springline.codegen.kernel.metrics import print_metrics
from springline.codegen.kernel.paying import Shape, what_pays
from springline.codegen.kernel.spec import KernelOptions, KernelSpec
from springline.codegen.kernel.steps import print_steps
from springline.codegen.program import Program, casadi_c, kernel_update
from springline.model.quantities import entries

_RUNTIME = ("loop.c", "metrics.h", "sl_tables.h", "sl_lanes.h", "sl_casadi.h", "sl_noise.h")


@dataclass(frozen=True, slots=True)
class KernelSource:
    """All that a compiler has to be given: it may travel to another machine.

    files       (name, text), loop.c is the one to compile
    flags       compiler flags
    parameters  slot keys in the order of the parameter columns
    """

    files: tuple[tuple[str, str], ...]
    flags: tuple[str, ...]
    parameters: tuple[str, ...]

    @property
    def hash(self) -> str:
        """SHA-256 of files and parameters: equal hashes compute equal results."""
        return hashlib.sha256(json.dumps([self.files, self.parameters]).encode()).hexdigest()


def preamble(
    program: Program, shape: Shape, *, width: int, sampled: bool, sizes: Mapping[str, int], alone: bool = False
) -> str:
    """The macros and types that every kernel.h starts with; `sizes`: parameters, run, uniform and varying values."""
    memory, sliding = program.size("z"), len(program.system.sliding)
    channels = sum(len(table.channels) for table in program.system.tables)
    numbers = {
        "SL_NJ": program.system.n,
        "SL_NX": program.size("x") + memory,
        "SL_NB": program.system.base.b.numel(),
        "SL_NF": len(entries(program.system.forces, program.system.joints)),
        "SL_NP": sizes["p"],
        "SL_NR": sizes["r"],
        "SL_NU": sizes["uniform"],
        "SL_NV": sizes["varying"],
        "SL_ND": program.size("d"),
        "SL_NTABLES": len(program.system.tables),
    }
    assert program.size("d") == len(program.system.tables) + 4 * channels
    sensors = ""
    if measured := program.size("measured"):
        pairs = ", ".join(map(str, program.system.noise_pairs))
        sensors = f"#define SL_NMEASURED {measured}\n#define SL_NNOISE {program.size('noise')}\n"
        sensors += f"#define SL_NOISE_PAIRS {{{pairs}}}\n" if pairs else ""
    if program.size("commanded"):
        delay = program.system.structure.delay
        sensors += f"#define SL_ACTUATED 1\n#define SL_DELAY {delay}\n#define SL_NM {program.size('m')}\n"
    if program.system.structure.differenced:
        sensors += "#define SL_RUN_PERIOD , (double)job->hold * job->step\n"
    enum = ", ".join(f"{name} = {value}" for name, value in numbers.items())
    return f"""#define SL_W {width}
#define SL_G {shape.groups}
#define SL_PACKS {shape.packs}
#define SL_ALONE {int(alone)}
#define SL_SAMPLED {int(sampled)}
#define SL_NZ {memory}
#define SL_SLIDING {sliding}
#define SL_NTIP {len(program.system.observed)}
{sensors}#include "metrics.h"
#include "simulate.h"
#include "sl_lanes.h"

typedef sl_v sl_group[SL_G]; /* one quantity of a pack of runs */

/* Signals at one time: those that all runs share (SL_W doubles apart) and those of each run. */
typedef struct {{
  const double *uniform;
  const sl_group *varying;
}} sl_time;

enum {{ {enum} }};


{kernel_update(program.system.tableau, "SL_NX - SL_NZ" if sampled and memory else "SL_NX")}"""


def print_kernel(program: Program, spec: KernelSpec) -> KernelSource:
    """Print the kernel of a Program, which is that of the spec's structure.

    Raises ValueError for a Program of another structure, UnprintableOperation, ToolchainError when there is no compiler
    to ask how wide its vectors are.
    """
    if program.system.structure != spec.structure:
        raise ValueError(f"the program is of {program.system.structure}, expected {spec.structure}")
    shared = {name: text for name, text in runtime_sources().items() if name != "sl_noise.h" or program.size("noise")}
    slots, size, sampled, options = program.system.slots, program.size, spec.sampled, spec.options
    if options.engine == "casadi":
        sizes = {"p": size("p"), "r": size("r"), "uniform": 0, "varying": size("w") + size("s")}
        start = preamble(program, _ONE_BY_ONE, width=1, sampled=sampled, sizes=sizes)
        stages = program.system.tableau.stages
        sizes_of_steps = f"enum {{ SL_BLOCKS = {stages}, SL_PER_BLOCK = 1, SL_GAINS = 0 }};"
        start += f"\n#define SL_BLOCKED 0\n#define SL_BLOCKED_TIMES 0\n#define SL_FUSED 0\n{sizes_of_steps}\n"
        parameters = tuple(slot.key for slot in slots)
        start = f"{start}\n{print_metrics(program.system)}"
        files = {**shared, **casadi_c.kernel_header(program, start)}
    else:
        width = options.width or toolchain.native_vector_width(options.compiler)
        if options.alone:
            width = min(max(width, 2), 4)

        def shape(evaluation: int, step: int) -> Shape:
            best = what_pays(1 if options.alone else width, sampled, evaluation, step)
            return replace(
                best,
                span=options.span or best.span,
                groups=options.groups or best.groups,
                packs=options.packs or best.packs,
                paired=options.alone and (best.paired if options.paired is None else options.paired),
            )

        emission = lanes.emit(program, spec.constants)
        steps = print_steps(emission.values, sampled, shape)
        start = preamble(program, steps.shape, width=width, sampled=sampled, sizes=emission.sizes, alone=options.alone)
        parameters = emission.tunable
        files = {**shared, "kernel.h": f"{start}\n{emission.text}\n{steps.text}"}
    return KernelSource(tuple(sorted(files.items())), _flags(options), parameters)


def best_flags(compiler: toolchain.Compiler) -> tuple[str, ...]:
    """Optimisation flags that make the fastest kernel with this compiler on this machine."""
    flags = ("-O3", *toolchain.native_flags(compiler))
    if compiler.family == "gcc":  # the order of a block is made for the processor: let it stand
        flags += ("-fno-schedule-insns", "-fno-schedule-insns2", "-mtune=generic")
    return flags


def _flags(options: KernelOptions) -> tuple[str, ...]:
    wanted = best_flags(options.compiler or toolchain.find_compiler()) if options.flags is None else options.flags
    return (*wanted, "-std=gnu99", "-fvisibility=hidden", "-Wno-unused-parameter", "-Wno-psabi", "-lm")


_ONE_BY_ONE = Shape("evaluation", 1, 1, 0)


@lru_cache(maxsize=1)
def runtime_sources() -> dict[str, str]:
    """The C that kernels share, by file name."""
    folder = resources.files("springline.codegen") / "runtime"
    files = {"simulate.h": job_header(), "sl_math.h": math_header()}
    return {**files, **{name: (folder / name).read_text() for name in _RUNTIME}}
