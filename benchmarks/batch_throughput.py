"""What a sweep costs beyond its kernel, and what a second thread brings: `python -m benchmarks.batch_throughput`.

Three things are timed in turn in one process, several times over, and the best of each counts. Processor time is given
beside it: on a machine that others use too, it alone tells what storing and drawing cost.

    kernel  the compiled loop alone, called with the same runs by the same number of threads
    batch   the same runs as a sweep: drawn, simulated, stored in a dataset
    single  the same sweep with one thread
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from springline.runner.cli import time_text
from springline.runner.sweep import Dataset, Plan, load_sweep, open_pool, place, processors, run_sweep, versions

SWEEP = """
scenario = "paper/nominal"
method = "sobol"
samples = {runs}

[set]
simulation.duration = {duration}

[vary]
control.delta = {{ log_uniform = [0.03, 0.1] }}
"""

RUN = 4.0  # s, the run that the projection is for
MILLION = 1_000_000


class Times(NamedTuple):
    """Seconds on the clock, and of all processors."""

    wall: float
    cpu: float


class Stopwatch:
    def __init__(self) -> None:
        self._start = time.perf_counter(), time.process_time()

    def read(self) -> Times:
        return Times(time.perf_counter() - self._start[0], time.process_time() - self._start[1])


def best(times: list[Times]) -> Times:
    return Times(min(t.wall for t in times), min(t.cpu for t in times))


def kernel_times(plan: Plan, threads: int) -> Times:
    """The loop alone: every thread takes packs until there are none."""
    work = plan.groups[0].work
    loop, settings = work.kernel(), replace(work.settings, output_every=0)
    chunks = [plan.chunk(k) for k in range(plan.chunks)]
    parameters = np.concatenate([plan.inputs(chunk, plan.columns(chunk)).parameters for chunk in chunks])
    pieces = [parameters[i : i + plan.chunk_size] for i in range(0, len(parameters), plan.chunk_size)]
    with ThreadPoolExecutor(threads) as pool:
        watch = Stopwatch()
        list(pool.map(lambda piece: loop.run(piece, settings, work.tables), pieces))
        return watch.read()


def batch_times(plan: Plan, threads: int) -> Times:
    """The sweep, from the first draw to the last part on the disk."""
    with tempfile.TemporaryDirectory() as folder:
        dataset = Dataset(place(Path(folder)))
        dataset.begin(plan, versions(), resume=False)
        with open_pool(threads) as pool:
            watch = Stopwatch()
            tally = run_sweep(plan, dataset, pool, set())
            times = watch.read()
    assert tally.done == plan.runs, tally
    return times


def measure(runs: int, duration: float, threads: int, repeats: int) -> dict[str, float]:
    """Best times, runs per second and ratios."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "throughput.toml")
        file.write_text(SWEEP.format(runs=runs, duration=duration), encoding="utf-8")
        plan = Plan(load_sweep(file))
    plan.groups[0].work.kernel()
    rounds = [(kernel_times(plan, threads), batch_times(plan, threads), batch_times(plan, 1)) for _ in range(repeats)]
    kernel, batch, single = (best([each[i] for each in rounds]) for i in range(3))
    return {
        "runs": runs,
        "duration": duration,
        "threads": threads,
        "kernel_runs_per_s": runs / kernel.wall,
        "batch_runs_per_s": runs / batch.wall,
        "single_runs_per_s": runs / single.wall,
        "batch_over_kernel": kernel.wall / batch.wall,
        "batch_over_kernel_cpu": kernel.cpu / batch.cpu,
        "threads_over_one": single.wall / batch.wall,
        "million_4s_runs_s": batch.wall / runs * MILLION * RUN / duration,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table, or with --json one object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.batch_throughput", description=__doc__)
    parser.add_argument("--runs", type=int, default=2048)
    parser.add_argument("--duration", type=float, default=RUN, help="s simulated per run")
    parser.add_argument("--threads", type=int, default=processors())
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args(arguments)
    found = measure(chosen.runs, chosen.duration, chosen.threads, chosen.repeats)
    if chosen.json:
        print(json.dumps(found, indent=2))
        return
    print(f"{chosen.runs} runs of {chosen.duration:g} s, best of {chosen.repeats}")
    print(f"  kernel alone, {chosen.threads} threads   {found['kernel_runs_per_s']:10.1f} runs/s")
    print(f"  batch, {chosen.threads} threads          {found['batch_runs_per_s']:10.1f} runs/s")
    print(f"  batch, 1 thread           {found['single_runs_per_s']:10.1f} runs/s")
    print(f"  batch / kernel alone      {found['batch_over_kernel']:10.3f}")
    print(f"    in processor time       {found['batch_over_kernel_cpu']:10.3f}")
    print(f"  {chosen.threads} threads / 1             {found['threads_over_one']:10.3f}")
    print(f"  a million 4 s runs        {time_text(found['million_4s_runs_s']):>10}")


if __name__ == "__main__":
    main()
