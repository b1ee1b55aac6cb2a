"""What of a system is structure and no number: a new structure is a new kernel, a new number is not."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from springline.model.base import BaseCoordinate, moving
from springline.model.control import LogForm, ObserverInput, SurfaceExponents
from springline.model.drive import DriveKind

SignalKind = Literal["none", "sine", "polynomial", "table", "own", "input"]
MotorStart = Literal["unloaded", "equilibrium", "given"]
JointStart = Literal["given", "reference"]
Feedforward = Literal["none", "base"]


@dataclass(frozen=True, slots=True)
class SignalShape:
    """The shape of a vector signal: its kind, and what it has per coordinate.

    kind   "input": its values come from outside, step by step, and are zero in a simulation
    terms  sine: number of terms; polynomial: number of via points; table and own: 1 for one that moves, 0 (zero)
           without; of the base one for each of COORDINATES, of which zeros at the end may be left out
    own    the user's class that it is, by its key in MOTIONS
    """

    kind: SignalKind = "none"
    terms: tuple[int, ...] = ()
    own: str = ""


@dataclass(frozen=True, slots=True)
class Structure:
    """Everything about a system that is no number: a new structure is a new kernel, a new number is not.

    size           how many joints a mechanism has that comes in several sizes, 0 for as many as it has
    controller     by name; law, log_form and exponents are those of one that has a reaching law
    observer       of disturbances, by name;  observer_input: what drives it
    feedforward    whether the controller is told how the base moves
    start          whether the joints start where "initial.q" and "initial.dq" say, or on the reference
    effects        properties of sensors and motors, by name, in the order in which they act
    delay          steps from a command to when it arrives at the motors; in a kernel the most that its runs may have
    differenced    whether the controller is told of positions alone, and makes out the rates by itself
    disturbance    forces on the links, per joint; not even zero where its kind is "none"
    friction       damping and friction that there is, names of drive.FRICTION in their order
    initial_motor  where the motors start: with unloaded springs, with springs that carry the weight, or where they are
                   told; on the reference they start with springs that carry the arm along it
    mount          whether the arm's foot stands elsewhere than at the base's origin
    mount_rpy      whether the arm's axes are turned against the base's
    """

    mechanism: str = "transfer_manipulator"
    law: str = "variable_power_log"
    log_form: LogForm = "power"
    exponents: SurfaceExponents = field(default_factory=SurfaceExponents)
    reference: SignalShape = SignalShape("sine", (1, 1))
    base_motion: SignalShape = SignalShape("none", (0, 0, 0))
    initial_motor: MotorStart = "unloaded"
    drive: DriveKind = "elastic"
    start: JointStart = "given"
    integrator: str = "rk4"
    effects: tuple[str, ...] = ()
    controller: str = "terminal_sliding"
    size: int = 0
    mount: bool = False
    mount_rpy: bool = False
    friction: tuple[str, ...] = ()
    disturbance: SignalShape = SignalShape()
    observer: str = "none"
    observer_input: ObserverInput = "command"
    feedforward: Feedforward = "none"
    delay: int = 0
    differenced: bool = False

    @property
    def base_coordinates(self) -> tuple[BaseCoordinate, ...]:
        """What b, its rate and its acceleration have one entry of."""
        return moving(self.base_motion.terms)


@dataclass(frozen=True, slots=True)
class TableLayout:
    """Where a table stands in the data vector d: d[start] is tau (s from the knot), then four coefficients a channel.

    channels: indices of the signal's coordinates that have a column, in the order of their coefficients.
    """

    signal: Literal["reference", "base_motion", "disturbance"]
    start: int
    channels: tuple[int, ...]
