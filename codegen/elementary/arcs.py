"""atan, atan2, asin and acos."""

from __future__ import annotations

import sys

from springline.codegen.elementary.coefficients import ASIN, ATAN
from springline.codegen.elementary.primitives import (
    Computed,
    absolute,
    chained,
    cut,
    fours,
    hexadecimal,
    is_single,
    with_sign,
)
from springline.codegen.elementary.words import Both, Word, constant, fmax, fmin, if_, named, select, sqrt, true

HALF_PI = Both(hexadecimal("0x1.921fb54442d18p+0"), hexadecimal("0x1.921fb6p+0"))
HALF_PI_LO = Both(hexadecimal("0x1.1a62633145c07p-54"), hexadecimal("-0x1.777a5cp-25"))
QUARTER_PI = Both(hexadecimal("0x1.921fb54442d18p-1"), hexadecimal("0x1.921fb6p-1"))
QUARTER_PI_LO = Both(hexadecimal("0x1.1a62633145c07p-55"), hexadecimal("-0x1.777a5cp-26"))
PI = Both(hexadecimal("0x1.921fb54442d18p+1"), hexadecimal("0x1.921fb6p+1"))
PI_LO = Both(hexadecimal("0x1.1a62633145c07p-53"), hexadecimal("-0x1.777a5cp-24"))
ATAN_1_2 = Both(hexadecimal("0x1.dac670561bb4fp-2"), hexadecimal("0x1.dac67p-2"))
ATAN_1_2_LO = Both(hexadecimal("0x1.a2b7f222f65e2p-56"), hexadecimal("0x1.586ed4p-28"))
ATAN_3_2 = Both(hexadecimal("0x1.f730bd281f69bp-1"), hexadecimal("0x1.f730bep-1"))
ATAN_3_2_LO = Both(hexadecimal("0x1.007887af0cbbdp-56"), hexadecimal("-0x1.afc12cp-26"))
SMALLEST_NORMAL = Both(sys.float_info.min, 2.0**-126)
LARGE = Both(2.0**1000, 2.0**100)


def _steps(masks: tuple[Word, Word, Word, Word], values: tuple[float, float, float, float]) -> Word:
    """The value of the last mask that holds, 0 if none does."""
    chosen = if_(masks[0], constant(values[0]))
    for mask, value in zip(masks[1:], values[1:], strict=True):
        chosen = select(mask, constant(value), chosen)
    return chosen


def _angle(y: Word, x: Word | float) -> Word:
    """The angle in [0, pi/2] whose tangent is y / x, both positive.

    atan c + atan t with c = 0, 1/2, 1, 3/2 or infinite, c = b / a and t = (a y - b x) / (a x + b y), |t| <= 7/16.
    """
    m1 = named("m1", y >= 0.4375 * x)
    m2 = named("m2", y >= 0.6875 * x)
    m3 = named("m3", y >= 1.1875 * x)
    m4 = named("m4", y >= 2.4375 * x)
    first = named("first", true(m1))
    a = named("a", select(m4, constant(0.0), select(m2, constant(1.0), 1.0 + first)))
    b = named("b", select(m4, constant(1.0), select(m3, constant(1.5), first)))
    hi = named("hi", _steps((m1, m2, m3, m4), (ATAN_1_2(), QUARTER_PI(), ATAN_3_2(), HALF_PI())))
    lo = named("lo", _steps((m1, m2, m3, m4), (ATAN_1_2_LO(), QUARTER_PI_LO(), ATAN_3_2_LO(), HALF_PI_LO())))
    t = named("t", (a * y - b * x) / (a * x + b * y))
    z = named("z", t * t)
    w = named("w", z * z)
    w2 = named("w2", w * w)
    p = named("p", chained(fours(ATAN(), z, w), w2))
    return named("angle", hi + (t + (lo + (t * z) * p)))


def angle(y: Word, x: Word) -> Computed:
    """What atan2 needs of two positive numbers."""
    return (_angle(y, x),), None


def atan(x: Word) -> Computed:
    """The angle of x to 1."""
    return (with_sign(_angle(named("y", fmin(constant(LARGE()), absolute(x))), 1.0), x),), None


def atan2(y: Word, x: Word) -> Computed:
    """The angle of |y| to |x|, reflected."""
    a = named("abs_y", absolute(y))
    b = named("abs_x", absolute(x))
    first = _angle(a, b)
    reflected = named("reflected", select(x < 0.0, PI() - (first - PI_LO()), first))
    least, most = 1.0 / LARGE(), LARGE()
    fine = ((a > least) & (a < most)) & ((b > least) & (b < most))
    return (with_sign(reflected, y),), fine


def _halves(x: Word) -> tuple[Word, Word, Word, Word, Word]:
    """What asin and acos have in common, from 1/2 on by asin x = pi/2 - 2 asin s, s = sqrt((1 - x) / 2).

    Whether |x| < 1/2, s, its leading bits and the rest, and s^2 P(s^2) of asin s = s + s^3 P(s^2).
    """
    a = named("abs_x", absolute(x))
    small = named("is_small", a < 0.5)
    z = named("z", select(small, a * a, 0.5 * (1.0 - a)))
    s = named("s", sqrt(z))
    sh = named("sh", cut(s))
    sl = named("sl", (z - sh * sh) / fmax(constant(SMALLEST_NORMAL()), s + sh))
    w = named("w", z * z)
    w2 = named("w2", w * w)
    return small, s, sh, sl, named("tail", z * chained(fours(ASIN(), z, w), w2))


def asin(x: Word) -> Computed:
    """The leading parts, which are exact, are added last."""
    small, s, sh, sl, tail = _halves(x)
    a = named("abs_x", absolute(x))
    p = named("p", (2.0 * s) * tail - (HALF_PI_LO() - 2.0 * sl))
    if is_single():  # the low part of pi/2 is no small one there: asin 1 would be the float below
        large = named("large", (HALF_PI() - 2.0 * sh) - p)
    else:
        q = named("q", QUARTER_PI() - 2.0 * sh)
        large = named("large", QUARTER_PI() - (p - q))
    return (with_sign(named("size", select(small, a + a * tail, large)), x),), None


def acos(x: Word) -> Computed:
    """pi/2 - asin x, or twice asin s."""
    small, s, sh, sl, tail = _halves(x)
    w = named("rest", s * tail)
    half = named("half", select(x < 0.0, HALF_PI() - (s + (w - HALF_PI_LO())), sh + (w + sl)))
    middle = named("middle", HALF_PI() - (x - (HALF_PI_LO() - x * tail)))
    return (select(small, middle, half + half),), None
