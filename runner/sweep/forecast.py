"""What a sweep will take of time, memory and disk, before it starts."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from springline.codegen.memory import memory
from springline.runner.files import InputError, Problem
from springline.runner.run import trajectory_schema
from springline.runner.sweep.places import Place
from springline.runner.sweep.plan import Group, Plan

Floats = NDArray[np.float64]


_CALIBRATION_STEPS = 2000
_TIMED = 3


_FOOTER = 600  # bytes per column of a Parquet file, for what is said of it
COPIES = 2  # of a table in memory: the loop's results and the table's columns


@dataclass(frozen=True, slots=True)
class Estimate:
    """What a sweep will take: seconds of simulation with the threads there are, bytes of the dataset."""

    seconds: float
    bytes: int


def estimate(plan: Plan, threads: int, left: int | None = None) -> Estimate:
    """Time the first pack of the first kinds of work on this machine, and multiply.

    threads  how many work at a time;  left  runs that are not done yet, None for all
    Raises ToolchainError where there is no compiler.
    """
    first = {id(group.work): group for group in reversed(plan.groups)}
    timed = list(reversed(first.values()))[:_TIMED]  # more would be a wait for compilers before the sweep begins
    per_step = sum(_seconds_per_step(plan, group) for group in timed) / len(timed)
    steps = sum(group.runs * group.work.settings.steps for group in plan.groups)
    share = 1.0 if left is None else left / plan.runs
    return Estimate(share * per_step * steps / threads, dataset_bytes(plan))


def _seconds_per_step(plan: Plan, group: Group) -> float:
    """Seconds for one step of one run among a full pack, measured over a short run."""
    chunk = plan.chunk_of(group.first)
    work = chunk.group.work
    loop = work.kernel()
    parameters = np.resize(plan.inputs(chunk, plan.columns(chunk)).parameters, (2 * loop.width, len(work.parameters)))
    steps = min(work.settings.steps, _CALIBRATION_STEPS)
    settings = replace(work.settings, steps=steps, output_every=0)
    best = float("inf")
    for _ in range(2):
        start = time.perf_counter()
        loop.run(parameters, settings, work.tables)
        best = min(best, time.perf_counter() - start)
    return best / (len(parameters) * steps)


def dataset_bytes(plan: Plan) -> int:
    """About how large the dataset will be: doubles hardly compress, and every part and trajectory has a footer."""
    columns = len(plan.schema)
    size = plan.runs * 8 * columns + plan.chunks * _FOOTER * columns
    for group in plan.groups if plan.sweep.keep else ():
        kept = -(-group.runs // plan.sweep.keep)
        size += kept * (8 * group.work.settings.rows + _FOOTER) * len(trajectory_schema(group.work.system))
    return size


def refuse_oversized(plan: Plan, where: Place, threads: int, left: int | None = None) -> None:
    """Raise InputError for a sweep that needs more memory or room than there is.

    threads, left  as for `estimate`
    Doubles hardly compress: what does not fit as it is estimated is refused. A chunk's trajectories are held at least
    twice, as the loop writes them and as they are stored.
    """
    source = plan.sweep.source
    for group in plan.groups if plan.sweep.keep else ():
        runs = min(plan.chunk_size, group.runs)
        trajectories = min(threads, plan.chunks) * -(-runs // plan.sweep.keep)
        rows = group.work.settings.rows
        need = 2 * 8 * trajectories * rows * len(trajectory_schema(group.work.system))
        if need > memory():
            text = (
                f"expected more, a larger simulation.output_every, a smaller chunk or fewer --jobs: {trajectories:,} "
                f"trajectories of {rows:,} rows at a time take {need:,} bytes, and there are {memory():,} of memory"
            )
            raise InputError(Problem(source, "keep.trajectories", text, str(plan.sweep.keep)))
    free = where.free()
    share = 1.0 if left is None else left / plan.runs
    need = int(share * dataset_bytes(plan))
    if free is not None and need > free:
        text = f"has {free:,} bytes free, and the dataset takes about {need:,}: choose another place with -o"
        if plan.sweep.keep:
            text += ", or keep fewer trajectories"
        raise InputError(Problem(where.name, "", text))
