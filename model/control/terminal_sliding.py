"""The paper's controller: computed torque on a terminal sliding surface, and fast control (docs/paper.md 4 and 5)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from springline.model.control.common import composite, slow_control, tracking_error
from springline.model.control.controller import ArmModel, Control, Controller
from springline.model.control.reaching import LAWS, Law, reaching_rate
from springline.model.control.sliding import SurfaceExponents, surface
from springline.model.parameters import Values
from springline.model.quantities import SIGMA, U_F, U_S
from springline.model.terms import named, section


@dataclass(frozen=True)
class TerminalSliding(Controller):
    """The composite law U = U_s + U_f                                                             (13), (25), E4.

    reaching   how the sliding variable shall go to zero
    exponents  of the surface
    Its parameters are those of the [control] table; the rigid drive has no fast part.
    """

    name = "terminal_sliding"
    title = "computed torque on a terminal sliding surface"
    diagnostics = (SIGMA, U_S, U_F)

    reaching: Law = LAWS["variable_power_log"]
    exponents: SurfaceExponents = field(default_factory=SurfaceExponents)

    @property
    def law(self) -> Law:
        """The reaching law."""
        return self.reaching

    def with_law(self, law: Law, exponents: SurfaceExponents) -> TerminalSliding:
        """The controller with another law and surface."""
        return TerminalSliding(law, exponents)

    def control(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values) -> Control:
        """Command, error, sliding variable and the two parts of the command."""
        with section("tracking error and sliding variable", "(22), E3"):
            error, rate_error = tracking_error(r, y)
            sigma, surface_rate = surface(error, rate_error, p, self.exponents)
            named("sigma", sigma), named("dsurface", surface_rate)
        written = ", ".join(filter(None, (self.reaching.equations, "limit E4")))
        with section(f"reaching law: {self.reaching.title}", written):
            rate, a_law = reaching_rate(self.reaching, sigma, p)
        with section("slow control: computed torque", "(14), (25)"):
            u_e = named("u_e", rate - surface_rate)
            slow = named("u_s", slow_control(r.ddq, u_e, model(y.q1, y.dq1)))
        return replace(composite(r, y, model, p, slow, error, sigma), a_law=a_law)
