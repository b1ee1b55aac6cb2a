"""Columns of trajectories and metrics as Arrow tables, with units."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from springline.codegen.kernel import METRICS, STATUS, Runs
from springline.model.system import System
from springline.runner.files import arrow_numbers, arrow_texts

Floats = NDArray[np.float64]


def field(name: str, unit: str, kind: pa.DataType | None = None) -> pa.Field:
    """An Arrow field that carries its SI unit in its metadata."""
    return pa.field(name, kind or pa.float64(), metadata={"unit": unit})


def trajectory_schema(system: System) -> pa.Schema:
    """Columns of a trajectory, in the order of the loop's rows."""
    return pa.schema([field(entry.name, entry.unit) for entry in system.trajectory])


def metrics_schema(*systems: System) -> pa.Schema:
    """Columns of a table of metrics, metric by metric, then status and t_end.

    Of several systems it has the columns of each. Raises ValueError where one name has two units.
    """
    units: dict[str, str] = {}
    for k in range(len(METRICS)):
        for system in systems:
            for entry in system.metrics[k * system.n : (k + 1) * system.n]:
                if units.setdefault(entry.name, entry.unit) != entry.unit:
                    raise ValueError(f"{entry.name} would be in {units[entry.name]} and in {entry.unit}")
    judged = [field(name, unit) for name, unit in units.items()]
    return pa.schema([*judged, field("status", "", pa.string()), field("t_end", "s")])


def trajectory_table(system: System, rows: Floats) -> pa.Table:
    """A trajectory, of the loop's rows (times, columns)."""
    return pa.Table.from_arrays([arrow_numbers(column) for column in rows.T], schema=trajectory_schema(system))


def metrics_table(system: System, runs: Runs) -> pa.Table:
    """Metrics of all runs, one row each."""
    columns = [arrow_numbers(runs.metrics[:, j, k], null=True) for k in range(len(METRICS)) for j in range(system.n)]
    status = arrow_texts([STATUS[i] for i in runs.status])
    return pa.Table.from_arrays([*columns, status, arrow_numbers(runs.end_time)], schema=metrics_schema(system))
