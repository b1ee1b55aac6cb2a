"""Springline itself: vector widths, everything tunable, all threads, a single run, and the casadi engine."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from springline.benchmarks import problem
from springline.codegen import toolchain
from springline.codegen.kernel import Kernel, KernelOptions, LoopSettings, kernel
from springline.codegen.kernel_source import ONE_RUN, best_flags
from springline.codegen.program import program
from springline.model.system import SignalShape, Structure

NAME = "springline"
STRUCTURE = Structure(base_motion=SignalShape("sine", (1, 0, 0)))
DEFAULT = KernelOptions(tunable=("control.delta",))
"""One varied parameter, all others baked; the machine's vector width, and as many groups as pay."""

# Two packs of the widest kernel (8 lanes, two groups), so that no kernel idles lanes.
BATCH = 32
WIDTHS = (1, 2, 4, 8)

_VALUES = {
    "reference.lift.terms.0.amplitude": 1.0,
    "reference.lift.terms.0.omega": problem.REFERENCE_OMEGA[0],
    "reference.rotation.offset": 1.0,
    "reference.rotation.terms.0.amplitude": 1.0,
    "reference.rotation.terms.0.omega": problem.REFERENCE_OMEGA[1],
    "base_motion.shake.0.amplitude": problem.SHAKE_AMPLITUDE,
    "base_motion.shake.0.omega": problem.SHAKE_OMEGA,
    "initial.q.0": problem.INITIAL_STATE[0],
    "initial.q.1": problem.INITIAL_STATE[1],
}


def values() -> dict[str, float]:
    """Every number of the system by its slot key: springline's defaults are the paper's."""
    return {slot.key: _VALUES.get(slot.key, slot.default) for slot in program(STRUCTURE).system.slots}


def build_kernel(mode: problem.Control, options: KernelOptions) -> Kernel:
    """The compiled loop."""
    baked = () if options.tunable is None else tuple(values().values())
    return kernel(STRUCTURE, mode == "sampled", options, baked)


def build(mode: problem.Control, options: KernelOptions, threads: int = 1) -> problem.Runner:
    """Runs are dealt to threads in equal parts; the loop releases the GIL."""
    loop = build_kernel(mode, options)
    known = values()
    column = loop.parameters.index("control.delta")

    def run_part(delta: problem.Floats, steps: int) -> problem.Floats:
        parameters = np.tile([known[key] for key in loop.parameters], (delta.size, 1))
        parameters[:, column] = delta
        return loop.run(parameters, LoopSettings(steps, problem.STEP)).final_state

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        if threads == 1:
            return run_part(delta, steps)
        with ThreadPoolExecutor(threads) as pool:
            parts = pool.map(lambda part: run_part(part, steps), np.array_split(delta, threads))
        return np.concatenate(list(parts))

    return run


def build_fused(mode: problem.Control) -> problem.Runner:
    """The default, but free to fuse multiplications and additions: what equal bits on every machine cost."""
    flags = (*best_flags(toolchain.find_compiler()), "-ffp-contract=fast")
    return build(mode, replace(DEFAULT, flags=flags))


def reference(mode: problem.Control) -> problem.Runner:
    """What all others are compared with: the default, which has this machine's vector width."""
    return build(mode, DEFAULT)


def default_kernel(mode: problem.Control) -> Kernel:
    """The compiled loop of the default."""
    return build_kernel(mode, DEFAULT)


def is_default(contender: problem.Contender) -> bool:
    """Whether this is what ratios refer to, for its control mode."""
    return contender.name == NAME and contender.variant == contender.control


def _contender(
    variant: str,
    mode: problem.Control,
    options: KernelOptions,
    *,
    batch: int = BATCH,
    threads: int = 1,
) -> problem.Contender:
    return problem.Contender(
        NAME,
        variant,
        mode,
        partial(build, mode, options, threads),
        batch=batch * threads,
        threads=threads,
        compiles=threads == 1 and options.width is None,
        tolerance=0.0,
    )


def contenders() -> tuple[problem.Contender, ...]:
    """Both control modes, each with the default first."""
    cores = os.cpu_count() or 1
    result = []
    for mode in problem.MODES:
        result.append(_contender(mode, mode, DEFAULT))
        result += [_contender(f"{mode}, W = {width}", mode, replace(DEFAULT, width=width)) for width in WIDTHS]
        result.append(_contender(f"{mode}, all tunable", mode, KernelOptions()))
        result.append(problem.Contender(NAME, f"{mode}, FMA allowed", mode, partial(build_fused, mode), batch=BATCH))
        if cores > 1:
            result.append(_contender(f"{mode}, {cores} threads", mode, DEFAULT, threads=cores))
        result.append(_contender(f"{mode}, one run", mode, replace(ONE_RUN, tunable=DEFAULT.tunable), batch=1))
        result.append(_contender(f"{mode}, casadi engine", mode, KernelOptions(engine="casadi"), batch=1))
    return tuple(result)


CONTENDERS = contenders()
