"""Drives: how the motor forces reach the joints, and the full-order plant (docs/paper.md section 2).

Elastic: a spring between each motor and its joint.

    M1 ddq1 + C dq1 + G + K (q1 - q2) = S
    M2 ddq2 + K (q2 - q1) = U                                                                         (1)

Rigid: the motors sit on the joints, which carry their inertia.

    (M1 + M2) ddq1 + C dq1 + G = U + S                                                                (4)
"""

from __future__ import annotations

from typing import Literal, Protocol

import casadi as ca

from springline.model.dynamics import EquationsOfMotion
from springline.model.mechanisms import Mechanism
from springline.model.parameters import Bounds, Parameter, Values
from springline.model.perturbation import slow_mass
from springline.model.quantities import DQ1, DQ2, Q1, Q2, Quantity
from springline.model.symbolic import over, solve_spd
from springline.model.terms import named, section

DriveKind = Literal["elastic", "rigid"]

EPSILON = Parameter("epsilon", "1", 1.0, "singular perturbation parameter", Bounds(0.0, 1.0, low_open=True))


def spring_force(q1: ca.SX, q2: ca.SX, stiffness: ca.SX) -> ca.SX:
    """z = K (q2 - q1), n x 1, N or N m."""
    return stiffness * (q2 - q1)


def static_motor_position(q1: ca.SX, load: ca.SX, stiffness: ca.SX) -> ca.SX:
    """q2 at which the springs carry a load (n x 1, N or N m), n x 1, m or rad: K (q2 - q1) = load."""
    return q1 + over(load, stiffness)


def diagonal(parameters: tuple[Parameter, ...], p: Values) -> ca.SX:
    """The entries of a diagonal that one parameter per joint, or one with an entry per joint, declares; n x 1."""
    return ca.vertcat(*(p[item.name] for item in parameters))


class Drive(Protocol):
    """A kind of drive: `state` is what the plant's state x consists of, one entry per joint each."""

    @property
    def kind(self) -> DriveKind:
        """Name in scenario files."""

    @property
    def state(self) -> tuple[Quantity, ...]:
        """What x consists of, positions and rates in turn; q1 and dq1 come first."""

    def parameters(self, mechanism: Mechanism) -> tuple[Parameter, ...]:
        """Parameters of the [drive] table that the plant has too."""

    def plant(self, x: ca.SX, u: ca.SX, link: EquationsOfMotion, mechanism: Mechanism, p: Values) -> ca.SX:
        """dx/dt under the motor forces u (n x 1, N or N m)."""

    def energy(self, x: ca.SX, mechanism: Mechanism, p: Values) -> ca.SX:
        """Energy of motors and springs, J."""


class Elastic:
    """x = [q1, dq1, q2, dq2]: a spring between each motor and its joint."""

    kind: DriveKind = "elastic"
    state = (Q1, DQ1, Q2, DQ2)

    def parameters(self, mechanism: Mechanism) -> tuple[Parameter, ...]:
        """Motor inertia and stiffness."""
        return (*mechanism.motor_inertia, *mechanism.stiffness)

    def plant(self, x: ca.SX, u: ca.SX, link: EquationsOfMotion, mechanism: Mechanism, p: Values) -> ca.SX:
        """dx/dt (4n x 1), equation (1)."""
        q1, dq1, q2, dq2 = ca.vertsplit(x, x.numel() // 4)
        with section("springs", "(1)"):
            z = named("z", spring_force(q1, q2, diagonal(mechanism.stiffness, p)))
        with section("motors", "(1)"):
            motors = named("ddq2", over(u - z, diagonal(mechanism.motor_inertia, p)))
        with section("mass matrix of the arm", "(1)"):
            named("M1", link.mass)
        with section("Coriolis, centrifugal and gravity forces less what the moving base adds", "(1)"):
            named("C_dq1_G_S", link.bias)
        with section("accelerations of the joints", "(1)"):
            joints = named("ddq1", solve_spd(link.mass, z - link.bias))
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

    def plant(self, x: ca.SX, u: ca.SX, link: EquationsOfMotion, mechanism: Mechanism, p: Values) -> ca.SX:
        """dx/dt (2n x 1): equation (4) with U in place of its slow part."""
        _, dq1 = ca.vertsplit(x, x.numel() // 2)
        with section("mass matrix of the arm, motors on its joints", "(4)"):
            mass = named("H", slow_mass(link.mass, diagonal(mechanism.motor_inertia, p)))
        with section("Coriolis, centrifugal and gravity forces less what the moving base adds", "(4)"):
            named("C_dq1_G_S", link.bias)
        with section("accelerations of the joints", "(4)"):
            joints = named("ddq1", solve_spd(mass, u - link.bias))
        return ca.vertcat(dq1, joints)

    def energy(self, x: ca.SX, mechanism: Mechanism, p: Values) -> ca.SX:
        """Kinetic energy of the motors, J."""
        _, dq1 = ca.vertsplit(x, x.numel() // 2)
        return ca.dot(diagonal(mechanism.motor_inertia, p), dq1**2) / 2


DRIVES: dict[str, Drive] = {drive.kind: drive for drive in (Elastic(), Rigid())}
