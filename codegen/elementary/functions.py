"""The elementary functions: for each the common case, without branches, and where it holds.

What lies outside is a scalar function sl_<name>_rare in sl_math.h. Special values are those of C99 Annex F.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

from springline.codegen.elementary.words import (
    Kind,
    Procedure,
    Word,
    below,
    bits,
    constant,
    pick,
    real,
    select,
    sqrt,
    trace,
)

SIGN_BIT = 0x8000000000000000
FRACTION = 0x000FFFFFFFFFFFFF
ONE = 0x3FF0000000000000
SQRT_HALF = 0x3FE6A09E667F3BCD
ROUND = float.fromhex("0x1.8p52")
LN2_HI = float.fromhex("0x1.62e42fefa38p-1")
LN2_LO = float.fromhex("0x1.ef35793c7673p-45")
FIELD_BIAS = 4503599627372544.0

Computed = tuple[tuple[Word, ...], Word | None]

_f = float.fromhex


def fabs(x: Word) -> Word:
    """|x|."""
    return real(bits(x) & (2**63 - 1))


def copysign(x: Word, sign: Word) -> Word:
    """|x| with the sign of another."""
    return real((bits(x) & (2**63 - 1)) | (bits(sign) & SIGN_BIT))


def _sign(x: Word) -> Word:
    return select(x > 0.0, constant(1.0), select(x < 0.0, constant(-1.0), x))


def _exponent_of(shifted: Word) -> Word:
    return real((shifted >> 52) ^ 0x4330000000000800)


def _is_normal(shifted: Word, start: int) -> Word:
    return below(shifted + ((start - 0x0010000000000000) % 2**64), 0x7FE0000000000000)


def _exp_tail(rh: Word, rl: Word) -> Word:
    r = rh + rl
    r2 = r * r
    r4 = r2 * r2
    p01 = _f("0x1.000000000000cp-1") + r * _f("0x1.5555555555561p-3")
    p23 = _f("0x1.555555554ff92p-5") + r * _f("0x1.111111110d5cep-7")
    p45 = _f("0x1.6c16c185cac53p-10") + r * _f("0x1.a01a01bb06d7ep-13")
    p67 = _f("0x1.a0199630e5d3fp-16") + r * _f("0x1.71dddf79ade3cp-19")
    p89 = _f("0x1.28b0a6e418617p-22") + r * _f("0x1.af860aa738e43p-26")
    return rl + r2 * ((p01 + r2 * p23) + r4 * ((p45 + r2 * p67) + r4 * p89))


def exp(x: Word) -> Computed:
    """x = k ln 2 + r."""
    t = x * _f("0x1.71547652b82fep+0") + ROUND
    k = t - ROUND
    rh = x - k * LN2_HI
    m = 1.0 + (rh + _exp_tail(rh, k * -LN2_LO))
    return (real(bits(m) + (bits(t) << 52)),), fabs(x) < 708.0


def _log_sum(k: Word, f: Word, lo: Word) -> Word:
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    half = 0.5 * f * f
    p = (_f("0x1.5555555555592p-1") + z * _f("0x1.999999997fd37p-2")) + w * (
        (_f("0x1.24924941f8d20p-2") + z * _f("0x1.c71c5202b27cdp-3"))
        + w * ((_f("0x1.7466405bfb1c1p-3") + z * _f("0x1.39a1933386ffcp-3")) + w * _f("0x1.2f0705ae6bc4fp-3"))
    )
    return k * LN2_HI - ((half - (s * (half + z * p) + lo)) - f)


def log(x: Word) -> Computed:
    """x = 2^k m."""
    b = bits(x)
    shifted = b - SQRT_HALF
    k = _exponent_of(shifted) - FIELD_BIAS
    mantissa = real(b - (shifted & (~FRACTION & (2**64 - 1))))
    return (_log_sum(k, mantissa - 1.0, k * LN2_LO),), _is_normal(shifted, SQRT_HALF)


def log1p(x: Word) -> Computed:
    """1 + x rounded gives k alone."""
    shifted = bits(1.0 + x) - SQRT_HALF
    k = _exponent_of(shifted) - FIELD_BIAS
    scale = real(constant_bits(ONE) - (shifted & (~FRACTION & (2**64 - 1))))
    xs = x * scale
    one = scale - 1.0
    f = xs + one
    lost = (one - f) + xs
    r = _log_sum(k, f, k * LN2_LO + lost)
    r = real(bits(r) | (bits(x) & SIGN_BIT))
    return (r,), below(shifted + ((SQRT_HALF - 0x3C90000000000000) % 2**64), 0x41F0000000000000)


def constant_bits(value: int) -> Word:
    """The Word of 64 bits."""
    return constant(value, Kind.BITS)


def sincos(x: Word) -> Computed:
    """x = n pi/2 + r, both polynomials of r, swapped and signed by n."""
    t = x * _f("0x1.45f306dc9c883p-1") + ROUND
    k = t - ROUND
    a = x - k * _f("0x1.921fb54440000p+0")
    b = k * _f("0x1.68c234c4c0000p-39")
    r = a - b
    n = bits(t)
    y = ((a - r) - b) - k * _f("0x1.98a2e03707345p-77")
    odd = n << 63
    upper = n << 62
    z = r * r
    w = z * z
    v = z * r
    half = 0.5 * z
    s = (_f("-0x1.5555555555549p-3") + z * _f("0x1.111111110f87ap-7")) + w * (
        (_f("-0x1.a01a019c11992p-13") + z * _f("0x1.71de3577b6633p-19"))
        + w * (_f("-0x1.ae5e663a62750p-26") + z * _f("0x1.5d9300ee9c9afp-33"))
    )
    c = (_f("0x1.555555555554cp-5") + z * _f("-0x1.6c16c16c1517ep-10")) + w * (
        (_f("0x1.a01a019cb1bd8p-16") + z * _f("-0x1.27e4f809f0783p-22"))
        + w * (_f("0x1.1ee9ebe91257dp-29") + z * _f("-0x1.8fae9c690c6dcp-37"))
    )
    s = r - ((half * y - y) - v * s)
    c = 1.0 - (half - (w * c - r * y))
    sine = real(bits(pick(odd, s, c)) ^ (upper & SIGN_BIT))
    cosine = real(bits(pick(odd, c, s)) ^ ((upper ^ odd) & SIGN_BIT))
    return (sine, cosine), fabs(x) < _f("0x1p17")


def sin(x: Word) -> Computed:
    """The sine of sincos."""
    (s, _), fine = sincos(x)
    return (s,), fine


def cos(x: Word) -> Computed:
    """The cosine of sincos."""
    (_, c), fine = sincos(x)
    return (c,), fine


def _rcbrt_parts(x: Word) -> tuple[Word, Word]:
    t = real((bits(x) >> 20) | 0x4330000000000000)
    y = real(bits(_f("0x1.55aa943ece2a5p+52") - t * _f("0x1.5555555555555p-2")) << 20)
    h = 1.0 - x * (y * y * y)
    y = y + (y * h) * (_f("0x1.5553d34e15d9fp-2") + h * (_f("0x1.c9afb5eeada12p-3") + h * _f("0x1.65cc774f45369p-3")))
    y = real(bits(y) & 0xFFFFFFF000000000)
    h = 1.0 - x * (y * y * y)
    d = h * (_f("0x1.5555555555555p-2") + h * (_f("0x1.c71c71c71c71cp-3") + h * _f("0x1.61f9add3c0ca4p-3")))
    return y, d


def _thirds_ok(x: Word) -> Word:
    return below(bits(x) - 0x0170000000000000, 0x7D00000000000000)


def pow_m1_3(x: Word) -> Computed:
    """x^(-1/3) = y (1 + d)."""
    y, d = _rcbrt_parts(x)
    return (y + y * d,), _thirds_ok(x)


def pow_p1_2(x: Word) -> Computed:
    """The root, +0 for -0."""
    return (sqrt(x) + 0.0,), ~(x <= -float("inf"))


FUNCTIONS: dict[str, tuple[Callable[..., Computed], int]] = {
    "exp": (exp, 1),
    "log": (log, 1),
    "log1p": (log1p, 1),
    "sincos": (sincos, 1),
    "sin": (sin, 1),
    "cos": (cos, 1),
    "pow_m1_3": (pow_m1_3, 1),
    "pow_p1_2": (pow_p1_2, 1),
    "fabs": (lambda x: ((fabs(x),), None), 1),
    "copysign": (lambda x, sign: ((copysign(x, sign),), None), 2),
    "sign": (lambda x: ((_sign(x),), None), 1),
    "pow_p1": (lambda x: ((x,), None), 1),
    "pow_m1": (lambda x: ((1.0 / x,), None), 1),
    "pow_p2": (lambda x: ((x * x,), None), 1),
    "pow_p3": (lambda x: ((x * x * x,), None), 1),
}


@cache
def procedure(name: str) -> Procedure:
    """The steps of an elementary function."""
    function, inputs = FUNCTIONS[name]
    return trace(function, inputs)
