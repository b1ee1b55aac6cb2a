"""Super-twisting on a linear surface, per joint (docs/controllers.md 2)."""

from __future__ import annotations

from springline.model import lazy_casadi as ca
from springline.model.control.common import composite, held_at_limit, slow_control, softened, tracking_error
from springline.model.control.controller import ArmModel, Condition, Control, Controller
from springline.model.parameters import NON_NEGATIVE, POSITIVE, Parameter, Values
from springline.model.quantities import SIGMA, U_F, U_S, Quantity
from springline.model.terms import named, section

THEOREM = "the theorem of Seeber and Horn (2017)"


class SuperTwisting(Controller):
    """sigma = de + slope e, dsigma/dt = -root_gain |sigma|^(1/2) sgn sigma - nu - H^-1 S.

    dnu/dt = integral_gain sgn sigma: it goes to -H^-1 S in finite time where that changes no faster than
    disturbance_rate, and the layer is zero.
    """

    title = "super-twisting on a linear surface"
    parameters = (
        Parameter("slope", "1/s", 15.0, "of the surface", POSITIVE, per_joint=True),
        Parameter("root_gain", "SI", 15.0, "gain of the root of sigma", POSITIVE, per_joint=True),
        Parameter("integral_gain", "{q}/s^3", 110.0, "gain of the integrated sign of sigma", POSITIVE, per_joint=True),
        Parameter("disturbance_rate", "{q}/s^3", 100.0, "bound on d(H^-1 S)/dt", NON_NEGATIVE, per_joint=True),
        Parameter("layer", "{q}/s", 0.1, "boundary layer of root and sign (0: the literal law)", NON_NEGATIVE),
    )
    states = (Quantity("nu", r"\nu", "{q}/s^2", "integrated sign of the sliding variable"),)
    diagnostics = (SIGMA, U_S, U_F)

    def control(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values) -> Control:
        """Command, error, sliding variable, the two parts of the command and the rate of nu."""
        with section("tracking error and sliding variable", "docs/controllers.md 2"):
            e, de = tracking_error(r, y)
            sigma = named("sigma", de + p.slope * e)
        with section("super-twisting", "docs/controllers.md 2"):
            size = named("size", softened(sigma, p.layer))
            root, sign = named("root", sigma / ca.sqrt(size)), named("sign", sigma / size)
        with section("slow control: computed torque", "docs/controllers.md 2"):
            u_e = named("u_e", -(p.slope * de + p.root_gain * root + z.nu))
            slow = named("u_s", slow_control(r.ddq, u_e, model(y.q1, y.dq1)))
        found = composite(r, y, model, p, slow, e, sigma)
        return Control(
            found.u,
            found.error,
            held_at_limit(found.u, {"nu": p.integral_gain * sign}),
            found.diagnostics,
        )

    def conditions(self, p: Values) -> tuple[Condition, ...]:
        """Finite-time convergence for |d(H^-1 S)/dt| <= disturbance_rate = L: k2 > L, k1 > sqrt(k2 + L)."""
        bound, effect = p.disturbance_rate, "that sigma reaches zero in finite time"
        return (
            Condition("integral_gain", p.integral_gain, bound, "disturbance_rate", THEOREM, effect),
            Condition(
                "root_gain",
                p.root_gain,
                ca.sqrt(p.integral_gain + bound),
                "sqrt(integral_gain + disturbance_rate)",
                THEOREM,
                effect,
            ),
        )
