"""What a run gave, as tables: what figures and reports are made from."""

from __future__ import annotations

from dataclasses import dataclass

import pyarrow as pa


@dataclass(frozen=True, slots=True)
class Simulated:
    """What a run gave.

    trajectory  columns as System.trajectory has them: t, the state, q1d_, e_, sigma_, U_ per joint, the base
    metrics     one row, columns as System.metrics has them; null where there is none
    status      "ok", "diverged", "out_of_bounds" or "out_of_limits"
    message     one sentence: for a run that stopped, the quantity and the time at which it left its bound; for one that
                chatters, how much
    """

    trajectory: pa.Table
    metrics: pa.Table
    status: str
    message: str
