"""Many runs: chunks of them over threads or a cluster, each finished one into the dataset.

A Pool takes chunks as futures of concurrent.futures, whether its threads are here or on a cluster; what happens to a
chunk afterwards is the same code. No more chunks are under way than keep the pool busy, so memory does not grow with
the sweep.
"""

from __future__ import annotations

import contextlib
import logging
import os
import platform
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, field, replace
from importlib import import_module, metadata
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from springline.codegen.kernel import Runs, joined
from springline.codegen.memory import memory
from springline.codegen.toolchain import ToolchainError
from springline.runner.crew import REFRESH, Crew, results
from springline.runner.dataset import Dataset, Place
from springline.runner.dotted import expect_keys
from springline.runner.errors import InputError, Problem
from springline.runner.plan import Chunk, Columns, Group, Plan
from springline.runner.scenario import Scenario, expect_scenario
from springline.runner.simulate import field as unit_field
from springline.runner.simulate import metrics_schema, metrics_table, trajectory_schema
from springline.runner.terminal import version
from springline.runner.work import Outcome, Work, parcel, perform, perform_parcel, work_for

Floats = NDArray[np.float64]

_ATTEMPTS = 3
_IN_A_ROW = 3
_PAUSE = 0.5
_ANSWER = "10s"  # for a scheduler to answer
_CALIBRATION_STEPS = 2000
_TIMED = 3
_CHUNKS_PER_THREAD = 8
_FOOTER = 600  # bytes per column of a Parquet file, for what is said of it
_COPIES = 2  # of a table in memory: the loop's results and the table's columns


# --- where runs are simulated ----------------------------------------------------------------------------


class Pool(Protocol):
    """Where chunks are simulated."""

    @property
    def threads(self) -> int:
        """How many chunks are simulated at a time."""
        ...

    def submit(self, work: Work, parameters: Floats, kept: Sequence[int]) -> Future[Outcome]:
        """Begin a chunk."""
        ...

    def underway(self) -> int:
        """Steps times runs that were simulated so far, as far as is known before chunks end."""
        ...

    def stop(self) -> None:
        """Give up what is under way, soon."""
        ...


class Threads(Crew):
    """Threads of this process."""

    def submit(self, work: Work, parameters: Floats, kept: Sequence[int]) -> Future[Outcome]:
        """Begin a chunk in a free thread."""
        return self.begin(lambda watch: perform(work.kernel(), work.settings, work.tables, parameters, kept, watch))


class Cluster:
    """Workers of dask.distributed, which compile the kernel from the sources they are sent."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._executor: Executor = client.get_executor(pure=False)
        self._threads = (0.0, 1)

    @property
    def threads(self) -> int:
        """Threads of all workers there are now."""
        asked, count = self._threads
        if time.monotonic() - asked > 1.0:
            count = max(1, sum(self._client.nthreads().values()))
            self._threads = time.monotonic(), count
        return count

    def submit(self, work: Work, parameters: Floats, kept: Sequence[int]) -> Future[Outcome]:
        """Send a chunk to a worker."""
        return self._executor.submit(perform_parcel, parcel(work), parameters, list(kept))

    def underway(self) -> int:
        """Nothing: workers report whole chunks."""
        return 0

    def stop(self) -> None:
        """Drop what is under way."""
        self._executor.shutdown(wait=False)


@contextlib.contextmanager
def open_pool(jobs: int | None = None, scheduler: str = "") -> Iterator[Pool]:
    """The pool that the user asked for; whatever ends the context ends the pool.

    jobs       threads, None for one per processor that this process may use
    scheduler  "" for threads here, "tcp://host:port" for a dask scheduler, "local:N" for N worker processes here
    Raises InputError if the address is none or nobody answers there.
    """
    if not scheduler:
        with Threads(jobs or processors()) as threads:
            yield threads
        return
    with contextlib.ExitStack() as stack:
        cluster = Cluster(_client(scheduler, stack))
        try:
            yield cluster
        finally:
            cluster.stop()


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _client(scheduler: str, stack: contextlib.ExitStack) -> Any:
    """A client of the scheduler at an address, or of one that is started here."""
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        hint = "needs dask.distributed: pip install 'springline[distributed]'"
        raise InputError(Problem("--scheduler", "", hint, scheduler)) from error
    kind, _, count = scheduler.partition(":")
    if kind == "local":
        if not count.isdecimal() or int(count) < 1:
            raise InputError(Problem("--scheduler", "", "expected local:N with N >= 1 worker processes", scheduler))
        with _ignoring_interrupts():
            address: Any = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=int(count), threads_per_worker=1, dashboard_address=None, silence_logs=logging.ERROR
                )
            )
    elif "://" in scheduler:
        address = scheduler
    else:
        raise InputError(Problem("--scheduler", "", 'expected an address ("tcp://host:port") or local:N', scheduler))
    try:
        return stack.enter_context(distributed.Client(address, timeout=_ANSWER))
    except (OSError, ValueError) as error:
        raise InputError(Problem("--scheduler", "", f"no scheduler answers ({error})", scheduler)) from error


@contextlib.contextmanager
def _ignoring_interrupts() -> Iterator[None]:
    """Processes that are started here inherit that Ctrl-C is not for them: this one tells them when to end."""
    if threading.current_thread() is not threading.main_thread():  # which alone may say what a signal does
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


# --- a sweep ---------------------------------------------------------------------------------------------


@dataclass
class Tally:
    """How a sweep stands. Runs are counted by what became of them; `failures` tells why chunks failed."""

    runs: int
    found: int = 0
    done: int = 0
    diverged: int = 0
    failed: int = 0
    steps: int = 0
    failures: list[str] = field(default_factory=list)

    @property
    def left(self) -> int:
        """Runs that no part holds."""
        return self.runs - self.found - self.done


Report = Callable[[Tally, int], None]
"""Called several times a second with the tally and the steps times runs that are done, chunks under way included."""


def run_sweep(
    plan: Plan, dataset: Dataset, pool: Pool, done: set[int], report: Report = lambda tally, steps: None
) -> Tally:
    """Simulate every chunk of the plan whose number is not among `done`, store it, and add its number.

    A chunk that fails (its worker died, the disk refuses) is tried three times, then given up, and the rest goes on,
    unless three chunks in a row were given up. Raises ToolchainError where the kernel cannot be compiled.
    """
    tally = Tally(plan.runs, found=sum(plan.chunk(k).runs for k in done))
    todo = (k for k in range(plan.chunks) if k not in done)
    pending: dict[Future[Outcome], tuple[Chunk, Columns, int]] = {}
    in_a_row = 0

    def submit(chunk: Chunk, columns: Columns, attempt: int) -> None:
        parameters, kept = plan.parameters(chunk, columns), plan.kept(chunk)
        try:
            future = pool.submit(chunk.group.work, parameters, kept)
        except (OSError, RuntimeError) as error:  # the pool itself is gone: the chunk fails like any other
            future = Future()
            future.set_exception(error)
        pending[future] = chunk, columns, attempt

    while in_a_row < _IN_A_ROW:
        while len(pending) < 2 * pool.threads and (number := next(todo, None)) is not None:
            chunk = plan.chunk(number)
            submit(chunk, plan.columns(chunk), 1)
        if not pending:
            break
        ended, _ = wait(pending, timeout=REFRESH, return_when=FIRST_COMPLETED)
        for future in sorted(ended, key=lambda item: pending[item][0].number):
            chunk, columns, attempt = pending.pop(future)
            try:
                outcome = future.result()
            except ToolchainError:
                raise
            except Exception as error:  # whatever it was, the tally tells it
                if attempt < _ATTEMPTS:
                    submit(chunk, columns, attempt + 1)
                    continue
                problem: Exception | None = error
            else:
                problem = _store(plan, dataset, chunk, columns, outcome)
                if problem is None:
                    done.add(chunk.number)
                    tally.done += chunk.runs
                    tally.diverged += int(np.count_nonzero(outcome.runs.status))
            tally.steps += chunk.runs * chunk.group.work.settings.steps
            in_a_row = 0 if problem is None else in_a_row + 1
            if problem is not None:
                tally.failed += chunk.runs
                last = chunk.first + chunk.runs - 1
                tally.failures.append(f"runs {chunk.first} to {last}: {type(problem).__name__}: {problem}")
        report(tally, max(tally.steps, pool.underway()))
    return tally


def _store(plan: Plan, dataset: Dataset, chunk: Chunk, columns: Columns, outcome: Outcome) -> Exception | None:
    """Write a chunk's part; what went wrong if the place refuses again and again."""
    table = plan.table(chunk, columns, outcome)
    schema = trajectory_schema(chunk.group.work.system)
    trajectories = {
        chunk.first + index: pa.Table.from_arrays([pa.array(column) for column in rows.T], schema=schema)
        for index, rows in zip(plan.kept(chunk), outcome.trajectories, strict=True)
    }
    problem: Exception | None = None
    for attempt in range(_ATTEMPTS):
        try:
            dataset.write_part(chunk, table, trajectories)
        except OSError as error:
            problem = error
            if attempt + 1 < _ATTEMPTS:
                time.sleep(_PAUSE * (attempt + 1))
        else:
            return None
    return problem


def versions() -> dict[str, Any]:
    """What made a dataset, for its description."""
    libraries = {name: metadata.version(name) for name in ("casadi", "numpy", "pyarrow", "scipy")}
    return {"springline": version(), "versions": {"python": platform.python_version(), **libraries}}


# --- what it will cost -----------------------------------------------------------------------------------


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
    parameters = np.resize(plan.parameters(chunk, plan.columns(chunk)), (2 * loop.width, len(work.parameters)))
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


# --- from Python -----------------------------------------------------------------------------------------


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
    arrays = scenario.columns_for(columns)
    lengths = {key: len(values) for key, values in arrays.items()}
    if len(set(lengths.values())) != 1 or 0 in lengths.values():
        text = "the columns of a batch must be non-empty arrays of one length"
        raise InputError(Problem(scenario.source, "", text, str(lengths)))
    slots, runs = scenario.slots_for(arrays), max(lengths.values())
    work = work_for(scenario, slots)
    need = _COPIES * 8 * runs * (len(metrics_schema(work.system)) + len(arrays) + len(work.parameters))
    if need > memory():
        text = (
            f"expected fewer runs, or a sweep (springline batch): {runs:,} runs take {need:,} bytes, and there are "
            f"{memory():,} of memory"
        )
        raise InputError(Problem(scenario.source, "", text))
    result = metrics_table(work.system, _over_threads(work, work.chosen(slots, runs), jobs))
    keys = scenario.numeric_keys()
    for position, (key, array) in enumerate(arrays.items()):
        result = result.add_column(position, unit_field(key, keys[key].unit), pa.array(array, pa.float64()))
    return result.add_column(0, unit_field("run", "", pa.int64()), pa.array(np.arange(runs)))


def _over_threads(work: Work, parameters: Floats, jobs: int | None) -> Runs:
    """The runs of a Work, in whole packs over the threads of this process."""
    width = work.kernel().width
    with open_pool(jobs) as pool:
        packs = -(-len(parameters) // width)
        size = width * max(1, packs // (_CHUNKS_PER_THREAD * pool.threads))
        futures = [pool.submit(work, parameters[i : i + size], ()) for i in range(0, len(parameters), size)]
        return joined([outcome.runs for outcome in results(futures)])
