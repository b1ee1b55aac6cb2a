"""What several elementary functions are made of: constants, signs, exponents."""

from __future__ import annotations

from collections.abc import Sequence

from springline.codegen.elementary.words import (
    SINGLE,
    Both,
    Kind,
    Word,
    below,
    bits,
    constant,
    if_,
    named,
    real,
    select,
    traced_format,
)

Computed = tuple[tuple[Word, ...], Word | None]
"""Results of a function, and where they hold (None: everywhere)."""

hexadecimal = float.fromhex

SIGN_BIT = Both(0x8000000000000000, 0x80000000)
FRACTION = Both(0x000FFFFFFFFFFFFF, 0x007FFFFF)
ONE = Both(0x3FF0000000000000, 0x3F800000)
HIGH_HALF = Both(0xFFFFFFFFF8000000, 0xFFFFF000)  # leaves 26 or 12 significant bits: two such have an exact product
SMALLEST_NORMAL = Both(0x0010000000000000, 0x00800000)
NORMAL = Both(0x7FE0000000000000, 0x7F000000)  # so many bit patterns from there on
ROUND = Both(hexadecimal("0x1.8p52"), hexadecimal("0x1.8p23"))
"""x + ROUND holds x, rounded to an integer, in its low bits."""
LN2_HI = Both(hexadecimal("0x1.62e42fefa38p-1"), hexadecimal("0x1.62e4p-1"))  # short: times an exponent it is exact
LN2_LO = Both(hexadecimal("0x1.ef35793c7673p-45"), hexadecimal("0x1.7f7d1cp-20"))
INTEGERS = Both(2.0**52, 2.0**23)  # from there on there is nothing else
FIELD_BIAS = Both(2.0**52 + 2048.0, 2.0**23 + 256.0)
FIELD = Both(0x4330000000000800, 0x4B000100)  # the bits of FIELD_BIAS


def top(b: Word) -> Word:
    """The lowest bit, moved to the top."""
    return b << traced_format().width - 1


def to_field(b: Word) -> Word:
    """An integer in the low bits, moved to the exponent."""
    return b << traced_format().digits - 1


def absolute(x: Word) -> Word:
    """|x|."""
    return real(bits(x) & ~SIGN_BIT())


def with_sign(x: Word, sign: Word) -> Word:
    """|x| with the sign of another."""
    return real((bits(x) & ~SIGN_BIT()) | (bits(sign) & SIGN_BIT()))


def cut(x: Word) -> Word:
    """The leading half of the bits of x."""
    return real(bits(x) & HIGH_HALF())


def one() -> Word:
    """The bits of 1.0."""
    return constant(ONE(), Kind.BITS)


def exponent(shifted: Word) -> Word:
    """k + FIELD_BIAS, of bits from which those of the start of a binade were subtracted."""
    return real((shifted >> traced_format().digits - 1) ^ FIELD())


def is_normal(shifted: Word, start: int) -> Word:
    """The smallest normal number <= x < infinity, from bits(x) - start."""
    return below(shifted + (start - SMALLEST_NORMAL()), NORMAL())


def is_single() -> bool:
    """Whether the function is traced for floats, which keep more of what roundings leave over."""
    return traced_format() is SINGLE


def in_pairs(c: Sequence[float], x: Word, x2: Word) -> Word:
    """The polynomial of these coefficients by pairs, a chain of two operations for each."""
    if len(c) > 6:  # more than a line has room for
        rest = named(f"p4{len(c) - 1:x}", in_pairs(c[4:], x, x2))
        return chained([c[0] + x * c[1], c[2] + x * c[3], rest], x2)
    return chained([c[i] + x * c[i + 1] if i + 1 < len(c) else c[i] for i in range(0, len(c), 2)], x2)


def fours(c: Sequence[float], x: Word, x2: Word) -> list[Word | float]:
    """Its parts of four coefficients, which a reader knows as p and the first and last of them."""
    parts = [c[i : i + 4] for i in range(0, len(c), 4)]
    return [
        named(f"p{4 * i:x}{4 * i + len(part) - 1:x}", in_pairs(part, x, x2)) if len(part) > 1 else part[0]
        for i, part in enumerate(parts)
    ]


def chained(parts: Sequence[Word | float], x: Word) -> Word:
    """The polynomial of x whose coefficients these are, by Horner's rule."""
    *before, result = parts
    for part in reversed(before):
        result = part + x * result
    assert isinstance(result, Word)
    return result


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
    """x + INTEGERS - INTEGERS rounds |x| < INTEGERS to the nearest integer."""
    named("sign", bits(x) & SIGN_BIT())
    shift = named("shift", with_sign(constant(INTEGERS()), x))
    return named("nearest", (x + shift) - shift)


def floor(x: Word) -> Computed:
    """One comparison mends the direction."""
    nearest = _nearest(x)
    below_x = named("n", nearest - if_(nearest > x, 1.0))
    return (select(absolute(x) < INTEGERS(), with_sign(below_x, x), x),), None


def ceil(x: Word) -> Computed:
    """One comparison mends the direction."""
    nearest = _nearest(x)
    above_x = named("n", nearest + if_(nearest < x, 1.0))
    return (select(absolute(x) < INTEGERS(), with_sign(above_x, x), x),), None
