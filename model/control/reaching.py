"""Reaching laws (docs/paper.md section 4, errata E4, E8).

A reaching law is one class with its parameters and one method: one of a user's own file, or one that is named in LAWS.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import casadi as ca

from springline.model.control.sliding import TINY
from springline.model.declared import column, expect_names, expect_parameters, expect_text, snake_case, symbols_of
from springline.model.parameters import EVEN, LIMIT, POSITIVE, UNIT_OPEN, Bounds, Parameter, Values
from springline.model.registry import Registry
from springline.model.symbolic import over
from springline.model.terms import named, of_joint

LogForm = Literal["power", "base"]


# exp of this is 1e304: a reaching law that asks for more is clipped by a_max or reported as divergence.
LARGEST_EXPONENT = 700.0


A_MAX = Parameter("a_max", "{q}/s^2", 200.0, "limit on the reaching law's acceleration", LIMIT, per_joint=True)

K1 = Parameter("k1", "SI", 3.0, "gain of the reaching law's first term", POSITIVE)
K2 = Parameter("k2", "SI", 5.0, "gain of the reaching law's second term", POSITIVE)
K3 = Parameter("k3", "SI", 12.0, "gain of the reaching law's third term", POSITIVE)
ALPHA = Parameter("alpha", "1", 0.5, "exponent of the reaching law", UNIT_OPEN)
BETA = Parameter("beta", "1", 5.0, "exponent of the double power law's second term", Bounds(low=1.0, low_open=True))
EPSILON_LOG = Parameter("epsilon_log", "SI", 10.0, "factor inside the logarithm", POSITIVE)
NU = Parameter("nu", "1", 2.0, "even power inside the logarithm", EVEN)
ZETA = Parameter("zeta", "1", 0.9, "exponent of the variable power", UNIT_OPEN)


class Law(ABC):
    """A reaching law. A subclass says at least its rate.

    name        in scenario files and of the generated function: the class's name in snake_case unless the class says
                otherwise
    title       for people: the name unless the class says otherwise
    equations   where it is written, "(20)" in docs/paper.md for the packaged ones; "" where there is nothing to cite
    parameters  what it reads: of a packaged law from the [control] table, of another from [control.<its name>]
    """

    name: ClassVar[str]
    title: ClassVar[str]
    equations: ClassVar[str] = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    def __init_subclass__(cls) -> None:
        """Name the class unless it names itself."""
        cls.name = vars(cls).get("name", snake_case(cls.__name__))
        cls.title = vars(cls).get("title", cls.name)

    def with_form(self, log_form: LogForm) -> Law:
        """The law with another reading of its logarithms (E8); one that has none is the same."""
        return self

    @abstractmethod
    def rate(self, sigma: ca.SX, p: Values) -> ca.SX:
        """Wished d sigma / dt of a scalar sigma, without the limit a_max. p.<name>: its parameters, and [control]'s."""


@dataclass(frozen=True)
class VariablePowerLog(Law):
    """-k1 f(s) - k2 L^(1+alpha) sgn s - k3 L^(1-alpha) sgn s, L = ln(epsilon |s|^nu + 1)          (18), (19), E8."""

    name = "variable_power_log"
    title = "variable power log"
    equations = "(18), (19), E8"
    parameters = (K1, K2, K3, ALPHA, EPSILON_LOG, NU, ZETA)

    log_form: LogForm = "power"

    def with_form(self, log_form: LogForm) -> VariablePowerLog:
        """With the power of a logarithm, or a logarithm to a base                                              (E8)."""
        return replace(self, log_form=log_form)

    def rate(self, sigma: ca.SX, p: Values) -> ca.SX:
        """Wished d sigma / dt of a scalar sigma."""
        size = named("size", ca.fmax(ca.fabs(sigma), TINY))
        exponent = named("exponent", p.zeta * ca.fmax(size, 1.0) * ca.log(size))
        power = named("f", ca.exp(ca.fmin(exponent, LARGEST_EXPONENT)))
        log = named("L", ca.fmax(ca.log1p(p.epsilon_log * size**p.nu), TINY))
        if self.log_form == "power":
            fast, slow = log * log**p.alpha, log ** (1 - p.alpha)
        else:
            fast, slow = over(log, ca.log1p(p.alpha)), over(log, -ca.log1p(-p.alpha))
        named("L_far", fast), named("L_near", slow)
        return -(p.k1 * power + p.k2 * fast + p.k3 * slow) * ca.sign(sigma)


class DoublePower(Law):
    """-k1 |s|^alpha sgn s - k2 |s|^beta sgn s                                                            (21)."""

    name = "double_power"
    title = "double power"
    equations = "(21)"
    parameters = (K1, K2, ALPHA, BETA)

    def rate(self, sigma: ca.SX, p: Values) -> ca.SX:
        """Wished d sigma / dt of a scalar sigma."""
        size = named("size", ca.fmax(ca.fabs(sigma), TINY))
        return -(p.k1 * size**p.alpha + p.k2 * size**p.beta) * ca.sign(sigma)


class Power(Law):
    """-k1 |s|^alpha sgn s                                                                                (20)."""

    name = "power"
    title = "power"
    equations = "(20)"
    parameters = (K1, ALPHA)

    def rate(self, sigma: ca.SX, p: Values) -> ca.SX:
        """Wished d sigma / dt of a scalar sigma."""
        size = named("size", ca.fmax(ca.fabs(sigma), TINY))
        return -(p.k1 * size**p.alpha) * ca.sign(sigma)


def check_law(law: Law) -> None:
    """Raise ValueError, with what was expected, for a law that cannot be computed with."""
    owner = f"law {type(law).__name__}"
    expect_names(owner, "name", [law.name])
    expect_text(owner, "title", law.title)
    expect_parameters(owner, "parameters", law.parameters, ())
    if any(item.per_joint for item in law.parameters):
        raise ValueError(f"{owner}: parameters: expected one number each, for rate is computed of a joint's sigma")


LAWS: Registry[Law] = Registry(Law, {law.name: law for law in (VariablePowerLog(), DoublePower(), Power())}, check_law)


def reaching_rate(law: Law, sigma: ca.SX, p: Values) -> tuple[ca.SX, ca.SX]:
    """The law's d sigma / dt per joint (n x 1), limited to +-a_max (E4), and what it was before.

    Raises ValueError for a law whose rate is no scalar of what it was given.
    """
    rates, given = [], symbols_of(*p.values())
    for i, s in enumerate(ca.vertsplit(sigma)):
        with of_joint(i):
            rates.append(column(f"law {law.name}", "rate", law.rate(s, p), 1, given | symbols_of(s)))
    wished = named("a_law", ca.vertcat(*rates))
    return named("a", ca.fmin(ca.fmax(wished, -p.a_max), p.a_max)), wished
