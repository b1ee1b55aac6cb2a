"""Series elastic drive and the full-order plant (docs/paper.md section 2).

M1 ddq1 + C dq1 + G + K (q1 - q2) = S
M2 ddq2 + K (q2 - q1) = U                                                                             (1)
"""

from __future__ import annotations

import casadi as ca

from springline.model.lagrange import EquationsOfMotion
from springline.model.linear import over, solve_spd
from springline.model.parameters import Bounds, Parameter

EPSILON = Parameter("epsilon", "1", 1.0, "singular perturbation parameter", Bounds(0.0, 1.0, low_open=True))


def spring_force(q1: ca.SX, q2: ca.SX, stiffness: ca.SX) -> ca.SX:
    """z = K (q2 - q1), n x 1, N or N m."""
    return stiffness * (q2 - q1)


def plant(x: ca.SX, u: ca.SX, link: EquationsOfMotion, motor_inertia: ca.SX, stiffness: ca.SX) -> ca.SX:
    """dx/dt (4n x 1) of x = [q1, dq1, q2, dq2] under the motor forces u (n x 1, N or N m), equation (1)."""
    q1, dq1, q2, dq2 = ca.vertsplit(x, x.numel() // 4)
    z = spring_force(q1, q2, stiffness)
    return ca.vertcat(dq1, solve_spd(link.mass, z - link.bias), dq2, over(u - z, motor_inertia))


def static_motor_position(q1: ca.SX, gravity: ca.SX, stiffness: ca.SX) -> ca.SX:
    """q2 at which the springs carry the arm's weight, n x 1, m or rad: K (q2 - q1) = G."""
    return q1 + over(gravity, stiffness)
