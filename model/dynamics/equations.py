"""The equations of motion of any mechanism on a moving base, in the cheaper of two forms.

    M(q) ddq + C(q, dq) dq + G(q) = S + generalised forces                                                (1)

S is minus (left side, base moving - left side, base at rest); it contains no ddq because M does not depend on the base.

normal    Lagrange's equations as a sum of products whose coefficients depend on parameters alone: best for two joints,
          explosive for many
factored  as they come: recursive for a kinematic tree, projected for bodies, differentiated for energies

Which is printed is decided by counting operations; what depends on parameters alone is not counted, for it is computed
once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from springline.model import lazy_casadi as ca
from springline.model.base import BaseState
from springline.model.dynamics import newton_euler, rigid_bodies
from springline.model.dynamics.lagrange import energies_of
from springline.model.mechanisms import Mechanism, aligned
from springline.model.parameters import Values
from springline.model.symbolic import TooManyTerms, collect, operations

Form = Literal["normal", "factored"]


@dataclass(frozen=True, slots=True)
class EquationsOfMotion:
    """The terms of (1). n joints; q, dq (n x 1), the base's symbols and p are left free.

    mass         M(q), n x n
    coriolis     C(q, dq) dq, n x 1, base at rest
    gravity      G(q), n x 1, base at rest
    disturbance  S, n x 1
    bias         C dq + G - S put together: what the moving plant needs, with the fewest operations
    form         which one this is
    counted      operations of mass and bias by form; a normal form that explodes is not there
    """

    mass: ca.SX
    coriolis: ca.SX
    gravity: ca.SX
    disturbance: ca.SX
    bias: ca.SX
    form: Form
    counted: Mapping[Form, int] = field(default_factory=dict)

    @property
    def told(self) -> str:
        """Which form this is and why, a sentence for people."""
        other: Form = "factored" if self.form == "normal" else "normal"
        rival = f"{self.counted[other]} {other}" if other in self.counted else f"the {other} form explodes"
        return f"equations of motion in {self.form} form: {self.counted[self.form]} operations ({rival})"


@dataclass(frozen=True, slots=True, eq=False)
class _Terms:
    """Of the symbols q, dq, omega, alpha and force.

    excess  what the base adds, where force is what it has above that at rest;  moving: all of it
    """

    mass: ca.SX
    coriolis: ca.SX
    gravity: ca.SX
    excess: ca.SX
    moving: ca.SX


def equations_of_motion(
    mechanism: Mechanism, q: ca.SX, dq: ca.SX, base: BaseState, p: Values, form: Form | None = None
) -> EquationsOfMotion:
    """Derive (1); q, dq, and the entries of `base` and `p` are symbols.

    form  None for the one with the fewest operations
    Raises ValueError for what the mechanism says wrongly: an energy that is no scalar of what it was given or no
    quadratic form in the rates, a body or link of a wrong shape, a tree with a circle.
    """
    omega, alpha, force = (ca.SX.sym(name, 3) for name in ("omega", "alpha", "gravity"))
    rest = base.rest_force(p.g)
    symbols = ca.vertcat(q, dq, omega, alpha, force, *p.values(), base.constants)
    found: dict[Form, _Terms] = {}
    if form != "normal":
        found["factored"] = _factored(mechanism, q, dq, omega, alpha, force, rest, p)
    if form != "factored":
        try:
            found["normal"] = _normal(mechanism, q, dq, omega, alpha, force, rest, symbols, p)
        except TooManyTerms:
            if form == "normal":
                raise
    fast = ca.vertcat(q, dq, omega, alpha, force)
    counted = {
        name: operations(ca.vertcat(ca.vec(ca.tril(terms.mass)), terms.moving), symbols, fast)
        for name, terms in found.items()
    }
    chosen = min(found, key=lambda name: (counted[name], name != "normal"))
    terms = found[chosen]
    imu = ca.vertcat(omega, alpha, force)
    felt = ca.vertcat(base.omega, base.alpha, base.specific_force(p.g))
    felt_excess = ca.vertcat(base.omega, base.alpha, base.excess_force(p.g))
    return EquationsOfMotion(
        mass=terms.mass,
        coriolis=terms.coriolis,
        gravity=terms.gravity,
        disturbance=ca.substitute(terms.excess, imu, felt_excess),
        bias=ca.substitute(terms.moving, imu, felt),
        form=chosen,
        counted=counted,
    )


def _factored(
    mechanism: Mechanism, q: ca.SX, dq: ca.SX, omega: ca.SX, alpha: ca.SX, force: ca.SX, rest: ca.SX, p: Values
) -> _Terms:
    """The terms as the mechanism's own way of saying itself gives them."""
    zero, still = ca.SX.zeros(3), ca.SX.zeros(q.numel())
    if mechanism.said_as == "energies":
        energies = energies_of(mechanism, q, dq, omega, force, p)
        moving = energies.inverse_dynamics(alpha)
        at_rest = ca.substitute(moving, ca.vertcat(omega, alpha, force), ca.SX.zeros(9))
        weight = ca.substitute(energies.weight(), force, rest)
        return _Terms(energies.mass_matrix(), at_rest, weight, at_rest - moving, moving)

    def needed(rates: ca.SX, *imu: ca.SX) -> ca.SX:
        if mechanism.said_as == "links":
            return newton_euler.inverse_dynamics(segments, q, rates, *imu)
        return rigid_bodies.inverse_dynamics(bodies, q, rates, *imu)

    if mechanism.said_as == "links":
        segments = aligned(mechanism.segments(p))
        mass = newton_euler.mass_matrix(segments, q)
    else:
        bodies = mechanism.checked_bodies(q, p)
        mass = rigid_bodies.mass_matrix(bodies, q)
    moving, at_rest = needed(dq, omega, alpha, force), needed(dq, zero, zero, zero)
    return _Terms(mass, at_rest, needed(still, zero, zero, rest), at_rest - moving, moving)


def _normal(
    mechanism: Mechanism,
    q: ca.SX,
    dq: ca.SX,
    omega: ca.SX,
    alpha: ca.SX,
    force: ca.SX,
    rest: ca.SX,
    symbols: ca.SX,
    p: Values,
) -> _Terms:
    """The terms in normal form. Raises TooManyTerms for one that explodes."""
    energies = energies_of(mechanism, q, dq, omega, force, p)
    state, imu = ca.vertcat(q, dq), ca.vertcat(omega, alpha, force)

    def normal(expression: ca.SX) -> ca.SX:
        return collect(expression, symbols, [state, imu])

    moving = energies.inverse_dynamics(alpha)
    standing = ca.substitute(moving, imu, ca.vertcat(ca.SX.zeros(6), rest))
    weight = ca.substitute(energies.weight(), force, rest)
    # S against the specific force's excess over its value at rest: the weight cancels here, not in rounded numbers.
    tilted = ca.substitute(standing - moving, force, rest + force)
    return _Terms(
        normal(energies.mass_matrix()), normal(standing - weight), normal(weight), normal(tilted), normal(moving)
    )
