"""Terminal sliding surface (docs/paper.md section 4, errata E3, E4)."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from springline.model import lazy_casadi as ca
from springline.model.parameters import NON_NEGATIVE, POSITIVE, Parameter, Values
from springline.model.terms import named, of_joint

# Guards arguments of roots and logarithms at zero: far below any signal, and h**(-5/2) of it, the steepest power
# in the derivatives of the surface's slope, is still finite.
TINY = 1e-120

SURFACE_PARAMETERS = (
    Parameter("mu", "1/s", 5.0, "surface gain of the odd power e^(l/m)", POSITIVE, per_joint=True),
    Parameter("lambda", "1/s", 5.0, "surface gain of the terminal term e^(p/r)", POSITIVE),
    Parameter("delta", "{q}", 0.05, "boundary layer of the terminal term (0: the literal law)", NON_NEGATIVE),
)


LARGEST_SURFACE_EXPONENT = 99
"""Powers are unrolled into products: larger exponents make code that nobody needs, and at last no end of it."""


@dataclass(frozen=True, slots=True)
class SurfaceExponents:
    """Positive odd integers l > m and r > p of the surface (22). Raises ValueError beyond LARGEST_SURFACE_EXPONENT."""

    l: int = 3  # noqa: E741 - the paper's letter
    m: int = 1
    p: int = 1
    r: int = 3

    def __post_init__(self) -> None:
        for name in ("l", "m", "p", "r"):
            value = getattr(self, name)
            if not isinstance(value, int) or not 1 <= value <= LARGEST_SURFACE_EXPONENT or value % 2 == 0:
                raise ValueError(f"{name} is {value}, expected an odd integer from 1 to {LARGEST_SURFACE_EXPONENT}")


def growth(e: ca.SX, exponent: Fraction) -> ca.SX:
    """|e|^(a-1) for a > 1: sgn(e) |e|^a is e times it, and the derivative of that a times it."""
    rest = exponent - 1
    if rest.denominator == 1 and rest.numerator % 2 == 0:
        result = ca.SX(1)
        for _ in range(rest.numerator // 2):
            result = result * e**2
        return result
    return ca.fmax(ca.fabs(e), TINY) ** float(rest)


def terminal_root(e: ca.SX, delta: ca.SX, exponent: Fraction) -> tuple[ca.SX, ca.SX]:
    """h^((n-1)/2) and h^((n-3)/2) with h = e^2 + delta^2, 0 < n < 1                                         (E3).

    phi(e) is e times the first, phi'(e) the second times n e^2 + delta^2.
    """
    h = named("h", ca.fmax(e**2 + delta**2, TINY))
    root = h ** float((exponent - 1) / 2)
    # h^((n-3)/2) is a whole power of h^((n-1)/2) for the usual n (4 for 1/3): products instead of a second power.
    ratio = (exponent - 3) / (exponent - 1)
    if ratio.denominator != 1 or ratio > 8:
        return root, root / h
    steep = ca.SX(1)
    power, square = int(ratio), root
    while power:
        if power & 1:
            steep = steep * square
        power >>= 1
        if power:
            square = square**2
    return root, steep


def surface(e: ca.SX, de: ca.SX, p: Values, exponents: SurfaceExponents) -> tuple[ca.SX, ca.SX]:
    """Sliding variable (22) and the part of its time derivative that the control cancels in (25).

    e, de: tracking error and rate, n x 1. Returns sigma (n x 1, 1/s of the coordinate) and
    de * (mu (l/m) |e|^((l-m)/m) + lambda phi'(e)). What e and de are factors of is put together before they come in.
    """
    strong, weak = Fraction(exponents.l, exponents.m), Fraction(exponents.p, exponents.r)
    sigma, slope = [], []
    for i in range(e.numel()):
        with of_joint(i):
            grown = growth(e[i], strong)
            root, steep = terminal_root(e[i], p.delta, weak)
            factor = named("surface_factor", p.mu[i] * grown + p["lambda"] * root)
            terminal = (float(weak) * p["lambda"]) * e[i] ** 2 + p["lambda"] * p.delta**2
            rate_factor = named("rate_factor", (float(strong) * p.mu[i]) * grown + steep * terminal)
        sigma.append(de[i] + e[i] * factor)
        slope.append(de[i] * rate_factor)
    return ca.vertcat(*sigma), ca.vertcat(*slope)
