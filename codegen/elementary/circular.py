"""sin, cos and tan: x = n pi/2 + r, |r| <= pi/4."""

from __future__ import annotations

from springline.codegen.elementary.coefficients import COS, SIN, TAN
from springline.codegen.elementary.primitives import (
    ROUND,
    SIGN_BIT,
    Computed,
    absolute,
    chained,
    fours,
    hexadecimal,
    in_pairs,
    is_single,
    top,
)
from springline.codegen.elementary.words import Both, Word, bits, named, pick, real, traced_format

# pi/2 in short pieces, such that n times a piece is exact, and a last one with all bits.
HALF_PI = Both(
    tuple(map(hexadecimal, ("0x1.921fb54440000p+0", "0x1.68c234c4c0000p-39", "0x1.98a2e03707345p-77"))),
    tuple(map(hexadecimal, ("0x1.92p+0", "0x1.fb4p-12", "0x1.444p-24", "0x1.68c234p-39"))),
)
PER_HALF_PI = Both(hexadecimal("0x1.45f306dc9c883p-1"), hexadecimal("0x1.45f306p-1"))
LARGEST = Both(hexadecimal("0x1p17"), hexadecimal("0x1p13"))


def _quarters(x: Word) -> tuple[Word, Word, Word, list[tuple[Word, Word, Word]]]:
    """ROUND + n, n, r without what the last piece of pi/2 is to it, and the subtractions of the middle ones."""
    first, *middle, _ = HALF_PI()
    t = named("t", x * PER_HALF_PI() + ROUND())
    n = named("n", t - ROUND())
    r = named("a", x - n * first)
    subtractions = []
    for name, piece in zip(("b", "c"), middle, strict=False):
        subtracted = named(name, n * piece)
        before, r = r, named("r", r - subtracted)
        subtractions.append((before, subtracted, r))
    return t, n, r, subtractions


def _rest(n: Word, subtractions: list[tuple[Word, Word, Word]]) -> Word:
    """n times the last piece, and what the subtractions lost."""
    rest = n * HALF_PI()[-1]
    for before, subtracted, r in subtractions:
        rest = rest - ((before - r) - subtracted)
    return named("rest", rest)


def _sincos(r: Word, rest: Word, t: Word) -> tuple[Word, Word]:
    """Sine and cosine of r - rest in quarter t; on doubles the cosine does without the rest."""
    z = named("z", r * r)
    w = named("w", z * z)
    v = named("v", z * r)
    s = named("ps", in_pairs(SIN(), z, w))
    c = named("pc", in_pairs(COS(), z, w))
    if is_single():
        named("rest", rest)
        half = named("half", 0.5 * z)
        lead = named("lead", 1.0 - half)
        s = named("s", r - ((rest - half * rest) - v * s))
        c = named("c", lead + (((1.0 - lead) - half) + (w * c + r * rest)))
    else:
        s = named("s", r - (rest - v * s))
        c = named("c", 1.0 - (0.5 * z - w * c))
    quarter = bits(t)
    odd = named("odd", top(quarter))
    upper = named("upper", quarter << traced_format().width - 2)
    sine = named("sine", real(bits(pick(odd, s, c)) ^ (upper & SIGN_BIT())))
    cosine = named("cosine", real(bits(pick(odd, c, s)) ^ ((upper ^ odd) & SIGN_BIT())))
    return sine, cosine


def sincos(x: Word) -> Computed:
    """Both polynomials, swapped and signed by n."""
    t, n, r, subtractions = _quarters(x)
    return _sincos(r, _rest(n, subtractions if is_single() else []), t), absolute(x) < LARGEST()


def sin(x: Word) -> Computed:
    """The sine of sincos."""
    (sine, _), fine = sincos(x)
    return (sine,), fine


def cos(x: Word) -> Computed:
    """The cosine of sincos."""
    (_, cosine), fine = sincos(x)
    return (cosine,), fine


def sincos_reduced(r: Word, lo: Word, t: Word) -> Computed:
    """Sine and cosine of r + lo in the quarter that the low bits of t tell."""
    return _sincos(r, -lo, t), None


def _tan(r: Word, rest: Word, t: Word) -> Word:
    """tan r = r + r^3 T(r^2), at r - rest; in odd quarters -1 / tan r, what the tangent cannot hold carried along."""
    z = named("z", r * r)
    w = named("w", z * z)
    w2 = named("w2", w * w)
    p = named("p", chained(fours(TAN(), z, w), w2))
    u = named("u", (r * z) * p)
    first = named("first", r + u)
    v = named("v", u - rest * (1.0 + first * first))
    tangent = named("tangent", r + v)
    lo = named("lo", v - (tangent - r))
    q = named("q", -1.0 / tangent)
    return pick(top(bits(t)), tangent, named("inverse", q + (q * q) * lo))


def tan(x: Word) -> Computed:
    """r without its rounding error."""
    t, n, r, subtractions = _quarters(x)
    return (_tan(r, _rest(n, subtractions), t),), absolute(x) < LARGEST()


def tan_reduced(r: Word, lo: Word, t: Word) -> Computed:
    """Tangent of r + lo in the quarter that the low bits of t tell."""
    return (_tan(r, -lo, t),), None
