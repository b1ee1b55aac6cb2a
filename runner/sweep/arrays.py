"""Many runs from arrays of numbers, without a file or a folder."""

from __future__ import annotations

import sys
from collections import deque
from collections.abc import Generator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import closing

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from springline.codegen.kernel import joined
from springline.codegen.memory import memory
from springline.codegen.numbers import whole
from springline.runner.files import InputError, Problem, arrow_array, arrow_numbers
from springline.runner.run import field, metrics_schema, metrics_table, trajectory_schema
from springline.runner.scenario import Scenario, absent_at, expect_keys, expect_scenario
from springline.runner.sweep.forecast import COPIES
from springline.runner.sweep.pool import open_pool
from springline.runner.sweep.trajectories import Reduce, Trajectories
from springline.runner.sweep.work import TRAJECTORY_BYTES, Inputs, Outcome, Work, work_for

Floats = NDArray[np.float64]


_CHUNKS_PER_THREAD = 8
_AHEAD = 2  # chunks for each thread that are under way, or done and not taken yet


def batch(
    scenario: Scenario,
    columns: Mapping[str, ArrayLike],
    *,
    jobs: int | None = None,
    trajectories: int = 0,
    reduce: Reduce | None = None,
) -> pa.Table:
    """Simulate one run per entry of the arrays in `columns`, all threads at work.

    columns  dotted key -> values, all of one length; every other number is the scenario's and becomes a constant of
             the kernel (compiled on first use, then cached). Bands of the metrics are such keys too:
             "simulation.settling_error" takes the place of the scenario's settling_band, and the reverse
    jobs     threads, None for one per processor
    trajectories  of every how many runs the trajectory is kept, run 0 first; 0 for none. Each column of a trajectory is
             one of the table: a list of numbers where it is kept, null elsewhere
    reduce   a function of the trajectories of all runs, of which a few are in memory at a time. It takes the columns of
             a trajectory, name -> (some runs, rows), NaN behind the end of a run that stopped early, and "run" ->
             (some runs,), their numbers. It gives columns of the table, name -> (some runs,), numbers (NaN is null),
             texts or truth values. It is called in this thread, in the order of the runs; how many come at a time
             differs from machine to machine, so it must take each run by itself
    Returns a table with one row a run: run, the varied keys, every metric, status, t_end, what `reduce` gives, the
    columns of trajectories. It does not depend on `jobs`.
    Raises TypeError for arguments of another kind, InputError (a ValueError) for an unknown key, a value out of bounds,
    unequal lengths and more than memory holds, ValueError for jobs < 1, trajectories that are no whole number >= 0 and
    what `reduce` may not give, ToolchainError if there is no C compiler, and whatever `reduce` raises.
    """
    expect_scenario(scenario)
    expect_keys(columns, "columns such as {'control.delta': array}")
    if jobs is not None and not isinstance(jobs, int | np.integer):
        raise TypeError(f"jobs is {jobs!r}, expected a whole number or None")
    if jobs is not None and jobs < 1:
        raise ValueError(f"jobs is {jobs}, expected at least 1")
    keep = whole("trajectories", trajectories, 0, sys.maxsize)
    if reduce is not None and not callable(reduce):
        raise TypeError(f"reduce is {reduce!r}, expected a function of trajectories or None")
    scenario = scenario.including({key: values for key, values in columns.items() if absent_at(key) is not None})
    arrays = scenario.columns_for(columns)
    lengths = {key: len(values) for key, values in arrays.items()}
    if len(set(lengths.values())) != 1 or 0 in lengths.values():
        text = "the columns of a batch must be non-empty arrays of one length"
        raise InputError(Problem(scenario.source, "", text, str(lengths)))
    found = scenario.implausible_run(arrays)
    if found:
        key = next(iter(arrays)) if len(arrays) == 1 else ""
        raise InputError(Problem(scenario.source, key, f"run {found[0]}: {found[1]}"))
    runs = max(lengths.values())
    work = work_for(scenario, arrays)
    _refuse_oversized(scenario, work, runs, len(arrays), keep)
    seen = Trajectories(work.system, runs, arrays, keep, reduce)
    parts = []
    with closing(_outcomes(work, work.inputs(scenario, arrays, range(runs)), seen.every, jobs)) as outcomes:
        for wanted, outcome in outcomes:
            seen.take(wanted, outcome.trajectories)
            parts.append(outcome.runs)
    keys = scenario.numeric_keys()
    fields = [field("run", "", pa.int64()), *(field(key, keys[key].unit) for key in arrays)]
    given = [arrow_array(np.arange(runs), pa.int64()), *map(arrow_numbers, arrays.values())]
    tables = [metrics_table(work.system, joined(parts)), seen.reduced(), seen.kept()]
    for table in tables:
        fields += table.schema
        given += table.columns
    return pa.Table.from_arrays(given, schema=pa.schema(fields))


def _refuse_oversized(scenario: Scenario, work: Work, runs: int, keys: int, keep: int) -> None:
    """Raise InputError for results that memory does not hold."""
    need = COPIES * 8 * runs * (len(metrics_schema(work.system)) + keys + len(work.parameters))
    text, remedy = f"{runs:,} runs", "fewer runs"
    if keep:
        kept, rows = -(-runs // keep), work.settings.rows
        need += COPIES * 8 * kept * rows * len(trajectory_schema(work.system))
        text += f" with {kept:,} trajectories of {rows:,} rows"
        remedy += ", fewer trajectories, a larger simulation.output_every"
    if need > memory():
        text = (
            f"expected {remedy}, or a sweep (springline batch): {text} take {need:,} bytes, and there are "
            f"{memory():,} of memory"
        )
        raise InputError(Problem(scenario.source, "", text))


def _outcomes(
    work: Work, inputs: Inputs, every: int, jobs: int | None
) -> Generator[tuple[Sequence[int], Outcome], None, None]:
    """Whole packs of runs at a time over the threads of this process, in the order of the runs.

    every  of how many runs a trajectory is wanted; 0 for none
    Gives the numbers of those whose trajectory is wanted, and what the runs gave.
    """
    width = work.kernel().width
    waiting: deque[tuple[Sequence[int], Future[Outcome]]] = deque()
    with open_pool(jobs) as pool:
        size = -(-len(inputs) // width) // (_CHUNKS_PER_THREAD * pool.threads)
        if every:
            row = 8 * work.settings.rows * len(trajectory_schema(work.system))
            size = min(size, int(TRAJECTORY_BYTES * every / (row * width)))
        size = width * max(1, size)
        for start in range(0, len(inputs), size):
            part = inputs.take(range(start, min(start + size, len(inputs))))
            kept = range(-start % every, len(part), every) if every else range(0)
            waiting.append(([part.numbers[k] for k in kept], pool.submit(work, part, kept)))
            if len(waiting) > _AHEAD * pool.threads:
                wanted, future = waiting.popleft()
                yield wanted, future.result()
        for wanted, future in waiting:
            yield wanted, future.result()
