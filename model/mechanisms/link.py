"""Kinematic trees: an arm said joint by joint, each with the link that it moves."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set
from dataclasses import dataclass, replace
from typing import Any, Literal

from springline.model import lazy_casadi as ca
from springline.model.declared import column
from springline.model.mechanisms.body import Solid, inertia_matrix, stacked

JointKind = Literal["revolute", "prismatic"]

# A rotation this near to a quarter turn is one: a written pi/2 is not exact.
_QUARTER = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A joint and the link that it moves. Entries are expressions of the parameters, or one of the numbers 0, 1 and -1.

    These numbers are structure: what they rule out is neither computed nor printed. Any other number is a parameter,
    which the class declares. Angles may also be whole multiples of pi/2.

    name     of the link, for messages
    joint    "revolute" (q in rad) or "prismatic" (q in m)
    parent   index of the link that it is hinged on, -1 for the base
    origin   of the joint's frame in its parent's frame, 3, m
    rpy      roll, pitch, yaw of the joint's frame in its parent's: R = Rz(yaw) Ry(pitch) Rx(roll), rad
    axis     that the joint turns about or slides along, joint frame, of any length but 0
    mass     kg
    com      centre of mass, 3, m, joint frame
    inertia  about the centre of mass, kg m^2, joint frame: 3 x 3, or a scalar for one about z alone
    The joint's frame moves with the link; its axes at q = 0 are those that origin and rpy say.
    """

    name: str
    joint: JointKind
    parent: int = -1
    origin: Any = (0, 0, 0)
    rpy: Any = (0, 0, 0)
    axis: Any = (0, 0, 1)
    mass: Any = 0
    com: Any = (0, 0, 0)
    inertia: Any = 0


@dataclass(frozen=True, slots=True, eq=False)
class Segment:
    """A link as expressions of full shape.

    frame    3 x 3, joint axes at q = 0 to the parent's axes
    axis     3 x 1, of length 1
    inertia  3 x 3, about the centre of mass; planar: whether it was said as a scalar, about z alone
    """

    name: str
    revolute: bool
    parent: int
    origin: ca.SX
    frame: ca.SX
    axis: ca.SX
    mass: ca.SX
    com: ca.SX
    inertia: ca.SX
    planar: bool

    def turn(self, q: ca.SX) -> ca.SX:
        """3 x 3: axes of the link to those of the joint at q = 0 (Rodrigues)."""
        if not self.revolute:
            return ca.SX.eye(3)
        c, s, a = ca.cos(q), ca.sin(q), self.axis
        if _along_one(a):
            k = next(k for k in range(3) if not a[k].is_zero())
            i, j = (k + 1) % 3, (k + 2) % 3
            turned = ca.SX.eye(3)
            turned[i, i] = turned[j, j] = c
            turned[j, i], turned[i, j] = a[k] * s, -a[k] * s
            return ca.densify(turned)
        return ca.densify(c * ca.SX.eye(3) + s * ca.skew(a) + (1 - c) * (a @ a.T))

    def place(self, q: ca.SX) -> ca.SX:
        """Origin of the link's frame in the parent's, 3 x 1, m."""
        return self.origin if self.revolute else self.origin + self.frame @ self.axis * q


def segments_of(links: object, joints: Sequence[str], owner: str, known: Set[int]) -> tuple[Segment, ...]:
    """The links of a tree, checked.

    joints   names of the joints, one per link
    owner    for messages
    known    symbols that they may depend on
    Raises ValueError, with the link's name and what was expected.
    """
    if not isinstance(links, list | tuple) or not all(isinstance(link, Link) for link in links):
        raise ValueError(f"{owner}: links: expected a list of Link, got {links!r}")
    if len(links) != len(joints):
        raise ValueError(
            f"{owner}: links: expected {len(joints)}, one per joint ({', '.join(joints)}), got {len(links)}"
        )
    made = tuple(_segment(link, len(links), f"{owner}: link {link.name!r}", known) for link in links)
    for start in made:
        seen, at = [start.name], start.parent
        while at >= 0:
            seen.append(made[at].name)
            if len(seen) > len(made):
                raise ValueError(
                    f"{owner}: links: {' -> '.join(seen)} is a circle, expected a tree with its root at -1"
                )
            at = made[at].parent
    return made


def aligned(segments: Sequence[Segment]) -> tuple[Segment, ...]:
    """The same tree with link axes turned so that every joint's axis is one of them, up to its sign.

    A turn about a coordinate axis is four multiplications, one about a direction that parameters say is nine and more;
    the turns between depend on parameters alone.
    """
    into = [ca.SX.eye(3) if _along_one(s.axis) else _basis(s.axis) for s in segments]
    result = []
    for s, own in zip(segments, into, strict=True):
        outer = into[s.parent].T if s.parent >= 0 else ca.SX.eye(3)
        origin, frame, com = outer @ s.origin, outer @ s.frame @ own, own.T @ s.com
        axis = s.axis if _along_one(s.axis) else ca.SX([0, 0, 1])
        result.append(
            replace(
                s,
                origin=ca.densify(origin),
                frame=ca.densify(frame),
                com=ca.densify(com),
                axis=axis,
                inertia=ca.densify(own.T @ s.inertia @ own),
            )
        )
    return tuple(result)


def _along_one(axis: ca.SX) -> bool:
    return sum(not axis[k].is_zero() for k in range(3)) == 1


def _basis(axis: ca.SX) -> ca.SX:
    """A rotation that turns z into a unit vector, 3 x 3, without a singular direction (Duff et al. 2017, JCGT 6(1))."""
    x, y, z = ca.vertsplit(axis)
    sign = ca.if_else(z >= 0, 1, -1)
    a = -1 / (sign + z)
    b = x * y * a
    return ca.horzcat(ca.vertcat(1 + sign * x * x * a, sign * b, -sign * x), ca.vertcat(b, sign + y * y * a, -y), axis)


def outwards(segments: Sequence[Segment]) -> list[int]:
    """Indices of the links, each after its parent."""

    def depth(i: int) -> int:
        return 0 if i < 0 else 1 + depth(segments[i].parent)

    return sorted(range(len(segments)), key=depth)


def _segment(link: Link, count: int, owner: str, known: Set[int]) -> Segment:
    if link.joint not in ("revolute", "prismatic"):
        raise ValueError(f'{owner}: joint: expected "revolute" or "prismatic", got {link.joint!r}')
    if isinstance(link.parent, bool) or not isinstance(link.parent, int) or not -1 <= link.parent < count:
        raise ValueError(f"{owner}: parent: expected the index of a link, or -1 for the base, got {link.parent!r}")
    inertia, planar = inertia_matrix(owner, link.inertia, known)
    axis = _entries(owner, "axis", link.axis, known)
    if axis.is_zero():
        raise ValueError(f"{owner}: axis: expected a direction, got {link.axis!r}")
    if not _along_one(axis):
        axis = axis / ca.norm_2(axis)
    elif not axis.is_constant():
        axis = ca.sign(axis)
    return Segment(
        link.name,
        link.joint == "revolute",
        link.parent,
        _entries(owner, "origin", link.origin, known),
        _frame(owner, link.rpy, known),
        axis,
        _exact(owner, "mass", column(owner, "mass", link.mass, 1, known)),
        _entries(owner, "com", link.com, known),
        _exact(owner, "inertia", inertia),
        planar,
    )


def _exact(owner: str, what: str, value: ca.SX) -> ca.SX:
    """An expression whose entries are of parameters, or 0, 1 or -1."""
    for entry in ca.vertsplit(ca.densify(ca.vec(value))):
        if entry.is_constant() and float(entry) not in (-1.0, 0.0, 1.0):
            text = "expected 0, 1, -1 or an expression of parameters, which the class declares"
            raise ValueError(f"{owner}: {what}: {text}, got the number {float(entry):g}")
    return value


def _entries(owner: str, what: str, value: object, known: Set[int]) -> ca.SX:
    return _exact(owner, what, column(owner, what, stacked(value), 3, known))


def _frame(owner: str, rpy: object, known: Set[int]) -> ca.SX:
    """R = Rz(yaw) Ry(pitch) Rx(roll), quarter turns exact."""
    roll, pitch, yaw = ca.vertsplit(column(owner, "rpy", stacked(rpy), 3, known))

    def cosine_and_sine(angle: ca.SX) -> tuple[ca.SX, ca.SX]:
        if not angle.is_constant():
            return ca.cos(angle), ca.sin(angle)
        quarters = float(angle) / (math.pi / 2)
        k = round(quarters) if math.isfinite(quarters) else 0
        if not abs(quarters - k) <= _QUARTER:
            text = "expected whole multiples of pi/2, or expressions of parameters, which the class declares"
            raise ValueError(f"{owner}: rpy: {text}, got the number {float(angle):g}")
        return ca.SX((1, 0, -1, 0)[k % 4]), ca.SX((0, 1, 0, -1)[k % 4])

    (cr, sr), (cp, sp), (cy, sy) = (cosine_and_sine(angle) for angle in (roll, pitch, yaw))
    about_z = ca.blockcat([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = ca.blockcat([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = ca.blockcat([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return ca.densify(about_z @ about_y @ about_x)


def bodies_of(segments: Sequence[Segment], q: ca.SX) -> list[Solid]:
    """The links as bodies in base axes."""
    frames: dict[int, tuple[ca.SX, ca.SX]] = {-1: (ca.SX.zeros(3), ca.SX.eye(3))}
    for i in outwards(segments):
        segment = segments[i]
        place, rotation = frames[segment.parent]
        frames[i] = (
            place + rotation @ segment.place(q[i]),
            ca.densify(rotation @ segment.frame @ segment.turn(q[i])),
        )
    return [
        Solid(s.mass, frames[i][0] + frames[i][1] @ s.com, frames[i][1], s.inertia, s.planar)
        for i, s in enumerate(segments)
    ]
