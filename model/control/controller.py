"""What a controller has to tell: its parameters, what it remembers, and the command that it computes.

    command  u = control(r, y, z),   limited per motor to +-U_max
    memory   dz/dt, integrated with the plant where the control is continuous; where it is sampled, z goes on once a
             sample, by an explicit Euler step of the control period or as `update` says, and is held like the command

A controller is one class. Names in it: reference r.q, r.dq, r.ddq; what is measured y.q1, y.dq1 and, on the elastic
drive, y.q2, y.dq2; states z.<name>; parameters p.<name>; model(q, dq).M, .c, .G, .H of the arm as the controller
believes it to be. All are n x 1, but for M and H (n x n) and the parameters and states that there is one of.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import add
from typing import ClassVar

from springline.model import lazy_casadi as ca
from springline.model.control.reaching import Law
from springline.model.control.sliding import SurfaceExponents
from springline.model.declared import (
    expect_names,
    expect_parameters,
    expect_text,
    hash_of,
    is_number,
    snake_case,
    symbols_of,
)
from springline.model.dynamics import EquationsOfMotion
from springline.model.parameters import Joint, Parameter, Values
from springline.model.perturbation import slow_mass
from springline.model.quantities import SIGMA, U_WISHED, Quantity
from springline.model.terms import named, section

States = Mapping[str, "ca.SX"]
Rates = States | Callable[["ca.SX"], States]
"""One expression per state, by name; or what gives them, called with the command that U_max let through."""


@dataclass(frozen=True, slots=True)
class ArmTerms:
    """The arm's equations at one place: mass matrix M, c = C dq, gravity G, and H = M + M2 with the motors' inertia."""

    M: ca.SX
    c: ca.SX
    G: ca.SX
    H: ca.SX


class ArmModel:
    """The arm as its controller believes it to be, base at rest: model(q, dq) for joint coordinates and rates n x 1."""

    def __init__(self, terms: EquationsOfMotion, q: ca.SX, dq: ca.SX, motor_inertia: ca.SX) -> None:
        self._symbols = ca.vertcat(q, dq)
        self._terms = ArmTerms(terms.mass, terms.coriolis, terms.gravity, slow_mass(terms.mass, motor_inertia))

    @property
    def constants(self) -> ca.SX:
        """What the terms depend on besides q and dq, as a column."""
        terms = self._terms
        known = symbols_of(self._symbols)
        everything = ca.symvar(ca.vertcat(*(ca.vec(item) for item in (terms.M, terms.c, terms.G, terms.H))))
        return ca.vertcat(ca.SX(0, 1), *(item for item in everything if hash_of(item) not in known))

    def __call__(self, q: ca.SX, dq: ca.SX) -> ArmTerms:
        """The terms at q, dq."""
        at = ca.vertcat(q, dq)
        if ca.is_equal(at, self._symbols):
            return self._terms
        terms = self._terms
        return ArmTerms(*ca.substitute([terms.M, terms.c, terms.G, terms.H], [self._symbols], [at]))


@dataclass(frozen=True, slots=True)
class Control:
    """What a controller computes.

    u            the whole command, before U_max, n x 1
    dz           time derivatives of its states
    error        tracking error, n x 1
    diagnostics  what else it declares to show, by the quantities' names
    a_law        what its reaching law asks for before a_max limits it, n x 1; None without a law. The loop checks it,
                 for a limit turns infinity into a number
    """

    u: ca.SX
    error: ca.SX
    dz: Rates = field(default_factory=dict)
    diagnostics: Mapping[str, ca.SX] = field(default_factory=dict)
    a_law: ca.SX | None = None


@dataclass(frozen=True, slots=True)
class Condition:
    """What a theorem asks of a gain: that it be greater than something. Where it is not, the user is warned.

    gain     the parameter;  value: it, a scalar or n x 1
    least    what it must exceed, likewise;  relation: that as a formula, for people
    theorem  for people;  effect: what does not follow from it otherwise
    """

    gain: str
    value: ca.SX
    least: ca.SX
    relation: str
    theorem: str
    effect: str


class Controller(ABC):
    """A controller. A subclass says at least how it computes the command.

    name         in a Structure: the class's name in snake_case unless the class says otherwise
    title        for people: the name unless the class says otherwise
    parameters   what it reads besides the [control] table that all controllers have
    states       what it remembers, with initial values
    diagnostics  what it shows besides the error: SIGMA, if it has a sliding variable; all others are the parts that
                 the command is the sum of, in this order and as far as the drive has them
    """

    name: ClassVar[str]
    title: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    states: ClassVar[tuple[Quantity, ...]] = ()
    diagnostics: ClassVar[tuple[Quantity, ...]] = ()

    def __init_subclass__(cls) -> None:
        """Name the class unless it names itself."""
        cls.name = vars(cls).get("name", snake_case(cls.__name__))
        cls.title = vars(cls).get("title", cls.name)

    @property
    def law(self) -> Law | None:
        """The reaching law, which a_max limits, of one that has one."""
        return None

    def with_law(self, law: Law, exponents: SurfaceExponents) -> Controller:
        """The controller with the law and the surface that a structure names; without a law it is the same."""
        return self

    @abstractmethod
    def control(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values) -> Control:
        """Command, rates of the states and diagnostics."""

    def update(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values, h: ca.SX) -> Rates | None:
        """The states one sample of h seconds later, where the control is sampled; None for an explicit Euler step."""
        return None

    def conditions(self, p: Values) -> Sequence[Condition]:
        """What its theory asks of its gains."""
        return ()


@dataclass(frozen=True, slots=True)
class ControlSignals:
    """What the loop takes of a controller, n x 1 each but for the states.

    command  what the motors are told, after the limit;  wished: before it
    parts    what `wished` is the sum of, by quantity
    error    tracking error;  sigma: sliding variable;  a_law: the law before a_max; both zero where there is none
    dz       rates of the states as one column;  ahead: the states one sample later
    """

    command: ca.SX
    wished: ca.SX
    parts: dict[Quantity, ca.SX]
    error: ca.SX
    sigma: ca.SX
    a_law: ca.SX
    dz: ca.SX
    ahead: ca.SX


def states_of(declared: Sequence[Quantity], joints: Sequence[Joint], z: ca.SX) -> Values:
    """The column z by the states' names."""
    sizes = [len(state.entries(joints)) for state in declared]
    ends = [sum(sizes[: k + 1]) for k in range(len(sizes))]
    return Values({state.name: z[end - size : end] for state, size, end in zip(declared, sizes, ends, strict=True)})


@dataclass(frozen=True, slots=True)
class Checked:
    """What a controller or an observer gives, by name and shape. Its methods raise ValueError with the owner's name.

    owner  "controller servo"
    """

    owner: str
    joints: Sequence[Joint]

    def column(self, what: str, value: ca.SX, rows: int) -> ca.SX:
        """A value that must have one column."""
        shape = ca.SX(value).shape
        if shape != (rows, 1):
            raise ValueError(f"{self.owner}: {what} has shape {shape[0]} x {shape[1]}, expected {rows} x 1")
        return ca.SX(value)

    def by_name(self, what: str, values: Mapping[str, ca.SX], wanted: Sequence[Quantity]) -> dict[str, ca.SX]:
        """Values of some quantities, in their order; no others."""
        unknown = [name for name in values if name not in {item.name for item in wanted}]
        if unknown:
            known = ", ".join(item.name for item in wanted) or "nothing"
            raise ValueError(f"{self.owner}: {what} has {unknown[0]!r}, expected {known}")
        return {
            item.name: self.column(f"{what} of {item.name!r}", values[item.name], len(item.entries(self.joints)))
            for item in wanted
            if item.name in values
        }

    def stacked(self, what: str, values: Mapping[str, ca.SX], states: Sequence[Quantity]) -> ca.SX:
        """Values of all states, one column."""
        found = self.by_name(what, values, states)
        for state in states:
            if state.name not in found:
                size = len(state.entries(self.joints))
                raise ValueError(f"{self.owner}: {what} has no {state.name!r}, expected {size} x 1 for this state")
        return ca.vertcat(*found.values()) if found else ca.SX(0, 1)


def commanded(
    controller: Controller,
    joints: Sequence[Joint],
    r: Values,
    y: Values,
    z: ca.SX,
    model: ArmModel,
    p: Values,
    h: ca.SX,
) -> ControlSignals:
    """What a controller computes, limited per motor to +-U_max and checked                                     (E4).

    z  the states as one column;  h: the sample period, s;  the others as in Controller.control
    Raises ValueError, with the controller's name, for what it leaves out, has too much, or gives another shape.
    """
    n, states = len(joints), states_of(controller.states, joints, z)
    checked = Checked(f"controller {controller.name}", joints)
    given = controller.control(r, y, states, model, p)
    if not isinstance(given, Control):
        raise ValueError(f"controller {controller.name}: control: expected a Control, got {type(given).__name__}")
    for what, items in (("dz", {} if callable(given.dz) else given.dz), ("diagnostics", given.diagnostics)):
        if not isinstance(items, Mapping):
            raise ValueError(
                f"controller {controller.name}: {what}: expected a dict of names and expressions, "
                f"got {type(items).__name__}"
            )

    def stacked(what: str, rates: Rates) -> ca.SX:
        return checked.stacked(what, rates(command) if callable(rates) else rates, controller.states)

    wished, error = checked.column("u", given.u, n), checked.column("error", given.error, n)
    if controller.law and given.a_law is None:
        raise ValueError(f"controller {controller.name}: Control has no a_law, expected what its law asks for")
    a_law = ca.SX.zeros(n) if given.a_law is None else checked.column("a_law", given.a_law, n)
    shown = checked.by_name("diagnostics", given.diagnostics, controller.diagnostics)
    if SIGMA in controller.diagnostics and SIGMA.name not in shown:
        raise ValueError(f"controller {controller.name}: diagnostics has no 'sigma', which the class declares")
    parts = {item: shown[item.name] for item in controller.diagnostics if item != SIGMA and item.name in shown}
    parts = parts or {U_WISHED: wished}
    if not ca.is_equal(ca.densify(reduce(add, parts.values())), ca.densify(wished), 100):
        names = " + ".join(item.name for item in parts)
        raise ValueError(f"controller {controller.name}: u is not {names}, the parts that diagnostics has")
    with section("command, limited per motor", "(13), E4"):
        command = named("u", ca.fmin(ca.fmax(named("u_wished", wished), -p.U_max), p.U_max))
    dz = stacked("dz", given.dz)
    later = controller.update(r, y, states, model, p, h)
    ahead = z + h * dz if later is None else stacked("update", later)
    sigma = shown.get(SIGMA.name, ca.SX.zeros(n))
    return ControlSignals(command, wished, parts, error, sigma, a_law, dz, ahead)


def check_controller(controller: Controller) -> None:
    """Raise ValueError, with what was expected, for a controller whose declarations cannot be used."""
    owner = f"controller {type(controller).__name__}"
    expect_names(owner, "name", [controller.name])
    expect_text(owner, "title", controller.title)
    expect_parameters(owner, "parameters", controller.parameters, ())
    for what in ("states", "diagnostics"):
        check_states(owner, what, getattr(controller, what))


def check_states(owner: str, what: str, declared: object) -> None:
    """Raise ValueError for what is no tuple of quantities with different names, units and finite initial values."""
    if not isinstance(declared, tuple) or not all(isinstance(item, Quantity) for item in declared):
        raise ValueError(f"{owner}: {what}: expected a tuple of Quantity, got {declared!r}")
    expect_names(owner, what, [item.name for item in declared])
    for item in declared:
        for text in (item.unit, item.meaning):
            expect_text(owner, f"{what}, {item.name}", text)
        if not is_number(item.initial) or not math.isfinite(item.initial):
            raise ValueError(f"{owner}: {what}, {item.name}: expected a finite initial value, got {item.initial!r}")
