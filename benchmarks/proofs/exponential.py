"""exp: s (1 + q) with s = 2^(n/2), rounded, and q = r + r^2 P(r) ~ e^R - 1."""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

import mpmath

from springline.benchmarks.math_accuracy import Case, uniform
from springline.benchmarks.proofs.claims import DOUBLE, Claim, Reduction, UnprovedError
from springline.benchmarks.proofs.gappa import Program, Theorem, between, number, within
from springline.benchmarks.proofs.polynomials import EXP, LN2, Polynomial, distance
from springline.codegen.elementary import Op, Procedure

REDUCTION = Reduction(
    function="exp",
    period=(LN2[0] / 2, LN2[1] / 2),
    smallest=Fraction(1, 8),
    largest=Fraction(708),
    reach=Fraction("0.1733"),
    most=2043,
)
ERROR_OF_R = Fraction(1001, 1000) / 2**56
LEAST = -1074  # exponent of the least denormal number
LOW, HIGH = Fraction("0.84"), Fraction("1.1893")  # of e^R


def claims(procedure: Procedure) -> Iterator[Claim]:
    """For ordinary results, and for those next to denormal ones, where the product with s is rounded more coarsely."""
    program = Program(procedure)
    root = _scale(program)
    reduction = (*REDUCTION.theorems(program, "r", (within("r", REDUCTION.reach), within("r - R", ERROR_OF_R))),)
    # n = 2k or 2k + 1; from -706 on, k is -1019 at least.
    for case, bound, exponents in (
        (Case("exp", "-706 .. 708", uniform(-706.0, 708.0), mpmath.exp), Fraction("1.51"), (None,)),
        (Case("exp", "-708 .. -706", uniform(-708.0, -706.0), mpmath.exp), Fraction("1.64"), (-1020, -1021, -1022)),
    ):
        evaluated = (theorem for k in exponents for theorem in _evaluated(program, root, k, bound))
        yield Claim(case, bound, (*reduction, *evaluated))


def _scale(program: Program) -> float:
    """What stands for the root of 2, once s was seen to be 2^(n/2) with it for every n there is."""
    s, t, shift = program.place("s"), program.place("t"), program.real("t")
    root = program.value(s, {t: shift + 1.0})
    for n in range(-REDUCTION.most, REDUCTION.most + 1):
        if program.value(s, {t: shift + n}) != math.ldexp(root if n % 2 else 1.0, n // 2):
            raise UnprovedError(f"s is not 2^(n/2) for n = {n}")
    return float(root)


def _evaluated(program: Program, root: float, k: int | None, bound: Fraction) -> Iterator[Theorem]:
    """The result divided by 2^k, which changes no rounding but that of the product with s next to denormal numbers."""
    result = program.results[0]
    s, product = program.arguments(result, Op.ADD)
    again, q = program.arguments(product, Op.MUL)
    r = program.place("r")
    if (s, again) != (program.place("s"), s):
        raise UnprovedError("the result is not s + s q")
    approximation = distance(
        Polynomial.of(1) + program.polynomial(q, {r: Polynomial.of(0, 1)}), EXP, -REDUCTION.reach, REDUCTION.reach
    )
    q_ = program.name(q)
    # The halves of R for n even, such that the exact result is on one side of 1 and its unit known.
    zero, one = Fraction(0), Fraction(1)
    parts = [
        ("odd", number(root), "sqrt(2)", (-REDUCTION.reach, REDUCTION.reach), (LOW, HIGH), 52),
        ("above-1", "1", "1", (zero, REDUCTION.reach), (one, HIGH), 52),
        ("below-1", "1", "1", (-REDUCTION.reach, zero), (LOW, one), 53),
    ]
    for name, scale, exact, range_of_r, range_of_e, digits in parts:
        if k == -REDUCTION.most // 2 and name != "odd":
            continue  # n would be beyond the largest
        size = Fraction(1, 2 if name == "odd" else 4)
        lines = [
            DOUBLE,
            "r = rnd(any);",
            *program.lines({r: "r"}, q),
            *program.lines({r: "R"}, q, prefix="m_", rounding=""),
        ]
        known = [
            f"R in {between(*range_of_r)}",
            within("r - R", ERROR_OF_R),
            within(f"1 + m_{q_} - E", approximation),
            f"E in {between(*range_of_e)}",
        ]
        if k is None:
            lines += [f"y = rnd({scale} + p);"]
            # Half a unit of such a number; for k >= -1019 half the least denormal number is not more, divided by 2^k.
            known += [within(f"p - {scale} * {q_}", size / 2**54)]
        else:
            lines += [
                f"@shifted = float<53,{LEAST - k},ne>;",
                f"p = shifted({scale} * {q_});",
                f"y = shifted({scale} + p);",
            ]
        yield Theorem(
            f"exp-{name}{'' if k is None else k}",
            tuple(lines),
            tuple(known),
            (within(f"{scale} * {q_}", size), within(f"y - {exact} * E", bound / 2**digits)),
            (
                f"y - {exact} * E -> (y - ({scale} + p)) + (p - {scale} * {q_})"
                f" + {scale} * (({q_} - m_{q_}) + (1 + m_{q_} - E)) + ({scale} - {exact}) * E;",
                f"{q_} -> ({q_} - m_{q_}) + (1 + m_{q_} - E) + (E - 1);",
                "$ R in 4;",
            ),
        )
