"""Polynomials of the elementary functions, as benchmarks/math_coefficients.py computes them."""

from springline.codegen.elementary.words import Both

# (e^r - 1 - r) / r^2, |r| <= ln 2 / 2
EXPM1 = Both(
    (
        float.fromhex("0x1.000000000000ap-1"),
        float.fromhex("0x1.55555555554fap-3"),
        float.fromhex("0x1.555555555088ap-5"),
        float.fromhex("0x1.1111111127b48p-7"),
        float.fromhex("0x1.6c16c184267b1p-10"),
        float.fromhex("0x1.a01a012a833a8p-13"),
        float.fromhex("0x1.a0199a177a37fp-16"),
        float.fromhex("0x1.71df2506b09b6p-19"),
        float.fromhex("0x1.28ad67a46807dp-22"),
        float.fromhex("0x1.ad7fc465e629dp-26"),
    ),
    (
        float.fromhex("0x1.0000000000000p-1"),
        float.fromhex("0x1.5555540000000p-3"),
        float.fromhex("0x1.5554e80000000p-5"),
        float.fromhex("0x1.11130e0000000p-7"),
        float.fromhex("0x1.6d4cb80000000p-10"),
        float.fromhex("0x1.9dfa7e0000000p-13"),
    ),
)
# the same, |r| <= ln 2 / 4
EXP = (
    float.fromhex("0x1.ffffffffffefcp-2"),
    float.fromhex("0x1.555555555589dp-3"),
    float.fromhex("0x1.5555555600160p-5"),
    float.fromhex("0x1.1111110f0d41ep-7"),
    float.fromhex("0x1.6c16b8dcec34bp-10"),
    float.fromhex("0x1.a01a1826fbb53p-13"),
    float.fromhex("0x1.a06fe78c68969p-16"),
    float.fromhex("0x1.71a9f807860fep-19"),
)
# (2 atanh(s) / s - 2) / z of z = s^2, s <= (sqrt 2 - 1)^2
LOG = Both(
    (
        float.fromhex("0x1.5555555555592p-1"),
        float.fromhex("0x1.999999997ff4cp-2"),
        float.fromhex("0x1.24924941dcee9p-2"),
        float.fromhex("0x1.c71c52189af7dp-3"),
        float.fromhex("0x1.74663bf8e45adp-3"),
        float.fromhex("0x1.39a2023bc6593p-3"),
        float.fromhex("0x1.2f02b927c3e23p-3"),
    ),
    (
        float.fromhex("0x1.5555540000000p-1"),
        float.fromhex("0x1.999c260000000p-2"),
        float.fromhex("0x1.23d3e60000000p-2"),
        float.fromhex("0x1.f138ae0000000p-3"),
    ),
)
# the same, s <= 1 / 5
LOG1P = Both(
    (
        float.fromhex("0x1.5555555555773p-1"),
        float.fromhex("0x1.99999998f1641p-2"),
        float.fromhex("0x1.249249b1be681p-2"),
        float.fromhex("0x1.c71c019db48a8p-3"),
        float.fromhex("0x1.7474da65bd729p-3"),
        float.fromhex("0x1.38536f6f973ffp-3"),
        float.fromhex("0x1.3ab9e70597862p-3"),
    ),
    (
        float.fromhex("0x1.5555540000000p-1"),
        float.fromhex("0x1.999c0c0000000p-2"),
        float.fromhex("0x1.23e0480000000p-2"),
        float.fromhex("0x1.ee9dbc0000000p-3"),
    ),
)
# (sin r - r) / r^3 of z = r^2, r <= pi / 4
SIN = Both(
    (
        float.fromhex("-0x1.5555555555548p-3"),
        float.fromhex("0x1.111111110f733p-7"),
        float.fromhex("-0x1.a01a019bea64dp-13"),
        float.fromhex("0x1.71de35574d307p-19"),
        float.fromhex("-0x1.ae5e4e231f75fp-26"),
        float.fromhex("0x1.5d8c63e45a9a4p-33"),
    ),
    (
        float.fromhex("-0x1.5555560000000p-3"),
        float.fromhex("0x1.1111740000000p-7"),
        float.fromhex("-0x1.a059500000000p-13"),
        float.fromhex("0x1.7c2a1e0000000p-19"),
    ),
)
# (cos r - 1 + z / 2) / z^2 of z = r^2, r <= pi / 4
COS = Both(
    (
        float.fromhex("0x1.555555555554bp-5"),
        float.fromhex("-0x1.6c16c16c15015p-10"),
        float.fromhex("0x1.a01a019c8f24bp-16"),
        float.fromhex("-0x1.27e4f7f190216p-22"),
        float.fromhex("0x1.1ee9dbcdae5f2p-29"),
        float.fromhex("-0x1.8fa683a3ac440p-37"),
    ),
    (
        float.fromhex("0x1.55554a0000000p-5"),
        float.fromhex("-0x1.6c0c280000000p-10"),
        float.fromhex("0x1.99e8140000000p-16"),
    ),
)
# (tan r - r) / r^3 of z = r^2, r <= pi / 4
TAN = Both(
    (
        float.fromhex("0x1.55555555554f2p-2"),
        float.fromhex("0x1.11111111182c9p-3"),
        float.fromhex("0x1.ba1ba1b46be95p-5"),
        float.fromhex("0x1.664f49a85a480p-6"),
        float.fromhex("0x1.226e125c18b3fp-7"),
        float.fromhex("0x1.d6d933881d934p-9"),
        float.fromhex("0x1.7d5b5e6ff45aap-10"),
        float.fromhex("0x1.37fa7e070f8a4p-11"),
        float.fromhex("0x1.d2714bfc9fed7p-13"),
        float.fromhex("0x1.1e282527e334bp-13"),
        float.fromhex("-0x1.b8eede5990f4ep-16"),
        float.fromhex("0x1.76cae235549b2p-14"),
        float.fromhex("-0x1.7806da6d76e2ap-15"),
        float.fromhex("0x1.5dd31c74861afp-16"),
    ),
    (
        float.fromhex("0x1.5555600000000p-2"),
        float.fromhex("0x1.110d9e0000000p-3"),
        float.fromhex("0x1.bad9be0000000p-5"),
        float.fromhex("0x1.5cc1340000000p-6"),
        float.fromhex("0x1.62c8940000000p-7"),
        float.fromhex("0x1.9e017c0000000p-14"),
        float.fromhex("0x1.1e8d820000000p-8"),
    ),
)
# (atan t - t) / t^3 of z = t^2, t <= 7 / 16
ATAN = Both(
    (
        float.fromhex("-0x1.555555555550bp-2"),
        float.fromhex("0x1.999999998e7ecp-3"),
        float.fromhex("-0x1.2492491ff36a1p-3"),
        float.fromhex("0x1.c71c6fdb28516p-4"),
        float.fromhex("-0x1.745cdba591548p-4"),
        float.fromhex("0x1.3b0f2069ab996p-4"),
        float.fromhex("-0x1.10d601f28f5c9p-4"),
        float.fromhex("0x1.ddddb11c0de1fp-5"),
        float.fromhex("-0x1.97a08d886231cp-5"),
        float.fromhex("0x1.2b17b5f0f8355p-5"),
        float.fromhex("-0x1.0a7ea8ff09049p-6"),
    ),
    (
        float.fromhex("-0x1.5555420000000p-2"),
        float.fromhex("0x1.998df80000000p-3"),
        float.fromhex("-0x1.236f140000000p-3"),
        float.fromhex("0x1.add6640000000p-4"),
        float.fromhex("-0x1.dd3a380000000p-5"),
    ),
)
# (asin s - s) / s^3 of z = s^2, s <= 1 / 2
ASIN = Both(
    (
        float.fromhex("0x1.5555555555390p-3"),
        float.fromhex("0x1.333333336e854p-4"),
        float.fromhex("0x1.6db6db4276f73p-5"),
        float.fromhex("0x1.f1c72c3a15e85p-6"),
        float.fromhex("0x1.6e89f425ddbafp-6"),
        float.fromhex("0x1.1c6be32b477a6p-6"),
        float.fromhex("0x1.c6fda43ff74edp-7"),
        float.fromhex("0x1.8ec3b9e8fdf71p-7"),
        float.fromhex("0x1.abc9194ea091fp-8"),
        float.fromhex("0x1.3ff8dbdaf8618p-6"),
        float.fromhex("-0x1.09d99aa6f64c8p-6"),
        float.fromhex("0x1.056f96435a3b3p-5"),
    ),
    (
        float.fromhex("0x1.55554c0000000p-3"),
        float.fromhex("0x1.3338ac0000000p-4"),
        float.fromhex("0x1.6ca7660000000p-5"),
        float.fromhex("0x1.04d1500000000p-5"),
        float.fromhex("0x1.d5502c0000000p-7"),
        float.fromhex("0x1.34aca20000000p-5"),
    ),
)
# (2 atanh(s) / s - 2) / z of z = s^2, s <= 1 / 16
POW = Both(
    (
        float.fromhex("0x1.5555555555555p-1"),
        float.fromhex("0x1.999999999a393p-2"),
        float.fromhex("0x1.2492492181b18p-2"),
        float.fromhex("0x1.c71c7f485bf65p-3"),
        float.fromhex("0x1.744eb860cb8a9p-3"),
        float.fromhex("0x1.41fb23ae5a2d1p-3"),
    ),
    (
        float.fromhex("0x1.5555560000000p-1"),
        float.fromhex("0x1.9994c00000000p-2"),
        float.fromhex("0x1.2916800000000p-2"),
    ),
)
# ((1 - h)^(-1/3) - 1) / h, |h| <= 5.64e-6
MINUS_ONE_THIRD = (
    float.fromhex("0x1.555555556777fp-2"),
    float.fromhex("0x1.c71c71c744b7ap-3"),
)
# ((1 - h)^(-2/3) - 1) / h, |h| <= 2.82e-6
MINUS_TWO_THIRDS = (
    float.fromhex("0x1.555555555bcf7p-1"),
    float.fromhex("0x1.1c71c71c79b04p-1"),
)
# ((1 - h)^(-1/3) - 1) / h, |h| <= 1.18e-2
MINUS_ONE_THIRD_LONG = (
    float.fromhex("0x1.5555560000000p-2"),
    float.fromhex("0x1.c725060000000p-3"),
    float.fromhex("0x1.61dca40000000p-3"),
)
# a, b, c, k: k (u - a) (u (u - b) + c) ~ u^(-1/3), 2.6653 <= u <= 3.1590
CUBE_ROOT_START = Both(
    (
        float.fromhex("0x1.0ccf36b58beaep+3"),
        float.fromhex("0x1.04a1a00bc1e04p+2"),
        float.fromhex("0x1.d3cf10e73aa3cp+4"),
        float.fromhex("-0x1.435e87cb87d78p-8"),
    ),
    (
        float.fromhex("0x1.0ccf360000000p+3"),
        float.fromhex("0x1.04a1a00000000p+2"),
        float.fromhex("0x1.d3cf100000000p+4"),
        float.fromhex("-0x1.435e880000000p-8"),
    ),
)
