"""What figures of a dataset show: its rows as arrays, with titles and marks for the axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa
from matplotlib.axis import Axis
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from springline.model.parameters import Joint
from springline.runner.files import numpy_array
from springline.runner.report import label, name_axis
from springline.runner.sweep.summary import chattering

Floats = NDArray[np.float64]

MOST_GROUPS = 6
STOPPED = "#D55E00"


@dataclass(frozen=True)
class Runs:
    """The rows that figures show, as arrays."""

    table: pa.Table
    units: dict[str, str]
    joints: tuple[Joint, ...]
    keys: list[str]
    logarithmic: dict[str, bool]
    group: NDArray[np.int64]
    names: list[str]
    gridded: bool

    def __getitem__(self, column: str) -> Floats:
        return numpy_array(self.table[column].cast(pa.float64()))

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which runs ended as they should."""
        return np.asarray(np.array(self.table["status"].to_pylist()) == "ok", dtype=np.bool_)

    @property
    def chattering(self) -> NDArray[np.bool_]:
        """Which runs chatter."""
        return chattering(self.table, self.joints)

    def title(self, column: str) -> str:
        """Axis label of a column."""
        unit = self.units[column]
        return f"{short(column)} [{unit}]" if " or " in unit else label(short(column), unit)

    def name(self, axis: Axis, column: str, text: str = "") -> None:
        """Label an axis with a column, or with `text` for it, and the SI prefix that suits: once all is drawn."""
        unit = self.units[column]
        if " or " in unit:
            axis.set_label_text(self.title(column))
        else:
            name_axis(axis, text or short(column), unit)


def short(column: str) -> str:
    """A key without its table, as the sweep has it; a metric in words."""
    _, dot, name = column.partition(".")
    return name if dot else column.replace("steady_state_error", "steady-state error").replace("_", " ")


PLAIN = FuncFormatter(lambda value, place: f"{value:g}")


def plain_decades(axis: Axis) -> None:
    """Marks at 1, 2 and 5 of each decade (of many decades at 1 only), written out."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 100 * low else (1,)))
    axis.set_major_formatter(PLAIN)
    axis.set_minor_formatter(NullFormatter())
