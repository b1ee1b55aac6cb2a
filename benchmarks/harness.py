"""Measure the contenders: in one process, one after the other in rounds, each compared with springline's result.

Time is the processor time of the whole process (wall-clock time where a contender may use several cores), so that
other programs on the machine disturb little; the best of all rounds counts. A contender with a fixed step does as many
steps as fit the time of a sample, since all steps cost the same; one that chooses its steps does the whole duration.
"""

from __future__ import annotations

import gc
import os
import platform
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from springline.benchmarks import problem, roofline
from springline.benchmarks.compile_time import compile_times
from springline.benchmarks.contenders import CONTENDERS, ours
from springline.codegen.kernel import kernel, toolchain

PACKAGES = ("casadi", "jax", "numba", "numpy", "scipy")

UNITS = {
    "ns_per_eval": "ns",
    "ratio": "1",
    "batch": "1",
    "threads": "1",
    "noise": "1",
    "compared": "1",
    "difference": "1",
    "tolerance": "1",
    "compile_cold": "s",
    "compile_cached": "s",
    "flops_per_eval": "1",
    "wanted": "1",
    "measured": "1",
    "roofline_share": "1",
}


@dataclass(frozen=True, slots=True)
class Effort:
    """How long to measure.

    rounds     samples of each contender; two at least, but not more than `patience` s of them
    sample     s of a sample
    adaptive   steps that stand for the duration of those who choose their own
    compared   steps after which results are compared, less where they take longer than `comparison` s
    compilers  whether to time them, which takes two processes each
    """

    rounds: int = 60
    sample: float = 0.015
    patience: float = 3.0
    adaptive: int = problem.STEPS
    compared: int = problem.PREFIX
    comparison: float = 1.0
    compilers: bool = True


QUICK = Effort(rounds=10, sample=0.015, patience=0.5, adaptive=problem.PREFIX, comparison=0.2, compilers=False)


@dataclass
class Row:
    """A line of the table.

    ns_per_eval     time of a run, divided by 160,000 (four evaluations a step)
    ratio           ns_per_eval over that of springline's default with the same control, or of its plant
    batch, threads  runs in one call, cores it may use
    noise           median over best of the samples
    difference      largest difference of a state from springline's after `compared` steps, relative to max(1, |state|)
    compile_*       s from nothing, and from full caches, to the first result; NaN where there is nothing to compile
    flops_per_eval, roofline_share   of springline's continuous default; NaN elsewhere, or where they cannot be counted
    note            why there is no number, or what is wrong with it
    """

    contender: str
    variant: str
    ns_per_eval: float = np.nan
    ratio: float = np.nan
    batch: int = 1
    threads: int = 1
    noise: float = np.nan
    compared: int = 0
    difference: float = np.nan
    tolerance: float = np.nan
    compile_cold: float = np.nan
    compile_cached: float = np.nan
    flops_per_eval: float = np.nan
    roofline_share: float = np.nan
    note: str = ""


@dataclass
class Report:
    """All rows, what they were measured on, and whether every contender's result agreed."""

    rows: list[Row]
    machine: dict[str, Any]

    @property
    def agreed(self) -> bool:
        """Whether all differences are within their tolerance."""
        return all(row.difference <= row.tolerance for row in self.rows if row.compared)


@dataclass
class _Entry:
    """A contender that is being measured."""

    contender: problem.Contender
    row: Row
    run: problem.Runner
    delta: problem.Floats
    steps: int
    rounds: int
    samples: list[float] = field(default_factory=list)

    def sample(self) -> None:
        clock = time.perf_counter if self.contender.threads > 1 else time.process_time
        start = clock()
        self.run(self.delta, self.steps)
        spent = clock() - start
        self.samples.append(spent / (self.delta.size * self.steps * problem.STAGES) * 1e9)


def measure(
    effort: Effort | None = None,
    contenders: Sequence[problem.Contender] = CONTENDERS,
    progress: Callable[[float], None] = lambda share: None,
) -> Report:
    """Measure `contenders`, springline's defaults among them; `progress` is called with the share done (0 .. 1).

    Raises ToolchainError if there is no C compiler.
    """
    effort = effort or Effort()
    reference = {mode: ours.reference(mode) for mode in problem.MODES}
    rows, entries = [], []
    for number, contender in enumerate(contenders):
        row = Row(
            contender.name,
            contender.variant,
            batch=contender.batch,
            threads=contender.threads,
            tolerance=contender.tolerance,
        )
        rows.append(row)
        missing = [module for module in contender.modules if find_spec(module) is None]
        if missing:
            row.note = f"needs {', '.join(missing)}: pip install 'springline[bench]'"
            continue
        entries.append(_prepare(contender, row, reference[contender.control], effort))
        progress(0.3 * (number + 1) / len(contenders))
    peak, free = _sample(entries, effort, lambda share: progress(0.3 + 0.5 * share))
    for number, entry in enumerate(entries):
        best = min(entry.samples)
        entry.row.ns_per_eval, entry.row.noise = best, statistics.median(entry.samples) / best
        if effort.compilers and entry.contender.compiles and entry.contender.control == "continuous":
            entry.row.compile_cold, entry.row.compile_cached = compile_times(entry.contender)
        progress(0.8 + 0.2 * (number + 1) / len(entries))
    _refer(entries, peak)
    return Report(fastest(rows), _machine(peak, free))


def _prepare(contender: problem.Contender, row: Row, reference: problem.Runner, effort: Effort) -> _Entry:
    """Build a contender, find how many steps fit a time, and compare its result with springline's."""
    run, delta = contender.build(), problem.deltas(contender.batch)
    run(delta, problem.QUANTUM)
    start = time.process_time()
    run(delta, problem.QUANTUM)
    step = (time.process_time() - start) / problem.QUANTUM

    def steps_in(seconds: float) -> int:
        wanted = int(seconds / step) // problem.QUANTUM * problem.QUANTUM
        return min(max(wanted, problem.QUANTUM), problem.STEPS)

    if contender.comparable:
        row.compared = min(effort.compared, steps_in(effort.comparison))
        final, expected = run(delta, row.compared), reference(delta, row.compared)
        row.difference = float(np.max(np.abs(final - expected) / np.maximum(1.0, np.abs(expected))))
        if not row.difference <= contender.tolerance:
            row.note = "result differs from springline's"
    steps = effort.adaptive if contender.adaptive else steps_in(effort.sample)
    rounds = min(effort.rounds, max(2, int(effort.patience / (step * steps))))
    return _Entry(contender, row, run, delta, steps, rounds)


def _sample(entries: list[_Entry], effort: Effort, progress: Callable[[float], None]) -> tuple[float, float | None]:
    """Fill the samples of all entries, round by round; returns the roof, GFLOP/s, and how many of two cores were free.

    Two threads that only calculate say how many; None where no contender has threads.
    """
    roof = roofline.build()
    threaded = any(entry.contender.threads > 1 for entry in entries)
    peak = pair = 0.0
    gc.collect()
    gc.disable()
    try:
        for number in range(effort.rounds):
            peak = max(peak, roof(1))
            if threaded:
                pair = max(pair, roof(2))
            # To and fro, for whoever comes after the roof finds the processor otherwise than after a neighbour.
            for entry in entries if number % 2 else reversed(entries):
                if number < entry.rounds:
                    entry.sample()
            progress((number + 1) / effort.rounds)
    finally:
        gc.enable()
    return peak, pair / peak if threaded else None


def fastest(rows: list[Row]) -> list[Row]:
    """Of rows with the same contender and variant, the fastest."""
    best: dict[tuple[str, str], Row] = {}
    for row in rows:
        key = row.contender, row.variant
        if key not in best or row.ns_per_eval < best[key].ns_per_eval:
            best[key] = row
    return list(best.values())


def _refer(entries: list[_Entry], peak: float) -> None:
    """Fill in ratios to springline's defaults, and what the continuous default asks of the machine."""
    measures = {entry.contender.variant: entry.row for entry in entries if entry.contender.name == ours.NAME}
    for entry in entries:
        measure = measures[entry.contender.variant.partition(",")[0]]
        entry.row.ratio = entry.row.ns_per_eval / measure.ns_per_eval
    if "continuous" in measures:
        row = measures["continuous"]
        row.flops_per_eval = roofline.flops_per_evaluation(
            kernel(replace(ours.DEFAULT["continuous"], options=roofline.EVALUATIONS))
        )
        row.roofline_share = row.flops_per_eval / row.ns_per_eval / peak


def _machine(peak: float, free: float | None) -> dict[str, Any]:
    """What the numbers belong to."""
    compiler = toolchain.find_compiler()
    info = Path("/proc/cpuinfo")
    text = info.read_text() if info.exists() else ""
    models = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("model name")]
    return {
        "processor": models[0] if models else platform.processor(),
        "cores": os.cpu_count(),
        "instruction_set": toolchain.native_instruction_set(compiler),
        "vector_width": toolchain.native_vector_width(compiler),
        "peak_gflops": peak,
        "free_cores": free,
        "versions": {
            compiler.family: compiler.version,
            "Python": platform.python_version(),
            **{name: version(name) for name in PACKAGES if find_spec(name) is not None},
        },
    }
