"""Reaching laws (docs/paper.md section 4, errata E4, E8).

A reaching law is one class with its parameters and one method: one of a user's own file, or one that is named in LAWS.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

from springline.model import lazy_casadi as ca
from springline.model.control.sliding import TINY
from springline.model.declared import column, expect_names, expect_parameters, expect_text, snake_case, symbols_of
from springline.model.parameters import EVEN, LIMIT, POSITIVE, UNIT_OPEN, Bounds, Parameter, Values
from springline.model.registry import Registry
from springline.model.symbolic import as_written, over
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


class OddLaw(Law):
    """A law that asks for the same on both sides of sigma = 0. A subclass says how much: its strength."""

    @abstractmethod
    def strength(self, size: ca.SX, p: Values) -> ca.SX:
        """Wished speed of a scalar sigma towards zero, of its size, which is no less than TINY. p: as in `rate`."""

    def rate(self, sigma: ca.SX, p: Values) -> ca.SX:
        """Wished d sigma / dt of a scalar sigma."""
        with as_written():
            return self.opposing(sigma, p) * ca.sign(sigma)

    def opposing(self, sigma: ca.SX, p: Values) -> ca.SX:
        """Less the strength: the wished d sigma / dt where sigma is positive."""
        size = named("size", ca.fmax(ca.fabs(sigma), TINY))
        return named("a_law", -self.strength(size, p))


@dataclass(frozen=True)
class VariablePowerLog(OddLaw):
    """-k1 f(s) - k2 L^(1+alpha) sgn s - k3 L^(1-alpha) sgn s, L = ln(epsilon |s|^nu + 1)          (18), (19), E8."""

    name = "variable_power_log"
    title = "variable power log"
    equations = "(18), (19), E8"
    parameters = (K1, K2, K3, ALPHA, EPSILON_LOG, NU, ZETA)

    log_form: LogForm = "power"

    def with_form(self, log_form: LogForm) -> VariablePowerLog:
        """With the power of a logarithm, or a logarithm to a base                                              (E8)."""
        return replace(self, log_form=log_form)

    def strength(self, size: ca.SX, p: Values) -> ca.SX:
        """k1 f + k2 L^(1+alpha) + k3 L^(1-alpha), the last two by what they have in common."""
        exponent = named("exponent", p.zeta * ca.fmax(size, 1.0) * ca.log(size))
        power = named("f", ca.exp(ca.fmin(exponent, LARGEST_EXPONENT)))
        log = named("L", ca.fmax(ca.log1p(p.epsilon_log * size**p.nu), TINY))
        if self.log_form == "power":
            near = named("L_near", log ** (1 - p.alpha))
            logs = near * (p.k2 * log ** (2 * p.alpha) + p.k3)
        else:
            logs = log * (over(p.k2, ca.log1p(p.alpha)) - over(p.k3, ca.log1p(-p.alpha)))
        return p.k1 * power + named("L_terms", logs)


class DoublePower(OddLaw):
    """-k1 |s|^alpha sgn s - k2 |s|^beta sgn s                                                            (21)."""

    name = "double_power"
    title = "double power"
    equations = "(21)"
    parameters = (K1, K2, ALPHA, BETA)

    def strength(self, size: ca.SX, p: Values) -> ca.SX:
        """k1 |s|^alpha + k2 |s|^beta."""
        return p.k1 * size**p.alpha + p.k2 * size**p.beta


class Power(OddLaw):
    """-k1 |s|^alpha sgn s                                                                                (20)."""

    name = "power"
    title = "power"
    equations = "(20)"
    parameters = (K1, ALPHA)

    def strength(self, size: ca.SX, p: Values) -> ca.SX:
        """k1 |s|^alpha."""
        return p.k1 * size**p.alpha


def check_law(law: Law) -> None:
    """Raise ValueError, with what was expected, for a law that cannot be computed with."""
    owner = f"law {type(law).__name__}"
    expect_names(owner, "name", [law.name])
    expect_text(owner, "title", law.title)
    expect_text(owner, "equations", law.equations)
    expect_parameters(owner, "parameters", law.parameters, ())
    if any(item.per_joint for item in law.parameters):
        raise ValueError(f"{owner}: parameters: expected one number each, for rate is computed of a joint's sigma")


LAWS: Registry[Law] = Registry(Law, {law.name: law for law in (VariablePowerLog(), DoublePower(), Power())}, check_law)


def reaching_rate(law: Law, sigma: ca.SX, p: Values) -> tuple[ca.SX, ca.SX]:
    """The law's d sigma / dt per joint (n x 1), limited to +-a_max (E4), and what it was before, but for its sign.

    Raises ValueError for a law whose rate is no scalar of what it was given.
    """
    rates, wished, given = [], [], symbols_of(*p.values())
    for i, s in enumerate(ca.vertsplit(sigma)):
        known = given | symbols_of(s)
        with of_joint(i):
            if isinstance(law, OddLaw):
                opposing = column(f"law {law.name}", "strength", law.opposing(s, p), 1, known)
                wished.append(opposing)
                limited = ca.fmax(opposing, -p.a_max[i]) * ca.sign(s)  # one limit instead of two
            else:
                wished.append(named("a_law", column(f"law {law.name}", "rate", law.rate(s, p), 1, known)))
                limited = ca.fmin(ca.fmax(wished[i], -p.a_max[i]), p.a_max[i])
            rates.append(named("a", limited))
    return ca.vertcat(*rates), ca.vertcat(*wished)
