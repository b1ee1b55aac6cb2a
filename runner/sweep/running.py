"""A sweep under way: chunks of runs over a pool, each finished one into the dataset.

What happens to a chunk is the same code wherever it was simulated. No more chunks are under way than keep the pool
busy, so memory does not grow with the sweep.
"""

from __future__ import annotations

import platform
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springline.codegen.kernel import ToolchainError
from springline.runner.run import REFRESH, trajectory_table
from springline.runner.sweep.dataset import Dataset
from springline.runner.sweep.drawing import Columns
from springline.runner.sweep.plan import Chunk, Plan
from springline.runner.sweep.pool import Pool
from springline.runner.sweep.work import Outcome
from springline.runner.version import __version__

Floats = NDArray[np.float64]

_ATTEMPTS = 3
_IN_A_ROW = 3
_PAUSE = 0.5


# --- where runs are simulated ----------------------------------------------------------------------------


# --- a sweep ---------------------------------------------------------------------------------------------


@dataclass
class Tally:
    """How a sweep stands. Runs are counted by what became of them; `failures` tells why chunks failed."""

    runs: int
    found: int = 0
    done: int = 0
    stopped_early: int = 0
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
        inputs, kept = plan.inputs(chunk, columns), plan.kept(chunk)
        try:
            future = pool.submit(chunk.group.work, inputs, kept)
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
                    tally.stopped_early += int(np.count_nonzero(outcome.runs.status))
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
    trajectories = {
        chunk.first + index: trajectory_table(chunk.group.work.system, rows)
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
    return {"springline": __version__, "versions": {"python": platform.python_version(), **libraries}}


# --- what it will cost -----------------------------------------------------------------------------------


# --- from Python -----------------------------------------------------------------------------------------
