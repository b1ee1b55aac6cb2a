"""Computed torque: the rigid model's inverse with a PD law on the error (docs/controllers.md 1)."""

from __future__ import annotations

from springline.model.control.common import composite, slow_control, tracking_error
from springline.model.control.controller import ArmModel, Control, Controller
from springline.model.parameters import POSITIVE, Parameter, Values
from springline.model.quantities import U_F, U_S
from springline.model.terms import named, section


class ComputedTorque(Controller):
    """U_s = H (ddq1d + k_d de + k_p e) + C dq1 + G: without disturbance, dde + k_d de + k_p e = 0 on a rigid drive."""

    title = "computed torque, PD on the rigid model"
    parameters = (
        Parameter("k_p", "1/s^2", 900.0, "gain on the error", POSITIVE, per_joint=True),
        Parameter("k_d", "1/s", 60.0, "gain on the error's rate", POSITIVE, per_joint=True),
    )
    diagnostics = (U_S, U_F)

    def control(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values) -> Control:
        """Command, error, and the two parts of the command."""
        with section("tracking error"):
            e, de = tracking_error(r, y)
        with section("slow control: computed torque", "docs/controllers.md 1"):
            u_e = named("u_e", -(p.k_d * de + p.k_p * e))
            slow = named("u_s", slow_control(r.ddq, u_e, model(y.q1, y.dq1)))
        return composite(r, y, model, p, slow, e)
