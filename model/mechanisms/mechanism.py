"""What a mechanism has to tell: its joints, its parameters and its energies. Everything else has a default."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import casadi as ca

from springline.model.declared import expect_names, expect_parameters, expect_text, snake_case
from springline.model.parameters import Joint, Parameter, Values
from springline.model.signals import SineTerm

# Of the critical damping of a motor on its spring: what the fast control adds unless a mechanism says otherwise. It is
# no small share, for the slow law eats much of it (docs/paper.md, E13).
_FAST_DAMPING = 0.5

TAKEN = frozenset({
    *("name", "limits", "kind", "epsilon", "spring_damping", "link_viscous", "link_coulomb", "motor_viscous"),
    *("motor_coulomb", "coulomb_velocity"),
})  # fmt: skip
"""Keys that [mechanism], [drive] and [plant] have whatever the mechanism is."""


class Mechanism(ABC):
    """An arm of n joints, n >= 1. A subclass says at least its joints, parameters, motors, springs and two energies.

    name              in scenario files: the class's name in snake_case unless the class says otherwise
    joints            in the order of q
    parameters        of the two energies; "g" is one of them
    motor_inertia     diagonal of M2: a parameter for each joint, or one with an entry per joint
    stiffness         diagonal of K, likewise
    reference_offset  constant part of the desired trajectory, one per joint; () for all zero
    reference_terms   sine terms of the desired trajectory, a tuple per joint; () for none
    start_position    initial joint coordinates; () for all zero
    start_rate        initial joint rates; () for all zero
    limits            least and greatest coordinate of each joint, beyond which a run ends; () for none
    control_defaults  what the controller's parameters are for this arm, by name: a number, or one per joint
    source            where its equations and numbers come from, a sentence; "" where there is nothing to cite
    sampling          what sample periods and delays its loop was seen to bear, Markdown for those who embed it; ""
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
    source: ClassVar[str] = ""
    sampling: ClassVar[str] = ""

    def __init_subclass__(cls) -> None:
        """Fill in what the class leaves open and depends on how many joints it has."""
        cls.name = vars(cls).get("name", snake_case(cls.__name__))
        joints = getattr(cls, "joints", ())
        for attribute in ("reference_offset", "start_position", "start_rate"):
            if not getattr(cls, attribute):
                setattr(cls, attribute, (0.0,) * len(joints))
        if not cls.reference_terms:
            cls.reference_terms = ((),) * len(joints)

    @abstractmethod
    def kinetic_energy(self, q: ca.SX, dq: ca.SX, omega: ca.SX, p: Values) -> ca.SX:
        """T, J, seen from a frame that moves with the base origin.

        q, dq  n x 1;  omega  3 x 1, angular velocity of the base, rad/s, base axes. The velocity of a point r(q) is
        jtimes(r, q, dq) + cross(omega, r), base axes.
        """

    @abstractmethod
    def potential_energy(self, q: ca.SX, gravity: ca.SX, p: Values) -> ca.SX:
        """V, J.  gravity: 3 x 1 vector that points up, m/s^2, base axes."""

    def tip(self, q: ca.SX, p: Values) -> ca.SX | None:
        """Where the arm ends, 3 x 1, m, base axes; None for an arm that does not say."""
        return None

    def fitted(self, parameter: Parameter) -> Parameter:
        """A parameter of the controller with the default that suits this arm.

        K_f, unless `control_defaults` has it, damps each motor on its spring with half of the critical damping.
        """
        own = self.control_defaults.get(parameter.name)
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


def check_mechanism(mechanism: Mechanism) -> None:
    """Raise ValueError, with what was expected, for a mechanism whose declarations do not fit each other."""
    owner, joints = f"mechanism {type(mechanism).__name__}", getattr(mechanism, "joints", None)
    if not isinstance(joints, tuple) or not joints or not all(isinstance(joint, Joint) for joint in joints):
        raise ValueError(f"{owner}: joints: expected a tuple of at least one Joint, got {joints!r}")
    expect_names(owner, "joints", [joint.name for joint in joints])
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
    if mechanism.limits and not (
        len(mechanism.limits) == len(joints) and all(len(pair) == 2 and pair[0] < pair[1] for pair in mechanism.limits)
    ):
        raise ValueError(f"{owner}: limits: expected () or a pair low < high per joint, got {mechanism.limits!r}")
    if "g" not in {item.name for item in mechanism.parameters}:
        raise ValueError(f"{owner}: parameters: expected one called g, the gravity in m/s^2")
    for what in ("motor_inertia", "stiffness"):
        declared = getattr(mechanism, what)
        entries = sum(len(joints) if item.per_joint else 1 for item in declared)
        if entries != len(joints):
            raise ValueError(f"{owner}: {what}: expected {len(joints)} numbers, one per joint, got {entries}")
    for what in ("reference_offset", "start_position", "start_rate", "reference_terms"):
        found = getattr(mechanism, what)
        if len(found) != len(joints):
            raise ValueError(f"{owner}: {what}: expected {len(joints)} entries, one per joint, got {len(found)}")
        if what != "reference_terms" and not all(math.isfinite(value) for value in found):
            raise ValueError(f"{owner}: {what}: expected finite numbers, got {found!r}")
