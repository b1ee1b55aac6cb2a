"""Slow control (computed torque on a terminal sliding surface) and fast control (docs/paper.md sections 4 and 5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from springline.model.lagrange import EquationsOfMotion
from springline.model.parameters import LIMIT, NON_NEGATIVE, Parameter, Values
from springline.model.perturbation import slow_mass
from springline.model.quantities import DQ1, DQ2, Q1, U_F, U_S, Quantity
from springline.model.sliding import LogForm, ReachingLaw, SurfaceExponents, reaching_rate, surface

K_F = Parameter("K_f", "{F} s/{q}", 0.0, "fast control gain on dq1 - dq2", NON_NEGATIVE, per_joint=True)
U_MAX = Parameter("U_max", "{F}", float("inf"), "limit on the motor force", LIMIT, per_joint=True)


@dataclass(frozen=True, slots=True)
class ControlSignals:
    """What the controller computes, each n x 1.

    command  what the motors are told, after the limit;  wished: before it
    parts    what `wished` is the sum of, by quantity
    error    tracking error;  sigma: sliding variable
    a_law    what the reaching law asks for, before a_max
    """

    command: ca.SX
    wished: ca.SX
    parts: dict[Quantity, ca.SX]
    error: ca.SX
    sigma: ca.SX
    a_law: ca.SX


def slow_control(ddq_d: ca.SX, u_e: ca.SX, nominal: EquationsOfMotion, motor_inertia: ca.SX) -> ca.SX:
    """U_s = H (ddq1d - u_e) + C dq1 + G, n x 1, with nominal parameters                                   (14)."""
    return slow_mass(nominal.mass, motor_inertia) @ (ddq_d - u_e) + nominal.coriolis + nominal.gravity


def fast_control(dq1: ca.SX, dq2: ca.SX, gain: ca.SX) -> ca.SX:
    """U_f = K_f (dq1 - dq2), n x 1                                                                         (33)."""
    return gain * (dq1 - dq2)


def control(
    reference: tuple[ca.SX, ca.SX, ca.SX],
    y: Mapping[Quantity, ca.SX],
    nominal: EquationsOfMotion,
    motor_inertia: ca.SX,
    p: Values,
    law: ReachingLaw,
    log_form: LogForm,
    exponents: SurfaceExponents,
) -> ControlSignals:
    """The composite law U = U_s + U_f, limited per motor to +-U_max                                (13), (25), E4.

    reference  q1d, dq1d, ddq1d, each n x 1
    y          what is measured, each n x 1: q1, dq1 and, on the elastic drive, q2, dq2; the rigid one has no fast part
    nominal    terms built on the measured q1, dq1
    """
    q_d, dq_d, ddq_d = reference
    error = q_d - y[Q1]
    sigma, surface_rate = surface(error, dq_d - y[DQ1], p, exponents)
    rate, a_law = reaching_rate(law, sigma, p, log_form)
    parts = {U_S: slow_control(ddq_d, rate - surface_rate, nominal, motor_inertia)}
    wished = parts[U_S]
    if DQ2 in y:
        parts[U_F] = fast_control(y[DQ1], y[DQ2], p.K_f)
        wished = wished + parts[U_F]
    command = ca.fmin(ca.fmax(wished, -p.U_max), p.U_max)
    return ControlSignals(command, wished, parts, error, sigma, a_law)
