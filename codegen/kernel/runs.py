"""What the loop gives of its runs, and what that means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from springline.codegen.kernel.job import STATUSES
from springline.model import metrics
from springline.model.system import System

Floats = NDArray[np.float64]


METRICS = tuple(metric.name for metric in metrics.METRICS)
"""Names of the metrics of each joint, in their order."""

STATUS = tuple(STATUSES)
"""How a run ends, by number."""

CHATTERING = 20.0
"""1/s: a command whose `chatter` is larger chatters. Clean runs have 0 to 1.3."""
_SWINGS = 4.0  # so many at least, or the one swing of a run that lasts no time would be taken for many in a second


@dataclass(frozen=True, slots=True)
class Runs:
    """Results, one row a run.

    metrics      (runs, joints, len(METRICS)), NaN where there is none
    final_state  (runs, states), the last finite state, that of the controller behind the plant's;  end_time (runs,), s
    status       (runs,) index into STATUS
    quantity     (runs,) place in System.judged of what left its bound (`quantity_name`), or -1
    trajectory   (runs, rows, columns) or None;  rows (runs,) rows that were written
    """

    metrics: Floats
    final_state: Floats
    end_time: Floats
    status: NDArray[np.int32]
    quantity: NDArray[np.int32]
    trajectory: Floats | None = None
    rows: NDArray[np.int64] | None = None


def joined(parts: Sequence[Runs]) -> Runs:
    """The Runs of several calls as those of one, without trajectories."""
    names = ("metrics", "final_state", "end_time", "status", "quantity")
    return Runs(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def chatters(chatter: Floats, duration: Floats | float) -> NDArray[np.bool_]:
    """Which commands chatter: they go to and fro often in a second, and more than twice in the half that was looked at.

    chatter   the metric, 1/s;  duration  of the runs, s
    """
    return np.asarray((chatter > CHATTERING) & (chatter * (np.asarray(duration) / 2.0) > _SWINGS), dtype=np.bool_)


def quantity_name(system: System, quantity: int) -> str:
    """Name of what left its bound, "dq2_lift"; `quantity` as in Runs."""
    return system.judged[quantity].name
