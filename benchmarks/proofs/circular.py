"""sin and cos: x = n pi/2 + R, r = R + d rounded, where n times the third piece of pi/2 is d, and taken off last."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from functools import cache

import mpmath

from springline.benchmarks.math_accuracy import Case, uniform
from springline.benchmarks.proofs.claims import DOUBLE, Claim, Reduction, UnprovedError
from springline.benchmarks.proofs.gappa import Program, Theorem, between, within
from springline.benchmarks.proofs.polynomials import BITS, COS, HALF_PI, SIN, Polynomial, distance
from springline.codegen.elementary import Op, Procedure

REDUCTION = Reduction(
    function="sincos",
    period=HALF_PI,
    smallest=Fraction(1, 2),
    largest=Fraction(2**17),
    reach=Fraction("0.78541"),
    most=83444,
)
BOUND = Fraction("1.65")
SPLIT = 2  # so many theorems need their interval in parts
EXACT = 22  # from there on r is M: a multiple of 2^-74 if n is not 0, and else x
NEAR = Fraction(1, 2**40)


def claims(procedure: Procedure) -> Iterator[Claim]:
    """Of sincos, whose parts sin and cos are."""
    program = Program(procedure)
    _quarters(program)
    a, b, beyond = REDUCTION.parts(program)
    goals = f"{program.name(a)} - {program.name(b)} - M in [0,0]", "@FIX(M,-74)", "|rest -/ (n * beyond)| <= 1b-52"
    theorems = (
        *REDUCTION.theorems(program, "rest", goals),
        *_sines(program, max(map(abs, beyond))),
        *_cosine(program, REDUCTION.most * max(map(abs, beyond))),
    )
    for name, exact in (("sin", mpmath.sin), ("cos", mpmath.cos)):
        yield Claim(Case(name, "-2^17 .. 2^17", uniform(-(2.0**17), 2.0**17), exact), BOUND, theorems)


def _quarters(program: Program) -> None:
    """See that the results are the polynomials' that belong to n modulo 4, the last two bits of t."""
    t, s, c = (program.place(name) for name in ("t", "s", "c"))
    shift = program.real("t")
    for n in range(-4, 5):
        given = {t: shift + n, s: 0.25, c: 0.75}
        found = [program.value(result, given) for result in program.results]
        if found != [(0.25, 0.75, -0.25, -0.75)[n % 4], (0.75, -0.25, -0.75, 0.25)[n % 4]]:
            raise UnprovedError(f"sine and cosine are mistaken for one another where n is {n}")


@cache
def _distances() -> tuple[int, ...]:
    """What every double is at least away from n pi/2, times 2^BITS, for each n from 1 to the largest."""
    low, found = int(HALF_PI[0] * 2**BITS), []
    for n in range(1, REDUCTION.most + 1):
        turns = n * low
        unit = 1 << (turns.bit_length() - 53)
        off = turns % unit
        found.append(min(off, unit - off) - 8 * n)
    return tuple(found)


def _most(below: Fraction) -> int:
    """The largest n with R below a number."""
    reach = int(below * 2**BITS)
    return max((n for n, distance in enumerate(_distances(), 1) if distance <= reach), default=0)


def _lines(program: Program, result: str) -> list[str]:
    place, r, rest = (program.place(name) for name in (result, "r", "rest"))
    middle = ("rest = rnd(any);",) if result == "s" else ()
    return [
        DOUBLE,
        "M = R + d;",
        "r = rnd(M);",
        *middle,
        *program.lines({r: "r", rest: "rest"}, place),
        *program.lines({r: "r" if result == "s" else "R", rest: "0"}, place, prefix="m_", rounding=""),
    ]


def _sines(program: Program, d: Fraction) -> Iterator[Theorem]:
    """Two theorems for each power of two: that r - u is where sin R is, and where it lies there, the error.

    x is positive, for all is odd. sin R = sin r - (r - R) cos(between them), d is that of n = 1. n = 0 is a case of
    it, with no d; where x is less than the least R that other n have, its cube is too small to change it.
    """
    s, r, rest = (program.place(name) for name in ("s", "r", "rest"))
    minuend, u = program.arguments(s, Op.SUB)
    again, w = program.arguments(u, Op.SUB)
    if (minuend, again) != (r, rest):
        raise UnprovedError("the sine is not r - (rest - w)")
    least = Fraction(min(_distances()), 2**BITS)
    u_, w_ = program.name(u), program.name(w)
    polynomial = program.polynomial(s, {r: Polynomial.of(0, 1), rest: Polynomial.of(0)}).less_powers(1)
    even = Polynomial(polynomial.coefficients[::2])
    if any(polynomial.coefficients[1::2]):
        raise UnprovedError("the sine's polynomial is not odd")
    high, place = Fraction(1), 0
    while high > least:
        low = high / 2
        # Where the sine is: y + y^3 / 6 < asin y < y + 0.19 y^3, the latter up to y = 1/2.
        first = (low + low**3 / 6) * (1 - NEAR)
        last = REDUCTION.reach if high == 1 else (high + Fraction("0.19") * high**3) * (1 + NEAR)
        rest_below = d * _most(last)
        apart = rest_below + high / 2**50
        farthest = last + apart
        error = distance(even, SIN, Fraction(0), farthest**2) * farthest
        lines = (*_lines(program, "s"), "cosine = 1 - R * R / 2 + k;", "S = sin_r - (r - R) * cosine;")
        known = (
            f"R in {between(first, last)}",
            *(("r - M in [0,0]",) if place >= EXACT else ()),
            within("d", rest_below),
            within("rest - d", rest_below / 2**52),
            within("m_s - sin_r", error),
            within("k", apart * farthest + farthest**4 / 24),
        )
        errors = (
            f"- ({u_} - (rest - {w_})) + ({w_} - m_{w_}) + (m_s - sin_r)"
            " + (r - M) * cosine - (rest - d) + d * (cosine - 1);"
        )
        hints = (
            "r - R -> (r - M) + d;",
            f"r - {u_} - S -> {errors}",
            f"s - S -> (s - (r - {u_})) {errors}",
            *(("$ R in 8;",) if place < SPLIT else ()),
        )
        yield Theorem(f"sincos-sine-{place}-place", lines, known, (within(f"r - {u_} - S", low / 2**48),), hints)
        yield Theorem(
            f"sincos-sine-{place}",
            lines,
            (*known, f"r - {u_} in {between(low, high)}"),
            (within("s - S", BOUND * low / 2**52),),
            hints,
        )
        high, place = low, place + 1


def _cosine(program: Program, d: Fraction) -> Iterator[Theorem]:
    c, r = program.place("c"), program.place("r")
    polynomial = program.polynomial(c, {r: Polynomial.of(0, 1)})
    if any(polynomial.coefficients[1::2]):
        raise UnprovedError("the cosine's polynomial is not even")
    even = Polynomial(polynomial.coefficients[::2])
    error = distance(even, COS, Fraction(0), REDUCTION.reach**2)
    yield Theorem(
        "sincos-cosine",
        tuple(_lines(program, "c")),
        (
            f"R in {between(Fraction(0), REDUCTION.reach)}",
            within("d", d),
            within("m_c - C", error),
        ),
        (within("c - C", BOUND / 2**53),),
        ("r - R -> (r - M) + d;", "$ R in 8;"),
    )
