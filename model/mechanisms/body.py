"""Rigid bodies: what an arm consists of, if it says so instead of its energies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca

from springline.model.declared import column


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A rigid body that moves with the joints. Entries are numbers or expressions of q and the parameters.

    mass      kg
    position  of the centre of mass, 3 x 1, m, base axes
    rotation  3 x 3, body axes to base axes; identity unless given
    inertia   about the centre of mass, kg m^2, body axes: 3 x 3, or a scalar for one about z alone; zero unless given
    """

    mass: Any
    position: Any
    rotation: Any = None
    inertia: Any = 0.0


def expressions_of(body: Body, owner: str, symbols: Sequence[ca.SX]) -> Body:
    """The body with CasADi expressions of full shape in place of what the user wrote.

    owner    for messages
    symbols  what it may depend on
    Raises ValueError, with what was expected, for a wrong shape and a symbol that was not given.
    """
    if not isinstance(body, Body):
        raise ValueError(f"{owner}: expected a Body, got {type(body).__name__}")

    def matrix(what: str, value: object) -> ca.SX:
        if isinstance(value, list | tuple):
            value = ca.blockcat([list(row) for row in value])
        if not isinstance(value, ca.SX | ca.DM) or value.shape != (3, 3):
            shape = f"{value.shape[0]} x {value.shape[1]}" if isinstance(value, ca.SX | ca.DM) else repr(value)
            raise ValueError(f"{owner}: {what}: expected 3 x 3, got {shape}")
        column(owner, what, ca.densify(ca.vec(value)), 9, symbols)
        return ca.densify(ca.SX(value))

    position = ca.vertcat(*body.position) if isinstance(body.position, list | tuple) else body.position
    inertia, rotation = body.inertia, body.rotation
    if isinstance(inertia, int | float) or (isinstance(inertia, ca.SX | ca.DM) and inertia.numel() == 1):
        inertia = ca.diag(ca.vertcat(0, 0, column(owner, "inertia", inertia, 1, symbols)))
    return Body(
        column(owner, "mass", body.mass, 1, symbols),
        column(owner, "position", ca.densify(position) if isinstance(position, ca.SX) else position, 3, symbols),
        matrix("rotation", ca.SX.eye(3) if rotation is None else rotation),
        matrix("inertia", inertia),
    )


def turning(body: Body, q: ca.SX) -> ca.SX:
    """3 x n: times dq it is the angular velocity that the joints give the body, rad/s, body axes."""
    rotation = body.rotation
    if not ca.depends_on(rotation, q):
        return ca.SX.zeros(3, q.numel())
    change = ca.jacobian(ca.vec(rotation), q)
    columns = []
    for k in range(q.numel()):
        spin = rotation.T @ ca.reshape(ca.densify(change[:, k]), 3, 3)
        columns.append(ca.vertcat(spin[2, 1], spin[0, 2], spin[1, 0]))
    return ca.horzcat(*columns)


def kinetic_energy_of(bodies: Sequence[Body], q: ca.SX, dq: ca.SX, omega: ca.SX) -> ca.SX:
    """T, J, as Mechanism.kinetic_energy has it; `bodies` from `expressions_of`."""
    energy = ca.SX(0)
    for body in bodies:
        v = ca.jtimes(body.position, q, dq) + ca.cross(omega, body.position)
        energy += body.mass * ca.dot(v, v)
        if not body.inertia.is_zero():
            spin = body.rotation.T @ omega + turning(body, q) @ dq
            energy += ca.dot(spin, body.inertia @ spin)
    return energy / 2


def potential_energy_of(bodies: Sequence[Body], gravity: ca.SX) -> ca.SX:
    """V, J, as Mechanism.potential_energy has it."""
    return sum((body.mass * ca.dot(gravity, body.position) for body in bodies), ca.SX(0))
