"""The packaged observers (docs/controllers.md 4): a first-order disturbance observer and an extended state observer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from springline.model import lazy_casadi as ca
from springline.model.control.controller import ArmModel
from springline.model.control.observer import Estimate, NoObserver, Observer, ObserverInput, check_observer
from springline.model.parameters import POSITIVE, Parameter, Values
from springline.model.quantities import Quantity
from springline.model.registry import Registry
from springline.model.symbolic import solve_spd
from springline.model.terms import named, section


@dataclass(frozen=True)
class _Driven(Observer):
    """An observer that the command may drive, or the springs' force."""

    inputs: ClassVar[tuple[ObserverInput, ...]] = ("command", "spring")
    source: ObserverInput = "command"

    def expected(self, y: Values, u: ca.SX, model: ArmModel) -> ca.SX:
        """Acceleration of the joints without disturbance, n x 1: of the arm with its motors, or behind the springs."""
        arm = model(y.q1, y.dq1)
        inertia = arm.H if self.source == "command" else arm.M
        return named("ddq_expected", solve_spd(inertia, u - arm.c - arm.G))

    def felt(self, d: ca.SX, y: Values, model: ArmModel) -> ca.SX:
        """What a disturbance of the driven inertia is to the arm with its motors, an acceleration, n x 1."""
        if self.source == "command":
            return d
        arm = model(y.q1, y.dq1)
        return solve_spd(arm.H, arm.M @ d)


@dataclass(frozen=True)
class DisturbanceObserver(_Driven):
    """d = xi + L dq1, dxi/dt = -L (ddq_expected + d): with ddq1 = ddq_expected + d_true, dd/dt = L (d_true - d)."""

    name = "disturbance"
    title = "disturbance observer of first order"
    parameters = (Parameter("bandwidth", "1/s", 6.0, "of the estimate", POSITIVE, per_joint=True),)
    states = (Quantity("xi_d", r"\xi_d", "{q}/s^2", "disturbance observer's state"),)

    def driven_by(self, source: ObserverInput) -> DisturbanceObserver:
        """With another input."""
        return DisturbanceObserver(source)

    def estimate(self, y: Values, u: ca.SX, z: Values, model: ArmModel, p: Values) -> Estimate:
        """A lag of 1 / bandwidth behind the disturbance."""
        with section("disturbance observer", "docs/controllers.md 4"):
            d = named("d_driven", z.xi_d + p.bandwidth * y.dq1)
            rate = named("dxi", -p.bandwidth * (self.expected(y, u, model) + d))
            return named("d_observed", self.felt(d, y, model)), {"xi_d": rate}


@dataclass(frozen=True)
class ExtendedStateObserver(_Driven):
    """dv/dt = ddq_expected + d + 2 w (dq1 - v), dd/dt = w^2 (dq1 - v): d lags the disturbance by two poles at -w."""

    name = "extended_state"
    title = "extended state observer of second order, on the measured rate"
    parameters = (Parameter("bandwidth", "1/s", 30.0, "both poles of the estimate", POSITIVE, per_joint=True),)
    states = (
        Quantity("v_hat", r"\hat v", "{q}/s", "extended state observer's joint rate"),
        Quantity("d_hat", r"\hat d", "{q}/s^2", "extended state observer's disturbance"),
    )

    def driven_by(self, source: ObserverInput) -> ExtendedStateObserver:
        """With another input."""
        return ExtendedStateObserver(source)

    def estimate(self, y: Values, u: ca.SX, z: Values, model: ArmModel, p: Values) -> Estimate:
        """A state, so nothing of the measurement reaches the command through it at once."""
        with section("extended state observer", "docs/controllers.md 4"):
            off = named("v_off", y.dq1 - z.v_hat)
            rate = self.expected(y, u, model) + z.d_hat + 2 * p.bandwidth * off
            return named("d_observed", self.felt(z.d_hat, y, model)), {"v_hat": rate, "d_hat": p.bandwidth**2 * off}


OBSERVERS: Registry[Observer] = Registry(
    Observer,
    {item.name: item for item in (NoObserver(), DisturbanceObserver(), ExtendedStateObserver())},
    check_observer,
)
"""The observers that a structure can name; "none" stands for there being none."""
