"""What is proved of the elementary functions: Gappa agrees, and does not where a program is wrong."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest

from springline.benchmarks.proofs import polynomials
from springline.benchmarks.proofs.claims import UnprovedError
from springline.benchmarks.proofs.functions import FUNCTIONS
from springline.benchmarks.proofs.gappa import PACKAGE, Theorem, number, objection
from springline.benchmarks.proofs.polynomials import HALF_PI, LN2, Polynomial
from springline.codegen.elementary import Op, Procedure, procedure

Require = Callable[..., str]


def theorems(program: Procedure, function: str) -> list[Theorem]:
    """Of all claims, each once."""
    return list(
        {theorem.name: theorem for claim in FUNCTIONS[function](program) for theorem in claim.theorems}.values()
    )


@pytest.mark.parametrize("function", FUNCTIONS)
def test_gappa_proves_what_is_claimed(function: str, require_tool: Require, tmp_path: Path) -> None:
    """Of the many theorems on sine one in twelve; `make prove` proves them all."""
    require_tool(PACKAGE)
    chosen = theorems(procedure(function), function)
    for theorem in chosen if len(chosen) < 20 else [chosen[-1], *chosen[:4], *chosen[4::12]]:
        assert objection(theorem, tmp_path) == ""


def changed(function: str, old: float, new: float) -> Procedure:
    """Its program with another constant."""
    program = procedure(function)
    steps = [
        dataclasses.replace(step, number=new) if (step.op, step.number) == (Op.REAL_CONSTANT, old) else step
        for step in program.steps
    ]
    assert sum(a != b for a, b in zip(steps, program.steps, strict=True)) == 1
    return dataclasses.replace(program, steps=tuple(steps))


WRONG = {
    "low bits of a coefficient": ("exp", "exp-odd", "0x1.555555555589dp-3", "0x1.5555555555a9dp-3"),
    "last coefficient left out": ("exp", "exp-odd", "0x1.71a9f807860fep-19", "0"),
    "one part of ln 2": ("exp", "exp-reduction", "0x1.ef35793c7673p-46", "0"),
    "first part of ln 2 too long": ("exp", "exp-reduction", "0x1.62e42fefa38p-2", "0x1.62e42fefa39efp-2"),
    "third part of pi/2 too short": ("sincos", "sincos-reduction", "0x1.98a2e03707345p-77", "0x1.98a2ep-77"),
    "low bits of a sine's coefficient": ("sincos", "sincos-sine-0", "-0x1.5555555555548p-3", "-0x1.5555555555508p-3"),
    "low bits of a cosine's coefficient": ("sincos", "sincos-cosine", "0x1.555555555554bp-5", "0x1.555555555514bp-5"),
}
"""What is wrong: the function, the theorem that fails, a constant and what it is changed to."""


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_constant_is_not_proved(what: str, require_tool: Require, tmp_path: Path) -> None:
    require_tool(PACKAGE)
    function, name, old, new = WRONG[what]
    program = changed(function, float.fromhex(old), float.fromhex(new))
    (theorem,) = (each for each in theorems(program, function) if each.name == name)
    assert re.search("Error: (some properties were not satisfied|no contradiction)", objection(theorem, tmp_path))


def test_a_wrong_root_of_two_is_seen_before_gappa() -> None:
    """What is made of bits is looked at for every n there is: with another pattern s is not 2^(n/2)."""
    program = procedure("exp")
    steps = [
        dataclasses.replace(step, number=50) if step.op is Op.SHIFT_LEFT and step.number == 51 else step
        for step in program.steps
    ]
    with pytest.raises(UnprovedError, match="s is not"):
        list(FUNCTIONS["exp"](dataclasses.replace(program, steps=tuple(steps))))


def test_a_hint_that_is_no_equality_proves_nothing(require_tool: Require, tmp_path: Path) -> None:
    require_tool(PACKAGE)
    lie = Theorem("lie", (), ("a in [1,2]",), ("a * a in [0,1]",), ("a * a -> a / 2;",))
    assert "not trivially equal" in objection(lie, tmp_path)


# --- bounds of polynomials -----------------------------------------------------------------------------------


def test_a_bound_is_above_the_supremum_and_near() -> None:
    """T_7 has no value beyond 1 between -1 and 1, and takes it eight times."""
    chebyshev = Polynomial.of(0, -7, 0, 56, 0, -112, 0, 64)
    assert 1 <= chebyshev.largest(Fraction(-1), Fraction(1)) <= Fraction(101, 100)
    inner = chebyshev.largest(Fraction(1, 10), Fraction(2, 10))
    values = [
        abs(sum(c * (0.1 + k / 1e4) ** i for i, c in enumerate((0, -7, 0, 56, 0, -112, 0, 64)))) for k in range(1001)
    ]
    assert max(values) <= inner <= 1.01 * max(values)


@pytest.mark.parametrize(
    ("series", "exact", "x"),
    [
        ("EXP", math.exp(-0.3), -0.3),
        ("SIN", math.sin(0.5) / 0.5, 0.25),
        ("COS", math.cos(0.5), 0.25),
        ("ATANH", 2 * math.atanh(0.2) / 0.2, 0.04),
        ("MINUS_ONE_THIRD", 0.9 ** (-1 / 3), 0.1),
    ],
)
def test_a_series_is_its_function(series: str, exact: float, x: float) -> None:
    cut, rest = getattr(polynomials, series).cut(Fraction("0.6"))
    assert float(sum(c * Fraction(x) ** k for k, c in enumerate(cut.coefficients))) == pytest.approx(exact, rel=1e-15)
    assert 0 < rest < 2.0**-90


def test_constants_lie_within_their_bounds() -> None:
    for (low, high), nearest in ((LN2, math.log(2)), (HALF_PI, math.pi / 2)):
        assert low < high < low + Fraction(1, 2**190)
        assert float(low) == float(high) == nearest


def test_numbers_for_gappa_are_not_smaller_than_meant() -> None:
    def value(text: str) -> Fraction:
        mantissa, _, exponent = text.partition("b")
        return int(mantissa) * Fraction(2) ** int(exponent or 0)

    third = Fraction(1, 3)
    assert value(number(third, up=False)) < third < value(number(third, up=True)) < third + Fraction(1, 2**80)
    assert value(number(-third, up=False)) < -third < value(number(-third, up=True))
    assert [value(number(each)) for each in (0.0, -1.5, 2.0**-1074)] == [0, Fraction(-3, 2), Fraction(1, 2**1074)]
    with pytest.raises(ValueError, match="bits"):
        number(third)
