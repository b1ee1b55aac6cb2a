"""Springline itself: vector widths, everything tunable, all threads, a single run, and the casadi engine."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from springline.benchmarks import problem
from springline.codegen.kernel import ONE_RUN, KernelOptions, KernelSpec, LoopSettings, best_flags, kernel, toolchain
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

NAME = "springline"
STRUCTURE = Structure(base_motion=SignalShape("sine", (1, 0, 0)))
# Two packs of the widest kernel (8 lanes, two groups), so that no kernel idles lanes.
BATCH = 32
WIDTHS = (1, 2, 4, 8)

_VALUES = {
    "reference.lift.terms.0.amplitude": 1.0,
    "reference.lift.terms.0.omega": problem.REFERENCE_OMEGA[0],
    "reference.rotation.offset": 1.0,
    "reference.rotation.terms.0.amplitude": 1.0,
    "reference.rotation.terms.0.omega": problem.REFERENCE_OMEGA[1],
    "base_motion.heave.0.amplitude": problem.SHAKE_AMPLITUDE,
    "base_motion.heave.0.omega": problem.SHAKE_OMEGA,
    "initial.q.0": problem.INITIAL_STATE[0],
    "initial.q.1": problem.INITIAL_STATE[1],
}


VALUES = {slot.key: _VALUES.get(slot.key, slot.default) for slot in System(STRUCTURE).slots}
"""Every number of the system by its slot key: springline's defaults are the paper's."""

DEFAULT: dict[problem.Control, KernelSpec] = {
    mode: KernelSpec(STRUCTURE, mode == "sampled", ("control.delta",), tuple(VALUES.values())) for mode in problem.MODES
}
"""One varied parameter, all others baked; the machine's vector width, and as many groups as pay."""


def build(spec: KernelSpec, threads: int = 1) -> problem.Runner:
    """Runs are dealt to threads in equal parts; the loop releases the GIL."""
    loop = kernel(spec)
    column = loop.parameters.index("control.delta")

    def run_part(delta: problem.Floats, steps: int) -> problem.Floats:
        parameters = np.tile([VALUES[key] for key in loop.parameters], (delta.size, 1))
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
    return build(_printed(DEFAULT[mode], flags=flags))


def reference(mode: problem.Control) -> problem.Runner:
    """What all others are compared with: the default, which has this machine's vector width."""
    return build(DEFAULT[mode])


def is_default(contender: problem.Contender) -> bool:
    """Whether this is what ratios refer to, for its control mode."""
    return contender.name == NAME and contender.variant == contender.control


def _printed(spec: KernelSpec, **options: Any) -> KernelSpec:
    return replace(spec, options=KernelOptions(**options))


def _contender(variant: str, spec: KernelSpec, *, batch: int = BATCH, threads: int = 1) -> problem.Contender:
    return problem.Contender(
        NAME,
        variant,
        "sampled" if spec.sampled else "continuous",
        partial(build, spec, threads),
        batch=batch * threads,
        threads=threads,
        compiles=threads == 1 and spec.options.width is None,
        tolerance=0.0,
    )


def contenders() -> tuple[problem.Contender, ...]:
    """Both control modes, each with the default first."""
    cores = os.cpu_count() or 1
    result = []
    for mode, default in DEFAULT.items():
        free = replace(default, tunable=None, baked=())
        result.append(_contender(mode, default))
        result += [_contender(f"{mode}, W = {width}", _printed(default, width=width)) for width in WIDTHS]
        result.append(_contender(f"{mode}, all tunable", free))
        result.append(problem.Contender(NAME, f"{mode}, FMA allowed", mode, partial(build_fused, mode), batch=BATCH))
        if cores > 1:
            result.append(_contender(f"{mode}, {cores} threads", default, threads=cores))
        result.append(_contender(f"{mode}, one run", replace(default, options=ONE_RUN), batch=1))
        result.append(_contender(f"{mode}, casadi engine", _printed(free, engine="casadi"), batch=1))
    return tuple(result)


CONTENDERS = contenders()
