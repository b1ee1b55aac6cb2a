"""A block: operations as a processor has them, in single assignment, without branches.

Values of the loop's graph are expanded to primitives, the elementary functions included; equal ones become one. A block
knows the common case alone, and the masks that say where that holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from springline.codegen.elementary import COMMUTATIVE, Kind, Op, Procedure, procedure
from springline.codegen.kernel.loop_values import LoopValues
from springline.codegen.program import POWERS, SPECIAL_POWERS, Binding, function_name

_ARITHMETIC = {
    ca.OP_ADD: Op.ADD,
    ca.OP_SUB: Op.SUB,
    ca.OP_MUL: Op.MUL,
    ca.OP_DIV: Op.DIV,
    ca.OP_NEG: Op.NEG,
    ca.OP_SQRT: Op.SQRT,
    ca.OP_FMIN: Op.FMIN,
    ca.OP_FMAX: Op.FMAX,
    ca.OP_LT: Op.LT,
    ca.OP_LE: Op.LE,
    ca.OP_EQ: Op.EQ,
    ca.OP_NE: Op.NE,
}
_LOGIC = {ca.OP_AND: Op.AND, ca.OP_OR: Op.OR, ca.OP_NOT: Op.NOT}


@dataclass(frozen=True, slots=True)
class Primitive:
    """An operation of a block on earlier ones.

    number  of a constant, a shift, a bound
    text    of what is loaded, its C expression
    second  of a constant, the number in the other lane, if it is another
    """

    op: Op
    arguments: tuple[int, ...] = ()
    number: float | int = 0
    text: str = ""
    second: float | int | None = None


class Block:
    """Primitives on one vector of runs, known by their places.

    stores  (C expression of where, place) of the results; @ stands for the group in these, and in what is loaded
    fine    places of the masks that tell where the block holds
    labels  what the model calls a value
    """

    def __init__(self) -> None:
        self.nodes: list[Primitive] = []
        self.stores: list[tuple[str, int]] = []
        self.fine: list[int] = []
        self.labels: dict[int, str] = {}
        self._places: dict[object, int] = {}
        self._named: set[str] = set()

    def add(
        self,
        op: Op,
        *arguments: int,
        number: float | int = 0,
        text: str = "",
        second: float | int | None = None,
    ) -> int:
        """The place of an operation, which may be there already."""
        ordered = tuple(sorted(arguments)) if op in COMMUTATIVE else arguments
        other = number if second is None else second
        key = (op, ordered, number, math.copysign(1.0, number), text, other, math.copysign(1.0, other))
        if key not in self._places:
            self._places[key] = len(self.nodes)
            self.nodes.append(Primitive(op, arguments, number, text, second))
        return self._places[key]

    @property
    def content(self) -> object:
        """What tells it from another block."""
        return tuple(self.nodes), tuple(self.stores), tuple(self.fine)

    def load(self, text: str) -> int:
        """The place of what is loaded from memory."""
        return self.add(Op.INPUT, text=text)

    def constant(self, value: float) -> int:
        """The place of a constant."""
        return self.add(Op.REAL_CONSTANT, number=float(value))

    def sum(self, a: int, b: int) -> int:
        """The place of a sum."""
        return self.add(Op.ADD, a, b)

    def multiply(self, a: int, b: int) -> int:
        """The place of a product."""
        return self.add(Op.MUL, a, b)

    def elementary(self, steps: Procedure, inputs: Sequence[int]) -> list[int]:
        """The results of an elementary function; where they hold is noted."""
        at: dict[int, int] = {}
        for k in steps.needed:
            step = steps.steps[k]
            if step.op is Op.INPUT:
                at[k] = inputs[int(step.number)]
            else:
                at[k] = self.add(step.op, *(at[a] for a in step.arguments), number=step.number)
        if steps.fine is not None:
            self.require(at[steps.fine])
        return [at[k] for k in steps.results]

    def require(self, mask: int) -> None:
        """Note that the block holds only where this mask does."""
        if mask not in self.fine:
            self.fine.append(mask)

    def name(self, place: int, label: str) -> None:
        """Call a value by a name that no other has, if it has none yet."""
        if label not in self._named and place not in self.labels:
            self._named.add(label)
            self.labels[place] = label


class Expansion:
    """Puts values of a binding time into a block; `load` gives the C expression of (value, instant) known before."""

    def __init__(
        self, block: Block, values: LoopValues, load: Callable[[int, int], str], binding: Binding = Binding.STATE
    ) -> None:
        self.block, self.loop, self.graph, self.load, self.binding = block, values, values.graph, load, binding

    def values(self, wanted: Sequence[int], given: Mapping[tuple[str, int], int], instant: int) -> list[int]:
        """Places of wanted values, of inputs as `given` and signals at an instant, counted from the block's first."""
        graph, block = self.graph, self.block
        done: dict[int, int] = {}

        def number(i: int) -> int:
            place = done[i]
            return block.add(Op.TRUE, place) if block.nodes[place].op.kind is Kind.MASK else place

        def truth(i: int) -> int:
            place = done[i]
            if block.nodes[place].op.kind is Kind.MASK:
                return place
            return block.add(Op.NE, place, block.constant(0.0))

        def leaf(i: int) -> None:
            node = graph.nodes[i]
            if i in done:
                return
            if node.binding is Binding.CONSTANT:
                done[i] = block.constant(node.value)
            elif node.op is None and node.source in given:
                done[i] = given[node.source]
            elif node.op is None or not graph.computed_at(node, self.binding):
                done[i] = block.load(self.load(i, instant))

        for i in graph.needed(wanted, self.binding):
            op, arguments = graph.nodes[i].op, graph.nodes[i].arguments
            assert op is not None
            for a in arguments:
                leaf(a)
            if op in _LOGIC:
                done[i] = block.add(_LOGIC[op], *map(truth, arguments))
            elif op == ca.OP_IF_ELSE_ZERO:
                done[i] = block.add(Op.IF, truth(arguments[0]), number(arguments[1]))
            else:
                done[i] = self._computed(i, [number(a) for a in arguments])
            if i in self.loop.names:
                block.name(done[i], self.loop.names[i])
        for i in wanted:
            leaf(i)
        return [number(i) for i in wanted]

    def _computed(self, i: int, values: Sequence[int]) -> int:
        block, node = self.block, self.graph.nodes[i]
        op = node.op
        assert op is not None
        if op in _ARITHMETIC:
            return block.add(_ARITHMETIC[op], *values)
        if op == ca.OP_SQ:
            return block.multiply(values[0], values[0])
        if op == ca.OP_TWICE:
            return block.multiply(block.constant(2.0), values[0])
        if op == ca.OP_INV:
            return block.add(Op.DIV, block.constant(1.0), values[0])
        name = function_name(op, "slv", node.origin)
        if op in POWERS:
            exponent = self._exponent(node.arguments[1], values[1])
            if exponent is not None:
                name, values = f"pow_{SPECIAL_POWERS[exponent]}", values[:1]
        return block.elementary(procedure(name), values)[0]

    def _exponent(self, power: int, place: int) -> float | None:
        """The special exponent that a power has, or is taken to have."""
        node = self.graph.nodes[power]
        if node.binding is Binding.CONSTANT:
            return node.value if node.value in SPECIAL_POWERS else None
        assumed = self.loop.assumed_power(power)
        if assumed is not None:
            self.block.require(self.block.add(Op.EQ, place, self.block.constant(assumed)))
        return assumed
