"""Roots and powers with a fixed exponent.

Cube roots: y ~ x^(-1/3) from the bits of x divided by -3 (in floating point: lanes have no 64-bit division), times a
cubic polynomial of x y^3, which is near 2.9. The result comes of y by one step of third order: with h = 1 - x y^3,
x^(-1/3) = y (1 - h)^(-1/3), and likewise for the other thirds.
"""

from __future__ import annotations

import math

from springline.codegen.elementary.coefficients import (
    CUBE_ROOT_START,
    MINUS_ONE_THIRD,
    MINUS_TWO_THIRDS,
)
from springline.codegen.elementary.primitives import Computed, absolute, hexadecimal, with_sign
from springline.codegen.elementary.words import Word, below, bits, named, not_equal, real, sqrt

START = hexadecimal("0x1.55aa9c70e38a5p+52")
THIRD = hexadecimal("0x1.5555555555555p-2")
SMALLEST_THIRDS = 0x0170000000000000  # 2^-1000 <= x < 2^1000, where y^3 is neither denormal nor infinite
RANGE_THIRDS = 0x7D00000000000000


def _start(x: Word) -> tuple[Word, Word]:
    """y with a relative error of 1e-6, and where all this holds. The polynomial in factors: real ones are short."""
    a, b, c, scale = CUBE_ROOT_START
    t = named("t", real((bits(x) >> 20) | 0x4330000000000000))
    divided = named("divided", START - t * THIRD)
    y = named("y0", real(bits(divided) << 20))
    u = named("u", (x * y) * (y * y))
    fine = below(bits(x) - SMALLEST_THIRDS, RANGE_THIRDS)
    return named("y", ((y * scale) * (u - a)) * (u * (u - b) + c)), fine


def _step(z: Word, h: Word, c: tuple[float, ...]) -> Word:
    """z (1 - h)^e, where c holds the coefficients of the exponent e."""
    return z + (z * h) * (c[0] + c[1] * h)


def pow_m1_3(x: Word) -> Computed:
    """x^(-1/3)."""
    y, fine = _start(x)
    h = named("h", 1.0 - (x * y) * (y * y))
    return (_step(y, h, MINUS_ONE_THIRD),), fine


def pow_m2_3(x: Word) -> Computed:
    """x^(-2/3) = z (1 - h)^(-1/3) with z = y^2 and h = 1 - x^2 z^3, which sees the rounding of z."""
    y, fine = _start(x)
    z = named("z", y * y)
    v = named("v", x * z)
    h = named("h", 1.0 - (v * z) * v)
    return (_step(z, h, MINUS_ONE_THIRD),), fine


def pow_p1_3(x: Word) -> Computed:
    """x^(1/3) from x y^2."""
    y, fine = _start(x)
    z = named("z", (x * y) * y)
    h = named("h", 1.0 - z * y)
    return (_step(z, h, MINUS_TWO_THIRDS),), fine


def pow_p2_3(x: Word) -> Computed:
    """x^(2/3) from x y."""
    y, fine = _start(x)
    z = named("z", x * y)
    h = named("h", 1.0 - z * (y * y))
    return (_step(z, h, MINUS_ONE_THIRD),), fine


def cbrt(x: Word) -> Computed:
    """Of |x|, with the sign of x."""
    (r,), fine = pow_p1_3(named("a", absolute(x)))
    return (with_sign(named("root", r), x),), fine


def hypot(x: Word, y: Word) -> Computed:
    """Where no square overflows or is lost."""
    q = named("q", x * x + y * y)
    return (sqrt(q),), (q > 2.0**-900) & (q < 2.0**1000)


def _not_minus_infinity(x: Word) -> Word:
    return not_equal(x, -math.inf)


def pow_p1_2(x: Word) -> Computed:
    """The root, but +0 for -0."""
    return (sqrt(x) + 0.0,), _not_minus_infinity(x)


def pow_m1_2(x: Word) -> Computed:
    """1 / root."""
    return (1.0 / (sqrt(x) + 0.0),), _not_minus_infinity(x)


def pow_p3_2(x: Word) -> Computed:
    """x times its root."""
    return (x * sqrt(x),), _not_minus_infinity(x)


def pow_p1(x: Word) -> Computed:
    """The number itself."""
    return (x,), None


def pow_m1(x: Word) -> Computed:
    """The reciprocal."""
    return (1.0 / x,), None


def pow_p2(x: Word) -> Computed:
    """The square."""
    return (x * x,), None


def pow_p3(x: Word) -> Computed:
    """The cube."""
    return ((x * x) * x,), None
