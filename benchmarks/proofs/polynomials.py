"""Polynomials and bounds in exact rational arithmetic: nothing here is rounded, and nothing is sampled."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise, zip_longest

CLOSE = Fraction(101, 100)  # how near a bound comes to the supremum
BITS = 200  # of the constants that are no fractions


@dataclass(frozen=True, slots=True)
class Polynomial:
    """sum c_i x^i with rational c_i; numbers beside it are constants."""

    coefficients: tuple[Fraction, ...]

    @classmethod
    def of(cls, *coefficients: Fraction | float) -> Polynomial:
        """From numbers, which are taken as they are."""
        return cls(tuple(Fraction(each) for each in coefficients))

    def __add__(self, other: Polynomial) -> Polynomial:
        pairs = zip_longest(self.coefficients, other.coefficients, fillvalue=Fraction(0))
        return Polynomial(tuple(a + b for a, b in pairs))

    def __sub__(self, other: Polynomial) -> Polynomial:
        return self + Polynomial.of(-1) * other

    def __mul__(self, other: Polynomial) -> Polynomial:
        out = [Fraction(0)] * (len(self.coefficients) + len(other.coefficients) - 1)
        for i, a in enumerate(self.coefficients):
            for k, b in enumerate(other.coefficients):
                out[i + k] += a * b
        return Polynomial(tuple(out))

    def at(self, inner: Polynomial) -> Polynomial:
        """The polynomial of a polynomial."""
        out = Polynomial.of(0)
        for each in reversed(self.coefficients):
            out = out * inner + Polynomial((each,))
        return out

    def less_powers(self, count: int) -> Polynomial:
        """Divided by x^count, which must leave nothing."""
        if any(self.coefficients[:count]):
            raise ValueError(f"x^{count} does not divide {self.coefficients}")
        return Polynomial(self.coefficients[count:])

    def largest(self, low: Fraction, high: Fraction) -> Fraction:
        """A bound of |p| between low and high, at most 1 % above its supremum.

        The polynomial lies within its Bernstein coefficients, the first and the last of which are values that it
        takes; the interval is halved where they are largest.
        """
        on_unit = self.at(Polynomial.of(low, high - low)).coefficients
        n = len(on_unit) - 1
        bernstein = [sum((Fraction(math.comb(k, i), math.comb(n, i)) * on_unit[i] for i in range(k + 1)), Fraction(0))
                     for k in range(n + 1)]  # fmt: skip
        seen = Fraction(0)
        waiting: list[tuple[Fraction, int, list[Fraction]]] = []
        count = 0

        def wait(b: list[Fraction]) -> None:
            nonlocal seen, count
            seen = max(seen, abs(b[0]), abs(b[-1]))
            count += 1
            heapq.heappush(waiting, (-max(map(abs, b)), count, b))

        wait(bernstein)
        while -waiting[0][0] > CLOSE * seen:
            for half in _halves(heapq.heappop(waiting)[2]):
                wait(half)
        return -waiting[0][0]


def _halves(b: list[Fraction]) -> tuple[list[Fraction], list[Fraction]]:
    """Bernstein coefficients on both halves of the interval (de Casteljau)."""
    left, right = [b[0]], [b[-1]]
    while len(b) > 1:
        b = [(x + y) / 2 for x, y in pairwise(b)]
        left.append(b[0])
        right.append(b[-1])
    return left, right[::-1]


@dataclass(frozen=True, slots=True)
class Series:
    """A power series of radius at least 1: term k, where |term| does not grow with k."""

    term: Callable[[int], Fraction]

    def cut(self, reach: Fraction) -> tuple[Polynomial, Fraction]:
        """The polynomial that is left of it for |x| <= reach < 1, and a bound of what was cut off."""
        terms: list[Fraction] = []
        while True:
            terms.append(self.term(len(terms)))
            rest = abs(self.term(len(terms))) * reach ** len(terms) / (1 - reach)
            if rest < Fraction(1, 2**90):
                return Polynomial(tuple(terms)), rest


def distance(p: Polynomial, series: Series, low: Fraction, high: Fraction) -> Fraction:
    """A bound of |p - series| between low and high."""
    known, rest = series.cut(max(abs(low), abs(high)))
    return (p - known).largest(low, high) + rest


def _binomial(exponent: Fraction) -> Callable[[int], Fraction]:
    def term(k: int) -> Fraction:
        out = Fraction(1)
        for i in range(k):
            out *= (i - exponent) / (i + 1)
        return out

    return term


EXP = Series(lambda k: Fraction(1, math.factorial(k)))
"""e^x."""
SIN = Series(lambda k: Fraction((-1) ** k, math.factorial(2 * k + 1)))
"""sin(r) / r of r^2."""
COS = Series(lambda k: Fraction((-1) ** k, math.factorial(2 * k)))
"""cos r of r^2."""
ATANH = Series(lambda k: Fraction(2, 2 * k + 1))
"""2 atanh(s) / s of s^2."""
MINUS_ONE_THIRD = Series(_binomial(Fraction(-1, 3)))
"""(1 - h)^(-1/3)."""


def _inverse_tangent(n: int, sign: int) -> tuple[Fraction, Fraction]:
    """Bounds of atan(1/n) for sign -1, of atanh(1/n) for 1."""
    total, k = Fraction(0), 0
    while n ** (2 * k) < 2**BITS:
        total += Fraction(sign**k, (2 * k + 1) * n ** (2 * k + 1))
        k += 1
    rest = Fraction(2, n ** (2 * k + 1))
    return total - rest, total + rest


def _combined(*parts: tuple[int, tuple[Fraction, Fraction]]) -> tuple[Fraction, Fraction]:
    """Bounds of a sum of multiples."""
    ends: Sequence[tuple[Fraction, Fraction]] = [
        (factor * bounds[factor < 0], factor * bounds[factor > 0]) for factor, bounds in parts
    ]
    return sum((low for low, _ in ends), Fraction(0)), sum((high for _, high in ends), Fraction(0))


LN2 = _combined((2, _inverse_tangent(3, 1)))
"""Bounds of ln 2 = 2 atanh(1/3)."""
HALF_PI = _combined((8, _inverse_tangent(5, -1)), (-2, _inverse_tangent(239, -1)))
"""Bounds of pi/2 = 8 atan(1/5) - 2 atan(1/239)."""
