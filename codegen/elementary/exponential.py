"""exp, expm1 and the hyperbolic functions: x = k ln 2 + r, |r| <= ln 2 / 2, exp r = 1 + r + r^2 P(r).

On doubles exp itself takes x = n ln 2 / 2 + r, which halves r and saves two coefficients. The root of 2 is not exact
there, which costs 0.4 ulp; what else is made of exp does without that, and so do floats.
"""

from __future__ import annotations

from springline.codegen.elementary.coefficients import EXP, EXPM1
from springline.codegen.elementary.primitives import (
    LN2_HI,
    LN2_LO,
    ROUND,
    Computed,
    absolute,
    chained,
    fours,
    hexadecimal,
    in_pairs,
    is_single,
    one,
    to_field,
    top,
    with_sign,
)
from springline.codegen.elementary.words import Both, Word, bits, constant, fmin, named, pick, real, select

PER_LN2 = Both(hexadecimal("0x1.71547652b82fep+0"), hexadecimal("0x1.715476p+0"))
ROOT_2_SHIFTED = hexadecimal("0x1.ea09e667f3bcdp-1")  # the bits of sqrt(2) less 2^51
LARGEST = Both(708.0, 87.0)  # below it k can be added to the exponent of the result
SMALL_TANH = Both(0.55, hexadecimal("0x1.1ap-1"))


def _power(x: Word) -> tuple[Word, Word]:
    """ROUND + k, whose low bits are k; and k."""
    t = named("t", x * PER_LN2() + ROUND())
    return t, named("k", t - ROUND())


def _series(r: Word) -> Word:
    """r^2 P(r)."""
    r2 = named("r2", r * r)
    if is_single():
        return r2 * named("p", in_pairs(EXPM1(), r, r2))
    r4 = named("r4", r2 * r2)
    return r2 * chained(fours(EXPM1(), r, r2), r4)


def significand(hi: Word, lo: Word | None = None) -> tuple[Word, Word, Word]:
    """m, t, k: exp(hi + lo) = m 2^k, the low bits of t are k. Without lo, r is k ln 2 less in two steps.

    Floats add the exact part of r apart from the rest.
    """
    t, k = _power(hi)
    small = k * LN2_LO()
    if is_single():
        exact = named("exact", hi - k * LN2_HI())
        rest = named("rest", small if lo is None else small - lo)
        return named("m", 1.0 + (exact - (rest - _series(named("r", exact - rest))))), t, k
    r = named("r", (hi - k * LN2_HI()) - (small if lo is None else small - lo))
    return named("m", 1.0 + (r + _series(r))), t, k


def scaled(m: Word, t: Word) -> Word:
    """m 2^k."""
    return real(bits(m) + to_field(bits(t)))


def exp(x: Word) -> Computed:
    """s + s (r + r^2 P(r)) with s = 2^(n/2); adding n << 51 to the bits of its significand makes it."""
    if is_single():
        m, t, _ = significand(x)
        return (scaled(m, t),), absolute(x) < LARGEST()
    t = named("t", x * (2.0 * PER_LN2()) + ROUND())
    n = named("n", t - ROUND())
    r = named("r", (x - n * (0.5 * LN2_HI())) - n * (0.5 * LN2_LO()))
    r2 = named("r2", r * r)
    r4 = named("r4", r2 * r2)
    parts = fours(EXP, r, r2)
    root = named("root", pick(top(bits(t)), 1.0, ROOT_2_SHIFTED))
    s = named("s", real(bits(root) + (bits(t) << 51)))
    return (s + s * (r + r2 * chained(parts, r4)),), absolute(x) < LARGEST()


def exp_parts(hi: Word, lo: Word) -> Computed:
    """m and k of exp(hi + lo) = m 2^k, for results that no exponent can hold."""
    m, _, k = significand(hi, lo)
    return (m, k), None


def _less_one(x: Word) -> tuple[Word, Word]:
    """A large and a small part of exp(x) - 1, with s = 2^k: s - 1 and s times the exact part of r come first.

    Signs are such that -0 is the result for -0.
    """
    t, k = _power(x)
    rh = named("rh", x - k * LN2_HI())
    rl = named("rl", k * LN2_LO())
    s = named("s", real(to_field(bits(t)) + one()))
    return named("large", s * rh - (1.0 - s)), named("small", s * (rl - _series(named("r", rh - rl))))


def expm1(x: Word) -> Computed:
    """The sum of both parts."""
    large, small = _less_one(x)
    return (large - small,), absolute(x) < LARGEST()


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
    return (0.5 * e + 0.5 / e,), a < LARGEST()


def sinh(x: Word) -> Computed:
    """(e + e / (1 + e)) / 2 with e + lo = exp|x| - 1; what the roundings of e and 1 + e left over enters linearly."""
    a = named("a", absolute(x))
    e, lo = _less_one_twice(a)
    u = named("u", 1.0 + e)
    q = named("q", e / u)
    v = named("v", 1.0 - q)
    rest = named("rest", lo * (1.0 + v * v) - (q * v) * (e - (u - 1.0)))
    return (with_sign(named("size", 0.5 * (e + (q + rest))), x),), a < LARGEST()


def tanh(x: Word) -> Computed:
    """With e + lo = exp(2|x|) - 1: e / (2 + e), mended likewise, or 1 - 2 / (2 + e); 1 to the last bit from 30 on."""
    a = named("a", absolute(x))
    e, lo = _less_one_twice(named("twice", 2.0 * fmin(constant(30.0), a)))
    u = named("u", 2.0 + e)
    small = named("is_small", a < SMALL_TANH())
    q = named("q", select(small, e, constant(2.0)) / u)
    other = named("other", 1.0 - q)
    v = named("v", 0.5 * other)
    rest = named("rest", v * ((2.0 * v) * lo - q * (e - (u - 2.0))))
    return (with_sign(named("size", select(small, q + rest, other)), x),), None
