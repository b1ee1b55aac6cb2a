"""The reference paper's arm: a lift that slides along the base's y axis and a rotation hinged on it.

Guo et al. 2023, J. Mar. Sci. Eng. 11(3) 474, equation (1); docs/paper.md section 1. In base axes the lifting part's
centroid is at (L1, y, 0), the rotating part's at (L1 + L3 cos theta, y + L3 sin theta, 0). The tip is the rotating
part's other end: J is that of a slender rod with its centroid in the middle, and so of length 2 L3.
"""

from __future__ import annotations

import math
from typing import ClassVar

from springline.model import lazy_casadi as ca
from springline.model.mechanisms.mechanism import Mechanism
from springline.model.parameters import POSITIVE, REAL, Joint, Parameter, Values
from springline.model.signals import SineTerm


class TransferManipulator(Mechanism):
    """Lift (prismatic, m) and rotation (revolute, rad) on a moving base."""

    joints = (Joint("lift", "m", "N"), Joint("rotation", "rad", "N m"))
    parameters = (
        Parameter("m2", "kg", 10.0, "mass of the lifting part", POSITIVE),
        Parameter("m3", "kg", 40.0, "mass of the rotating part", POSITIVE),
        Parameter("J", "kg m^2", 40.0 * 0.74**2 / 3.0, "inertia of the rotating part about its centroid", POSITIVE),
        Parameter("L1", "m", 0.5, "offset of the lift axis from the base origin along x", REAL),
        Parameter("L3", "m", 0.74, "distance from the hinge to the rotating part's centroid", POSITIVE),
        Parameter("g", "m/s^2", 9.8, "gravity", REAL),
    )
    motor_inertia = (
        Parameter("m_l", "kg", 2.0, "equivalent mass of the lift motor", POSITIVE),
        Parameter("I", "kg m^2", 0.01, "equivalent inertia of the rotation motor", POSITIVE),
    )
    stiffness = (
        Parameter("k_s2", "N/m", 2.0e6, "stiffness of the lift spring", POSITIVE),
        Parameter("k_s3", "N m/rad", 2.0e4, "stiffness of the rotation spring", POSITIVE),
    )
    # The paper's experiment (section 7): y_d = sin(pi t), theta_d = 1 + sin(pi t / 2), from (0.8, 0.5) at rest.
    reference_offset = (0.0, 1.0)
    reference_terms = ((SineTerm(1.0, math.pi),), (SineTerm(1.0, math.pi / 2),))
    start_position = (0.8, 0.5)
    control_defaults: ClassVar = {"mu": (12.0, 5.0), "K_f": (200.0, 2.6)}  # Table 3

    regular = True
    source = "Guo et al. 2023, Journal of Marine Science and Engineering 11(3) 474."

    def positions(self, q: ca.SX, p: Values) -> tuple[ca.SX, ca.SX]:
        """Centroids of the lifting and the rotating part, 3 x 1, m, base frame."""
        lift, theta = q[0], q[1]
        return (
            ca.vertcat(p.L1, lift, 0),
            ca.vertcat(p.L1 + p.L3 * ca.cos(theta), lift + p.L3 * ca.sin(theta), 0),
        )

    def tip(self, q: ca.SX, p: Values) -> ca.SX:
        """End of the rotating part, 2 L3 from its hinge."""
        lift, theta = q[0], q[1]
        return ca.vertcat(p.L1 + 2 * p.L3 * ca.cos(theta), lift + 2 * p.L3 * ca.sin(theta), 0)

    def kinetic_energy(self, q: ca.SX, dq: ca.SX, omega: ca.SX, p: Values) -> ca.SX:
        """1/2 m2 |v2|^2 + 1/2 m3 |v3|^2 + 1/2 J (dtheta + omega_z)^2, J (E7: no inertia about the other axes)."""
        v2, v3 = (ca.jtimes(r, q, dq) + ca.cross(omega, r) for r in self.positions(q, p))
        return (p.m2 * ca.dot(v2, v2) + p.m3 * ca.dot(v3, v3) + p.J * (dq[1] + omega[2]) ** 2) / 2

    def potential_energy(self, q: ca.SX, gravity: ca.SX, p: Values) -> ca.SX:
        """Weight against the gravity vector (pointing up, base frame, m/s^2), J."""
        r2, r3 = self.positions(q, p)
        return p.m2 * ca.dot(gravity, r2) + p.m3 * ca.dot(gravity, r3)
