"""Kernels at work in threads: watched, stopped, and waited for by whoever began them."""

import time
from collections.abc import Callable
from threading import Event

import numpy as np
import pytest

from springline.codegen.kernel import ONE_RUN, STATUS, KernelSpec, LoopSettings, Runs, Watch, kernel
from springline.model.structure import Structure
from springline.model.system import System
from springline.runner.run import Crew, results

LONG = LoopSettings(1_000_000_000, 1e-5)  # minutes


@pytest.fixture
def call() -> Callable[[Watch], Runs]:
    loop = kernel(KernelSpec(Structure(), options=ONE_RUN))
    values = np.array([[slot.default for slot in System().slots]])
    return lambda watch: loop.run(values, LONG, watch=watch)


def test_all_calls_of_a_crew_are_counted_together_and_stopped_together(call: Callable[[Watch], Runs]) -> None:
    with Crew(2) as crew:
        futures = [crew.begin(call), crew.begin(call), crew.begin(call)]
        while crew.underway() < 10_000:
            time.sleep(0.01)
        begun = time.monotonic()
    assert time.monotonic() - begun < 10.0
    assert futures[2].cancelled(), "a call that has not begun need not"
    assert [STATUS[future.result().status[0]] for future in futures[:2]] == ["stopped"] * 2


def test_ctrl_c_while_waiting_ends_the_calls(call: Callable[[Watch], Runs]) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), Crew(1) as crew:
        results([future := crew.begin(call)], interrupt)
    assert STATUS[future.result().status[0]] == "stopped"


def test_results_come_in_order_and_the_progress_with_them() -> None:
    told: list[int] = []
    first = Event()
    with Crew(2) as crew:
        slow = crew.begin(lambda watch: first.wait(10.0) and "slow")
        fast = crew.begin(lambda watch: first.set() or "fast")
        assert results([slow, fast], lambda: told.append(crew.underway())) == ["slow", "fast"]
    assert told
    assert results([]) == []


def test_a_call_that_fails_is_told_without_a_wait_for_the_others(call: Callable[[Watch], Runs]) -> None:
    def fail(watch: Watch) -> Runs:
        raise ZeroDivisionError("of ours")

    begun = time.monotonic()
    with pytest.raises(ZeroDivisionError, match="of ours"), Crew(2) as crew:
        results([crew.begin(call), crew.begin(fail)])
    assert time.monotonic() - begun < 10.0
