"""What is proved of a function, and what its parts have in common."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from springline.benchmarks.math_accuracy import Case
from springline.benchmarks.proofs.gappa import Program, Theorem, between, number, within
from springline.codegen.elementary import Op

Bounds = tuple[Fraction, Fraction]
"""The least and the largest value of a number."""

DOUBLE = "@rnd = float<ieee_64,ne>;"


class UnprovedError(Exception):
    """A program is not what a proof takes it for."""


@dataclass(frozen=True, slots=True)
class Claim:
    """The largest error of a function, in units in the last place of the exact result, and what it follows from.

    case  the function and its arguments, and how to measure it there
    """

    case: Case
    bound: Fraction
    theorems: tuple[Theorem, ...]


@dataclass(frozen=True, slots=True)
class Reduction:
    """r = a - b with a = x - n C1 and b = n C2, of x = n (C1 + C2 + beyond) + R; n = x times a number, rounded.

    function whose it is
    period   bounds of C1 + C2 + beyond
    smallest |x| below which n is 0
    largest  |x|
    reach    of r and R
    most     the largest |n|
    """

    function: str
    period: Bounds
    smallest: Fraction
    largest: Fraction
    reach: Fraction
    most: int

    def parts(self, program: Program) -> tuple[int, int, Bounds]:
        """The steps a and b, and bounds of `beyond`."""
        a, b = program.arguments(program.place("r"), Op.SUB)
        first, second = (self._constant(program, each) for each in (program.arguments(a, Op.SUB)[1], b))
        return a, b, (self.period[0] - first - second, self.period[1] - first - second)

    def _constant(self, program: Program, product: int) -> Fraction:
        n, constant = program.arguments(product, Op.MUL)
        if n != program.place("n"):
            raise UnprovedError(f"{program.name(product)} is not a multiple of n")
        return Fraction(program.steps[constant].number)

    def theorems(self, program: Program, last: str, goals: tuple[str, ...]) -> Iterator[Theorem]:
        """That n is 0 for small arguments, and else the goals: about steps up to the last, and M = R + n beyond."""
        a, b, beyond = self.parts(program)
        x, n1 = program.arguments(a, Op.SUB)
        t, shift = program.arguments(program.place("n"), Op.SUB)
        turns, again = program.arguments(t, Op.ADD)
        argument, rate = program.arguments(turns, Op.MUL)
        if (x, argument, again) != (0, 0, shift):
            raise UnprovedError("n is not what x times a number is rounded to")
        c0, c1, c2, k = (
            number(each)
            for each in (
                Fraction(program.steps[rate].number),
                self._constant(program, n1),
                self._constant(program, b),
                Fraction(program.steps[shift].number),
            )
        )
        a_, b_, n1_, turns_ = (program.name(place) for place in (a, b, n1, turns))
        start = DOUBLE, "x = rnd(any);"
        yield Theorem(
            f"{self.function}-reduction-small",
            (*start, *program.lines({0: "x"}, program.place("n"))),
            (within("x", self.smallest),),
            ("n in [0,0]",),
        )
        lines = (*start, *program.lines({0: "x"}, program.place("r"), program.place(last)))
        yield Theorem(
            f"{self.function}-reduction",
            (*lines, f"M = (x - n * {c1}) - n * {c2};", "R = M - n * beyond;"),
            (f"|x| in {between(self.smallest, self.largest)}", f"beyond in {between(*beyond)}"),
            (within("R", self.reach), within("n", self.most), *goals),
            (
                f"x - n * {c1} -> -(n - (t - {k})) / {c0} - (t - ({turns_} + {k})) / {c0}"
                f" - ({turns_} - x * {c0}) / {c0} + n * (1 / {c0} - {c1});",
                f"{a_} - {b_} - M -> ({a_} - (x - {n1_})) - ({n1_} - n * {c1}) - ({b_} - n * {c2});",
                f"r - R -> (r - ({a_} - {b_})) + ({a_} - {b_} - M) + n * beyond;",
            ),
        )
