"""Newton-Euler for free bodies, projected on the joints: the equations of motion of an arm that is said as bodies."""

from __future__ import annotations

from collections.abc import Sequence

from springline.model import lazy_casadi as ca
from springline.model.mechanisms import Solid, turning


def mass_matrix(bodies: Sequence[Solid], q: ca.SX) -> ca.SX:
    """M(q), n x n."""
    mass = ca.SX.zeros(q.numel(), q.numel())
    for body in bodies:
        moved = ca.densify(ca.jacobian(body.position, q))
        mass += body.mass * (moved.T @ moved)
        if not body.inertia.is_zero():
            turned = turning(body, q)
            mass += turned.T @ (body.inertia @ turned)
    lower = ca.tril2symm(ca.tril(mass))
    return ca.densify(lower)


def inverse_dynamics(bodies: Sequence[Solid], q: ca.SX, dq: ca.SX, omega: ca.SX, alpha: ca.SX, force: ca.SX) -> ca.SX:
    """Generalised forces that hold ddq at zero, n x 1.

    omega, alpha  of the base, 3 x 1, base axes;  force: specific force at its origin, m/s^2, base axes
    """
    result = ca.SX.zeros(q.numel())
    for body in bodies:
        r = body.position
        moved = ca.densify(ca.jacobian(r, q))
        v = moved @ dq
        a = force + ca.jtimes(v, q, dq) + ca.cross(alpha, r) + ca.cross(omega, 2 * v + ca.cross(omega, r))
        result += moved.T @ (body.mass * a)
        if not body.inertia.is_zero():
            turned = turning(body, q)
            seen = body.rotation.T @ omega
            spin = seen + turned @ dq
            change = body.rotation.T @ alpha + ca.jtimes(seen, q, dq) + ca.jtimes(turned @ dq, q, dq)
            moment = body.inertia @ change + ca.cross(spin, body.inertia @ spin)
            result += turned.T @ moment
    return result
