"""Many runs from arrays of numbers, without a file or a folder."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from springline.codegen.kernel import Runs, joined
from springline.codegen.memory import memory
from springline.runner.files import InputError, Problem, arrow_array, arrow_numbers
from springline.runner.run import field as unit_field
from springline.runner.run import metrics_schema, metrics_table, results
from springline.runner.scenario import Scenario, absent_at, expect_keys, expect_scenario
from springline.runner.sweep.forecast import COPIES
from springline.runner.sweep.pool import open_pool
from springline.runner.sweep.work import Work, work_for

Floats = NDArray[np.float64]


_CHUNKS_PER_THREAD = 8


def batch(scenario: Scenario, columns: Mapping[str, ArrayLike], *, jobs: int | None = None) -> pa.Table:
    """Simulate one run per entry of the arrays in `columns`, all threads at work, without trajectories.

    columns  dotted key -> values, all of one length; every other number is the scenario's and becomes a constant of
             the kernel (compiled on first use, then cached)
    jobs     threads, None for one per processor
    Returns a table with one row a run: run, the varied keys, every metric, status, t_end. It does not depend on `jobs`.
    Raises TypeError for arguments of another kind, InputError (a ValueError) for an unknown key, a value out of bounds,
    unequal lengths and more runs than memory holds, ValueError for jobs < 1, ToolchainError if there is no C compiler.
    """
    expect_scenario(scenario)
    expect_keys(columns, "columns such as {'control.delta': array}")
    if jobs is not None and not isinstance(jobs, int | np.integer):
        raise TypeError(f"jobs is {jobs!r}, expected a whole number or None")
    if jobs is not None and jobs < 1:
        raise ValueError(f"jobs is {jobs}, expected at least 1")
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
    slots, runs = scenario.slots_for(arrays), max(lengths.values())
    work = work_for(scenario, slots)
    need = COPIES * 8 * runs * (len(metrics_schema(work.system)) + len(arrays) + len(work.parameters))
    if need > memory():
        text = (
            f"expected fewer runs, or a sweep (springline batch): {runs:,} runs take {need:,} bytes, and there are "
            f"{memory():,} of memory"
        )
        raise InputError(Problem(scenario.source, "", text))
    result = metrics_table(work.system, _over_threads(work, work.chosen(slots, runs), jobs))
    keys = scenario.numeric_keys()
    for position, (key, array) in enumerate(arrays.items()):
        result = result.add_column(position, unit_field(key, keys[key].unit), arrow_numbers(array))
    return result.add_column(0, unit_field("run", "", pa.int64()), arrow_array(np.arange(runs), pa.int64()))


def _over_threads(work: Work, parameters: Floats, jobs: int | None) -> Runs:
    """The runs of a Work, in whole packs over the threads of this process."""
    width = work.kernel().width
    with open_pool(jobs) as pool:
        packs = -(-len(parameters) // width)
        size = width * max(1, packs // (_CHUNKS_PER_THREAD * pool.threads))
        futures = [pool.submit(work, parameters[i : i + size], (), i) for i in range(0, len(parameters), size)]
        return joined([outcome.runs for outcome in results(futures)])
