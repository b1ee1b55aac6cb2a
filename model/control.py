"""Slow control (computed torque on a terminal sliding surface) and fast control (docs/paper.md sections 4 and 5)."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from springline.model.lagrange import EquationsOfMotion
from springline.model.parameters import LIMIT, NON_NEGATIVE, Parameter, Values
from springline.model.perturbation import slow_mass
from springline.model.sliding import LogForm, ReachingLaw, SurfaceExponents, reaching_rate, surface

K_F = Parameter("K_f", "{F} s/{q}", (200.0, 2.6), "fast control gain on dq1 - dq2", NON_NEGATIVE)
U_MAX = Parameter("U_max", "{F}", (float("inf"), float("inf")), "limit on the motor force", LIMIT)


@dataclass(frozen=True, slots=True)
class ControlSignals:
    """What the controller computes, each n x 1: command, what it wished before U_max, its two parts, error, sigma."""

    command: ca.SX
    wished: ca.SX
    slow: ca.SX
    fast: ca.SX
    error: ca.SX
    sigma: ca.SX


def slow_control(ddq_d: ca.SX, u_e: ca.SX, nominal: EquationsOfMotion, motor_inertia: ca.SX) -> ca.SX:
    """U_s = H (ddq1d - u_e) + C dq1 + G, n x 1, with nominal parameters                                   (14)."""
    return slow_mass(nominal.mass, motor_inertia) @ (ddq_d - u_e) + nominal.coriolis + nominal.gravity


def fast_control(dq1: ca.SX, dq2: ca.SX, gain: ca.SX) -> ca.SX:
    """U_f = K_f (dq1 - dq2), n x 1                                                                         (33)."""
    return gain * (dq1 - dq2)


def control(
    reference: tuple[ca.SX, ca.SX, ca.SX],
    x: ca.SX,
    nominal: EquationsOfMotion,
    motor_inertia: ca.SX,
    p: Values,
    law: ReachingLaw,
    log_form: LogForm,
    exponents: SurfaceExponents,
) -> ControlSignals:
    """The composite law U = U_s + U_f, limited per motor to +-U_max                                (13), (25), E4.

    reference  q1d, dq1d, ddq1d, each n x 1
    x          measured state [q1, dq1, q2, dq2], 4n x 1; the nominal terms are built on its q1, dq1
    """
    q_d, dq_d, ddq_d = reference
    q1, dq1, _, dq2 = ca.vertsplit(x, x.numel() // 4)
    error = q_d - q1
    sigma, surface_rate = surface(error, dq_d - dq1, p, exponents)
    u_e = reaching_rate(law, sigma, p, log_form) - surface_rate
    slow = slow_control(ddq_d, u_e, nominal, motor_inertia)
    fast = fast_control(dq1, dq2, p.K_f)
    wished = slow + fast
    command = ca.fmin(ca.fmax(wished, -p.U_max), p.U_max)
    return ControlSignals(command, wished, slow, fast, error, sigma)
