"""A planar arm of n revolute joints that turn about the base's z axis; one is Spong's flexible-joint benchmark."""

from __future__ import annotations

from functools import cache
from typing import ClassVar

from springline.model import lazy_casadi as ca
from springline.model.mechanisms.link import Link
from springline.model.mechanisms.mechanism import Mechanism
from springline.model.parameters import NON_NEGATIVE, POSITIVE, Joint, Parameter, Values

MOST_JOINTS = 7


def _joints(count: int) -> tuple[Joint, ...]:
    return tuple(Joint(f"joint{k + 1}", "rad", "N m") for k in range(count))


class PlanarArm(Mechanism):
    """n links in the base's x-y plane, each hinged on the end of the one before; all at 0 it lies along x."""

    name = "planar_arm"
    sizes: ClassVar = range(1, MOST_JOINTS + 1)
    joints = _joints(2)
    parameters = (
        Parameter("length", "m", 0.5, "distance from a link's joint to its end", POSITIVE, per_joint=True),
        Parameter("mass", "kg", 2.0, "mass of a link", POSITIVE, per_joint=True),
        Parameter("com", "m", 0.25, "distance from a link's joint to its centre of mass", NON_NEGATIVE, per_joint=True),
        Parameter(
            "inertia", "kg m^2", 0.042, "inertia of a link about its centre of mass", NON_NEGATIVE, per_joint=True
        ),
        Parameter("g", "m/s^2", 9.81, "gravity"),
    )
    motor_inertia = (Parameter("motor_inertia", "kg m^2", 0.1, "motor, seen at the joint", POSITIVE, per_joint=True),)
    stiffness = (Parameter("stiffness", "N m/rad", 1.0e4, "stiffness of the spring", POSITIVE, per_joint=True),)

    def of_size(self, size: int) -> Mechanism:
        """The arm with `size` joints."""
        return self if size in (0, len(self.joints)) else _planar_arm(size)

    def tip(self, q: ca.SX, p: Values) -> ca.SX:
        """The end of the last link."""
        point, angle = ca.SX.zeros(3), ca.SX(0)
        for k in range(len(self.joints)):
            angle = angle + q[k]
            point = point + p.length[k] * ca.vertcat(ca.cos(angle), ca.sin(angle), 0)
        return point

    def links(self, p: Values) -> list[Link]:
        """A chain; every axis is z, every frame is parallel to the base's at rest."""
        return [
            Link(
                joint.name,
                "revolute",
                parent=k - 1,
                origin=(p.length[k - 1], 0, 0) if k else (0, 0, 0),
                mass=p.mass[k],
                com=(p.com[k], 0, 0),
                inertia=p.inertia[k],
            )
            for k, joint in enumerate(self.joints)
        ]


@cache
def _planar_arm(size: int) -> Mechanism:
    made = type("PlanarArm", (PlanarArm,), {"name": PlanarArm.name, "joints": _joints(size)})
    arm: Mechanism = made()
    return arm
