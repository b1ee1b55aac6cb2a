"""What is left of an expression where some of its symbols are zero.

Nothing is put together anew: x + 0 is x, 1 x is x and 0 x is 0, sin 0 is 0 and cos 0 is 1, to the last bit. So the
result is what the whole expression gives at zero, but for the sign of a zero, and but for infinity times zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from springline.model import lazy_casadi as ca
from springline.model.symbolic.derivation import as_written
from springline.model.symbolic.values import listed, stacked, unstacked, written


def _is(x: ca.SX, number: float) -> bool:
    return bool(x.is_constant()) and float(x) == number


def _sum(a: ca.SX, b: ca.SX) -> ca.SX | None:
    return b if _is(a, 0.0) else a if _is(b, 0.0) else None


def _difference(a: ca.SX, b: ca.SX) -> ca.SX | None:
    return a if _is(b, 0.0) else -b if _is(a, 0.0) else None


def _product(a: ca.SX, b: ca.SX) -> ca.SX | None:
    if _is(a, 0.0) or _is(b, 0.0):
        return ca.SX(0.0)
    return b if _is(a, 1.0) else a if _is(b, 1.0) else None


def _quotient(a: ca.SX, b: ca.SX) -> ca.SX | None:
    return ca.SX(0.0) if _is(a, 0.0) else a if _is(b, 1.0) else None


def _zero(a: ca.SX) -> ca.SX | None:
    return ca.SX(0.0) if _is(a, 0.0) else None


_RULES: dict[int, Callable[..., ca.SX | None]] = {
    ca.OP_ADD: _sum,
    ca.OP_SUB: _difference,
    ca.OP_MUL: _product,
    ca.OP_DIV: _quotient,
    **dict.fromkeys((ca.OP_NEG, ca.OP_TWICE, ca.OP_SIN, ca.OP_TAN, ca.OP_FABS, ca.OP_SIGN, ca.OP_SQRT), _zero),
    ca.OP_SQ: lambda a: a if _is(a, 0.0) or _is(a, 1.0) else None,
    ca.OP_COS: lambda a: ca.SX(1.0) if _is(a, 0.0) else None,
}
"""By operation: what is left of it, None for all of it."""


def without(results: Sequence[ca.SX], zeros: ca.SX) -> list[ca.SX]:
    """The results, dense, where the symbols of a column are zero."""
    made: list[ca.SX] = []
    with as_written():
        values, places = listed(stacked(results), [zeros])
        for value in values:
            arguments = [made[a] for a in value.arguments]
            rule = _RULES.get(value.op)
            left = rule(*arguments) if rule else None
            is_zero = value.op == ca.OP_INPUT and value.group == 0
            made.append(ca.SX(0.0) if is_zero else written(value, arguments) if left is None else left)
        return unstacked([made[i] for i in places], [item.shape for item in results])
