"""Programs of primitive operations as Gappa reads them, once with the roundings of IEEE 754 and once without."""

from __future__ import annotations

import math
import shutil
import struct
import subprocess
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

from springline.benchmarks.proofs.polynomials import Polynomial
from springline.codegen.elementary import INFIX, Op, Procedure

PACKAGE = "gappa"
"""Of Debian and its kin."""

DIGITS = 80  # bits of a number that is rounded outwards for Gappa
_CONSTANTS = (Op.REAL_CONSTANT, Op.BITS_CONSTANT)
_ARITHMETIC = (Op.ADD, Op.SUB, Op.MUL, Op.DIV)


def number(value: Fraction | float, up: bool | None = None) -> str:
    """A rational number as m * 2^e; rounded up or down to 80 bits, where that is not said exactly."""
    exact = Fraction(value)
    shift = DIGITS - exact.numerator.bit_length() + exact.denominator.bit_length()
    scaled = exact * Fraction(2) ** shift
    if scaled.denominator != 1 and up is None:
        raise ValueError(f"{value} has more than {DIGITS} bits")
    mantissa, exponent = math.ceil(scaled) if up else math.floor(scaled), -shift
    while mantissa and mantissa % 2 == 0:
        mantissa, exponent = mantissa // 2, exponent + 1
    return f"{mantissa}b{exponent}" if mantissa else "0"


def between(low: Fraction | float, high: Fraction | float) -> str:
    """The interval, not smaller."""
    return f"[{number(low, up=False)},{number(high, up=True)}]"


def within(text: str, bound: Fraction | float) -> str:
    """|text| <= bound."""
    return f"|{text}| <= {number(bound, up=True)}"


class Program:
    """A Procedure, its steps found by the names that they have in it."""

    def __init__(self, procedure: Procedure) -> None:
        self.steps = procedure.steps
        self.results = procedure.results
        self._names = procedure.names
        self._places = {name: place for place, name in procedure.names.items()}

    def place(self, name: str) -> int:
        """The step with a name; the argument is x."""
        return 0 if name == "x" else self._places[name]

    def name(self, place: int) -> str:
        """Of a step; those without have numbers."""
        return "x" if place == 0 else self._names.get(place, f"v{place}")

    def arguments(self, place: int, *ops: Op) -> tuple[int, ...]:
        """What a step works on, which has to be one of these operations."""
        if self.steps[place].op not in ops:
            raise ValueError(f"{self.name(place)} is {self.steps[place]}, not one of {ops}")
        return self.steps[place].arguments

    def _needed(self, given: Mapping[int, object], *places: int) -> list[int]:
        found: set[int] = set()
        waiting = [*places]
        while waiting:
            each = waiting.pop()
            if each not in found and each not in given:
                found.add(each)
                waiting += self.steps[each].arguments
        return sorted(found)

    def lines(self, given: Mapping[int, str], *places: int, prefix: str = "", rounding: str = "rnd") -> Iterator[str]:
        """Statements up to some steps, in Gappa's language, from steps whose names are given.

        prefix    before the names of steps; constants have none
        rounding  the operator of each operation; "" for the arithmetic of real numbers
        """
        names = dict(given)
        for each in self._needed(given, *places):
            step = self.steps[each]
            if step.op is Op.REAL_CONSTANT:
                names[each] = number(step.number)
                continue
            names[each] = f"{prefix}{self.name(each)}"
            a = [names[argument] for argument in step.arguments]
            if step.op is Op.NEG:
                yield f"{names[each]} = -{a[0]};"
            elif step.op in _ARITHMETIC:
                yield f"{names[each]} = {rounding}({a[0]} {INFIX[step.op]} {a[1]});"
            else:
                raise ValueError(f"{names[each]} is {step}, no arithmetic")

    def polynomial(self, place: int, given: Mapping[int, Polynomial]) -> Polynomial:
        """A step without rounding, as a polynomial, from steps that are given."""
        values = dict(given)
        for each in self._needed(given, place):
            step = self.steps[each]
            a = [values[argument] for argument in step.arguments]
            match step.op:
                case Op.REAL_CONSTANT:
                    values[each] = Polynomial.of(step.number)
                case Op.NEG:
                    values[each] = Polynomial.of(-1) * a[0]
                case Op.ADD:
                    values[each] = a[0] + a[1]
                case Op.SUB:
                    values[each] = a[0] - a[1]
                case Op.MUL:
                    values[each] = a[0] * a[1]
                case _:
                    raise ValueError(f"{self.name(each)} is {step}, no polynomial")
        return values[place]

    def real(self, name: str) -> float:
        """The constant that a step has for one of its arguments."""
        (found,) = (
            float(self.steps[each].number)
            for each in self.steps[self.place(name)].arguments
            if self.steps[each].op is Op.REAL_CONSTANT
        )
        return found

    def value(self, place: int, given: Mapping[int, float]) -> float | int:
        """What a step gives in double precision, or its bits, from steps that are given."""
        values: dict[int, float | int] = dict(given)
        for each in self._needed(given, place):
            step = self.steps[each]
            if step.op in _CONSTANTS:
                values[each] = step.number
            else:
                values[each] = _VALUES[step.op](*(values[argument] for argument in step.arguments), *_own(step.number))
        return values[place]


def _own(value: float | int) -> tuple[int, ...]:
    """A step's own number, where it has one."""
    return (int(value),) if value else ()


def as_bits(x: float) -> int:
    """The 64 bits of a double."""
    return int(struct.unpack("<Q", struct.pack("<d", x))[0])


def as_real(b: int) -> float:
    """The double with these 64 bits."""
    return float(struct.unpack("<d", struct.pack("<Q", b))[0])


_VALUES: dict[Op, Callable[..., float | int]] = {
    Op.ADD: lambda a, b: a + b,
    Op.SUB: lambda a, b: a - b,
    Op.MUL: lambda a, b: a * b,
    Op.BITS: as_bits,
    Op.REAL: as_real,
    Op.BIT_AND: lambda a, b: a & b,
    Op.BIT_OR: lambda a, b: a | b,
    Op.BIT_XOR: lambda a, b: a ^ b,
    Op.BIT_ADD: lambda a, b: (a + b) % 2**64,
    Op.BIT_SUB: lambda a, b: (a - b) % 2**64,
    Op.SHIFT_LEFT: lambda a, places: (a << places) % 2**64,
    Op.SHIFT_RIGHT: lambda a, places=0: a >> places,
    Op.PICK: lambda at, a, b: b if at >> 63 else a,
}


@dataclass(frozen=True, slots=True)
class Theorem:
    """What Gappa is asked.

    name         of the file
    lines        definitions
    known        what is assumed
    goals        what is to be proved
    hints        equalities that Gappa checks and follows, and where to split
    """

    name: str
    lines: tuple[str, ...]
    known: tuple[str, ...]
    goals: tuple[str, ...]
    hints: tuple[str, ...] = field(default=())

    @property
    def text(self) -> str:
        """The file."""
        known, goals = " /\\\n  ".join(self.known), " /\\\n  ".join(self.goals)
        return "\n".join([*self.lines, "{ " + known + "\n ->\n  " + goals + " }", *self.hints, ""])


def gappa() -> str | None:
    """The path of the program."""
    return shutil.which(PACKAGE)


def objection(theorem: Theorem, folder: Path) -> str:
    """What Gappa has to say against a theorem, whose file is left in a folder; "" if it is proved.

    A hint that Gappa cannot verify is a warning, and no proof.
    """
    path = gappa()
    assert path is not None
    file = folder / f"{theorem.name}.g"
    file.write_text(theorem.text)
    done = subprocess.run([path, "-Eno-auto-dichotomy", str(file)], capture_output=True, text=True, check=False)
    if done.returncode == 0 and not done.stderr:
        return ""
    said = "\n  ".join(dict.fromkeys(f"{done.stderr}{done.stdout}".splitlines()))  # it warns in the same words often
    return f"{file}:\n  {said}"
