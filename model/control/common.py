"""What every controller has besides its own: fast control on the elastic drive, and the limit of the command."""

from __future__ import annotations

import casadi as ca

from springline.model.parameters import LIMIT, NON_NEGATIVE, Parameter

K_F = Parameter("K_f", "{F} s/{q}", 0.0, "fast control gain on dq1 - dq2", NON_NEGATIVE, per_joint=True)
U_MAX = Parameter("U_max", "{F}", float("inf"), "limit on the motor force", LIMIT, per_joint=True)


def fast_control(dq1: ca.SX, dq2: ca.SX, gain: ca.SX) -> ca.SX:
    """U_f = K_f (dq1 - dq2), n x 1                                                                         (33)."""
    return gain * (dq1 - dq2)
