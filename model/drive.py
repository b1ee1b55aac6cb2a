"""Drives: how the motor forces reach the joints, and the full-order plant (docs/paper.md section 2).

Elastic: a spring between each motor and its joint.

    M1 ddq1 + C dq1 + G + K (q1 - q2) = S
    M2 ddq2 + K (q2 - q1) = U                                                                         (1)

Rigid: the motors sit on the joints, which carry their inertia.

    (M1 + M2) ddq1 + C dq1 + G = U + S                                                                (4)

What a drive has of damping and friction, each where it is not zero: D (dq2 - dq1) beside the spring's force, and
against the rate v of a link or motor B v + F v / sqrt(v^2 + v_c^2), viscous friction and Coulomb's made smooth: at
v = v_c it is 71 % of F, at 10 v_c 99.5 %. On a rigid drive the frictions of link and motor add up.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import reduce
from operator import add
from typing import Literal, Protocol

from springline.model import lazy_casadi as ca
from springline.model.dynamics import EquationsOfMotion
from springline.model.mechanisms import Mechanism
from springline.model.parameters import NON_NEGATIVE, POSITIVE, Bounds, Parameter, Values
from springline.model.perturbation import slow_mass
from springline.model.quantities import DQ1, DQ2, Q1, Q2, Quantity
from springline.model.symbolic import over, solve_spd
from springline.model.terms import named, section

DriveKind = Literal["elastic", "rigid"]

EPSILON = Parameter("epsilon", "1", 1.0, "singular perturbation parameter", Bounds(0.0, 1.0, low_open=True))

SPRING_DAMPING = Parameter(
    "spring_damping", "{F} s/{q}", 0.0, "damping beside the spring", NON_NEGATIVE, per_joint=True
)
LINK_VISCOUS = Parameter("link_viscous", "{F} s/{q}", 0.0, "viscous friction of the link", NON_NEGATIVE, per_joint=True)
LINK_COULOMB = Parameter("link_coulomb", "{F}", 0.0, "Coulomb friction of the link", NON_NEGATIVE, per_joint=True)
MOTOR_VISCOUS = Parameter(
    "motor_viscous", "{F} s/{q}", 0.0, "viscous friction of the motor", NON_NEGATIVE, per_joint=True
)
MOTOR_COULOMB = Parameter("motor_coulomb", "{F}", 0.0, "Coulomb friction of the motor", NON_NEGATIVE, per_joint=True)
COULOMB_VELOCITY = Parameter(
    "coulomb_velocity", "{q}/s", 0.01, "rate at which Coulomb friction has 71 % of its size", POSITIVE, per_joint=True
)
FRICTION = (SPRING_DAMPING, LINK_VISCOUS, LINK_COULOMB, MOTOR_VISCOUS, MOTOR_COULOMB)
"""What dissipates. A structure names those that are not zero for every joint; the others are nowhere printed."""


def friction_parameters(kind: DriveKind, present: Collection[str] | None = None) -> tuple[Parameter, ...]:
    """Parameters of the [drive] table for damping and friction; `present`: of these alone, and what they need."""
    declared = tuple(item for item in FRICTION if kind == "elastic" or item is not SPRING_DAMPING)
    if present is None:
        return (*declared, COULOMB_VELOCITY)
    there = tuple(item for item in declared if item.name in present)
    return (*there, COULOMB_VELOCITY) if {LINK_COULOMB, MOTOR_COULOMB} & {*there} else there


def friction(rate: ca.SX, p: Values, *sides: str) -> ca.SX | None:
    """What acts against a rate (n x 1) by the frictions of `sides` ("link", "motor"), n x 1; None if there are none."""

    def total(kind: str) -> ca.SX | None:
        sizes = [p[name] for side in sides if (name := f"{side}_{kind}") in p]
        return reduce(add, sizes) if sizes else None

    viscous, coulomb = total("viscous"), total("coulomb")
    if coulomb is None:
        return None if viscous is None else viscous * rate
    smooth = coulomb * (rate / ca.sqrt(rate**2 + p.coulomb_velocity**2))
    return smooth if viscous is None else viscous * rate + smooth


def spring_force(q1: ca.SX, q2: ca.SX, stiffness: ca.SX) -> ca.SX:
    """z = K (q2 - q1), n x 1, N or N m."""
    return stiffness * (q2 - q1)


def static_motor_position(q1: ca.SX, load: ca.SX, stiffness: ca.SX) -> ca.SX:
    """q2 at which the springs carry a load (n x 1, N or N m), n x 1, m or rad: K (q2 - q1) = load."""
    return q1 + over(load, stiffness)


def diagonal(parameters: tuple[Parameter, ...], p: Values) -> ca.SX:
    """The entries of a diagonal that one parameter per joint, or one with an entry per joint, declares; n x 1."""
    return ca.vertcat(*(p[item.name] for item in parameters))


def _pushed(force: ca.SX, other: ca.SX | None) -> ca.SX:
    """A force and another one beside it, if there is one."""
    return force if other is None else force + other


def _resisted(force: ca.SX, name: str, against: ca.SX | None) -> ca.SX:
    """A force less what acts against it, which is called `name`."""
    return force if against is None else force - named(name, against)


class Drive(Protocol):
    """A kind of drive: `state` is what the plant's state x consists of, one entry per joint each."""

    @property
    def kind(self) -> DriveKind:
        """Name in scenario files."""

    @property
    def state(self) -> tuple[Quantity, ...]:
        """What x consists of, positions and rates in turn; q1 and dq1 come first."""

    def parameters(self, mechanism: Mechanism) -> tuple[Parameter, ...]:
        """Parameters of the [drive] table that the plant always has too: `friction_parameters` has the others."""

    def plant(
        self, x: ca.SX, u: ca.SX, link: EquationsOfMotion, mechanism: Mechanism, p: Values, force: ca.SX | None = None
    ) -> ca.SX:
        """dx/dt under the motor forces u and, where there is one, a force on the links (n x 1 each, N or N m)."""

    def energy(self, x: ca.SX, mechanism: Mechanism, p: Values) -> ca.SX:
        """Energy of motors and springs, J."""


class Elastic:
    """x = [q1, dq1, q2, dq2]: a spring between each motor and its joint.

    M1 ddq1 + C dq1 + G + friction(dq1) = z + S,   M2 ddq2 + z + friction(dq2) = U,
    z = K (q2 - q1) + D (dq2 - dq1)
    """

    kind: DriveKind = "elastic"
    state = (Q1, DQ1, Q2, DQ2)

    def parameters(self, mechanism: Mechanism) -> tuple[Parameter, ...]:
        """Motor inertia and stiffness."""
        return (*mechanism.motor_inertia, *mechanism.stiffness)

    def plant(
        self, x: ca.SX, u: ca.SX, link: EquationsOfMotion, mechanism: Mechanism, p: Values, force: ca.SX | None = None
    ) -> ca.SX:
        """dx/dt (4n x 1), equation (1)."""
        q1, dq1, q2, dq2 = ca.vertsplit(x, x.numel() // 4)
        with section("springs", "(1)"):
            z = spring_force(q1, q2, diagonal(mechanism.stiffness, p))
            z = named("z", z + p.spring_damping * (dq2 - dq1) if SPRING_DAMPING.name in p else z)
        with section("motors", "(1)"):
            driven = _resisted(u - z, "motor_friction", friction(dq2, p, "motor"))
            motors = named("ddq2", over(driven, diagonal(mechanism.motor_inertia, p)))
        with section("mass matrix of the arm", "(1)"):
            named("M1", link.mass)
        with section("Coriolis, centrifugal and gravity forces less what the moving base adds", "(1)"):
            named("C_dq1_G_S", link.bias)
        with section("accelerations of the joints", "(1)"):
            pulled = _resisted(_pushed(z - link.bias, force), "link_friction", friction(dq1, p, "link"))
            joints = named("ddq1", solve_spd(link.mass, pulled))
        return ca.vertcat(dq1, joints, dq2, motors)

    def energy(self, x: ca.SX, mechanism: Mechanism, p: Values) -> ca.SX:
        """Kinetic energy of the motors and what the springs hold, J."""
        q1, _, q2, dq2 = ca.vertsplit(x, x.numel() // 4)
        motors = ca.dot(diagonal(mechanism.motor_inertia, p), dq2**2)
        return (motors + ca.dot(diagonal(mechanism.stiffness, p), (q2 - q1) ** 2)) / 2


class Rigid:
    """x = [q1, dq1]: the motors sit on the joints."""

    kind: DriveKind = "rigid"
    state = (Q1, DQ1)

    def parameters(self, mechanism: Mechanism) -> tuple[Parameter, ...]:
        """Motor inertia."""
        return mechanism.motor_inertia

    def plant(
        self, x: ca.SX, u: ca.SX, link: EquationsOfMotion, mechanism: Mechanism, p: Values, force: ca.SX | None = None
    ) -> ca.SX:
        """dx/dt (2n x 1): equation (4) with U in place of its slow part."""
        _, dq1 = ca.vertsplit(x, x.numel() // 2)
        with section("mass matrix of the arm, motors on its joints", "(4)"):
            mass = named("H", slow_mass(link.mass, diagonal(mechanism.motor_inertia, p)))
        with section("Coriolis, centrifugal and gravity forces less what the moving base adds", "(4)"):
            named("C_dq1_G_S", link.bias)
        with section("accelerations of the joints", "(4)"):
            driven = _resisted(_pushed(u - link.bias, force), "friction", friction(dq1, p, "link", "motor"))
            joints = named("ddq1", solve_spd(mass, driven))
        return ca.vertcat(dq1, joints)

    def energy(self, x: ca.SX, mechanism: Mechanism, p: Values) -> ca.SX:
        """Kinetic energy of the motors, J."""
        _, dq1 = ca.vertsplit(x, x.numel() // 2)
        return ca.dot(diagonal(mechanism.motor_inertia, p), dq1**2) / 2


DRIVES: dict[str, Drive] = {drive.kind: drive for drive in (Elastic(), Rigid())}
