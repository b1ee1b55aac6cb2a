"""An expression as a list of values, in an order in which they can be computed: to read it, and to write it anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from springline.model import lazy_casadi as ca
from springline.model.symbolic.derivation import as_written


@dataclass(frozen=True, slots=True)
class Value:
    """A constant, a symbol, or an operation on values before it.

    op         CasADi's number of the operation; OP_CONST and OP_INPUT for the other two
    arguments  places of its arguments in the list
    sx         the constant or symbol, else empty
    group      of a symbol: in which of the given groups it is
    """

    op: int
    arguments: tuple[int, ...]
    sx: ca.SX
    group: int = 0

    @property
    def constant(self) -> float | None:
        """The number that it is, None for one that is no constant."""
        return float(self.sx) if self.op == ca.OP_CONST else None


def listed(column: ca.SX, groups: Sequence[ca.SX]) -> tuple[list[Value], list[int]]:
    """The values of a dense column, equal ones once, and the places of its entries among them.

    groups  columns of symbols; what is in none of them is in a last one, behind them
    """
    flat = ca.cse(column)
    known = {symbol.element_hash() for group in groups for symbol in ca.vertsplit(group)}
    others = [symbol for symbol in ca.symvar(flat) if symbol.element_hash() not in known]
    inputs = [*groups, ca.vertcat(ca.SX(0, 1), *others)]
    function = ca.Function("values", inputs, [flat])
    values: list[Value] = []
    work: dict[int, int] = {}
    outputs: dict[int, int] = {}
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        into, source = function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            outputs[into[1]] = work[source[0]]
            continue
        if op == ca.OP_INPUT:
            value = Value(op, (), inputs[source[0]][source[1]], source[0])
        elif op == ca.OP_CONST:
            value = Value(op, (), ca.SX(function.instruction_constant(k)))
        else:
            value = Value(op, tuple(work[i] for i in source), ca.SX())
        work[into[0]] = len(values)
        values.append(value)
    zero = len(values)
    if len(outputs) < flat.numel():  # an entry that is zero has no instruction
        values.append(Value(ca.OP_CONST, (), ca.SX(0.0)))
    return values, [outputs.get(i, zero) for i in range(flat.numel())]


def stacked(results: Sequence[ca.SX]) -> ca.SX:
    """All entries of the results, the zeros among them too, as one dense column."""
    return ca.vertcat(ca.SX(0, 1), *(ca.vec(ca.densify(item)) for item in results))


def unstacked(entries: Sequence[ca.SX], shapes: Sequence[tuple[int, int]]) -> list[ca.SX]:
    """Results of these shapes from their entries: what `stacked` has put together, apart again."""
    rest = iter(entries)
    return [
        ca.reshape(ca.vertcat(ca.SX(0, 1), *(next(rest) for _ in range(rows * columns))), rows, columns)
        for rows, columns in shapes
    ]


def written(value: Value, arguments: Sequence[ca.SX]) -> ca.SX:
    """The value anew, of other arguments; to be called where CasADi leaves expressions as they are written."""
    if not value.arguments:
        return value.sx
    if len(arguments) == 1:
        return ca.SX.unary(value.op, *arguments)
    return ca.SX.binary(value.op, *arguments)


def replaced_values(results: Sequence[ca.SX], old: ca.SX, new: ca.SX) -> list[ca.SX]:
    """Results, with `new` wherever an entry of the column `old` is computed in them; what it alone needs drops out.

    Unlike a substitution it replaces values, not symbols. An entry of `old` that is a constant stays.
    """
    shapes = [item.shape for item in results]
    values, places = listed(ca.vertcat(stacked(results), ca.densify(old)), [])
    count = len(places) - old.numel()
    given = dict(zip(places[count:], ca.vertsplit(new), strict=True))
    rewritten: list[ca.SX] = []
    with as_written():
        for k, value in enumerate(values):
            stays = k not in given or value.constant is not None
            rewritten.append(written(value, [rewritten[i] for i in value.arguments]) if stays else given[k])
    return unstacked([rewritten[k] for k in places[:count]], shapes)
