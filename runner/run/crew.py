"""Kernels at work in threads of this process: watched and stopped together, whoever waits for them."""

from __future__ import annotations

from collections.abc import Callable, Collection
from concurrent.futures import FIRST_EXCEPTION, Future, ThreadPoolExecutor, wait
from typing import Self, TypeVar

from springline.codegen.kernel import Watch

T = TypeVar("T")

REFRESH = 0.1
"""Seconds after which whoever waits looks up, to tell how far the work is."""


class Crew:
    """Threads in which kernels run: the loop holds no lock and shares nothing.

    threads  how many calls run at a time
    Whatever ends its context, Ctrl-C above all, ends the calls too.
    """

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self._executor = ThreadPoolExecutor(threads, thread_name_prefix="springline")
        self._watch = Watch()

    def begin(self, call: Callable[[Watch], T]) -> Future[T]:
        """Begin a call in a free thread; what it is given goes to the kernels that it runs."""
        return self._executor.submit(call, self._watch)

    def underway(self) -> int:
        """Steps times runs that were simulated so far, a few thousand steps behind."""
        return int(self._watch.progress.value)

    def stop(self) -> None:
        """Calls under way end within some thousand steps; their results count for nothing. Others do not begin."""
        self._watch.stop.value = 1
        self._executor.shutdown(wait=True, cancel_futures=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def results(futures: Collection[Future[T]], report: Callable[[], None] = lambda: None) -> list[T]:
    """What all of them gave, in their order; the first that fails is raised, without a wait for the others.

    report  called several times a second in this thread, and once more at the end
    """
    while True:
        ended, left = wait(futures, timeout=REFRESH, return_when=FIRST_EXCEPTION)
        report()
        for future in ended:
            future.result()
        if not left:
            return [future.result() for future in futures]
