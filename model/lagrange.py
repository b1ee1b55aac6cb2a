"""Lagrange's equations on a moving base, by automatic differentiation of two energies (docs/paper.md sections 1 and 2).

    M(q) ddq + C(q, dq) dq + G(q) = S + generalised forces                                                (1)

The kinetic energy T(q, dq, omega) is taken in a frame that moves with the base origin; by the principle of equivalence
the origin's acceleration then acts as gravity does, so the potential energy takes the specific force in place of
gravity. S is minus (left side, base moving - left side, base at rest); it contains no ddq because M does not depend on
the base. Any number of joints, any base motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from springline.model.base import BaseState
from springline.model.declared import column
from springline.model.mechanisms import Mechanism
from springline.model.parameters import Values
from springline.model.symbolic import collect


@dataclass(frozen=True, slots=True)
class EquationsOfMotion:
    """The terms of (1). n joints; symbols q, dq (n x 1), omega, alpha, gravity (3 x 1) and p are left free.

    mass         M(q), n x n
    coriolis     C(q, dq) dq, n x 1, base at rest
    gravity      G(q), n x 1, base at rest
    disturbance  S, n x 1
    bias         C dq + G - S in one normal form: what the moving plant needs, with the fewest operations
    """

    mass: ca.SX
    coriolis: ca.SX
    gravity: ca.SX
    disturbance: ca.SX
    bias: ca.SX


def equations_of_motion(mechanism: Mechanism, q: ca.SX, dq: ca.SX, base: BaseState, p: Values) -> EquationsOfMotion:
    """Derive (1) from the mechanism's energies; q, dq, and the entries of `base` and `p` are symbols.

    Raises ValueError for an energy that is no scalar of what it was given, or no quadratic form in the rates.
    """
    omega, alpha, gravity = (ca.SX.sym(name, 3) for name in ("omega", "alpha", "gravity"))
    owner, known = f"mechanism {mechanism.name}", [q, *p.values()]
    given = mechanism.kinetic_energy(q, dq, omega, p)
    kinetic = column(owner, "kinetic_energy", given, 1, [dq, omega, *known])
    potential = column(owner, "potential_energy", mechanism.potential_energy(q, gravity, p), 1, [gravity, *known])

    momentum = ca.gradient(kinetic, dq)
    mass = ca.jacobian(momentum, dq)
    for symbol, told in ((dq, "the joint rates"), (omega, "the base's rate")):
        if ca.depends_on(ca.simplify(mass), symbol):
            raise ValueError(f"{owner}: kinetic_energy: the mass matrix depends on {told}, expected one of q alone")
    moving = (
        ca.jtimes(momentum, q, dq)
        + ca.jtimes(momentum, omega, alpha)
        - ca.gradient(kinetic, q)
        + ca.gradient(potential, q)
    )
    at_rest = [ca.SX.zeros(3), ca.SX.zeros(3), base.rest_force(p.g)]
    rest = ca.substitute(moving, ca.vertcat(omega, alpha, gravity), ca.vertcat(*at_rest))
    weight = ca.substitute(ca.gradient(potential, q), gravity, at_rest[2])

    state, imu = ca.vertcat(q, dq), ca.vertcat(omega, alpha, gravity)
    symbols = ca.vertcat(state, imu, *p.values(), base.constants)

    def normal(expression: ca.SX) -> ca.SX:
        return collect(expression, symbols, [state, imu])

    felt = ca.vertcat(base.omega, base.alpha, base.specific_force(p.g))

    # S against gravity's excess over its value at rest: the weight cancels here, not in rounded numbers.
    tilted = ca.substitute(rest - moving, gravity, at_rest[2] + gravity)
    felt_excess = ca.vertcat(base.omega, base.alpha, base.excess_force(p.g))

    return EquationsOfMotion(
        mass=normal(mass),
        coriolis=normal(rest - weight),
        gravity=normal(weight),
        disturbance=ca.substitute(normal(tilted), imu, felt_excess),
        bias=ca.substitute(normal(moving), imu, felt),
    )
