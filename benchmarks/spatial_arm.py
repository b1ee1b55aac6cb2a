"""Seven revolute joints in space of which nothing is special: frames, axes and inertias are all parameters.

A user's file like any other: `name = "spatial_arm.py:SpatialArm"`.
"""

from __future__ import annotations

from collections.abc import Sequence

from springline.model import Joint, Link, Mechanism, Parameter
from springline.model.parameters import Values

JOINTS = 7
_ENTRIES = (
    ("origin", "m", (0.35, 0.05, 0.03)),
    ("rpy", "rad", (0.3, 0.2, 0.1)),
    ("axis", "1", (0.1, 0.2, 1.0)),
    ("com", "m", (0.1, 0.02, 0.01)),
    ("inertia", "kg m^2", (0.05, 0.06, 0.07)),
    ("product", "kg m^2", (0.002, 0.001, 0.003)),
)


class SpatialArm(Mechanism):
    """A chain of links that get lighter towards its end."""

    joints = tuple(Joint(f"joint{k + 1}", "rad", "N m") for k in range(JOINTS))
    parameters = (
        *(
            Parameter(f"{name}{k + 1}_{entry}", unit, default, f"{name} of link {k + 1}, {entry}")
            for k in range(JOINTS)
            for name, unit, defaults in _ENTRIES
            for entry, default in zip("xyz", defaults, strict=True)
        ),
        *(Parameter(f"mass{k + 1}", "kg", 5.0 - 0.5 * k, f"mass of link {k + 1}") for k in range(JOINTS)),
        Parameter("g", "m/s^2", 9.81, "gravity"),
    )
    motor_inertia = (Parameter("rotor", "kg m^2", 0.3, "inertia of a motor", per_joint=True),)
    stiffness = (Parameter("spring", "N m/rad", 2.0e4, "stiffness of a spring", per_joint=True),)

    def links(self, p: Values) -> Sequence[Link]:
        """Each on the one before it."""
        return [_link(k, p) for k in range(JOINTS)]


def _link(k: int, p: Values) -> Link:
    origin, rpy, axis, com, (xx, yy, zz), (xy, xz, yz) = (
        tuple(p[f"{name}{k + 1}_{entry}"] for entry in "xyz") for name, *_ in _ENTRIES
    )
    inertia = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
    return Link(f"link{k + 1}", "revolute", k - 1, origin, rpy, axis, p[f"mass{k + 1}"], com, inertia)
