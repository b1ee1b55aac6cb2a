"""sin, cos and tan: x = n pi/2 + r, |r| <= pi/4."""

from __future__ import annotations

from springline.codegen.elementary.coefficients import COS, SIN, TAN
from springline.codegen.elementary.primitives import ROUND, SIGN_BIT, Computed, absolute, hexadecimal
from springline.codegen.elementary.words import Word, bits, named, pick, real

# pi/2 in two pieces of 36 bits and a double: n times a piece is exact.
HALF_PI_1 = hexadecimal("0x1.921fb54440000p+0")
HALF_PI_2 = hexadecimal("0x1.68c234c4c0000p-39")
HALF_PI_3 = hexadecimal("0x1.98a2e03707345p-77")
PER_HALF_PI = hexadecimal("0x1.45f306dc9c883p-1")
LARGEST = hexadecimal("0x1p17")


def _quarters(x: Word) -> tuple[Word, Word, Word, Word]:
    """ROUND + n, n, and r in two steps: x less n times the first piece, n times the second."""
    t = named("t", x * PER_HALF_PI + ROUND)
    n = named("n", t - ROUND)
    return t, n, named("a", x - n * HALF_PI_1), named("b", n * HALF_PI_2)


def _sincos(r: Word, rest: Word, t: Word) -> tuple[Word, Word]:
    """Sine and cosine of r - rest in quarter t; the cosine does not need the rest."""
    z = named("z", r * r)
    w = named("w", z * z)
    v = named("v", z * r)
    s = named("ps", (SIN[0] + z * SIN[1]) + w * ((SIN[2] + z * SIN[3]) + w * (SIN[4] + z * SIN[5])))
    c = named("pc", (COS[0] + z * COS[1]) + w * ((COS[2] + z * COS[3]) + w * (COS[4] + z * COS[5])))
    s = named("s", r - (rest - v * s))
    c = named("c", 1.0 - (0.5 * z - w * c))
    quarter = bits(t)
    odd = named("odd", quarter << 63)
    upper = named("upper", quarter << 62)
    sine = named("sine", real(bits(pick(odd, s, c)) ^ (upper & SIGN_BIT)))
    cosine = named("cosine", real(bits(pick(odd, c, s)) ^ ((upper ^ odd) & SIGN_BIT)))
    return sine, cosine


def sincos(x: Word) -> Computed:
    """Both polynomials, swapped and signed by n."""
    t, n, a, b = _quarters(x)
    return _sincos(named("r", a - b), named("rest", n * HALF_PI_3), t), absolute(x) < LARGEST


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
    c = TAN
    z = named("z", r * r)
    w = named("w", z * z)
    w2 = named("w2", w * w)
    p03 = named("p03", (c[0] + z * c[1]) + w * (c[2] + z * c[3]))
    p47 = named("p47", (c[4] + z * c[5]) + w * (c[6] + z * c[7]))
    p8b = named("p8b", (c[8] + z * c[9]) + w * (c[10] + z * c[11]))
    pcd = named("pcd", c[12] + z * c[13])
    p = named("p", p03 + w2 * (p47 + w2 * (p8b + w2 * pcd)))
    u = named("u", (r * z) * p)
    first = named("first", r + u)
    v = named("v", u - rest * (1.0 + first * first))
    tangent = named("tangent", r + v)
    lo = named("lo", v - (tangent - r))
    q = named("q", -1.0 / tangent)
    return pick(bits(t) << 63, tangent, named("inverse", q + (q * q) * lo))


def tan(x: Word) -> Computed:
    """r without its rounding error."""
    t, n, a, b = _quarters(x)
    r = named("r", a - b)
    rest = named("rest", n * HALF_PI_3 - ((a - r) - b))
    return (_tan(r, rest, t),), absolute(x) < LARGEST


def tan_reduced(r: Word, lo: Word, t: Word) -> Computed:
    """Tangent of r + lo in the quarter that the low bits of t tell."""
    return (_tan(r, -lo, t),), None
