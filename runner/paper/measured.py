"""What a run shows: its metrics, its columns over time, and statistics of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Measured:
    """One run as it is judged.

    columns  trajectory by column name, rows equally spaced in time; the cases of the paper have, besides the columns of
             a Result, dq1d_<joint> and velocity_error_<joint> (dq1d - dq1)
    metrics  <metric>_<joint> -> value, NaN where there is none
    status   "ok", or why the run stopped;  message  the same as a sentence
    """

    columns: Mapping[str, Floats]
    metrics: Mapping[str, float]
    status: str = "ok"
    message: str = ""

    def __getitem__(self, column: str) -> Floats:
        return self.columns[column]

    def metric(self, name: str, joint: str) -> float:
        """A metric of a joint in SI units, NaN if there is none."""
        return self.metrics[f"{name}_{joint}"]

    @property
    def end(self) -> float:
        """Time of the last row, s."""
        return float(self["t"][-1])

    def late(self, column: str, since: float = 0.5) -> Floats:
        """The rows of a column from the share `since` of the run on."""
        t = self["t"]
        rows: Floats = self[column][t >= t[0] + since * (t[-1] - t[0])]
        return rows

    def largest(self, column: str, since: float = 0.5) -> float:
        """Largest magnitude of a column from the share `since` of the run on, in the column's unit."""
        return float(np.max(np.abs(self.late(column, since))))

    def variation_rate(self, column: str, start: float) -> float:
        """Total variation of a column per second after the time `start` (s); NaN if nothing follows."""
        rows = self["t"] >= start
        if np.count_nonzero(rows) < 2:
            return float("nan")
        length = float(self["t"][-1] - self["t"][rows][0])
        return float(np.sum(np.abs(np.diff(self[column][rows])))) / length

    def above(self, column: str, frequency: float) -> Floats:
        """What a column holds above a frequency (Hz), in its unit, row by row.

        A Butterworth high-pass of fourth order, run forwards and backwards.
        """
        step = float(self["t"][1] - self["t"][0])
        sections = signal.butter(4, frequency, "highpass", fs=1 / step, output="sos")
        filtered: Floats = signal.sosfiltfilt(sections, self[column])
        return filtered

    def ripple(self, column: str, above: float, since: float = 0.5) -> float:
        """RMS of what a column holds above a frequency (Hz) from the share `since` of the run on, in its unit.

        The last twentieth is left out, for there the filter knows no future.
        """
        filtered = self.above(column, above)
        rows = len(filtered)
        return float(np.sqrt(np.mean(filtered[int(since * rows) : int(0.95 * rows)] ** 2)))


def first_time(t: Floats, inside: NDArray[np.bool_]) -> float:
    """The first time (s) at which a condition holds, NaN if it never does."""
    rows = np.flatnonzero(inside)
    return float(t[rows[0]]) if len(rows) else float("nan")


def lasting_time(t: Floats, inside: NDArray[np.bool_]) -> float:
    """The time (s) from which on a condition holds to the end, NaN if it does not hold at the end."""
    rows = np.flatnonzero(~inside)
    if not len(rows):
        return float(t[0])
    return float(t[rows[-1] + 1]) if rows[-1] + 1 < len(t) else float("nan")
