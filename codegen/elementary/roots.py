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
    MINUS_ONE_THIRD_LONG,
    MINUS_TWO_THIRDS,
)
from springline.codegen.elementary.primitives import Computed, absolute, hexadecimal, is_single, with_sign
from springline.codegen.elementary.words import Both, Word, below, bits, named, not_equal, real, sqrt

START = Both(hexadecimal("0x1.55aa9c70e38a5p+52"), hexadecimal("0x1.ff1c64p+23"))
THIRD = Both(hexadecimal("0x1.5555555555555p-2"), hexadecimal("0x1.555556p-2"))
UNUSED = Both(20, 8)  # bits that the start does without: the others fit into the fraction of INTEGERS
INTEGERS_FIELD = Both(0x4330000000000000, 0x4B000000)
SMALLEST_THIRDS = Both(0x0170000000000000, 0x0D800000)  # 2^-1000 <= x < 2^1000, 2^-100 <= x < 2^100:
RANGE_THIRDS = Both(0x7D00000000000000, 0x64000000)  # there y^3 is neither denormal nor infinite

SMALLEST_SQUARE = Both(2.0**-900, 2.0**-90)
LARGEST_SQUARE = Both(2.0**1000, 2.0**120)


def _start(x: Word) -> tuple[Word, Word]:
    """y with a relative error of 1e-6, and where all this holds. The polynomial in factors: real ones are short."""
    a, b, c, scale = CUBE_ROOT_START()
    t = named("t", real((bits(x) >> UNUSED()) | INTEGERS_FIELD()))
    divided = named("divided", START() - t * THIRD())
    y = named("y0", real(bits(divided) << UNUSED()))
    u = named("u", (x * y) * (y * y))
    fine = below(bits(x) - SMALLEST_THIRDS(), RANGE_THIRDS())
    return named("y", ((y * scale) * (u - a)) * (u * (u - b) + c)), fine


def _step(z: Word, h: Word, c: tuple[float, ...]) -> Word:
    """z (1 - h)^e, where c holds the coefficients of the exponent e."""
    return z + (z * h) * (c[0] + c[1] * h)


def _leading(x: Word, digits: int) -> Word:
    """The leading digits of a float, nothing behind them."""
    return real(bits(x) & (2**32 - 2 ** (24 - digits)))


def _short_start(x: Word) -> tuple[Word, Word, Word, Word]:
    """y of 8 digits, y^2, d and where this holds: x^(-1/3) = y (1 + d). Powers of y are exact, which floats need."""
    rounded, fine = _start(x)
    c = MINUS_ONE_THIRD_LONG
    y = named("short_y", real((bits(rounded) + 0x8000) & 0xFFFF0000))
    y2 = named("y2", y * y)
    h = named("h", 1.0 - x * (y * y2))
    return y, y2, named("d", h * (c[0] + h * (c[1] + h * c[2]))), fine


def _twice(d: Word) -> Word:
    """(1 + d)^2 - 1."""
    return (d + d) + d * d


def pow_m1_3(x: Word) -> Computed:
    """x^(-1/3)."""
    if is_single():
        y, _, d, fine = _short_start(x)
        return (y + y * d,), fine
    y, fine = _start(x)
    h = named("h", 1.0 - (x * y) * (y * y))
    return (_step(y, h, MINUS_ONE_THIRD),), fine


def pow_m2_3(x: Word) -> Computed:
    """x^(-2/3) = z (1 - h)^(-1/3) with z = y^2 and h = 1 - x^2 z^3, which sees the rounding of z."""
    if is_single():
        _, y2, d, fine = _short_start(x)
        return (y2 + y2 * _twice(d),), fine
    y, fine = _start(x)
    z = named("z", y * y)
    v = named("v", x * z)
    h = named("h", 1.0 - (v * z) * v)
    return (_step(z, h, MINUS_ONE_THIRD),), fine


def pow_p1_3(x: Word) -> Computed:
    """x^(1/3) from x y^2."""
    if is_single():
        _, y2, d, fine = _short_start(x)
        head = named("head", _leading(x, 8))
        return (head * y2 + ((x - head) * y2 + (x * y2) * _twice(d)),), fine
    y, fine = _start(x)
    z = named("z", (x * y) * y)
    h = named("h", 1.0 - z * y)
    return (_step(z, h, MINUS_TWO_THIRDS),), fine


def pow_p2_3(x: Word) -> Computed:
    """x^(2/3) from x y."""
    if is_single():
        y, _, d, fine = _short_start(x)
        head = named("head", _leading(x, 16))
        return (head * y + ((x - head) * y + (x * y) * d),), fine
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
    return (sqrt(q),), (q > SMALLEST_SQUARE()) & (q < LARGEST_SQUARE())


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
