"""pow for exponents without a function of their own: y log x as a sum of two numbers, then exp.

x = 2^k m; m / c is near 1 for one of four numbers c whose logarithms are almost numbers of the format;
s = (m - c) / (m + c) as sh + sl, log m = log c + 2 atanh s.
"""

from __future__ import annotations

from springline.codegen.elementary.coefficients import POW
from springline.codegen.elementary.exponential import LARGEST, scaled, significand
from springline.codegen.elementary.primitives import (
    FIELD_BIAS,
    FRACTION,
    LN2_HI,
    LN2_LO,
    Computed,
    absolute,
    cut,
    exponent,
    hexadecimal,
    in_pairs,
    is_normal,
)
from springline.codegen.elementary.words import Both, Word, below, bits, constant, named, pick, real, traced_format

START = Both(0x3FED580000000000, 0x3F6AC000)
CENTERS = Both(
    (1.0, hexadecimal("0x1.2d26acp+0"), hexadecimal("0x1.72d4cp+0"), hexadecimal("0x1.b372a8p+0")),
    (1.0, hexadecimal("0x1.33c04ep+0"), hexadecimal("0x1.74cbd2p+0"), hexadecimal("0x1.b3b8fp+0")),
)
LOGARITHMS = Both(
    (
        0.0,
        hexadecimal("0x1.4caa7dcbe8acfp-3"),
        hexadecimal("0x1.7b7679c3bb462p-2"),
        hexadecimal("0x1.0ff923a807833p-1"),
    ),
    (0.0, hexadecimal("0x1.7910dcp-3"), hexadecimal("0x1.80dff8p-2"), hexadecimal("0x1.104bcp-1")),
)
ALTERNATING = Both(0xAAAAAAAAAAAAA000, 0xAAAAAC00)  # the fraction of 1/3 and 2/3 below its first bit


def _choose(first: Word, second: Word, values: tuple[float, float, float, float]) -> Word:
    a, b, c, d = (constant(value) for value in values)
    return pick(first, pick(second, a, b), pick(second, c, d))


def _log(shifted: Word, y: Word, bias: Word | float) -> tuple[Word, Word]:
    """hi + lo = y log x to about 2^-63 relative, for normal positive x with its bits less START."""
    k = named("k", exponent(shifted) - bias)
    m = named("m", real((shifted & FRACTION()) + START()))
    fraction = traced_format().width - traced_format().digits + 1
    first = named("first", shifted << fraction)
    second = named("second", shifted << fraction + 1)
    c = named("c", _choose(first, second, CENTERS()))
    log_c = named("log_c", _choose(first, second, LOGARITHMS()))
    f = named("f", m - c)
    u = named("u", m + c)
    v = named("v", 1.0 / u)
    s = named("s", f * v)
    sh = named("sh", cut(s))
    uh = named("uh", cut(u))
    sl = named("sl", ((f - sh * uh) - sh * (m - (uh - c))) * v)
    ds = named("ds", (sh - s) + sl)  # s + ds is the better s
    z = named("z", s * s)
    w = named("w", z * z)
    p = named("p", in_pairs(POW(), z, w))
    kl = named("kl", k * LN2_HI())
    t = named("tk", kl + log_c)
    tl = named("tl", (kl - t) + log_c)
    sh2 = named("sh2", sh + sh)
    h = named("h", t + sh2)
    rest = named("rest", (tl + k * LN2_LO()) + ((sl + sl) + (z + z) * ds))
    low = named("low", (((t - h) + sh2) + rest) + (s * z) * p)
    lh = named("lh", cut(h + low))
    ll = named("ll", (h - lh) + low)
    yh = named("yh", cut(y))
    return named("hi", yh * lh), named("lo", y * ll + (y - yh) * lh)


def _general(x: Word, y: Word) -> tuple[Word, Word]:
    shifted = named("shifted", bits(x) - START())
    hi, lo = _log(shifted, y, FIELD_BIAS())
    m, t, _ = significand(hi, lo)
    return named("r", scaled(m, t)), is_normal(shifted, START()) & (absolute(hi) < LARGEST())


def pow_general(x: Word, y: Word) -> Computed:
    """x^y, also where y has a function of its own."""
    r, fine = _general(x, y)
    return (r,), fine


def pow_(x: Word, y: Word) -> Computed:
    """x^y where y has no function of its own, by the bits of its fraction."""
    r, fine = _general(x, y)
    low = named("fraction", bits(y) << traced_format().width - traced_format().digits + 2)
    return (r,), fine & ~(below(low, 1) | below(low ^ ALTERNATING(), 1))


def pow_log(x: Word, y: Word, bias: Word) -> Computed:
    """The logarithm alone, for x that was scaled."""
    return _log(named("shifted", bits(x) - START()), y, bias), None
