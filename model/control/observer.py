"""What an observer has to tell: its parameters, what it remembers, and which disturbance it makes out.

    q̈1 = H^-1 (u - C dq1 - G) + d

u is what drives the arm as the controller believes it to be: the command that U_max let through, less what the motors'
inertia is not part of (H has it); or, where the motors' position is measured, the force of the springs, and then M
stands for H. A controller is told r.ddq - d in place of r.ddq, and needs to know of no observer.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal

from springline.model import lazy_casadi as ca
from springline.model.control.controller import ArmModel, Checked, Condition, check_states, states_of
from springline.model.declared import column, expect_names, expect_parameters, expect_text, snake_case, symbols_of
from springline.model.parameters import Joint, Parameter, Values
from springline.model.quantities import Quantity
from springline.model.terms import noted

ObserverInput = Literal["command", "spring"]
Estimate = tuple["ca.SX", Mapping[str, "ca.SX"]]
"""The disturbance d, n x 1, and the rates of the observer's states by name."""

INPUT = "input"
"""Key of an observer's table [control.<its name>] for what drives it."""


class Observer(ABC):
    """An observer of disturbances. A subclass says at least how it estimates.

    name        in a Structure: the class's name in snake_case unless the class says otherwise
    title       for people: the name unless the class says otherwise
    parameters  what it reads, of [control.<its name>];  states: what it remembers, with initial values
    inputs      what may drive it, its default first: "command", or "spring" on the elastic drive
    """

    name: ClassVar[str]
    title: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    states: ClassVar[tuple[Quantity, ...]] = ()
    inputs: ClassVar[tuple[ObserverInput, ...]] = ("command",)

    def __init_subclass__(cls) -> None:
        """Name the class unless it names itself."""
        cls.name = vars(cls).get("name", snake_case(cls.__name__))
        cls.title = vars(cls).get("title", cls.name)

    def driven_by(self, source: ObserverInput) -> Observer:
        """The observer with one of its inputs; one that has no choice is the same."""
        return self

    @abstractmethod
    def estimate(self, y: Values, u: ca.SX, z: Values, model: ArmModel, p: Values) -> Estimate:
        """The disturbance d as an acceleration, n x 1, of y and z alone, and the rates of the states."""

    def conditions(self, p: Values) -> Sequence[Condition]:
        """What its theory asks of its gains."""
        return ()


class NoObserver(Observer):
    """What stands for an observer where there is none."""

    name = "none"
    title = "no observer"

    def estimate(self, y: Values, u: ca.SX, z: Values, model: ArmModel, p: Values) -> Estimate:
        """No disturbance."""
        return ca.SX.zeros(u.numel()), {}


def check_observer(observer: Observer) -> None:
    """Raise ValueError, with what was expected, for an observer whose declarations cannot be used."""
    owner = f"observer {type(observer).__name__}"
    expect_names(owner, "name", [observer.name])
    expect_text(owner, "title", observer.title)
    expect_parameters(owner, "parameters", observer.parameters, ())
    if INPUT in {item.name for item in observer.parameters}:
        raise ValueError(f"{owner}: parameters: {INPUT!r} is a key of every observer")
    known = ("command", "spring")
    if not observer.inputs or any(item not in known for item in observer.inputs):
        raise ValueError(f"{owner}: inputs: expected a tuple of {' and '.join(known)}, got {observer.inputs!r}")
    check_states(owner, "states", observer.states)


class Observing:
    """An observer at work: its disturbance d, n x 1, and the rates of its states for what drives the arm.

    z  its states as one column;  the others as in Observer.estimate
    Raises ValueError, with the observer's name, for what it leaves out, has too much, or gives another shape, and for a
    d that depends on more than y and z.
    """

    def __init__(
        self, observer: Observer, joints: Sequence[Joint], y: Values, z: ca.SX, model: ArmModel, p: Values
    ) -> None:
        self._observer = observer
        self._checked = Checked(f"observer {observer.name}", joints)
        self._given = (y, states_of(observer.states, joints, z), model, p)
        owner, n = self._checked.owner, len(joints)
        u = ca.SX.sym("u", n)
        with noted():  # of a u that there is not; `rates` notes them of the one that there is
            d, _ = self._estimate(u)
        if isinstance(d, ca.SX) and ca.depends_on(d, u):
            raise ValueError(f"{owner}: d depends on u, expected y and z alone: u is computed from d")
        self.d = column(owner, "d", d, n, symbols_of(*y.values(), z, *p.values(), model.constants))

    def _estimate(self, u: ca.SX) -> Estimate:
        y, z, model, p = self._given
        given = self._observer.estimate(y, u, z, model, p)
        if not isinstance(given, tuple) or len(given) != 2 or not isinstance(given[1], Mapping):
            raise ValueError(f"{self._checked.owner}: estimate: expected (d, rates of the states by name)")
        return given

    def rates(self, u: ca.SX) -> ca.SX:
        """Rates of the states as one column, with u (n x 1) as what drives the arm."""
        return self._checked.stacked("dz", self._estimate(u)[1], self._observer.states)
