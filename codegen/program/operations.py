"""What CasADi's operations are in C: the one table that every printer of ours reads."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca

_INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARISONS = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_LOGIC = {ca.OP_AND: "&", ca.OP_OR: "|"}
_ELEMENTARY = {
    ca.OP_SQRT: "sqrt",
    ca.OP_EXP: "exp",
    ca.OP_EXPM1: "expm1",
    ca.OP_LOG: "log",
    ca.OP_LOG1P: "log1p",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_TAN: "tan",
    ca.OP_POW: "pow",
    ca.OP_CONSTPOW: "pow",
    ca.OP_HYPOT: "hypot",
    ca.OP_FABS: "fabs",
    ca.OP_SIGN: "sign",
    ca.OP_FMIN: "fmin",
    ca.OP_FMAX: "fmax",
    ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil",
    ca.OP_COPYSIGN: "copysign",
    ca.OP_SINH: "sinh",
    ca.OP_COSH: "cosh",
    ca.OP_TANH: "tanh",
    ca.OP_ASIN: "asin",
    ca.OP_ACOS: "acos",
    ca.OP_ATAN: "atan",
    ca.OP_ATAN2: "atan2",
}

MASKS = frozenset({*_COMPARISONS, *_LOGIC, ca.OP_NOT})
"""Operations whose result is a truth value; used as a number it is 1 or 0."""

POWERS = (ca.OP_POW, ca.OP_CONSTPOW)

SPECIAL_POWERS = {
    1 / 3: "p1_3",
    -1 / 3: "m1_3",
    2 / 3: "p2_3",
    -2 / 3: "m2_3",
    0.5: "p1_2",
    -0.5: "m1_2",
    1.5: "p3_2",
    1.0: "p1",
    -1.0: "m1",
    2.0: "p2",
    3.0: "p3",
}
"""Exponents for which pow is defined as a kernel of its own; the nearest double where it is a third."""

_NAMES = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}


class UnprintableOperation(ValueError):
    """A Function holds an operation that the elementary functions do not have."""


def operation_name(op: int) -> str:
    """CasADi's name of an operation."""
    return _NAMES.get(op, str(op))


def formula(op: int, arguments: Sequence[str]) -> str:
    """An operation for a reader, not for a compiler."""
    if op in _INFIX:
        return f"({arguments[0]} {_INFIX[op]} {arguments[1]})"
    return f"{operation_name(op).removeprefix('OP_').lower()}({', '.join(arguments)})"


def print_operation(
    op: int,
    arguments: Sequence[int],
    *,
    library: str,
    value: Callable[[int], str],
    truth: Callable[[int], str],
    constant: Callable[[float], str],
    exponent: float | None,
    call: Callable[[str, Sequence[str]], str],
    origin: str,
) -> str:
    """C of one operation on the given nodes.

    library   prefix of the elementary functions
    value     C of a node as a number;  truth  as a truth value;  constant  of a number
    exponent  the exponent of a power where it is known, else None
    call      C of a call of a library function by its name without prefix
    origin    the Function the operation stands in, for the message
    Raises UnprintableOperation.
    """
    if op in _LOGIC:
        return f"{truth(arguments[0])} {_LOGIC[op]} {truth(arguments[1])}"
    if op == ca.OP_NOT:
        return f"{library}_not({truth(arguments[0])})"
    if op == ca.OP_IF_ELSE_ZERO:
        return f"{library}_if({truth(arguments[0])}, {value(arguments[1])})"
    operands = [value(a) for a in arguments]
    if op in _INFIX or op in _COMPARISONS:
        return f"{operands[0]} {(_INFIX | _COMPARISONS)[op]} {operands[1]}"
    if op == ca.OP_NEG:
        return f"-{operands[0]}"
    if op == ca.OP_SQ:
        return f"{operands[0]} * {operands[0]}"
    if op == ca.OP_TWICE:
        return f"{constant(2.0)} * {operands[0]}"
    if op == ca.OP_INV:
        return f"{constant(1.0)} / {operands[0]}"
    if op in POWERS and exponent in SPECIAL_POWERS:
        return call(f"pow_{SPECIAL_POWERS[exponent]}", operands[:1])
    return call(function_name(op, library, origin), operands)


def function_name(op: int, library: str, origin: str) -> str:
    """The elementary function that an operation is, without the prefix of its library.

    origin  the Function the operation stands in, for the message
    Raises UnprintableOperation.
    """
    if op in _ELEMENTARY:
        return _ELEMENTARY[op]
    raise UnprintableOperation(
        f"the operation {operation_name(op)} of the Function {origin!r} cannot be printed: "
        f"there is no {library}_ function for it"
    )
