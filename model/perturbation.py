"""Singular perturbation split: slow subsystem, quasi-steady spring force, fast subsystem (docs/paper.md section 3).

epsilon in (0, 1], K1 = epsilon^2 K, spring force z = K (q2 - q1), eta = z - zbar, tau = t / epsilon.
"""

from __future__ import annotations

from springline.model import lazy_casadi as ca
from springline.model.dynamics import EquationsOfMotion
from springline.model.symbolic import over, solve_spd


def slow_mass(mass: ca.SX, motor_inertia: ca.SX) -> ca.SX:
    """H = M1 + M2, n x n."""
    return mass + ca.diag(motor_inertia)


def slow_dynamics(u_slow: ca.SX, disturbance: ca.SX, link: EquationsOfMotion, motor_inertia: ca.SX) -> ca.SX:
    """ddq1 of the slow subsystem (epsilon = 0), n x 1: H ddq1 + C dq1 + G = U_s + S                       (4)."""
    return solve_spd(slow_mass(link.mass, motor_inertia), u_slow + disturbance - link.coriolis - link.gravity)


def quasi_steady_force(u_slow: ca.SX, disturbance: ca.SX, link: EquationsOfMotion, motor_inertia: ca.SX) -> ca.SX:
    """zbar, n x 1: (M2^-1 + M1^-1) zbar = M2^-1 U_s - M1^-1 (S - C dq1 - G)                              (8)."""
    compliance = ca.diag(1 / motor_inertia) + solve_spd(link.mass, ca.SX.eye(motor_inertia.numel()))
    load = over(u_slow, motor_inertia) - solve_spd(link.mass, disturbance - link.coriolis - link.gravity)
    return solve_spd(compliance, load)


def fast_dynamics(
    eta: ca.SX, u_fast: ca.SX, mass: ca.SX, motor_inertia: ca.SX, stiffness: ca.SX, epsilon: ca.SX
) -> ca.SX:
    """d^2 eta / d tau^2 = K1 (M2^-1 U_f - (M2^-1 + M1^-1) eta), n x 1                                    (11)."""
    k1 = epsilon**2 * stiffness
    return k1 * (over(u_fast - eta, motor_inertia) - solve_spd(mass, eta))
