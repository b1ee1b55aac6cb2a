"""Where the work of a sweep is done: threads of this process, or a cluster.

A Pool takes chunks as futures of concurrent.futures, whether its threads are here or elsewhere.
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, Future
from importlib import import_module
from typing import Any, Protocol

from springline.runner.files import InputError, Problem
from springline.runner.run import Crew
from springline.runner.sweep.work import Inputs, Outcome, Work, parcel, perform, perform_parcel

_ANSWER = "10s"  # for a scheduler to answer


class Pool(Protocol):
    """Where chunks are simulated."""

    @property
    def threads(self) -> int:
        """How many chunks are simulated at a time."""
        ...

    def submit(self, work: Work, inputs: Inputs, kept: Sequence[int]) -> Future[Outcome]:
        """Begin a chunk of runs, of which those at the places `kept` give their trajectory."""
        ...

    def underway(self) -> int:
        """Steps times runs that were simulated so far, as far as is known before chunks end."""
        ...

    def stop(self) -> None:
        """Give up what is under way, soon."""
        ...


class Threads(Crew):
    """Threads of this process."""

    def submit(self, work: Work, inputs: Inputs, kept: Sequence[int]) -> Future[Outcome]:
        """Begin a chunk in a free thread."""
        return self.begin(lambda watch: perform(work.kernel(), work.settings, work.tables, inputs, kept, watch))


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

    def submit(self, work: Work, inputs: Inputs, kept: Sequence[int]) -> Future[Outcome]:
        """Send a chunk to a worker."""
        return self._executor.submit(perform_parcel, parcel(work), inputs, list(kept))

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
