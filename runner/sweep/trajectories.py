"""What becomes of the trajectories of a batch: which are kept, and what a user's function makes of them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray

from springline.model.system import System
from springline.runner.files import arrow_array, arrow_numbers
from springline.runner.run import metrics_schema, trajectory_schema
from springline.runner.scenario import expect_keys

Floats = NDArray[np.float64]
Column = NDArray[np.generic]
Reduce = Callable[[Mapping[str, Column]], Mapping[str, ArrayLike]]
"""A user's function of the trajectories of some runs; `batch` says of what, and what it gives."""


@dataclass(eq=False, slots=True)
class Trajectories:
    """Trajectories of the runs 0 .. runs-1, which come in their order, some at a time.

    keys    that vary from run to run
    keep    of every how many runs one is kept, run 0 first; 0 for none
    reduce  what is made of all; None for nothing
    """

    system: System
    runs: int
    keys: Collection[str]
    keep: int
    reduce: Reduce | None
    _reduced: list[dict[str, Column]] = field(default_factory=list)
    _kept: dict[int, Floats] = field(default_factory=dict)

    @property
    def every(self) -> int:
        """Of every how many runs one is wanted; 0 for none."""
        return 1 if self.reduce else self.keep

    def take(self, runs: Sequence[int], trajectories: Sequence[Floats]) -> None:
        """The trajectories of the next runs that are wanted, each (rows, columns).

        Raises TypeError or ValueError for what the function may not give, and what it raises.
        """
        if self.reduce and runs:
            self._reduced.append(self._of(self.reduce, runs, trajectories))
        self._kept |= {
            run: rows for run, rows in zip(runs, trajectories, strict=True) if self.keep and run % self.keep == 0
        }

    def _of(self, reduce: Reduce, runs: Sequence[int], trajectories: Sequence[Floats]) -> dict[str, Column]:
        padded = np.full((len(runs), max(map(len, trajectories)), len(self.system.trajectory)), np.nan)
        for place, rows in zip(padded, trajectories, strict=True):
            place[: len(rows)] = rows
        given: dict[str, Column] = {"run": np.array(runs)}
        given |= {entry.name: padded[:, :, k] for k, entry in enumerate(self.system.trajectory)}
        where = f"reduce, runs {runs[0]} to {runs[-1]}"
        try:
            result = reduce(given)
        except Exception as error:
            error.add_note(f"in {where}")
            raise
        expect_keys(result, f"of {where}: columns such as {{'peak': array}}")
        found = {name: np.asarray(values) for name, values in result.items()}
        for name, values in found.items():
            if values.shape != (len(runs),) or values.dtype.kind not in "biufU":
                shape = f"has shape {values.shape} and type {values.dtype}"
                text = f"expected a number, text or truth value for each of {len(runs)} runs"
                raise ValueError(f"{where}: column {name!r} {shape}, {text}")
        known = found.keys() & {"run", *self.keys, *metrics_schema(self.system).names, *given}
        if known:
            raise ValueError(
                f"{where}: expected other names than those of columns there are: {', '.join(sorted(known))}"
            )
        before = self._reduced[0].keys() if self._reduced else found.keys()
        if found.keys() != before:
            raise ValueError(f"{where}: columns {list(found)}, expected those of the runs before, {list(before)}")
        return found

    def reduced(self) -> pa.Table:
        """The columns that the function gave; NaN is null."""
        found = {
            name: np.concatenate([part[name] for part in self._reduced])
            for name in (self._reduced[0] if self._reduced else ())
        }
        return pa.table({
            name: arrow_array(values, pa.from_numpy_dtype(values.dtype), null=True) for name, values in found.items()
        })  # fmt: skip

    def kept(self) -> pa.Table:
        """A list in each column of a trajectory, null for runs of which none is kept."""
        if not self.keep:
            return pa.table({})
        lengths = [len(self._kept.get(run, ())) for run in range(self.runs)]
        ends = arrow_array(np.cumsum([0, *lengths]), pa.int64())
        absent = arrow_array([run not in self._kept for run in range(self.runs)], pa.bool_())
        rows = np.concatenate(list(self._kept.values()))
        lists = [pa.LargeListArray.from_arrays(ends, arrow_numbers(column), mask=absent) for column in rows.T]
        fields = [entry.with_type(pa.large_list(pa.float64())) for entry in trajectory_schema(self.system)]
        return pa.Table.from_arrays(lists, schema=pa.schema(fields))
