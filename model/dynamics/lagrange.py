"""Lagrange's equations on a moving base, by automatic differentiation of two energies (docs/paper.md sections 1 and 2).

The kinetic energy T(q, dq, omega) is taken in a frame that moves with the base origin; by the principle of equivalence
the origin's acceleration then acts as gravity does, so the potential energy takes the specific force in place of
gravity. Any number of joints, any base motion.
"""

from __future__ import annotations

from dataclasses import dataclass

from springline.model import lazy_casadi as ca
from springline.model.declared import column, symbols_of
from springline.model.mechanisms import Mechanism
from springline.model.parameters import Values


@dataclass(frozen=True, slots=True, eq=False)
class Energies:
    """T(q, dq, omega) and V(q, force), J, with the symbols q, dq (n x 1), omega and force (3 x 1) that they hold."""

    kinetic: ca.SX
    potential: ca.SX
    q: ca.SX
    dq: ca.SX
    omega: ca.SX
    force: ca.SX

    def mass_matrix(self) -> ca.SX:
        """M(q), n x n."""
        return ca.jacobian(self._momentum, self.dq)

    def inverse_dynamics(self, alpha: ca.SX) -> ca.SX:
        """Generalised forces that hold ddq at zero, n x 1; alpha: symbol of the base's angular acceleration, 3 x 1."""
        return (
            ca.jtimes(self._momentum, self.q, self.dq)
            + ca.jtimes(self._momentum, self.omega, alpha)
            - ca.gradient(self.kinetic, self.q)
            + self.weight()
        )

    def weight(self) -> ca.SX:
        """The part of it that the specific force is to blame for, n x 1."""
        return ca.gradient(self.potential, self.q)

    @property
    def _momentum(self) -> ca.SX:
        return ca.gradient(self.kinetic, self.dq)


def energies_of(mechanism: Mechanism, q: ca.SX, dq: ca.SX, omega: ca.SX, force: ca.SX, p: Values) -> Energies:
    """The mechanism's energies, checked.

    Raises ValueError for one that is no scalar of what it was given, no quadratic form in the rates, or not linear in
    gravity (springs of the arm's own may stand beside that).
    """
    owner, known = f"mechanism {mechanism.name}", symbols_of(q, *p.values())
    given = mechanism.kinetic_energy(q, dq, omega, p)
    energies = Energies(
        column(owner, "kinetic_energy", given, 1, known | symbols_of(dq, omega)),
        column(owner, "potential_energy", mechanism.potential_energy(q, force, p), 1, known | symbols_of(force)),
        q, dq, omega, force,
    )  # fmt: skip
    mass = energies.mass_matrix()
    for symbol, told in ((dq, "the joint rates"), (omega, "the base's rate")):
        if ca.depends_on(ca.simplify(mass), symbol):
            raise ValueError(f"{owner}: kinetic_energy: the mass matrix depends on {told}, expected one of q alone")
    if ca.depends_on(ca.simplify(ca.gradient(energies.potential, force)), force):
        raise ValueError(f"{owner}: potential_energy: it is not linear in gravity, expected it times masses and places")
    return energies
