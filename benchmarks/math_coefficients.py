"""The polynomials of the elementary functions, computed anew: `python -m benchmarks.math_coefficients [--write]`.

Prints codegen/elementary/coefficients.py. Each polynomial is the best one of its degree: the largest weighted error is
as small as it can be (Remez' exchange on a fine grid, 160 bits), then every coefficient is rounded to a double. Where
the argument starts at 0, the leading two are rounded first, and the others found once more beside them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np

Real = Any
"""An mpmath number."""

FILE = Path(__file__).parent.parent / "codegen" / "elementary" / "coefficients.py"
PRECISION = 160
GRID = 20  # points per coefficient
MARGIN = mp.mpf("1e-5")  # of the interval: arguments are reduced by rounded numbers


@dataclass(frozen=True, slots=True)
class Polynomial:
    """sum c_i x^i ~ exact(x) between low and high; weight times the difference is the error of the function.

    terms    coefficients among doubles
    singles  coefficients among floats; of either 0, where the format does without
    """

    name: str
    meaning: str
    exact: Callable[[Real], Real]
    weight: Callable[[Real], Real]
    low: Real
    high: Real
    terms: int
    singles: int


def of_square(function: Callable[[Real], Real]) -> Callable[[Real], Real]:
    """A function of r as one of z = r^2."""
    return lambda z: function(mp.sqrt(z))


def fraction(thirds: int) -> Callable[[Real], Real]:
    """((1 - h)^(-thirds/3) - 1) / h."""
    return lambda h: ((1 - h) ** (-mp.mpf(thirds) / 3) - 1) / h


def _exponential(name: str, meaning: str, largest: Real, terms: int, singles: int) -> Polynomial:
    return Polynomial(
        name,
        meaning,
        lambda r: (mp.expm1(r) - r) / r**2,
        lambda r: r**2 / mp.exp(r),
        -largest * (1 + MARGIN),
        largest * (1 + MARGIN),
        terms,
        singles,
    )


def _logarithm(name: str, meaning: str, largest: Real, terms: int, singles: int) -> Polynomial:
    return Polynomial(
        name,
        meaning,
        of_square(lambda s: (2 * mp.atanh(s) / s - 2) / s**2),
        of_square(lambda s: s**3 / (2 * mp.atanh(s))),
        0,
        (largest * (1 + MARGIN)) ** 2,
        terms,
        singles,
    )


def _odd(
    name: str, meaning: str, function: Callable[[Real], Real], largest: Real, terms: int, singles: int
) -> Polynomial:
    """P of a function r + r^3 P(r^2)."""
    return Polynomial(
        name,
        meaning,
        of_square(lambda r: (function(r) - r) / r**3),
        of_square(lambda r: r**3 / function(r)),
        0,
        largest**2 * (1 + MARGIN) ** 2,
        terms,
        singles,
    )


def _thirds(name: str, thirds: int, largest: str, terms: int, singles: int) -> Polynomial:
    return Polynomial(
        name,
        f"((1 - h)^(-{thirds}/3) - 1) / h, |h| <= {largest}",
        fraction(thirds),
        lambda h: h,
        -mp.mpf(largest),
        mp.mpf(largest),
        terms,
        singles,
    )


def polynomials() -> tuple[Polynomial, ...]:
    """All but the start of the cube roots."""
    ln2, quarter_pi = mp.log(2), mp.pi / 4
    root = (mp.sqrt(2) - 1) ** 2  # (m - 1) / (m + 1) at m = sqrt(2)
    return (
        _exponential("EXPM1", "(e^r - 1 - r) / r^2, |r| <= ln 2 / 2", ln2 / 2, 10, 6),
        _exponential("EXP", "the same, |r| <= ln 2 / 4", ln2 / 4, 8, 0),
        _logarithm("LOG", "(2 atanh(s) / s - 2) / z of z = s^2, s <= (sqrt 2 - 1)^2", root, 7, 4),
        _logarithm("LOG1P", "the same, s <= 1 / 5", mp.mpf(1) / 5, 7, 4),
        _odd("SIN", "(sin r - r) / r^3 of z = r^2, r <= pi / 4", mp.sin, quarter_pi, 6, 4),
        Polynomial(
            "COS",
            "(cos r - 1 + z / 2) / z^2 of z = r^2, r <= pi / 4",
            of_square(lambda r: (mp.cos(r) - 1 + r**2 / 2) / r**4),
            of_square(lambda r: r**4 / mp.cos(r)),
            0,
            quarter_pi**2 * (1 + MARGIN) ** 2,
            6,
            3,
        ),
        _odd("TAN", "(tan r - r) / r^3 of z = r^2, r <= pi / 4", mp.tan, quarter_pi, 14, 7),
        _odd("ATAN", "(atan t - t) / t^3 of z = t^2, t <= 7 / 16", mp.atan, mp.mpf(7) / 16, 11, 5),
        _odd("ASIN", "(asin s - s) / s^3 of z = s^2, s <= 1 / 2", mp.asin, mp.mpf(1) / 2, 12, 6),
        _logarithm("POW", "(2 atanh(s) / s - 2) / z of z = s^2, s <= 1 / 16", mp.mpf(1) / 16, 6, 3),
        _thirds("MINUS_ONE_THIRD", 1, "5.64e-6", 2, 0),
        _thirds("MINUS_TWO_THIRDS", 2, "2.82e-6", 2, 0),
        _thirds("MINUS_ONE_THIRD_LONG", 1, "1.18e-2", 0, 3),
    )


START = Polynomial(
    "CUBE_ROOT_START",
    "a, b, c, k: k (u - a) (u (u - b) + c) ~ u^(-1/3), 2.6653 <= u <= 3.1590",
    lambda u: u ** (-mp.mpf(1) / 3),
    lambda u: u ** (mp.mpf(1) / 3),
    mp.mpf("2.6653"),
    mp.mpf("3.1590"),
    4,
    4,
)


def best(polynomial: Polynomial, known: list[Real]) -> list[Real]:
    """The coefficients behind those that are known, in 160 bits."""
    n = polynomial.terms - len(known)
    count, low, high = GRID * (n + 1), mp.mpf(polynomial.low), mp.mpf(polynomial.high)
    x = [(low + high) / 2 - (high - low) / 2 * mp.cos(mp.pi * (2 * i + 1) / (2 * count)) for i in range(count)]
    shift = [each ** len(known) for each in x]
    weight = [abs(polynomial.weight(each) * power) for each, power in zip(x, shift, strict=True)]
    wanted = [
        (polynomial.exact(each) - mp.polyval(known[::-1], each)) / power for each, power in zip(x, shift, strict=True)
    ]
    chosen = [(count - 1) * i // n for i in range(n + 1)]
    while True:
        matrix, right = mp.matrix(n + 1, n + 1), mp.matrix(n + 1, 1)
        for row, i in enumerate(chosen):
            for k in range(n):
                matrix[row, k] = x[i] ** k
            matrix[row, n], right[row] = (-1) ** row / weight[i], wanted[i]
        solution = mp.lu_solve(matrix, right)
        coefficients = [solution[k] for k in range(n)]
        error = [w * (f - mp.polyval(coefficients[::-1], each)) for w, f, each in zip(weight, wanted, x, strict=True)]
        # One exchange after the other makes the error at the chosen points grow, so that they end.
        if max(map(abs, error)) <= abs(solution[n]) * (1 + mp.mpf(2) ** -40):
            return coefficients
        chosen = _exchanged(chosen, error)


def _exchanged(chosen: list[int], error: list[Real]) -> list[int]:
    """With the worst point in the place of a neighbour, such that the errors go on alternating."""
    worst = max(range(len(error)), key=lambda i: abs(error[i]))
    same = [i for i in chosen if (error[i] > 0) == (error[worst] > 0)]
    below = [i for i in chosen if i < worst]
    if below and below[-1] in same:
        return [worst if i == below[-1] else i for i in chosen]
    above = [i for i in chosen if i > worst]
    if above and above[0] in same:
        return [worst if i == above[0] else i for i in chosen]
    return [worst, *chosen[:-1]] if not below else [*chosen[1:], worst]


def coefficients(polynomial: Polynomial, single: bool = False) -> tuple[float, ...]:
    """The doubles that stand in the functions, or the floats."""
    if single:
        polynomial = replace(polynomial, terms=polynomial.singles)

    def rounded(x: Real) -> float:
        return float(np.float32(float(x))) if single else float(x)

    with mp.workprec(PRECISION):
        known: list[Real] = []
        if polynomial.low == 0 or (single and polynomial.name != START.name):
            for _ in range(min(2, polynomial.terms)):
                known.append(mp.mpf(rounded(best(polynomial, known)[0])))
        if polynomial.terms == len(known):
            return tuple(map(float, known))
        found = [rounded(each) for each in [*known, *best(polynomial, known)]]
        if polynomial.name != START.name:
            return tuple(found)
        roots = mp.polyroots(best(polynomial, [])[::-1], maxsteps=200, extraprec=PRECISION)
        (real,) = (root for root in roots if mp.im(root) == 0)
        pair = next(root for root in roots if mp.im(root) > 0)
        return rounded(real), rounded(2 * mp.re(pair)), rounded(abs(pair) ** 2), found[-1]


def _tuple(values: tuple[float, ...], indent: str, end: str) -> list[str]:
    return [*(f'{indent}float.fromhex("{value.hex()}"),' for value in values), end]


def module() -> str:
    """The text of coefficients.py."""
    with mp.workprec(PRECISION):
        every = (*polynomials(), START)
    lines = ['"""Polynomials of the elementary functions, as benchmarks/math_coefficients.py computes them."""', ""]
    lines += ["from springline.codegen.elementary.words import Both", ""]
    for polynomial in every:
        double, single = coefficients(polynomial), coefficients(polynomial, single=True)
        lines += [f"# {polynomial.meaning}"]
        if double and single:
            lines += [f"{polynomial.name} = Both(", "    (", *_tuple(double, "        ", "    ),"), "    ("]
            lines += [*_tuple(single, "        ", "    ),"), ")"]
        else:
            lines += [f"{polynomial.name} = (", *_tuple(double or single, "    ", ")")]
    return "\n".join([*lines, ""])


def main() -> None:
    """Print the module, or write it."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.math_coefficients", description=__doc__)
    parser.add_argument("--write", action="store_true", help="write codegen/elementary/coefficients.py")
    text = module()
    if parser.parse_args().write:
        FILE.write_text(text)
    else:
        sys.stdout.write(text)


if __name__ == "__main__":
    main()
