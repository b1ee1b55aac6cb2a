"""What a mechanism has to tell: its joints, its parameters and what it consists of. All else has a default."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, Literal

from springline.model import lazy_casadi as ca
from springline.model.declared import (
    expect_names,
    expect_numbers,
    expect_parameters,
    expect_text,
    is_number,
    snake_case,
    symbols_of,
)
from springline.model.mechanisms.body import Body, Solid, kinetic_energy_of, potential_energy_of, solid
from springline.model.mechanisms.link import Link, Segment, bodies_of, segments_of
from springline.model.parameters import POSITIVE, REAL, Joint, Parameter, Values
from springline.model.signals import SineTerm

# Of the critical damping of a motor on its spring: what the fast control adds unless a mechanism says otherwise. It is
# no small share, for the slow law eats much of it (docs/paper.md, E13).
_FAST_DAMPING = 0.5

TAKEN = frozenset({
    *("name", "limits", "kind", "epsilon", "spring_damping", "link_viscous", "link_coulomb", "motor_viscous"),
    *("motor_coulomb", "coulomb_velocity"),
})  # fmt: skip
"""Keys that [mechanism], [drive] and [plant] have whatever the mechanism is."""


class Mechanism:
    """An arm of n joints, n >= 1. A subclass says its joints, parameters, motors and springs, and what it consists of.

    That is one of: `links` (a kinematic tree), `bodies`, or `kinetic_energy` and `potential_energy`. The equations of
    motion follow; where a subclass says several, energies count before bodies and bodies before links, so that it can
    add to what it has inherited.

    name              in scenario files: the class's name in snake_case unless the class says otherwise
    joints            in the order of q
    parameters        of the two energies; "g" is one of them
    motor_inertia     diagonal of M2: a parameter for each joint, or one with an entry per joint
    stiffness         diagonal of K, likewise; both greater than 0 unless their bounds say otherwise
    reference_offset  constant part of the desired trajectory, one per joint; () for all zero
    reference_terms   sine terms of the desired trajectory, a tuple per joint; () for none
    start_position    initial joint coordinates; () for all zero
    start_rate        initial joint rates; () for all zero
    limits            least and greatest coordinate of each joint, beyond which a run ends; () for none
    control_defaults  what the controller's parameters are for this arm, by name, "super_twisting.slope" for one of
                      [control.super_twisting]: a number, or one per joint
    regular           whether its mass matrix is positive definite for all that its parameters may be
    sizes             how many joints it may have, where that is open; `of_size` then gives the arm with so many
    source            where its equations and numbers come from, a sentence; "" where there is nothing to cite
                      where nothing was measured
    """

    name: ClassVar[str]
    joints: ClassVar[tuple[Joint, ...]]
    parameters: ClassVar[tuple[Parameter, ...]]
    motor_inertia: ClassVar[tuple[Parameter, ...]]
    stiffness: ClassVar[tuple[Parameter, ...]]
    reference_offset: ClassVar[tuple[float, ...]] = ()
    reference_terms: ClassVar[tuple[tuple[SineTerm, ...], ...]] = ()
    start_position: ClassVar[tuple[float, ...]] = ()
    start_rate: ClassVar[tuple[float, ...]] = ()
    limits: ClassVar[tuple[tuple[float, float], ...]] = ()
    control_defaults: ClassVar[Mapping[str, float | tuple[float, ...]]] = {}
    _open: ClassVar[frozenset[str]] = frozenset()
    regular: ClassVar[bool] = False
    sizes: ClassVar[Sequence[int]] = ()
    source: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        """Fill in what the class leaves open and depends on how many joints it has."""
        cls.name = vars(cls).get("name", snake_case(cls.__name__))
        count = len(getattr(cls, "joints", ()))
        blanks = {"reference_offset": 0.0, "reference_terms": (), "start_position": 0.0, "start_rate": 0.0}
        open_ = [name for name in blanks if name not in vars(cls) and (name in cls._open or not getattr(cls, name))]
        for name in open_:
            setattr(cls, name, (blanks[name],) * count)
        cls._open = frozenset(open_)
        for name in ("motor_inertia", "stiffness"):
            declared = vars(cls).get(name)
            if isinstance(declared, tuple) and all(isinstance(item, Parameter) for item in declared):
                setattr(cls, name, tuple(_positive(item) for item in declared))

    def of_size(self, size: int) -> Mechanism:
        """The arm with `size` joints, one of `sizes`; 0 stands for as many as it has."""
        return self

    def links(self, p: Values) -> Sequence[Link]:
        """The kinematic tree: one link per joint, in the order of `joints`.

        `check_mechanism` has refused a class that says neither this nor one of the other two.
        """
        raise NotImplementedError

    def bodies(self, q: ca.SX, p: Values) -> Sequence[Body]:
        """The bodies that the arm consists of, for joint coordinates q (n x 1); those of `links` unless said."""
        return [
            Body(s.mass, s.position, s.rotation, s.inertia[2, 2] if s.planar else s.inertia)
            for s in bodies_of(self.segments(p), q)
        ]

    def kinetic_energy(self, q: ca.SX, dq: ca.SX, omega: ca.SX, p: Values) -> ca.SX:
        """T, J, seen from a frame that moves with the base origin.

        q, dq  n x 1;  omega  3 x 1, angular velocity of the base, rad/s, base axes. The velocity of a point r(q) is
        jtimes(r, q, dq) + cross(omega, r), base axes.
        """
        return kinetic_energy_of(self.checked_bodies(q, p), q, dq, omega)

    def potential_energy(self, q: ca.SX, gravity: ca.SX, p: Values) -> ca.SX:
        """V, J.  gravity: 3 x 1 vector that points up, m/s^2, base axes."""
        return potential_energy_of(self.checked_bodies(q, p), gravity)

    @property
    def said_as(self) -> Literal["energies", "bodies", "links", ""]:
        """Which way of saying what the arm consists of counts; "" where there is none."""
        mine = type(self)
        if mine.kinetic_energy is not Mechanism.kinetic_energy:
            return "energies" if mine.potential_energy is not Mechanism.potential_energy or self._has_bodies else ""
        if not self._has_bodies:
            return ""
        if mine.potential_energy is not Mechanism.potential_energy:
            return "energies"
        return "bodies" if mine.bodies is not Mechanism.bodies else "links"

    @property
    def _has_bodies(self) -> bool:
        return type(self).bodies is not Mechanism.bodies or type(self).links is not Mechanism.links

    def segments(self, p: Values) -> tuple[Segment, ...]:
        """The links, checked. Raises ValueError."""
        joints = [joint.name for joint in self.joints]
        return segments_of(self.links(p), joints, f"mechanism {self.name}", symbols_of(*p.values()))

    def checked_bodies(self, q: ca.SX, p: Values) -> list[Solid]:
        """The bodies as expressions. Raises ValueError."""
        owner, bodies = f"mechanism {self.name}: bodies", self.bodies(q, p)
        if not isinstance(bodies, list | tuple) or not bodies:
            raise ValueError(f"{owner}: expected a list of at least one Body, got {bodies!r}")
        known = symbols_of(q, *p.values())
        return [solid(body, f"{owner}[{i}]", known) for i, body in enumerate(bodies)]

    def tip(self, q: ca.SX, p: Values) -> ca.SX | None:
        """Where the arm ends, 3 x 1, m, base axes; None for an arm that does not say."""
        return None

    def fitted(self, parameter: Parameter, table: str = "") -> Parameter:
        """A parameter of the controller with the default that suits this arm.

        table  the [control.<table>] that it stands in: "<table>.<name>" in `control_defaults` is it alone

        K_f, unless `control_defaults` has it, damps each motor on its spring with half of the critical damping.
        """
        own = self.control_defaults.get(f"{table}.{parameter.name}", self.control_defaults.get(parameter.name))
        if own is None and parameter.name == "K_f":
            inertia, stiffness = (self._diagonal(declared) for declared in (self.motor_inertia, self.stiffness))
            own = tuple(2 * _FAST_DAMPING * math.sqrt(m * k) for m, k in zip(inertia, stiffness, strict=True))
        return parameter if own is None else replace(parameter, default=own)

    def _diagonal(self, declared: tuple[Parameter, ...]) -> list[float]:
        """Defaults of a diagonal, one per joint."""
        return [
            value
            for k, item in enumerate(declared)
            for value in item.defaults(self.joints if item.per_joint else self.joints[k : k + 1])
        ]


def _positive(parameter: Parameter) -> Parameter:
    """A motor inertia or a stiffness, which the equations divide by: greater than 0 where its class says no bounds."""
    return replace(parameter, bounds=POSITIVE) if parameter.bounds == REAL else parameter


def check_mechanism(mechanism: Mechanism) -> None:
    """Raise ValueError, with what was expected, for a mechanism whose declarations do not fit each other."""
    owner, joints = f"mechanism {type(mechanism).__name__}", getattr(mechanism, "joints", None)
    if not isinstance(joints, tuple) or not joints or not all(isinstance(joint, Joint) for joint in joints):
        raise ValueError(f"{owner}: joints: expected a tuple of at least one Joint, got {joints!r}")
    expect_names(owner, "joints", [joint.name for joint in joints])
    if not mechanism.said_as:
        text = "expected links(p), bodies(q, p), or kinetic_energy(q, dq, omega, p) and potential_energy(q, gravity, p)"
        raise ValueError(f"{owner}: does not say what the arm consists of: {text}")
    expect_names(owner, "name", [mechanism.name])
    for text in (mechanism.source, *(text for joint in joints for text in (joint.unit, joint.force))):
        expect_text(owner, "units and source", text)
    names: list[str] = []
    for what in ("parameters", "motor_inertia", "stiffness"):
        declared = getattr(mechanism, what, None)
        expect_parameters(owner, what, declared, () if declared is None else joints)
        names += [item.name for item in getattr(mechanism, what)]
    expect_names(owner, "parameters, motor_inertia and stiffness", names)
    taken = [name for name in names if name in TAKEN]
    if taken:
        raise ValueError(f"{owner}: parameters, motor_inertia and stiffness: {taken[0]!r} is a key of every mechanism")
    if mechanism.limits != () and not (
        isinstance(mechanism.limits, tuple | list)
        and len(mechanism.limits) == len(joints)
        and all(_is_interval(pair) for pair in mechanism.limits)
    ):
        raise ValueError(f"{owner}: limits: expected () or a pair low < high per joint, got {mechanism.limits!r}")
    if "g" not in {item.name for item in mechanism.parameters}:
        raise ValueError(f"{owner}: parameters: expected one called g, the gravity in m/s^2")
    for what in ("motor_inertia", "stiffness"):
        declared = getattr(mechanism, what)
        entries = sum(len(joints) if item.per_joint else 1 for item in declared)
        if entries != len(joints):
            raise ValueError(f"{owner}: {what}: expected {len(joints)} numbers, one per joint, got {entries}")
    for what in ("reference_offset", "start_position", "start_rate"):
        expect_numbers(owner, what, getattr(mechanism, what), len(joints))
    terms = mechanism.reference_terms
    if not isinstance(terms, tuple | list) or len(terms) != len(joints) or not all(map(_are_terms, terms)):
        raise ValueError(f"{owner}: reference_terms: expected a tuple of SineTerm for each joint, got {terms!r}")
    if not isinstance(mechanism.control_defaults, Mapping):
        raise ValueError(
            f"{owner}: control_defaults: expected a dict of names and numbers, got {mechanism.control_defaults!r}"
        )
    for name, value in mechanism.control_defaults.items():
        if not is_number(value):
            expect_numbers(owner, f"control_defaults, {name}", value, len(joints))


def _is_interval(pair: object) -> bool:
    return isinstance(pair, tuple | list) and len(pair) == 2 and all(map(is_number, pair)) and pair[0] < pair[1]


def _are_terms(terms: object) -> bool:
    return isinstance(terms, tuple | list) and all(isinstance(term, SineTerm) for term in terms)
