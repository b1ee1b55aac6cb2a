"""Rigid bodies: what an arm consists of, if it says so instead of its energies."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from typing import Any

from springline.model import lazy_casadi as ca
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


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A body as expressions of full shape, checked; planar: whether its inertia was said as a scalar, about z alone."""

    mass: ca.SX
    position: ca.SX
    rotation: ca.SX
    inertia: ca.SX
    planar: bool


def solid(body: object, owner: str, known: Set[int]) -> Solid:
    """What a user wrote as expressions.

    owner    for messages
    known    symbols that it may depend on
    Raises ValueError, with what was expected, for a wrong shape and a symbol that was not given.
    """
    if not isinstance(body, Body):
        raise ValueError(f"{owner}: expected a Body, got {type(body).__name__}")
    rotation = ca.SX.eye(3) if body.rotation is None else matrix(owner, "rotation", body.rotation, known)
    inertia, planar = inertia_matrix(owner, body.inertia, known)
    return Solid(
        column(owner, "mass", body.mass, 1, known),
        column(owner, "position", stacked(body.position), 3, known),
        ca.densify(rotation),
        inertia,
        planar,
    )


def stacked(value: object) -> object:
    """A list or tuple of entries, or of rows of them, as an expression; anything else as it is, but dense."""
    if isinstance(value, list | tuple):
        rows = [item if isinstance(item, list | tuple) else [item] for item in value]
        try:
            return ca.densify(ca.SX(ca.blockcat([list(row) for row in rows])))
        except (RuntimeError, NotImplementedError, TypeError):
            return value  # what is no matrix of numbers and expressions: whoever asked for one refuses it by name
    return ca.densify(value) if isinstance(value, ca.SX | ca.DM) else value


def matrix(owner: str, what: str, value: object, known: Set[int]) -> ca.SX:
    """A 3 x 3 matrix, dense. Raises ValueError."""
    given = stacked(value)
    shape = given.shape if isinstance(given, ca.SX | ca.DM) else None
    if not isinstance(given, ca.SX | ca.DM) or shape != (3, 3):
        raise ValueError(f"{owner}: {what}: expected 3 x 3, got {f'{shape[0]} x {shape[1]}' if shape else repr(value)}")
    return ca.reshape(column(owner, what, ca.vec(ca.SX(given)), 9, known), 3, 3)


def inertia_matrix(owner: str, value: object, known: Set[int]) -> tuple[ca.SX, bool]:
    """An inertia as 3 x 3, and whether it was said as a scalar. Raises ValueError."""
    given = stacked(value)
    if isinstance(given, int | float) or (isinstance(given, ca.SX | ca.DM) and given.numel() == 1):
        return ca.densify(ca.diag(ca.vertcat(0, 0, column(owner, "inertia", given, 1, known)))), True
    return matrix(owner, "inertia", given, known), False


def turning(body: Solid, q: ca.SX) -> ca.SX:
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


def kinetic_energy_of(bodies: Sequence[Solid], q: ca.SX, dq: ca.SX, omega: ca.SX) -> ca.SX:
    """T, J, as Mechanism.kinetic_energy has it; `bodies` checked."""
    energy = ca.SX(0)
    for body in bodies:
        v = ca.jtimes(body.position, q, dq) + ca.cross(omega, body.position)
        energy += body.mass * ca.dot(v, v)
        if not body.inertia.is_zero():
            spin = body.rotation.T @ omega + turning(body, q) @ dq
            energy += ca.dot(spin, body.inertia @ spin)
    return energy / 2


def potential_energy_of(bodies: Sequence[Solid], gravity: ca.SX) -> ca.SX:
    """V, J, as Mechanism.potential_energy has it."""
    return sum((body.mass * ca.dot(gravity, body.position) for body in bodies), ca.SX(0))
