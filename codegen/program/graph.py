"""One graph of values over all Functions of a Program: what the lane emitter prints from.

Walking the frozen instruction lists, equal operations on equal arguments become one node (value numbering), so work is
shared across Functions. Baked parameters are constants here, and exact operations on constants (+ - * / sqrt and
comparisons, which IEEE 754 fixes to the last bit) are done; transcendental ones never are. x to the power of 1 is x. A
limit at infinity goes: NaN, which it would turn into infinity, stays NaN, and the loop stops at either. Nothing is
regrouped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import casadi as ca

from springline.codegen.program.frozen import Program
from springline.codegen.program.operations import POWERS
from springline.model.system import System


class Binding(IntEnum):
    """When a value becomes known, and for whom: emitted functions may use values of earlier times."""

    CONSTANT = 0
    RUN = 1
    UNIFORM = 2  # depends on time only: one value for all runs
    VARYING = 3  # depends on time and on a tunable parameter: one value per run
    STATE = 4


@dataclass(frozen=True, slots=True)
class Node:
    """A value: an operation on other nodes, a leaf (op None, with a source), or a constant.

    varies  whether it depends on a tunable parameter
    origin  the Function it was first met in
    """

    op: int | None
    arguments: tuple[int, ...]
    binding: Binding
    varies: bool = False
    value: float = math.nan
    source: tuple[str, int] = ("", 0)
    origin: str = ""


_COMMUTATIVE = frozenset({ca.OP_ADD, ca.OP_MUL, ca.OP_EQ, ca.OP_NE, ca.OP_AND, ca.OP_OR})

_EXACT: dict[int, Callable[..., float]] = {
    ca.OP_ADD: lambda a, b: a + b,
    ca.OP_SUB: lambda a, b: a - b,
    ca.OP_MUL: lambda a, b: a * b,
    ca.OP_DIV: lambda a, b: a / b,
    ca.OP_NEG: lambda a: -a,
    ca.OP_SQ: lambda a: a * a,
    ca.OP_TWICE: lambda a: 2.0 * a,
    ca.OP_INV: lambda a: 1.0 / a,
    ca.OP_SQRT: math.sqrt,
    ca.OP_FABS: abs,
    ca.OP_SIGN: lambda a: -1.0 if a < 0 else 1.0 if a > 0 else a,
    ca.OP_FMIN: lambda a, b: a if a < b else b,
    ca.OP_FMAX: lambda a, b: a if a > b else b,
    ca.OP_LT: lambda a, b: float(a < b),
    ca.OP_LE: lambda a, b: float(a <= b),
    ca.OP_EQ: lambda a, b: float(a == b),
    ca.OP_NE: lambda a, b: float(a != b),
    ca.OP_NOT: lambda a: float(not a),
    ca.OP_AND: lambda a, b: float(bool(a) and bool(b)),
    ca.OP_OR: lambda a, b: float(bool(a) or bool(b)),
    ca.OP_IF_ELSE_ZERO: lambda c, a: a if c else 0.0,
}

_NO_LIMIT = {ca.OP_FMIN: math.inf, ca.OP_FMAX: -math.inf}


class ValueGraph:
    """Value-numbered nodes; `outputs[function][k]` are the nodes of a Function's k-th output, entry by entry."""

    def __init__(self) -> None:
        self.nodes: list[Node] = []
        self.outputs: dict[str, list[list[int]]] = {}
        self._index: dict[object, int] = {}

    def leaf(self, name: str, index: int, binding: Binding, *, varies: bool = False) -> int:
        """The node of entry `index` of an input."""
        return self._intern((name, index), Node(None, (), binding, varies, source=(name, index)))

    def constant(self, value: float) -> int:
        """The node of a constant; 0.0 and -0.0 are two."""
        key = ("constant", value, math.copysign(1.0, value))
        return self._intern(key, Node(None, (), Binding.CONSTANT, value=float(value), source=("constant", 0)))

    def _intern(self, key: object, node: Node) -> int:
        if key not in self._index:
            self._index[key] = len(self.nodes)
            self.nodes.append(node)
        return self._index[key]

    def _folded(self, op: int, arguments: tuple[int, ...], value: float) -> int:
        """The node of what an exact operation on constants gives."""
        return self.constant(value)

    def _operation(self, op: int, arguments: tuple[int, ...], origin: str) -> int:
        nodes = [self.nodes[i] for i in arguments]
        if op in _EXACT and all(node.binding is Binding.CONSTANT for node in nodes):
            try:
                return self._folded(op, arguments, _EXACT[op](*(node.value for node in nodes)))
            except (ZeroDivisionError, ValueError):
                pass  # 1/0, sqrt(-1): left to C, which knows Inf and NaN
        if op in _NO_LIMIT and nodes[1].binding is Binding.CONSTANT and nodes[1].value == _NO_LIMIT[op]:
            return arguments[0]
        if op in POWERS and nodes[1].binding is Binding.CONSTANT and nodes[1].value == 1.0:
            return arguments[0]
        key = (op, tuple(sorted(arguments)) if op in _COMMUTATIVE else arguments)
        varies = any(node.varies for node in nodes)
        binding = max(Binding.RUN, *(node.binding for node in nodes))
        if binding in (Binding.UNIFORM, Binding.VARYING):
            binding = Binding.VARYING if varies else Binding.UNIFORM
        return self._intern(key, Node(op, arguments, binding, varies, origin=origin))

    def add(self, name: str, function: ca.Function, inputs: Sequence[Sequence[int]]) -> list[list[int]]:
        """Add a Function's instructions with the given nodes as its inputs; returns the nodes of its outputs."""
        work: dict[int, int] = {}
        results = [[self.constant(0.0)] * function.numel_out(k) for k in range(function.n_out())]
        for k in range(function.n_instructions()):
            op = function.instruction_id(k)
            into, source = function.instruction_output(k), function.instruction_input(k)
            if op == ca.OP_OUTPUT:
                results[into[0]][into[1]] = work[source[0]]
            elif op == ca.OP_INPUT:
                work[into[0]] = inputs[source[0]][source[1]]
            elif op == ca.OP_CONST:
                work[into[0]] = self.constant(function.instruction_constant(k))
            elif op == ca.OP_ASSIGN:
                work[into[0]] = work[source[0]]
            else:
                work[into[0]] = self._operation(op, tuple(work[i] for i in source), name)
        self.outputs[name] = results
        return results

    def needed(self, wanted: Sequence[int], binding: Binding) -> list[int]:
        """Nodes that a function of this binding time has to compute for `wanted`."""
        found: set[int] = set()
        stack = list(wanted)
        while stack:
            i = stack.pop()
            node = self.nodes[i]
            if i in found or node.op is None or not self.computed_at(node, binding):
                continue
            found.add(i)
            stack.extend(node.arguments)
        return sorted(found)

    @staticmethod
    def computed_at(node: Node, binding: Binding) -> bool:
        """Whether a function of this binding time computes the node itself, rather than being given it."""
        if binding is Binding.UNIFORM and node.binding is Binding.RUN and not node.varies:
            return True  # shared by all runs, and cheap next to carrying it there
        return node.binding is binding


class LoopGraph(ValueGraph):
    """The graph of a Program's loop: signals feed the control, the control feeds the plant.

    baked    slot key -> value for the parameters that are constants; all others are tunable
    tunable  their keys, in the order of their leaves ("p", k)
    labels   of a Function, the nodes that the model has a word for, with that word
    """

    def __init__(self, program: Program, baked: Mapping[str, float]) -> None:
        super().__init__()
        self.tunable = tuple(slot.key for slot in program.system.slots if slot.key not in baked)
        columns = {key: i for i, key in enumerate(self.tunable)}
        self._slot_of_column = [i for i, slot in enumerate(program.system.slots) if slot.key in columns]
        p = [
            self.constant(baked[slot.key])
            if slot.key in baked
            else self.leaf("p", columns[slot.key], Binding.RUN, varies=True)
            for slot in program.system.slots
        ]
        t = [self.leaf("t", 0, Binding.UNIFORM)]
        d = [self.leaf("d", i, Binding.UNIFORM) for i in range(program.size("d"))]
        x = [self.leaf("x", i, Binding.STATE) for i in range(program.size("x"))]
        u = [self.leaf("u", i, Binding.STATE) for i in range(program.size("u"))]
        z = [[self.leaf("z", i, Binding.STATE) for i in range(program.size("z"))]] if program.size("z") else []
        noise = (
            [[self.leaf("noise", i, Binding.STATE) for i in range(program.size("noise"))]]
            if program.size("noise")
            else []
        )
        functions = program.functions
        [r] = self.add("run", functions["run"], [p])
        beginning = [self.leaf("begin", 0, Binding.STATE)]
        first = [self.leaf("first", i, Binding.STATE) for i in range(program.size("d"))]
        self.add("start", functions["start"], [beginning, first, p, r])
        if "tip" in functions:
            self.add("tip", functions["tip"], [beginning, first, x, p])
        if "actuate" in functions:
            arrived, m = (
                [self.leaf(name, i, Binding.STATE) for i in range(size)]
                for name, size in (("arrived", program.size("u")), ("m", program.size("m")))
            )
            self.add("actuate", functions["actuate"], [arrived, m, [self.leaf("step", 0, Binding.RUN)], p])
        [w] = self.add("signals", functions["signals"], [t, d, p, r])
        [s] = self.add("time", functions["time"], [w, p, r])
        self.add("error", functions["error"], [w, s, x, *z, p, r])
        at = [w, s, x, *z]
        # The filter of differenced rates is of the period and of parameters, which a run has once.
        period = [[self.leaf("h", 0, Binding.RUN)]] if program.system.structure.differenced else []
        [command, *_] = self.add("control", functions["control"], [*at, *noise, *period, p, r])
        self.add("plant", functions["plant"], [w, s, x, u, p, r])
        self.add("closed", functions["plant"], [w, s, x, command, p, r])
        if "rates" in functions:
            self.add("rates", functions["rates"], [*at, *noise, p, r])
        if "update" in functions:
            [h] = period or [[self.leaf("h", 0, Binding.STATE)]]
            self.add("update", functions["update"], [*at, *noise, h, p, r])
        system = program.system
        self.labels = {
            "control": self._labelled(system, "control", [w, x, *z, *noise, *period, p]),
            "plant": self._labelled(system, "plant", [w, x, u, p]),
            "closed": self._labelled(system, "plant", [w, x, command, p]),
        }

    def _labelled(self, system: System, name: str, inputs: Sequence[Sequence[int]]) -> list[tuple[int, str]]:
        """What the model names in Function `name` of the loop of these inputs.

        The Function of the names is not staged: its values are the nodes of those that are, for the operations are the
        same. What only it computes is needed by nothing, and so it is not printed.
        """
        terms = system.terms(name)
        if not terms:
            return []
        joints = tuple(joint.name for joint in system.joints)
        values = self.add(f"{name}_terms", system.function(f"loop_{name}_terms"), inputs)
        labels = [label for term in terms for label in term.labels(joints)]
        return list(zip((i for part in values for i in part), labels, strict=True))

    def value_at(self, i: int, parameters: Sequence[float]) -> float | None:
        """Value of a run-time node at given slots' values where exact operations lead there, else None."""
        node = self.nodes[i]
        if node.binding is Binding.CONSTANT:
            return node.value
        if node.op is None:
            return parameters[self._slot_of_column[node.source[1]]] if node.source[0] == "p" else None
        arguments = [self.value_at(a, parameters) for a in node.arguments]
        known = [a for a in arguments if a is not None]
        if node.op not in _EXACT or len(known) < len(arguments):
            return None
        try:
            return _EXACT[node.op](*known)
        except (ZeroDivisionError, ValueError):
            return None
