"""exp, expm1 and the hyperbolic functions: x = k ln 2 + r, |r| <= ln 2 / 2, exp r = 1 + r + r^2 P(r).

exp itself takes x = n ln 2 / 2 + r, which halves r and saves two coefficients. The root of 2 is not exact there, which
costs 0.4 ulp; what else is made of exp does without that.
"""

from __future__ import annotations

from springline.codegen.elementary.coefficients import EXP, EXPM1
from springline.codegen.elementary.primitives import (
    LN2_HI,
    LN2_LO,
    ROUND,
    Computed,
    absolute,
    hexadecimal,
    one,
    with_sign,
)
from springline.codegen.elementary.words import Word, bits, constant, fmin, named, pick, real, select

PER_LN2 = hexadecimal("0x1.71547652b82fep+0")
ROOT_2_SHIFTED = hexadecimal("0x1.ea09e667f3bcdp-1")  # the bits of sqrt(2) less 2^51
LARGEST = 708.0  # below it k can be added to the exponent of the result


def _power(x: Word) -> tuple[Word, Word]:
    """ROUND + k, whose low bits are k; and k."""
    t = named("t", x * PER_LN2 + ROUND)
    return t, named("k", t - ROUND)


def _series(r: Word) -> Word:
    """r^2 P(r)."""
    c = EXPM1
    r2 = named("r2", r * r)
    r4 = named("r4", r2 * r2)
    low = named("p03", (c[0] + r * c[1]) + r2 * (c[2] + r * c[3]))
    middle = named("p47", (c[4] + r * c[5]) + r2 * (c[6] + r * c[7]))
    high = named("p89", c[8] + r * c[9])
    return r2 * (low + r4 * (middle + r4 * high))


def significand(hi: Word, lo: Word | None = None) -> tuple[Word, Word, Word]:
    """m, t, k: exp(hi + lo) = m 2^k, the low bits of t are k. Without lo, r is k ln 2 less in two steps."""
    t, k = _power(hi)
    small = k * LN2_LO
    r = named("r", (hi - k * LN2_HI) - (small if lo is None else small - lo))
    return named("m", 1.0 + (r + _series(r))), t, k


def scaled(m: Word, t: Word) -> Word:
    """m 2^k."""
    return real(bits(m) + (bits(t) << 52))


def exp(x: Word) -> Computed:
    """s + s (r + r^2 P(r)) with s = 2^(n/2); adding n << 51 to the bits of its significand makes it."""
    c = EXP
    t = named("t", x * (2.0 * PER_LN2) + ROUND)
    n = named("n", t - ROUND)
    r = named("r", (x - n * (0.5 * LN2_HI)) - n * (0.5 * LN2_LO))
    r2 = named("r2", r * r)
    r4 = named("r4", r2 * r2)
    low = named("p03", (c[0] + r * c[1]) + r2 * (c[2] + r * c[3]))
    high = named("p47", (c[4] + r * c[5]) + r2 * (c[6] + r * c[7]))
    root = named("root", pick(bits(t) << 63, 1.0, ROOT_2_SHIFTED))
    s = named("s", real(bits(root) + (bits(t) << 51)))
    return (s + s * (r + r2 * (low + r4 * high)),), absolute(x) < LARGEST


def exp_parts(hi: Word, lo: Word) -> Computed:
    """m and k of exp(hi + lo) = m 2^k, for results that no exponent can hold."""
    m, _, k = significand(hi, lo)
    return (m, k), None


def _less_one(x: Word) -> tuple[Word, Word]:
    """A large and a small part of exp(x) - 1, with s = 2^k: s - 1 and s times the exact part of r come first.

    Signs are such that -0 is the result for -0.
    """
    t, k = _power(x)
    rh = named("rh", x - k * LN2_HI)
    rl = named("rl", k * LN2_LO)
    s = named("s", real((bits(t) << 52) + one()))
    return named("large", s * rh - (1.0 - s)), named("small", s * (rl - _series(named("r", rh - rl))))


def expm1(x: Word) -> Computed:
    """The sum of both parts."""
    large, small = _less_one(x)
    return (large - small,), absolute(x) < LARGEST


def _less_one_twice(x: Word) -> tuple[Word, Word]:
    """exp(x) - 1, and what its rounding left over."""
    large, small = _less_one(x)
    e = named("e", large - small)
    return e, named("lo", (large - e) - small)


def cosh(x: Word) -> Computed:
    """(e + 1 / e) / 2."""
    a = named("a", absolute(x))
    m, t, _ = significand(a)
    e = named("e", scaled(m, t))
    return (0.5 * e + 0.5 / e,), a < LARGEST


def sinh(x: Word) -> Computed:
    """(e + e / (1 + e)) / 2 with e + lo = exp|x| - 1; what the roundings of e and 1 + e left over enters linearly."""
    a = named("a", absolute(x))
    e, lo = _less_one_twice(a)
    u = named("u", 1.0 + e)
    q = named("q", e / u)
    v = named("v", 1.0 - q)
    rest = named("rest", lo * (1.0 + v * v) - (q * v) * (e - (u - 1.0)))
    return (with_sign(named("size", 0.5 * (e + (q + rest))), x),), a < LARGEST


def tanh(x: Word) -> Computed:
    """With e + lo = exp(2|x|) - 1: e / (2 + e), mended likewise, or 1 - 2 / (2 + e); 1 to the last bit from 30 on."""
    a = named("a", absolute(x))
    e, lo = _less_one_twice(named("twice", 2.0 * fmin(constant(30.0), a)))
    u = named("u", 2.0 + e)
    small = named("is_small", a < 0.55)
    q = named("q", select(small, e, constant(2.0)) / u)
    other = named("other", 1.0 - q)
    v = named("v", 0.5 * other)
    rest = named("rest", v * ((2.0 * v) * lo - q * (e - (u - 2.0))))
    return (with_sign(named("size", select(small, q + rest, other)), x),), None
