"""What packaged controllers share: slow and fast control, the limit of the command, and conditions on gains."""

from __future__ import annotations

from springline.model import lazy_casadi as ca
from springline.model.control.controller import ArmModel, ArmTerms, Control, Rates
from springline.model.control.sliding import TINY
from springline.model.parameters import LIMIT, NON_NEGATIVE, Parameter, Values
from springline.model.quantities import SIGMA, U_F, U_S
from springline.model.terms import named, section

K_F = Parameter("K_f", "{F} s/{q}", 0.0, "fast control gain on dq1 - dq2", NON_NEGATIVE, per_joint=True)
U_MAX = Parameter("U_max", "{F}", float("inf"), "limit on the motor force", LIMIT, per_joint=True)


def slow_control(ddq_d: ca.SX, u_e: ca.SX, arm: ArmTerms) -> ca.SX:
    """U_s = H (ddq1d - u_e) + C dq1 + G, n x 1, with nominal parameters                                   (14)."""
    named("H", arm.H), named("C_dq1", arm.c), named("G", arm.G)
    return arm.H @ named("ddq", ddq_d - u_e) + arm.c + arm.G


def fast_control(dq1: ca.SX, dq2: ca.SX, gain: ca.SX) -> ca.SX:
    """U_f = K_f (dq1 - dq2), n x 1                                                                         (33)."""
    return gain * (dq1 - dq2)


def tracking_error(r: Values, y: Values) -> tuple[ca.SX, ca.SX]:
    """e = q1d - q1 and its rate, n x 1 each."""
    return named("e", r.q - y.q1), named("de", r.dq - y.dq1)


def composite(
    r: Values, y: Values, model: ArmModel, p: Values, slow: ca.SX, error: ca.SX, sigma: ca.SX | None = None
) -> Control:
    """U = U_s + U_f, the latter on the elastic drive alone                                                 (13)."""
    wished, diagnostics = slow, {U_S.name: slow}
    if sigma is not None:
        diagnostics[SIGMA.name] = sigma
    if "dq2" in y:
        with section("fast control", "(33)"):
            fast = named("u_f", fast_control(y.dq1, y.dq2, p.K_f))
        wished, diagnostics[U_F.name] = slow + fast, fast
    return Control(wished, error, diagnostics=diagnostics)


def held_at_limit(wished: ca.SX, rates: dict[str, ca.SX]) -> Rates:
    """Rates, n x 1 each, of states that stand still for a joint whose command U_max limits."""

    def limited(command: ca.SX) -> dict[str, ca.SX]:
        return {name: ca.if_else(command == wished, rate, 0) for name, rate in rates.items()}

    return limited


def softened(value: ca.SX, layer: ca.SX) -> ca.SX:
    """sqrt(value^2 + layer^2), elementwise and never zero: value over it is sgn(value) with a soft middle."""
    return ca.sqrt(ca.fmax(value**2 + layer**2, TINY))
