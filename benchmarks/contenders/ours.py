"""Springline itself: vector widths, all tunable, threads, one run, the casadi engine, real hardware, plants alone."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from springline.benchmarks import problem
from springline.codegen.kernel import (
    ONE_RUN,
    STATUS,
    KernelOptions,
    KernelSpec,
    LoopSettings,
    best_flags,
    kernel,
    toolchain,
)
from springline.model.hardware import ACTUATORS, SENSORS
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

NAME = "springline"
STRUCTURE = Structure(base_motion=SignalShape("sine", (1, 0, 0)))
# Two packs of the widest kernel (8 lanes, two groups), so that no kernel idles lanes.
BATCH = 32
WIDTHS = (1, 2, 4, 8)

PLANT, SEVEN = "plant", "plant, planar_arm of 7 links"
PLANTS = {
    PLANT: STRUCTURE,
    SEVEN: Structure(
        mechanism="planar_arm", size=7, reference=SignalShape("sine", (1,) * 7), base_motion=STRUCTURE.base_motion
    ),
}
"""Arms of which the plant is timed alone, on the same base, by variant."""

HELD = "sampled every 10 steps"
EFFECTS, DIFFERENCED = "hardware effects", "hardware effects, rates differenced"
_HOLD = 10
_ALL = tuple(effect.name for effect in (*SENSORS, *ACTUATORS))
REAL = {
    EFFECTS: replace(STRUCTURE, effects=_ALL, delay=3),
    DIFFERENCED: replace(
        STRUCTURE, effects=tuple(name for name in _ALL if name != "velocity_noise"), delay=3, differenced=True
    ),
}
"""The arm with everything of [sensor] and [actuator]; rates are measured, with noise, or made of differences."""

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
_HARDWARE = {
    "sensor.position_noise": 1e-5,
    "sensor.velocity_noise": 1e-3,
    "sensor.position_resolution": 1e-5,
    "sensor.velocity_cutoff": 2e3,
    "actuator.rate_limit": 1e7,
    "actuator.lag": 1e-4,
}


def values(structure: Structure) -> dict[str, float]:
    """Every number of a system by its slot key: springline's defaults are the paper's."""
    told = {slot.key: _HARDWARE.get(slot.key.rpartition(".")[0], slot.default) for slot in System(structure).slots}
    return told | {key: value for key, value in _VALUES.items() if key in told}


VALUES = values(STRUCTURE)
"""Those of the benchmark's arm."""

DEFAULT: dict[problem.Control, KernelSpec] = {
    mode: KernelSpec(STRUCTURE, mode == "sampled", ("control.delta",), tuple(VALUES.values())) for mode in problem.MODES
}
"""One varied parameter, all others baked; the machine's vector width, and as many groups as pay."""


def build(spec: KernelSpec, threads: int = 1, hold: int = 1) -> problem.Runner:
    """Runs are dealt to threads in equal parts; the loop releases the GIL."""
    loop, known = kernel(spec), values(spec.structure)
    column = loop.parameters.index("control.delta")
    pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def run_part(delta: problem.Floats, steps: int) -> problem.Floats:
        parameters = np.tile([known[key] for key in loop.parameters], (delta.size, 1))
        parameters[:, column] = delta
        runs = loop.run(parameters, LoopSettings(steps, problem.STEP, hold=hold), numbers=range(delta.size))
        if np.any(runs.status):
            raise RuntimeError(f"a run ended early, {STATUS[runs.status.max()]}: its time says nothing")
        return runs.final_state

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        if pool is None:
            return run_part(delta, steps)
        parts = pool.map(lambda part: run_part(part, steps), np.array_split(delta, threads))
        return np.concatenate(list(parts))

    return run


def build_plant(structure: Structure) -> problem.Runner:
    """An arm under the command of its first sample: the law is evaluated once a run, the plant in every stage."""
    spec = KernelSpec(structure, True, ("control.delta",), tuple(values(structure).values()))
    return build(spec, hold=problem.STEPS)


def build_sampled(structure: Structure, hold: int) -> problem.Runner:
    """Control sampled once in so many steps, through what sensors and motors of a structure make of it."""
    known = values(structure)
    return build(KernelSpec(structure, True, ("control.delta",), tuple(known.values())), hold=hold)


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
    """Both control modes, each with the default first; sensors and motors that are not ideal; plants alone."""
    cores = os.cpu_count() or 1
    result = []
    for mode, default in DEFAULT.items():
        free = replace(default, tunable=None, baked=())
        result.append(_contender(mode, default))
        result += [_contender(f"{mode}, W = {width}", _printed(default, width=width)) for width in WIDTHS]
        result.append(_contender(f"{mode}, all tunable", free))
        result.append(problem.Contender(NAME, f"{mode}, FMA allowed", mode, partial(build_fused, mode), batch=BATCH))
        for threads in sorted({2, cores}) if cores > 1 else ():
            result.append(_contender(f"{mode}, {threads} threads", default, threads=threads))
        result.append(_contender(f"{mode}, one run", replace(default, options=ONE_RUN), batch=1))
        result.append(_contender(f"{mode}, casadi engine", _printed(free, engine="casadi"), batch=1))
    for variant, hold in (("sampled", 1), (HELD, _HOLD)):
        arms = ({variant: STRUCTURE} if hold > 1 else {}) | {f"{variant}, {name}": arm for name, arm in REAL.items()}
        result += [
            problem.Contender(NAME, title, "sampled", partial(build_sampled, arm, hold), batch=BATCH, comparable=False)
            for title, arm in arms.items()
        ]
    result += [
        problem.Contender(NAME, variant, "sampled", partial(build_plant, arm), batch=BATCH, comparable=False)
        for variant, arm in PLANTS.items()
    ]
    return tuple(result)


CONTENDERS = contenders()
