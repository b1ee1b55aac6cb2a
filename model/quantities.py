"""Quantities: what the loop carries, by name, symbol, unit and meaning, declared once.

Trajectory columns, C structures and their comments, FMU variables, metrics, figure labels and the tables in the
documentation are printed from these declarations. A Quantity has one entry per joint, per base coordinate, or one; an
Entry is one number of it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from springline.model.base import PAPER_COORDINATES, BaseCoordinate
from springline.model.parameters import Joint

Scope = Literal["joint", "base", "scalar"]


@dataclass(frozen=True, slots=True)
class Entry:
    """One number of a quantity.

    name    column, C member and FMU variable: "q1_lift"
    unit    SI
    joint   its joint, None where it has none
    """

    name: str
    unit: str
    meaning: str
    joint: Joint | None = None


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number, or one per joint or base coordinate.

    name     before "_<joint>" in the names of its entries; before the coordinate's symbol where it is the base's
    symbol   for figures, in TeX's mathematics
    unit     SI; "{q}" and "{F}" stand for the coordinate's unit and its force's
    meaning  a phrase without a full stop
    per      what it has one entry of;  coordinates: those of the base, where it is that
    initial  its value at the beginning, where it is a state of the controller
    """

    name: str
    symbol: str
    unit: str
    meaning: str
    per: Scope = "joint"
    initial: float = 0.0
    coordinates: tuple[BaseCoordinate, ...] = PAPER_COORDINATES

    def entries(self, joints: Sequence[Joint]) -> tuple[Entry, ...]:
        """Its entries for an arm with these joints, in the order of a column vector."""
        if self.per == "joint":
            return tuple(
                Entry(
                    f"{self.name}_{joint.name}",
                    self.unit.format(q=joint.unit, F=joint.force),
                    f"{self.meaning} ({joint.name})",
                    joint,
                )
                for joint in joints
            )
        if self.per == "base":
            return tuple(
                Entry(f"{self.name}{c.symbol}", self.unit.format(q=c.unit), f"{self.meaning}: {c.key}, {c.positive}")
                for c in self.coordinates
            )
        return (Entry(self.name, self.unit, self.meaning),)


def entries(quantities: Iterable[Quantity], joints: Sequence[Joint]) -> tuple[Entry, ...]:
    """The entries of several quantities, one after the other."""
    return tuple(entry for quantity in quantities for entry in quantity.entries(joints))


T = Quantity("t", "t", "s", "time", per="scalar")

# The state, and its derivative
Q1 = Quantity("q1", "q_1", "{q}", "joint coordinate")
DQ1 = Quantity("dq1", r"\dot q_1", "{q}/s", "joint rate")
DDQ1 = Quantity("ddq1", r"\ddot q_1", "{q}/s^2", "joint acceleration")
Q2 = Quantity("q2", "q_2", "{q}", "motor coordinate, reflected to the joint")
DQ2 = Quantity("dq2", r"\dot q_2", "{q}/s", "motor rate, reflected to the joint")
DDQ2 = Quantity("ddq2", r"\ddot q_2", "{q}/s^2", "motor acceleration, reflected to the joint")

DERIVATIVES = {Q1: DQ1, DQ1: DDQ1, Q2: DQ2, DQ2: DDQ2}
"""Quantity of the state -> its derivative."""

# The reference
Q1D = Quantity("q1d", r"q_{1d}", "{q}", "reference of the joint coordinate")
DQ1D = Quantity("dq1d", r"\dot q_{1d}", "{q}/s", "reference of the joint rate")
DDQ1D = Quantity("ddq1d", r"\ddot q_{1d}", "{q}/s^2", "reference of the joint acceleration")
REFERENCE = (Q1D, DQ1D, DDQ1D)

# The base
B = Quantity("", "b", "{q}", "motion of the base", per="base")
DB = Quantity("d_", r"\dot b", "{q}/s", "rate of the base", per="base")
DDB = Quantity("dd_", r"\ddot b", "{q}/s^2", "acceleration of the base", per="base")
BASE = (B, DB, DDB)

# The links
DISTURBANCE = Quantity("disturbance", "F_d", "{F}", "disturbance force on the link, positive along +q1")

# The tip: in the ship's axes from the base's origin, and in the inertial ones, which the ship has at rest
_TIP = [
    (f"{axis}_{frame}", rf"{axis}_\mathrm{{{frame}}}", f"tip along {axis}, {meaning}, {seen}")
    for frame, seen in (("ship", "as seen from the ship"), ("inertial", "as seen from the earth"))
    for axis, meaning in (("x", "forward"), ("y", "up"), ("z", "to starboard"))
]
TIP = tuple(Quantity(f"tip_{name}", symbol, "m", meaning, per="scalar") for name, symbol, meaning in _TIP)
TIP_RATE = tuple(
    Quantity(f"d_tip_{name}", rf"\dot {symbol}", "m/s", f"rate of the {meaning}", per="scalar")
    for name, symbol, meaning in _TIP
)

# The controller
U = Quantity("U", "U", "{F}", "command to the motor")
U_CMD = Quantity("U_cmd", r"U_\mathrm{cmd}", "{F}", "command of the controller, which arrives at the motors later")
E = Quantity("e", "e", "{q}", "tracking error")
SIGMA = Quantity("sigma", r"\sigma", "{q}/s", "sliding variable")
U_S = Quantity("U_s", "U_s", "{F}", "slow part of the command, before its limit")
U_WISHED = Quantity("U_wished", r"U_w", "{F}", "command before its limit")
U_F = Quantity("U_f", "U_f", "{F}", "fast part of the command, before its limit")
A_LAW = Quantity("a_law", "a", "{q}/s^2", "acceleration that the reaching law asks for before a_max")
SATURATED = Quantity("saturated", "U = U_{max}", "0 or 1", "whether U_max limits the command")
A_LIMITED = Quantity("a_limited", "a = a_{max}", "0 or 1", "whether a_max limits the reaching law")
