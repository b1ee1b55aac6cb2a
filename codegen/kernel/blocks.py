"""A step of the loop, or a stage of it, as one block of primitive operations in single assignment.

The operations of the value graph are expanded to what a processor does, the elementary functions included, for every
stage that the block covers; equal ones become one. The block knows the common case alone: the masks that say where it
holds are put together, and where one fails the loop computes the step again with the complete functions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from springline.codegen.elementary import COMMUTATIVE, FUNCTIONS, Kind, Op, Procedure, procedure
from springline.codegen.program import MASKS, POWERS, SPECIAL_POWERS, Binding, LoopGraph, updates
from springline.codegen.program import FUNCTIONS as NAMES
from springline.codegen.program import literal
from springline.model.integrators import Tableau

_ARITHMETIC = {
    ca.OP_ADD: Op.ADD, ca.OP_SUB: Op.SUB, ca.OP_MUL: Op.MUL, ca.OP_DIV: Op.DIV, ca.OP_NEG: Op.NEG,
    ca.OP_SQRT: Op.SQRT, ca.OP_FMIN: Op.FMIN, ca.OP_FMAX: Op.FMAX,
    ca.OP_LT: Op.LT, ca.OP_LE: Op.LE, ca.OP_EQ: Op.EQ, ca.OP_NE: Op.NE,
}  # fmt: skip
_LOGIC = {ca.OP_AND: Op.AND, ca.OP_OR: Op.OR, ca.OP_NOT: Op.NOT}


@dataclass(frozen=True, slots=True)
class Primitive:
    """An operation of a block on earlier ones.

    text    of an input, the C expression of what is loaded;  of a call, the function
    number  of a constant, a shift, a bound
    label   what the model calls it, or ""
    """

    op: Op
    arguments: tuple[int, ...] = ()
    number: float | int = 0
    text: str = ""
    kind: Kind = Kind.REAL


class Block:
    """Primitives of one group of runs; `stores` are (C expression of the place, primitive), `fine` the masks."""

    def __init__(self) -> None:
        self.nodes: list[Primitive] = []
        self.labels: dict[int, str] = {}
        self.stores: list[tuple[str, int]] = []
        self.fine: list[int] = []
        self._places: dict[object, int] = {}

    def add(self, op: Op, *arguments: int, number: float | int = 0, text: str = "", kind: Kind | None = None) -> int:
        """The place of an operation; of one that is there already, its place."""
        ordered = tuple(sorted(arguments)) if op in COMMUTATIVE else arguments
        key = (op, ordered, number, math.copysign(1.0, number), text)
        if key not in self._places:
            self._places[key] = len(self.nodes)
            self.nodes.append(Primitive(op, arguments, number, text, kind or op.kind))
        return self._places[key]

    def load(self, text: str) -> int:
        """The place of what is loaded from memory."""
        return self.add(Op.INPUT, text=text)

    def constant(self, value: float) -> int:
        """The place of a constant."""
        return self.add(Op.REAL_CONSTANT, number=float(value))

    def expand(self, steps: Procedure, inputs: Sequence[int]) -> list[int]:
        """The results of an elementary function on these inputs; where they hold goes to `fine`."""
        at: list[int] = []
        needed = _needed(steps)
        for k, step in enumerate(steps.steps):
            if step.op is Op.INPUT:
                at.append(inputs[int(step.number)])
            elif k in needed:
                at.append(self.add(step.op, *(at[a] for a in step.arguments), number=step.number))
            else:
                at.append(-1)
        if steps.fine is not None:
            self.require(at[steps.fine])
        return [at[k] for k in steps.results]

    def require(self, mask: int) -> None:
        """Note that the block holds only where this mask does."""
        if mask not in self.fine:
            self.fine.append(mask)


def _needed(steps: Procedure) -> set[int]:
    found: set[int] = set()
    stack = [*steps.results, *([] if steps.fine is None else [steps.fine])]
    while stack:
        k = stack.pop()
        if k not in found:
            found.add(k)
            stack.extend(steps.steps[k].arguments)
    return found


class Translator:
    """Puts nodes of a LoopGraph into a Block.

    given    leaf or staged value (node, instant) -> its place in the block
    assumed  the special exponent that a run-time exponent is taken to have, or None
    """

    def __init__(
        self,
        block: Block,
        graph: LoopGraph,
        load: Callable[[int, int], str],
        assumed: Callable[[int], float | None],
        names: Mapping[int, str],
    ) -> None:
        self.block, self.graph, self.load, self.assumed, self.names = block, graph, load, assumed, names

    def stage(self, wanted: Sequence[int], given: Mapping[tuple[str, int], int], instant: int) -> list[int]:
        """Places of `wanted` where the inputs are as `given`, and signals those of an instant of the step."""
        graph, block = self.graph, self.block
        done: dict[int, int] = {}
        for i in graph.needed(wanted, Binding.STATE):
            for a in graph.nodes[i].arguments:
                self._leaf(a, given, instant, done)
            done[i] = self._operation(i, done)
            if i in self.names:
                block.labels.setdefault(done[i], self.names[i])
        for i in wanted:
            self._leaf(i, given, instant, done)
        return [self._number(i, done) for i in wanted]

    def _leaf(self, i: int, given: Mapping[tuple[str, int], int], instant: int, done: dict[int, int]) -> None:
        node = self.graph.nodes[i]
        if i in done:
            return
        if node.binding is Binding.CONSTANT:
            done[i] = self.block.constant(node.value)
        elif node.op is None and node.source in given:
            done[i] = given[node.source]
        elif node.op is None or not self.graph.computed_at(node, Binding.STATE):
            done[i] = self.block.load(self.load(i, instant))

    def _number(self, i: int, done: Mapping[int, int]) -> int:
        place = done[i]
        return self.block.add(Op.TRUE, place) if self.block.nodes[place].kind is Kind.MASK else place

    def _truth(self, i: int, done: Mapping[int, int]) -> int:
        place = done[i]
        if self.block.nodes[place].kind is Kind.MASK:
            return place
        return self.block.add(Op.NE, place, self.block.constant(0.0))

    def _operation(self, i: int, done: Mapping[int, int]) -> int:
        node, block = self.graph.nodes[i], self.block
        op, arguments = node.op, node.arguments
        assert op is not None
        if op in _LOGIC:
            return block.add(_LOGIC[op], *(self._truth(a, done) for a in arguments))
        if op == ca.OP_IF_ELSE_ZERO:
            return block.add(Op.IF, self._truth(arguments[0], done), self._number(arguments[1], done))
        values = [self._number(a, done) for a in arguments]
        if op in _ARITHMETIC:
            return block.add(_ARITHMETIC[op], *values)
        if op == ca.OP_SQ:
            return block.add(Op.MUL, values[0], values[0])
        if op == ca.OP_TWICE:
            return block.add(Op.MUL, block.constant(2.0), values[0])
        if op == ca.OP_INV:
            return block.add(Op.DIV, block.constant(1.0), values[0])
        return self._function(i, values)

    def _function(self, i: int, values: Sequence[int]) -> int:
        node, block = self.graph.nodes[i], self.block
        name = NAMES["slv"][node.op]
        if node.op in POWERS:
            power = self.graph.nodes[node.arguments[1]]
            exponent = power.value if power.binding is Binding.CONSTANT else None
            if exponent not in SPECIAL_POWERS:
                exponent = self.assumed(node.arguments[1])
                if exponent is not None:
                    block.require(block.add(Op.EQ, values[1], block.constant(exponent)))
            if exponent in SPECIAL_POWERS:
                name, values = f"pow_{SPECIAL_POWERS[exponent]}", values[:1]
        if name in FUNCTIONS:
            return block.expand(procedure(name), values)[0]
        return block.add(Op.CALL, *values, text=name)


def tableau_step(
    block: Block,
    tableau: Tableau,
    stages: Sequence[int],
    states: int,
    *,
    load: Callable[[str, int], int],
    slope: Callable[[int, Sequence[int]], Sequence[int]],
    gain: Callable[[float], int],
    store: Callable[[str, int, int], None],
) -> None:
    """Put some stages of a step into a block.

    load   (vector, element): x, next, at or slope_<stage> from memory
    slope  (stage, where) -> slopes
    gain   factor -> factor times the step
    store  (vector, element, place)
    """
    x = [load("x", i) for i in range(states)]
    every = updates(tableau)
    first_in_sum = next(k for k, update in enumerate(every) if update.next)
    begins = stages[0] == 0
    at = x if begins else [load("at", i) for i in range(states)]
    later = stages[-1] + 1 < tableau.stages
    total = None if stages[0] <= first_in_sum else [load("next", i) for i in range(states)]
    slopes: dict[int, Sequence[int]] = {}

    def known(stage: int) -> Sequence[int]:
        if stage not in slopes:
            slopes[stage] = [load(f"slope_{stage}", i) for i in range(states)]
        return slopes[stage]

    used_later = {s for k in range(stages[-1] + 1, tableau.stages) for _, s in every[k].at}
    for stage in stages:
        slopes[stage] = slope(stage, at)
        update = every[stage]
        if update.next:
            before = x if stage == first_in_sum else total
            assert before is not None
            total = [
                block.add(Op.ADD, before[i], block.add(Op.MUL, gain(update.next), slopes[stage][i]))
                for i in range(states)
            ]
        if update.at:
            at = list(x)
            for factor, k in update.at:
                at = [block.add(Op.ADD, at[i], block.add(Op.MUL, gain(factor), known(k)[i])) for i in range(states)]
        if stage in used_later:
            for i in range(states):
                store(f"slope_{stage}", i, slopes[stage][i])
    if total is not None:
        for i in range(states):
            store("next", i, total[i])
    if later:
        for i in range(states):
            store("at", i, at[i])


def printed(block: Block, order: Sequence[int], groups: int, indent: str) -> list[str]:
    """Statements of a block in this order, for every group side by side; `ok_<group>` collects where it holds."""
    nodes = block.nodes
    stores: dict[int, list[str]] = {}
    late: list[tuple[str, int]] = []
    alias: list[int] = []
    for i, node in enumerate(nodes):
        alias.append(alias[node.arguments[0]] if node.op in (Op.REAL, Op.BITS) else i)
    for place, i in block.stores:
        if nodes[alias[i]].op in (Op.INPUT, Op.REAL_CONSTANT):
            late.append((place, i))
        else:
            stores.setdefault(alias[i], []).append((place, i))
    fine = set(block.fine)

    def ref(i: int, g: int) -> str:
        node = nodes[i]
        if node.op is Op.INPUT:
            return node.text.replace("@", str(g))
        if node.op is Op.REAL_CONSTANT:
            return f"slv_set({literal(float(node.number))})"
        if node.op is Op.BITS_CONSTANT:
            return f"UINT64_C(0x{int(node.number):x})"
        if node.op is Op.REAL:
            return f"slv_real({ref(node.arguments[0], g)})"
        if node.op is Op.BITS:
            return f"slv_bits({ref(node.arguments[0], g)})"
        name = block.labels.get(i, f"a{i}")
        return f"{name}_{g}" if groups > 1 else name

    lines = []
    for i, g in ((i, g) for i in order for g in range(groups)):
        node = nodes[i]
        a = [ref(k, g) for k in node.arguments]
        lines.append(f"{indent}const {_TYPES[node.kind]} {ref(i, g)} = {_expression(node, a, g, groups)};")
        if i in fine:
            ok = f"ok_{g}" if groups > 1 else "ok"
            lines.append(f"{indent}{ok} = {ok} & {ref(i, g)};")
        lines.extend(f"{indent}{place.replace('@', str(g))} = {ref(k, g)};" for place, k in stores.get(i, ()))
    for place, i in late:
        lines.extend(f"{indent}{place.replace('@', str(g))} = {ref(i, g)};" for g in range(groups))
    return lines


_TYPES = {Kind.REAL: "sl_v", Kind.BITS: "sl_b", Kind.MASK: "sl_m"}
_INFIX = {
    Op.ADD: "+", Op.SUB: "-", Op.MUL: "*", Op.DIV: "/", Op.BIT_AND: "&", Op.BIT_OR: "|", Op.BIT_XOR: "^",
    Op.BIT_ADD: "+", Op.BIT_SUB: "-", Op.LT: "<", Op.LE: "<=", Op.EQ: "==", Op.NE: "!=", Op.AND: "&", Op.OR: "|",
}  # fmt: skip


def _expression(node: Primitive, a: Sequence[str], g: int, groups: int) -> str:
    if node.op in _INFIX:
        return f"{a[0]} {_INFIX[node.op]} {a[1]}"
    if node.op is Op.NEG:
        return f"-{a[0]}"
    if node.op in (Op.SHIFT_LEFT, Op.SHIFT_RIGHT):
        return f"{a[0]} {'<<' if node.op is Op.SHIFT_LEFT else '>>'} {int(node.number)}"
    if node.op is Op.BELOW:
        return f"slv_below({a[0]}, UINT64_C(0x{int(node.number):x}))"
    if node.op is Op.CALL:
        if node.text in FAST:
            ok = f"ok_{g}" if groups > 1 else "ok"
            return f"slv_{node.text}_fast({', '.join(a)}, &{ok})"
        return f"slv_{node.text}({', '.join(a)})"
    return f"slv_{node.op.value[0]}({', '.join(a)})"


FAST = frozenset({
    "exp", "expm1", "log", "log1p", "sin", "cos", "sincos", "tan", "hypot", "pow", "sinh", "cosh", "atan2",
    *(f"pow_{power}" for power in ("p1_3", "m1_3", "p2_3", "m2_3", "p1_2", "m1_2", "p3_2")),
})  # fmt: skip
