"""Recursive Newton-Euler and composite rigid bodies for kinematic trees, in link frames.

Featherstone, Rigid Body Dynamics Algorithms (2008), chapters 5 and 6, written with the mass, first moment and inertia
about the joint of each link, which depend on parameters alone. The acceleration of a point r of a link is a + B r with
B = [alpha] + [omega]^2, so that the moment about the joint of a link with second moments D is the axial vector of
B D - (B D)' plus the first moment times a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from springline.model import lazy_casadi as ca
from springline.model.mechanisms import Segment, outwards


@dataclass(frozen=True, slots=True, eq=False)
class _Moments:
    """Mass properties of a link: kg, kg m (3 x 1), and second moments, kg m^2 (3 x 3), about its joint."""

    mass: ca.SX
    first: ca.SX
    second: ca.SX


def _moments(segment: Segment) -> _Moments:
    about_com = ca.trace(segment.inertia) / 2 * ca.SX.eye(3) - segment.inertia
    first = segment.mass * segment.com
    return _Moments(segment.mass, first, ca.densify(about_com + first @ segment.com.T))


def _axial(matrix: ca.SX) -> ca.SX:
    """Of B D - (B D)': sum of r x (B r) over the second moments D."""
    return ca.vertcat(matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1])


def _acceleration_matrix(omega: ca.SX, alpha: ca.SX) -> ca.SX:
    """B = [alpha] + [omega]^2, 3 x 3."""
    x, y, z = ca.vertsplit(omega)
    xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
    return ca.blockcat([
        [-(yy + zz), xy - alpha[2], xz + alpha[1]],
        [xy + alpha[2], -(xx + zz), yz - alpha[0]],
        [xz - alpha[1], yz + alpha[0], -(xx + yy)],
    ])  # fmt: skip


def inverse_dynamics(
    segments: Sequence[Segment], q: ca.SX, dq: ca.SX, omega: ca.SX, alpha: ca.SX, force: ca.SX
) -> ca.SX:
    """Generalised forces that hold ddq at zero, n x 1.

    omega, alpha  of the base, 3 x 1, base axes;  force: specific force at its origin, m/s^2, base axes
    """
    order, turns = outwards(segments), [s.turn(q[i]) for i, s in enumerate(segments)]
    matrices: dict[int, ca.SX] = {-1: _acceleration_matrix(omega, alpha)}
    rates: dict[int, tuple[ca.SX, ca.SX]] = {-1: (omega, alpha)}
    accelerations: dict[int, ca.SX] = {-1: force}
    for i in order:
        s = segments[i]
        matrix, (w, dw) = matrices[s.parent], rates[s.parent]
        a = accelerations[s.parent] + matrix @ s.place(q[i])
        w, dw, a = (turns[i].T @ (s.frame.T @ v) for v in (w, dw, a))
        along = s.axis * dq[i]
        if s.revolute:
            dw = dw + ca.cross(w, along)
            w = w + along
        else:
            a = a + 2 * ca.cross(w, along)
        rates[i], accelerations[i], matrices[i] = (w, dw), a, _acceleration_matrix(w, dw)
    pushed, turned = [ca.SX.zeros(3)] * len(segments), [ca.SX.zeros(3)] * len(segments)
    result = [ca.SX(0)] * len(segments)
    for i in reversed(order):
        s, m = segments[i], _moments(segments[i])
        push = pushed[i] + m.mass * accelerations[i] + matrices[i] @ m.first
        turn = turned[i] + _axial(matrices[i] @ m.second) + ca.cross(m.first, accelerations[i])
        result[i] = ca.dot(s.axis, turn if s.revolute else push)
        if s.parent >= 0:
            push, turn = (s.frame @ (turns[i] @ v) for v in (push, turn))
            pushed[s.parent] = pushed[s.parent] + push
            turned[s.parent] = turned[s.parent] + turn + ca.cross(s.place(q[i]), push)
    return ca.vertcat(*result)


def mass_matrix(segments: Sequence[Segment], q: ca.SX) -> ca.SX:
    """M(q), n x n, by composite rigid bodies."""
    n = len(segments)
    turns = [s.turn(q[i]) for i, s in enumerate(segments)]
    composite = [_moments(s) for s in segments]
    for i in reversed(outwards(segments)):
        s, m = segments[i], composite[i]
        if s.parent >= 0:
            composite[s.parent] = _joined(composite[s.parent], _seen(m, s.frame, turns[i], s.place(q[i])))
    entries = [[ca.SX(0)] * n for _ in range(n)]
    for i, s in enumerate(segments):
        m, axis = composite[i], s.axis
        if s.revolute:  # spinning about the axis with unit acceleration: B = [axis]
            spin = ca.skew(axis)
            push, turn = spin @ m.first, _axial(spin @ m.second)
        else:
            push, turn = m.mass * axis, ca.cross(m.first, axis)
        at = i
        while True:
            bearer = segments[at]
            entries[i][at] = entries[at][i] = ca.dot(bearer.axis, turn if bearer.revolute else push)
            if bearer.parent < 0:
                break
            push, turn = (bearer.frame @ (turns[at] @ v) for v in (push, turn))
            turn = turn + ca.cross(bearer.place(q[at]), push)
            at = bearer.parent
    return ca.blockcat(entries)


def _joined(a: _Moments, b: _Moments) -> _Moments:
    return _Moments(a.mass + b.mass, a.first + b.first, _mirrored(a.second + b.second))


def _mirrored(matrix: ca.SX) -> ca.SX:
    """A symmetric matrix whose lower half is the upper one itself, so that it is computed once."""
    for row in range(3):
        for column in range(row):
            matrix[row, column] = matrix[column, row]
    return matrix


def _seen(m: _Moments, frame: ca.SX, turn: ca.SX, place: ca.SX) -> _Moments:
    """A link's moments in its parent's frame, about the parent's joint."""
    first, second = m.first, m.second
    for rotation in (turn, frame):
        first = ca.densify(rotation @ first)
        second = _mirrored(ca.densify(rotation @ second @ rotation.T))
    shifted = first + m.mass * place
    cross = place @ first.T
    return _Moments(m.mass, shifted, _mirrored(ca.densify(second + cross + cross.T + m.mass * (place @ place.T))))
