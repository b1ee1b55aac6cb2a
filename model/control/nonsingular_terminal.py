"""Nonsingular terminal sliding mode (docs/controllers.md 3): the usual remedy for the singularity of E3."""

from __future__ import annotations

from springline.model import lazy_casadi as ca
from springline.model.control.common import composite, slow_control, softened, tracking_error
from springline.model.control.controller import ArmModel, Condition, Control, Controller
from springline.model.control.sliding import TINY
from springline.model.parameters import NON_NEGATIVE, POSITIVE, Bounds, Parameter, Values
from springline.model.quantities import SIGMA, U_F, U_S
from springline.model.terms import named, section

THEOREM = "the theorem of Feng, Yu and Man (2002)"
_ONE_TO_TWO = Bounds(low=1.0, high=2.0, low_open=True, high_open=True)


class NonsingularTerminal(Controller):
    """sigma = beta e + |de|^g sgn de, dde = -(beta / g) |de|^(2-g) sgn de - gain sgn sigma - H^-1 S, 1 < g < 2.

    No power of e is differentiated, so no exponent is negative; beta is surface_gain, g is exponent.
    """

    title = "nonsingular terminal sliding surface"
    parameters = (
        Parameter("surface_gain", "SI", 12.0, "of the error in the surface", POSITIVE, per_joint=True),
        Parameter("exponent", "1", 1.4, "of the error's rate in the surface", _ONE_TO_TWO),
        Parameter("gain", "{q}/s^2", 60.0, "gain on the sign of sigma", POSITIVE, per_joint=True),
        Parameter("disturbance_bound", "{q}/s^2", 20.0, "bound on |H^-1 S|", NON_NEGATIVE, per_joint=True),
        Parameter("layer", "SI", 1.0, "boundary layer of the sign of sigma (0: the literal law)", NON_NEGATIVE),
        Parameter("rate_layer", "{q}/s", 0.01, "boundary layer of |de|^(2-g) (0: the literal law)", NON_NEGATIVE),
    )
    diagnostics = (SIGMA, U_S, U_F)

    def control(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values) -> Control:
        """Command, error, sliding variable and the two parts of the command."""
        with section("tracking error and sliding variable", "docs/controllers.md 3"):
            e, de = tracking_error(r, y)
            steep = named("steep", ca.fmax(ca.fabs(de), TINY) ** (p.exponent - 1))
            sigma = named("sigma", p.surface_gain * e + de * steep)
        with section("slow control: computed torque", "docs/controllers.md 3"):
            soft = named("soft", softened(de, p.rate_layer) ** (1 - p.exponent))
            sign = named("sign", sigma / softened(sigma, p.layer))
            u_e = named("u_e", -(p.surface_gain / p.exponent * soft * de + p.gain * sign))
            slow = named("u_s", slow_control(r.ddq, u_e, model(y.q1, y.dq1)))
        return composite(r, y, model, p, slow, e, sigma)

    def conditions(self, p: Values) -> tuple[Condition, ...]:
        """The surface is reached in finite time where the gain exceeds the disturbance."""
        effect = "that sigma reaches zero in finite time"
        return (Condition("gain", p.gain, p.disturbance_bound, "disturbance_bound", THEOREM, effect),)
