"""Procedures as C: one statement for each named value, in the macros of sl_math.h, so that scalar and lanes have it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from springline.codegen.elementary.primitives import (
    FIELD_BIAS,
    FRACTION,
    HIGH_26,
    LN2_HI,
    LN2_LO,
    ONE,
    ROUND,
    SIGN_BIT,
)
from springline.codegen.elementary.words import INFIX, Kind, Op, Procedure, Step

_TYPES = {Kind.REAL: "SL_F", Kind.BITS: "SL_B", Kind.MASK: "SL_M"}
_MIRRORED = {"<": ">", "<=": ">="}
_CALLS = (
    Op.SQRT,
    Op.FMIN,
    Op.FMAX,
    Op.SELECT,
    Op.IF,
    Op.TRUE,
    Op.PICK,
    Op.REAL,
    Op.BITS,
    Op.NOT,
)
_FREE = (Op.INPUT, Op.REAL_CONSTANT, Op.BITS_CONSTANT, Op.BITS, Op.REAL)

_NUMBERS = {ROUND: "SL_ROUND", LN2_HI: "SL_LN2_HI", LN2_LO: "SL_LN2_LO", FIELD_BIAS: "SL_FIELD_BIAS"}
_PATTERNS = {
    SIGN_BIT: "SL_SIGN_BIT",
    SIGN_BIT - 1: "~SL_SIGN_BIT",
    FRACTION: "SL_FRACTION",
    2**64 - 1 - FRACTION: "~SL_FRACTION",
    ONE: "SL_ONE",
    HIGH_26: "SL_HIGH_26",
}
"""Constants that sl_math.h has a name for."""

LINE = 100
_LONGER = 10  # steps; copysign itself has so many
_SHORT = 8  # characters of a decimal number that a reader prefers to its hexadecimal digits


def number(value: float) -> str:
    """C of a real constant."""
    if value < 0.0:
        return f"-{number(-value)}"
    if math.isinf(value):
        return "SL_INF"
    if value in _NUMBERS:
        return _NUMBERS[value]
    if len(repr(value)) <= _SHORT:
        return repr(value)
    digits, _, exponent = value.hex().partition("p")
    return f"{digits.rstrip('0').rstrip('.')}p{exponent}"


def pattern(value: int) -> str:
    """C of 64 bits."""
    return _PATTERNS.get(value, f"UINT64_C(0x{value:016x})")


class Statements:
    """The statements of a procedure, and the names of its values.

    inputs   C of the arguments
    results  C names of the results
    """

    def __init__(self, procedure: Procedure, inputs: Sequence[str], results: Sequence[str]) -> None:
        self._steps = procedure.steps
        self._idioms = len(procedure.steps) > _LONGER
        self._inputs = inputs
        roots = [*procedure.results, *([] if procedure.fine is None else [procedure.fine])]
        needed = self._needed(roots)
        uses = Counter(place for i in needed for place in self._steps[i].arguments)
        taken, self._names = {*inputs, *results}, dict[int, str]()
        for place, name in procedure.names.items():
            if place in needed and (uses[place] or place not in procedure.results):
                self._names[place] = _free(name, taken)
        for i in sorted(needed):
            assert uses[i] < 2 or i in self._names or self._steps[i].op in _FREE, (procedure.names, i, self._steps[i])
        self.lines = [
            f"const {_TYPES[self._steps[i].op.kind]} {self._names[i]} = {self._right(i)};"
            for i in sorted(needed)
            if i in self._names
        ]
        self.results = [self._argument(place) for place in procedure.results]
        self.fine = None if procedure.fine is None else self._right(procedure.fine)

    def _needed(self, roots: Sequence[int]) -> set[int]:
        found: set[int] = set()
        waiting = [*roots]
        while waiting:
            place = waiting.pop()
            if place not in found:
                found.add(place)
                waiting += self._steps[place].arguments
        return found

    def _right(self, place: int) -> str:
        """The right side of an assignment."""
        text = self._text(place, self._steps[place])
        return f"SL_FN(set)({text})" if self._steps[place].op is Op.REAL_CONSTANT else text

    def _idiom(self, place: int) -> str | None:
        """|x|, or |x| with the sign of another."""
        if isinstance(size := self._masked(place, SIGN_BIT - 1), int):
            return f"SL_FN(fabs)({self._argument(size)})"
        if self._steps[place].op is Op.BIT_OR:
            size, sign = (
                self._masked(each, mask)
                for each, mask in zip(self._steps[place].arguments, (SIGN_BIT - 1, SIGN_BIT), strict=True)
            )
            if size is not None and sign is not None:
                return f"SL_FN(copysign)({self._argument(size)}, {self._argument(sign)})"
        return None

    def _masked(self, place: int, mask: int) -> int | None:
        """The real number, if the step is its bits under a mask."""
        step = self._steps[place]
        if step.op is not Op.BIT_AND or place in self._names:
            return None
        bits, other = (self._steps[each] for each in step.arguments)
        return bits.arguments[0] if bits.op is Op.BITS and other == Step(Op.BITS_CONSTANT, (), mask) else None

    def _text(self, place: int, step: Step) -> str:
        arguments = step.arguments
        if self._idioms and step.op is Op.REAL and (idiom := self._idiom(arguments[0])):
            return idiom
        match step.op:
            case Op.INPUT:
                return self._inputs[int(step.number)]
            case Op.REAL_CONSTANT:
                return number(step.number)
            case Op.BITS_CONSTANT:
                return pattern(int(step.number))
            case Op.NEG:
                return f"-{self._operand(arguments[0])}"
            case Op.SHIFT_LEFT | Op.SHIFT_RIGHT:
                sign = "<<" if step.op is Op.SHIFT_LEFT else ">>"
                return f"{self._operand(arguments[0])} {sign} {step.number}"
            case Op.BELOW:
                return f"SL_FN(below)({self._argument(arguments[0])}, UINT64_C(0x{step.number:x}))"
        if step.op in _CALLS:
            return f"SL_FN({step.op.value[0]})({', '.join(self._argument(each) for each in arguments)})"
        left, right = (self._operand(each) for each in arguments)
        sign = INFIX[step.op]
        if sign in _MIRRORED and self._steps[arguments[0]].op is Op.REAL_CONSTANT:
            return f"{right} {_MIRRORED[sign]} {left}"
        return f"{left} {sign} {right}"

    def _argument(self, place: int) -> str:
        """Of a call."""
        return self._names.get(place) or self._right(place)

    def _operand(self, place: int) -> str:
        """Beside an operator."""
        step = self._steps[place]
        if place in self._names:
            return self._names[place]
        text = self._text(place, step)
        compound = step.op in INFIX or step.op in (Op.NEG, Op.SHIFT_LEFT, Op.SHIFT_RIGHT)
        return f"({text})" if compound else text


def _free(name: str, taken: set[str]) -> str:
    candidate, count = name, 1
    while candidate in taken:
        count += 1
        candidate = f"{name}{count}"
    taken.add(candidate)
    return candidate


def _define(head: str, body: Iterator[str]) -> str:
    lines = [f"{head} {{", *(f"  {line}" for line in body), "}"]
    return "".join(f"{part}\n" for line in lines for part in _broken(line))


def _broken(line: str) -> Iterator[str]:
    """A line that is too long, broken behind operators and commas that stand as far outside as can be."""
    indent = " " * (len(line) - len(line.lstrip()) + 4)
    while len(line) > LINE:
        depth, best = 0, (0, 0)
        for i, character in enumerate(line[:LINE]):
            depth += (character == "(") - (character == ")")
            if character == " " and line[i - 1] in "+-*/&|^,=<>" and i > len(indent) + LINE // 3:
                best = max(best, (-depth, i)) if best[1] else (-depth, i)
        assert best[1], line
        yield line[: best[1]]
        line = indent + line[best[1] + 1 :]
    yield line


def checked(name: str, procedure: Procedure, inputs: Sequence[str], results: Mapping[str, str]) -> str:
    """A function that holds nearly everywhere.

    results  name of a result -> the scalar function sl_<...> that has it elsewhere; several results go where
             arguments with these names point to
    """
    code = Statements(procedure, inputs, [*results])
    parameters = ", ".join(f"SL_F {each}" for each in inputs)
    patch, arguments = f"SL_PATCH{len(inputs)}", ", ".join(inputs)

    def body() -> Iterator[str]:
        yield from code.lines
        if len(results) == 1:
            ((result, rare),), (value,) = results.items(), code.results
            yield f"SL_F {result} = {value};"
            yield f"{patch}({code.fine}, {result}, {rare}, {arguments});"
            yield f"return {result};"
            return
        for result, value in zip(results, code.results, strict=True):
            yield f"*{result} = {value};"
        for result, rare in results.items():
            yield f"{patch}({code.fine}, *{result}, {rare}, {arguments});"

    if len(results) == 1:
        return _define(f"static inline SL_F SL_CHECKED({name})({parameters} SL_OK)", body())
    pointers = ", ".join(f"SL_F *{each}" for each in results)
    return _define(f"static inline void SL_CHECKED({name})({parameters}, {pointers} SL_OK)", body())


def plain(name: str, procedure: Procedure, inputs: Sequence[str], results: Sequence[str] = ("result",)) -> str:
    """A function that holds everywhere, or of which it does not matter where."""
    code = Statements(
        Procedure(procedure.steps, procedure.results, None, procedure.inputs, procedure.names), inputs, results
    )
    parameters = ", ".join(f"SL_F {each}" for each in inputs)

    def body() -> Iterator[str]:
        yield from code.lines
        if len(results) == 1:
            yield f"return {code.results[0]};"
        else:
            for result, value in zip(results, code.results, strict=True):
                yield f"*{result} = {value};"

    if len(results) == 1:
        return _define(f"static inline SL_F SL_FN({name})({parameters})", body())
    pointers = ", ".join(f"SL_F *{each}" for each in results)
    return _define(f"static inline void SL_FN({name})({parameters}, {pointers})", body())
