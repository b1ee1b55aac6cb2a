"""What several elementary functions are made of: constants, signs, exponents."""

from __future__ import annotations

from springline.codegen.elementary.words import Kind, Word, below, bits, constant, if_, named, real, select

Computed = tuple[tuple[Word, ...], Word | None]
"""Results of a function, and where they hold (None: everywhere)."""

hexadecimal = float.fromhex

SIGN_BIT = 0x8000000000000000
FRACTION = 0x000FFFFFFFFFFFFF
ONE = 0x3FF0000000000000
HIGH_26 = 0xFFFFFFFFF8000000  # leaves 26 significant bits: two such have an exact product
SMALLEST_NORMAL = 0x0010000000000000
NORMAL = 0x7FE0000000000000  # so many bit patterns from there on
ROUND = hexadecimal("0x1.8p52")  # x + ROUND holds x, rounded to an integer, in its low bits
LN2_HI = hexadecimal("0x1.62e42fefa38p-1")  # 42 bits: times an exponent it is exact
LN2_LO = hexadecimal("0x1.ef35793c7673p-45")
FIELD_BIAS = 4503599627372544.0  # 2^52 + 2048


def absolute(x: Word) -> Word:
    """|x|."""
    return real(bits(x) & ~SIGN_BIT)


def with_sign(x: Word, sign: Word) -> Word:
    """|x| with the sign of another."""
    return real((bits(x) & ~SIGN_BIT) | (bits(sign) & SIGN_BIT))


def cut(x: Word) -> Word:
    """The leading 26 bits of x."""
    return real(bits(x) & HIGH_26)


def one() -> Word:
    """The bits of 1.0."""
    return constant(ONE, Kind.BITS)


def exponent(shifted: Word) -> Word:
    """k + FIELD_BIAS, of bits from which those of the start of a binade were subtracted."""
    return real((shifted >> 52) ^ 0x4330000000000800)


def is_normal(shifted: Word, start: int) -> Word:
    """DBL_MIN <= x < infinity, from bits(x) - start."""
    return below(shifted + (start - SMALLEST_NORMAL), NORMAL)


def fabs(x: Word) -> Computed:
    """|x|."""
    return (absolute(x),), None


def copysign(x: Word, sign: Word) -> Computed:
    """|x| with the sign of another."""
    return (with_sign(x, sign),), None


def sign(x: Word) -> Computed:
    """-1, 1, or x itself where x is a zero or NaN."""
    return (select(x > 0.0, constant(1.0), select(x < 0.0, constant(-1.0), x)),), None


def sq(x: Word) -> Computed:
    """The square."""
    return (x * x,), None


def _nearest(x: Word) -> Word:
    """x + 2^52 - 2^52 rounds |x| < 2^52 to the nearest integer."""
    named("sign", bits(x) & SIGN_BIT)
    shift = named("shift", with_sign(constant(2.0**52), x))
    return named("nearest", (x + shift) - shift)


def floor(x: Word) -> Computed:
    """One comparison mends the direction."""
    nearest = _nearest(x)
    below_x = named("n", nearest - if_(nearest > x, 1.0))
    return (select(absolute(x) < 2.0**52, with_sign(below_x, x), x),), None


def ceil(x: Word) -> Computed:
    """One comparison mends the direction."""
    nearest = _nearest(x)
    above_x = named("n", nearest + if_(nearest < x, 1.0))
    return (select(absolute(x) < 2.0**52, with_sign(above_x, x), x),), None
