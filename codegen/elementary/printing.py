"""Procedures as C: one statement for each named value, in the macros of sl_math.h, so that scalar and lanes have it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from springline.codegen.elementary.primitives import (
    FIELD_BIAS,
    FRACTION,
    HIGH_HALF,
    LN2_HI,
    LN2_LO,
    ONE,
    ROUND,
    SIGN_BIT,
)
from springline.codegen.elementary.words import DOUBLE, INFIX, SINGLE, Both, Format, Kind, Op, Procedure, Step

T = TypeVar("T")

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

_NUMBERS = {"ROUND": ROUND, "LN2_HI": LN2_HI, "LN2_LO": LN2_LO, "FIELD_BIAS": FIELD_BIAS}
_PATTERNS = {"SIGN_BIT": SIGN_BIT, "FRACTION": FRACTION, "ONE": ONE}
"""Constants that the headers have a name for."""


class _Dialect:
    """How a format's C looks: doubles in the macros that make scalar and lanes of it, floats as they are."""

    def __init__(self, fmt: Format) -> None:
        def of(both: Both[T]) -> T:
            return both.double if fmt is DOUBLE else both.single

        prefix, high = ("SL", "HIGH_26") if fmt is DOUBLE else ("SLF", "HIGH_12")
        self.format, self.prefix = fmt, prefix
        self.types = {Kind.REAL: "SL_F", Kind.BITS: "SL_B", Kind.MASK: "SL_M"}
        if fmt is SINGLE:
            self.types = {Kind.REAL: "float", Kind.BITS: "uint32_t", Kind.MASK: "int"}
        self.suffix = "f" if fmt is SINGLE else ""
        self._numbers = {of(value): f"{prefix}_{name}" for name, value in _NUMBERS.items()}
        self._patterns = {of(value): f"{prefix}_{name}" for name, value in _PATTERNS.items()}
        for name in ("SIGN_BIT", "FRACTION"):
            self._patterns[2**fmt.width - 1 - of(_PATTERNS[name])] = f"~{prefix}_{name}"
        self._patterns[of(HIGH_HALF)] = f"{prefix}_{high}"
        self.sign_bit = of(SIGN_BIT)

    def function(self, name: str) -> str:
        """C of what a function is called."""
        return f"SL_FN({name})" if self.format is DOUBLE else f"slf_{name}"

    def number(self, value: float) -> str:
        """C of a real constant."""
        if value < 0.0:
            return f"-{self.number(-value)}"
        if math.isinf(value):
            return f"{self.prefix}_INF"
        if value in self._numbers:
            return self._numbers[value]
        if len(repr(value)) <= _SHORT:
            return f"{value!r}{self.suffix}"
        digits, _, exponent = value.hex().partition("p")
        return f"{digits.rstrip('0').rstrip('.')}p{exponent}{self.suffix}"

    def pattern(self, value: int) -> str:
        """C of the bits of a number."""
        digits = self.format.width // 4
        return self._patterns.get(value, f"UINT{self.format.width}_C(0x{value:0{digits}x})")


_DIALECTS = {each: _Dialect(each) for each in (DOUBLE, SINGLE)}

LINE = 100
_LONGER = 10  # steps; copysign itself has so many
_SHORT = 8  # characters of a decimal number that a reader prefers to its hexadecimal digits


class Statements:
    """The statements of a procedure, and the names of its values.

    inputs   C of the arguments
    results  C names of the results
    """

    def __init__(self, procedure: Procedure, inputs: Sequence[str], results: Sequence[str]) -> None:
        self._dialect = _DIALECTS[procedure.format]
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
            f"const {self._dialect.types[self._steps[i].op.kind]} {self._names[i]} = {self._right(i)};"
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
        constant = self._steps[place].op is Op.REAL_CONSTANT and self._dialect.format is DOUBLE
        return f"{self._dialect.function('set')}({text})" if constant else text

    def _idiom(self, place: int) -> str | None:
        """|x|, or |x| with the sign of another."""
        if isinstance(size := self._masked(place, self._dialect.sign_bit - 1), int):
            return f"{self._dialect.function('fabs')}({self._argument(size)})"
        if self._steps[place].op is Op.BIT_OR:
            size, sign = (
                self._masked(each, mask)
                for each, mask in zip(
                    self._steps[place].arguments, (self._dialect.sign_bit - 1, self._dialect.sign_bit), strict=True
                )
            )
            if size is not None and sign is not None:
                return f"{self._dialect.function('copysign')}({self._argument(size)}, {self._argument(sign)})"
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
                return self._dialect.number(step.number)
            case Op.BITS_CONSTANT:
                return self._dialect.pattern(int(step.number))
            case Op.NEG:
                return f"-{self._operand(arguments[0])}"
            case Op.SHIFT_LEFT | Op.SHIFT_RIGHT:
                sign = "<<" if step.op is Op.SHIFT_LEFT else ">>"
                return f"{self._operand(arguments[0])} {sign} {step.number}"
            case Op.BELOW:
                limit = f"UINT{self._dialect.format.width}_C(0x{step.number:x})"
                return f"{self._dialect.function('below')}({self._argument(arguments[0])}, {limit})"
        if step.op in _CALLS:
            called = ", ".join(self._argument(each) for each in arguments)
            return f"{self._dialect.function(step.op.value[0])}({called})"
        left, right = (self._operand(each) for each in arguments)
        sign = INFIX[step.op]
        if sign in _MIRRORED and self._steps[arguments[0]].op is Op.REAL_CONSTANT:
            return f"{right} {_MIRRORED[sign]} {left}"
        if sign == "-" and right.startswith("-"):
            right = f"({right})"
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

    results  name of a result -> the scalar function sl_<...> or slf_<...> that has it elsewhere; several results go
             where arguments with these names point to
    """
    code, single = Statements(procedure, inputs, [*results]), procedure.format is SINGLE
    real = _DIALECTS[procedure.format].types[Kind.REAL]
    head, end = (f"slf_{name}", "") if single else (f"SL_CHECKED({name})", " SL_OK")
    patch, arguments = f"SL_PATCH{len(inputs)}", ", ".join(inputs)

    def patched(result: str, rare: str) -> str:
        if single:
            return f"if (!SLF_LIKELY(usual)) {result} = slf_{rare}({arguments});"
        return f"{patch}({code.fine}, {result}, {rare}, {arguments});"

    def body() -> Iterator[str]:
        yield from code.lines
        if single:
            yield f"const int usual = {code.fine};"
        if len(results) == 1:
            ((result, rare),), (value,) = results.items(), code.results
            yield f"{real} {result} = {value};"
            yield patched(result, rare)
            yield f"return {result};"
            return
        for result, value in zip(results, code.results, strict=True):
            yield f"*{result} = {value};"
        for result, rare in results.items():
            yield patched(f"*{result}", rare)

    return _function(head, real, inputs, [*results], body(), end)


def plain(name: str, procedure: Procedure, inputs: Sequence[str], results: Sequence[str] = ("result",)) -> str:
    """A function that holds everywhere, or of which it does not matter where."""
    code = Statements(replace(procedure, fine=None), inputs, results)
    dialect = _DIALECTS[procedure.format]

    def body() -> Iterator[str]:
        yield from code.lines
        if len(results) == 1:
            yield f"return {code.results[0]};"
        else:
            for result, value in zip(results, code.results, strict=True):
                yield f"*{result} = {value};"

    return _function(dialect.function(name), dialect.types[Kind.REAL], inputs, results, body())


def _function(
    head: str, real: str, inputs: Sequence[str], results: Sequence[str], body: Iterator[str], end: str = ""
) -> str:
    """One result is returned; several go where arguments point to."""
    pointers = [f"{real} *{each}" for each in results] if len(results) > 1 else []
    parameters = ", ".join([*(f"{real} {each}" for each in inputs), *pointers])
    return _define(f"static inline {'void' if pointers else real} {head}({parameters}{end})", body)
