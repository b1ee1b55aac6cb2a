"""log and log1p: x = 2^k m, f = m - 1, s = f / (2 + f), log m = 2 atanh s = f - s (f - s^2 P(s^2))."""

from __future__ import annotations

from springline.codegen.elementary.coefficients import LOG, LOG1P
from springline.codegen.elementary.primitives import (
    FIELD_BIAS,
    FRACTION,
    LN2_HI,
    LN2_LO,
    Computed,
    exponent,
    in_pairs,
    is_normal,
    is_single,
    one,
)
from springline.codegen.elementary.words import Both, Word, below, bits, named, real

START = Both(0x3FE6A09E667F3BCD, 0x3F3504F3)
"""m of log begins at sqrt(1/2)."""
START_1P = Both(0x3FE8000000000000, 0x3F400000)
"""m of log1p begins at 3/4: then f = x 2^-k - (1 - 2^-k) is exact for every k."""
SMALLEST_1P = Both(0x3C90000000000000, 0x33000000)  # 1 + x >= 2^-54 or 2^-25
RANGE_1P = Both(0x41F0000000000000, 0x3E800000)  # up to 2^1001 or 2^100
DENORMAL_SCALE = Both(54.0, 25.0)  # this power of 2 makes any denormal number normal


def _sum(minus_k: Word, f: Word, c: tuple[float, ...]) -> Word:
    """k ln 2 + log(1 + f); of two zeros the one that f is, for -0 times -ln 2 is 0 and 0 times it -0.

    Floats take f - s f as f - f^2 / 2 + s f^2 / 2: the rounding of s weighs less then.
    """
    s = named("s", f / (2.0 + f))
    z = named("z", s * s)
    w = named("w", z * z)
    p = named("p", in_pairs(c, z, w))
    if is_single():
        half = named("half", (0.5 * f) * f)
        return (f - (half - (s * (half + z * p) - minus_k * LN2_LO()))) + minus_k * -LN2_HI()
    return (f - (s * (f - z * p) + minus_k * LN2_LO())) + minus_k * -LN2_HI()


def _log(x: Word, bias: float) -> tuple[Word, Word]:
    b = named("b", bits(x))
    shifted = named("shifted", b - START())
    minus_k = named("minus_k", bias - exponent(shifted))
    f = named("f", real(b - (shifted & ~FRACTION())) - 1.0)
    return _sum(minus_k, f, LOG()), is_normal(shifted, START())


def log(x: Word) -> Computed:
    """m in [sqrt(1/2), sqrt(2))."""
    r, fine = _log(x, FIELD_BIAS())
    return (r,), fine


def log_denormal(x: Word) -> Computed:
    """log(x), for x that was multiplied by 2^54 or 2^25."""
    r, _ = _log(x, FIELD_BIAS() + DENORMAL_SCALE())
    return (r,), None


def log1p(x: Word) -> Computed:
    """m in [3/4, 3/2); 1 + x rounded gives k alone."""
    shifted = named("shifted", bits(1.0 + x) - START_1P())
    minus_k = named("minus_k", FIELD_BIAS() - exponent(shifted))
    scale = named("scale", real(one() - (shifted & ~FRACTION())))
    f = named("f", x * scale - (1.0 - scale))
    return (_sum(minus_k, f, LOG1P()),), below(shifted + (START_1P() - SMALLEST_1P()), RANGE_1P())
