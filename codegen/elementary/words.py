"""Programs of primitive operations, as a processor has them: what the elementary functions are written in.

A function is written once, on Words: symbols of a real number, of its bits, or of a truth value. `trace` runs it for
one Format of real numbers and notes its steps in order, equal ones once. Printers make scalar C, lanes and blocks of
those steps; none of them regroups anything, so they all compute the same bits.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import Enum
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Format:
    """A format of real numbers: its name in C, all bits and the significant ones."""

    name: str
    width: int
    digits: int

    def holds(self, value: float) -> bool:
        """Whether a number is one of the format's."""
        return not math.isfinite(value) or struct.unpack(self._code, struct.pack(self._code, value)) == (value,)

    @property
    def _code(self) -> str:
        return {32: "<f", 64: "<d"}[self.width]


DOUBLE = Format("double", 64, 53)
SINGLE = Format("float", 32, 24)


class Kind(Enum):
    """What a Word stands for."""

    REAL = "real"
    BITS = "bits"
    MASK = "mask"


class Op(Enum):
    """A primitive operation: what it is called, and the kind of its result."""

    INPUT = ("input", Kind.REAL)
    REAL_CONSTANT = ("real_constant", Kind.REAL)
    BITS_CONSTANT = ("bits_constant", Kind.BITS)
    ADD = ("add", Kind.REAL)
    SUB = ("sub", Kind.REAL)
    MUL = ("mul", Kind.REAL)
    DIV = ("div", Kind.REAL)
    NEG = ("neg", Kind.REAL)
    SQRT = ("sqrt", Kind.REAL)
    FMIN = ("fmin", Kind.REAL)
    FMAX = ("fmax", Kind.REAL)
    SELECT = ("select", Kind.REAL)  # mask ? a : b
    IF = ("if", Kind.REAL)  # mask ? a : 0.0
    TRUE = ("true", Kind.REAL)  # mask ? 1.0 : 0.0
    PICK = ("pick", Kind.REAL)  # b where the top bit of the first argument is set, else a
    PAIR = ("pair", Kind.REAL)  # of vectors of two: a lane of each
    PAIR_MASKS = ("pair_masks", Kind.MASK)
    REAL = ("real", Kind.REAL)
    BITS = ("bits", Kind.BITS)
    BIT_AND = ("bit_and", Kind.BITS)
    BIT_OR = ("bit_or", Kind.BITS)
    BIT_XOR = ("bit_xor", Kind.BITS)
    BIT_ADD = ("bit_add", Kind.BITS)
    BIT_SUB = ("bit_sub", Kind.BITS)
    SHIFT_LEFT = ("shift_left", Kind.BITS)  # by a number
    SHIFT_RIGHT = ("shift_right", Kind.BITS)
    LT = ("lt", Kind.MASK)
    LE = ("le", Kind.MASK)
    EQ = ("eq", Kind.MASK)
    NE = ("ne", Kind.MASK)
    BELOW = ("below", Kind.MASK)  # unsigned bits less than a number
    AND = ("and", Kind.MASK)
    OR = ("or", Kind.MASK)
    NOT = ("not", Kind.MASK)

    @property
    def kind(self) -> Kind:
        """What the result is."""
        return self.value[1]


COMMUTATIVE = frozenset({
    Op.ADD, Op.MUL, Op.BIT_AND, Op.BIT_OR, Op.BIT_XOR, Op.BIT_ADD, Op.EQ, Op.NE, Op.AND, Op.OR,
})  # fmt: skip

INFIX = {
    Op.ADD: "+",
    Op.SUB: "-",
    Op.MUL: "*",
    Op.DIV: "/",
    Op.BIT_AND: "&",
    Op.BIT_OR: "|",
    Op.BIT_XOR: "^",
    Op.BIT_ADD: "+",
    Op.BIT_SUB: "-",
    Op.LT: "<",
    Op.LE: "<=",
    Op.EQ: "==",
    Op.NE: "!=",
    Op.AND: "&",
    Op.OR: "|",
}
"""Operations that are operators between two operands in C, of scalars and of vectors."""


@dataclass(frozen=True, slots=True)
class Step:
    """An operation on earlier steps; `number` of a constant, a shift, a bound, or which input."""

    op: Op
    arguments: tuple[int, ...] = ()
    number: float | int = 0


@dataclass(frozen=True, slots=True)
class Procedure:
    """A traced function: steps in order.

    results  the steps that are its results
    fine     the step, a mask, that tells where they hold; None if everywhere
    inputs   how many
    names    what a reader calls a step
    format   of the real numbers
    """

    steps: tuple[Step, ...]
    results: tuple[int, ...]
    fine: int | None
    inputs: int
    names: Mapping[int, str] = field(default_factory=dict, compare=False)
    format: Format = DOUBLE

    @property
    def needed(self) -> tuple[int, ...]:
        """The steps that results and mask need, in order."""
        found: set[int] = set()
        stack = [*self.results, *([] if self.fine is None else [self.fine])]
        while stack:
            k = stack.pop()
            if k not in found:
                found.add(k)
                stack.extend(self.steps[k].arguments)
        return tuple(sorted(found))


class _Trace:
    def __init__(self, fmt: Format) -> None:
        self.format = fmt
        self.steps: list[Step] = []
        self.names: dict[int, str] = {}
        self._places: dict[object, int] = {}

    def word(self, op: Op, arguments: Sequence[int] = (), number: float | int = 0) -> Word:
        ordered = tuple(sorted(arguments)) if op in COMMUTATIVE else tuple(arguments)
        key = (op, ordered, number, math.copysign(1.0, number))
        if key not in self._places:
            self._places[key] = len(self.steps)
            self.steps.append(Step(op, tuple(arguments), number))
        return Word(self._places[key], op.kind)


_CURRENT: ContextVar[_Trace] = ContextVar("trace")


def traced_format() -> Format:
    """The format that the function being traced is for."""
    return _CURRENT.get().format


@dataclass(frozen=True, slots=True)
class Both(Generic[T]):
    """A constant that each format has its own of; called, the one of the format being traced."""

    double: T
    single: T

    def __call__(self) -> T:
        """The one of the format being traced."""
        return self.double if traced_format() is DOUBLE else self.single


@dataclass(frozen=True, slots=True, eq=False)
class Word:
    """A symbol in a function that is being traced. Numbers beside it become constants of its kind."""

    place: int
    kind: Kind

    def _arithmetic(self, real: Op, bits: Op | None, a: Word | float, b: Word | float) -> Word:
        op = real if self.kind is Kind.REAL else bits
        assert op is not None
        return operation(op, a, b)

    def __add__(self, other: Word | float) -> Word:
        return self._arithmetic(Op.ADD, Op.BIT_ADD, self, other)

    def __radd__(self, other: float) -> Word:
        return self._arithmetic(Op.ADD, Op.BIT_ADD, other, self)

    def __sub__(self, other: Word | float) -> Word:
        return self._arithmetic(Op.SUB, Op.BIT_SUB, self, other)

    def __rsub__(self, other: float) -> Word:
        return self._arithmetic(Op.SUB, Op.BIT_SUB, other, self)

    def __mul__(self, other: Word | float) -> Word:
        return operation(Op.MUL, self, other)

    def __rmul__(self, other: float) -> Word:
        return operation(Op.MUL, other, self)

    def __truediv__(self, other: Word | float) -> Word:
        return operation(Op.DIV, self, other)

    def __rtruediv__(self, other: float) -> Word:
        return operation(Op.DIV, other, self)

    def __neg__(self) -> Word:
        return operation(Op.NEG, self)

    def __and__(self, other: Word | int) -> Word:
        return operation(Op.AND if self.kind is Kind.MASK else Op.BIT_AND, self, other)

    def __or__(self, other: Word | int) -> Word:
        return operation(Op.OR if self.kind is Kind.MASK else Op.BIT_OR, self, other)

    def __xor__(self, other: Word | int) -> Word:
        return operation(Op.BIT_XOR, self, other)

    def __invert__(self) -> Word:
        return operation(Op.NOT, self)

    def __lshift__(self, places: int) -> Word:
        return _CURRENT.get().word(Op.SHIFT_LEFT, [self.place], places)

    def __rshift__(self, places: int) -> Word:
        return _CURRENT.get().word(Op.SHIFT_RIGHT, [self.place], places)

    def __lt__(self, other: Word | float) -> Word:
        return operation(Op.LT, self, other)

    def __le__(self, other: Word | float) -> Word:
        return operation(Op.LE, self, other)

    def __gt__(self, other: Word | float) -> Word:
        return operation(Op.LT, other, self)

    def __ge__(self, other: Word | float) -> Word:
        return operation(Op.LE, other, self)


def operation(op: Op, *operands: Word | float) -> Word:
    """The Word of an operation; a number becomes a constant of the kind that the other operands have."""
    if op is Op.MUL and 1.0 in operands:
        return next(operand for operand in operands if isinstance(operand, Word))
    kind = Kind.BITS if op.name.startswith("BIT_") else Kind.REAL
    words = [operand if isinstance(operand, Word) else constant(operand, kind) for operand in operands]
    return _CURRENT.get().word(op, [word.place for word in words])


def named(name: str, word: Word) -> Word:
    """A Word that a reader knows by a name: it is printed as a statement of its own."""
    _CURRENT.get().names.setdefault(word.place, name)
    return word


def constant(value: float, kind: Kind = Kind.REAL) -> Word:
    """The Word of a number."""
    if kind is Kind.BITS:
        assert isinstance(value, int)
        return _CURRENT.get().word(Op.BITS_CONSTANT, (), value % 2 ** traced_format().width)
    assert traced_format().holds(value), value
    return _CURRENT.get().word(Op.REAL_CONSTANT, (), float(value))


def bits(x: Word) -> Word:
    """The bits of a real number."""
    return operation(Op.BITS, x)


def real(b: Word) -> Word:
    """The real number of these bits."""
    return operation(Op.REAL, b)


def sqrt(x: Word) -> Word:
    """The correctly rounded root."""
    return operation(Op.SQRT, x)


def equal(a: Word, b: Word | float) -> Word:
    """Whether two real numbers are equal."""
    return operation(Op.EQ, a, b)


def not_equal(a: Word, b: Word | float) -> Word:
    """Whether two real numbers differ."""
    return operation(Op.NE, a, b)


def select(mask: Word, a: Word | float, b: Word | float) -> Word:
    """a where the mask holds, else b."""
    return operation(Op.SELECT, mask, a, b)


def if_(mask: Word, a: Word | float) -> Word:
    """a where the mask holds, else 0.0."""
    return operation(Op.IF, mask, a)


def true(mask: Word) -> Word:
    """1.0 where the mask holds, else 0.0."""
    return operation(Op.TRUE, mask)


def fmin(a: Word | float, b: Word | float) -> Word:
    """a < b ? a : b."""
    return operation(Op.FMIN, a, b)


def fmax(a: Word | float, b: Word | float) -> Word:
    """a > b ? a : b."""
    return operation(Op.FMAX, a, b)


def pick(at: Word, a: Word | float, b: Word | float) -> Word:
    """b where the top bit of `at` is set, else a."""
    words = [w if isinstance(w, Word) else constant(w) for w in (a, b)]
    return operation(Op.PICK, at, *words)


def below(b: Word, limit: int) -> Word:
    """Whether the bits, as an unsigned number, are less than a limit."""
    return _CURRENT.get().word(Op.BELOW, [b.place], limit)


def trace(
    function: Callable[..., tuple[tuple[Word, ...], Word | None]], inputs: int, fmt: Format = DOUBLE
) -> Procedure:
    """Run a function of so many Words, which returns its results and where they hold, and note its steps."""
    current = _Trace(fmt)
    token = _CURRENT.set(current)
    try:
        results, fine = function(*(current.word(Op.INPUT, (), k) for k in range(inputs)))
    finally:
        _CURRENT.reset(token)
    return Procedure(
        tuple(current.steps),
        tuple(r.place for r in results),
        None if fine is None else fine.place,
        inputs,
        current.names,
        fmt,
    )
