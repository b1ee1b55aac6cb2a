"""The lane emitter: a Program printed as C on vectors, one run per lane, several vectors at once.

Works on the value graph of the frozen Functions, so it computes what CasADi's C computes, bit for bit. What it adds is
where and in which order: parameter-only values once per run, time-only values once for all runs, the rest in an order
that starts long chains first and puts the same operation of both joints and of all groups side by side, so that the
processor always has something independent to do.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from springline.codegen.graph import Binding, Graph
from springline.codegen.program import Program
from springline.model.base import COORDINATES

_VECTOR_CALLS = {
    ca.OP_SQRT: "sqrt", ca.OP_EXP: "exp", ca.OP_LOG: "log", ca.OP_LOG1P: "log1p", ca.OP_EXPM1: "expm1",
    ca.OP_SIN: "sin", ca.OP_COS: "cos", ca.OP_TAN: "tan", ca.OP_POW: "pow", ca.OP_CONSTPOW: "pow",
    ca.OP_FABS: "fabs", ca.OP_SIGN: "sign", ca.OP_FMIN: "fmin", ca.OP_FMAX: "fmax", ca.OP_FLOOR: "floor",
    ca.OP_CEIL: "ceil", ca.OP_COPYSIGN: "copysign", ca.OP_HYPOT: "hypot",
}
_INFIX = {ca.OP_ADD: "+", ca.OP_SUB: "-", ca.OP_MUL: "*", ca.OP_DIV: "/"}
_COMPARISONS = {ca.OP_LT: "<", ca.OP_LE: "<=", ca.OP_EQ: "==", ca.OP_NE: "!="}
_LOGIC = {ca.OP_AND: "&", ca.OP_OR: "|"}
_MASKS = frozenset({*_COMPARISONS, *_LOGIC, ca.OP_NOT})

# Exponents for which sl_pow is defined as a kernel of its own (sl_math.h); the nearest double where it is a third.
SPECIAL_POWERS = {
    1 / 3: "p1_3", -1 / 3: "m1_3", 2 / 3: "p2_3", -2 / 3: "m2_3", 0.5: "p1_2", -0.5: "m1_2", 1.5: "p3_2",
    1.0: "p1", 2.0: "p2", 3.0: "p3",
}

# Rough latencies in cycles: they only decide the order of statements.
_LATENCY = {
    ca.OP_DIV: 13, ca.OP_INV: 13, ca.OP_SQRT: 20, ca.OP_EXP: 45, ca.OP_LOG: 55, ca.OP_LOG1P: 60, ca.OP_EXPM1: 60,
    ca.OP_SIN: 45, ca.OP_COS: 45, ca.OP_TAN: 60, ca.OP_POW: 110, ca.OP_CONSTPOW: 60, ca.OP_HYPOT: 40,
}
_SIMPLE_LATENCY = 3

_NAMES = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}


class UnprintableOperation(ValueError):
    """A Function holds an operation that has no C in sl_math.h."""


@dataclass(frozen=True, slots=True)
class Emission:
    """The printed kernel and what it works on.

    text     body of kernel.h after the preamble
    sizes    numbers of tunable parameters and of run, uniform and varying values
    tunable  slot keys, in the order of the parameter columns
    counts   operations of each emitted function, per run
    """

    text: str
    sizes: dict[str, int]
    tunable: tuple[str, ...]
    counts: dict[str, int]


def literal(value: float) -> str:
    """A C literal that reads back as the same double."""
    if value != value:
        return "SL_NAN"
    if value in (float("inf"), float("-inf")):
        return "SL_INF" if value > 0 else "-SL_INF"
    text = repr(value)
    return text if any(c in text for c in ".e") else text + ".0"


class _Emitter:
    def __init__(self, program: Program, baked: Mapping[str, float], groups: int) -> None:
        self.program = program
        self.graph = Graph(program, baked)
        self.groups = groups
        self.slots: dict[Binding, dict[int, int]] = {Binding.RUN: {}, Binding.UNIFORM: {}, Binding.VARYING: {}}
        self.names = self._names()
        self.counts: dict[str, int] = {}
        outputs = self.graph.outputs
        # Later functions are visited first: they decide which earlier values are kept.
        self.state_functions = {
            "closed": [*outputs["closed"][0], *(i for part in outputs["control"] for i in part)],
            "control": [i for part in outputs["control"] for i in part],
            "error": [i for part in outputs["error"] for i in part],
            "plant": list(outputs["plant"][0]),
        }
        n = program.system.n
        w = outputs["signals"][0]
        self.observed = [*w[:n], *w[3 * n:3 * n + len(COORDINATES)]]
        for wanted in (*self.state_functions.values(), self.observed, outputs["start"][0]):
            self._keep(wanted, Binding.STATE)
        self._keep(list(self.slots[Binding.VARYING]), Binding.VARYING)
        self._keep(list(self.slots[Binding.UNIFORM]), Binding.UNIFORM)

    def _names(self) -> dict[int, str]:
        """Names of the model for inputs, outputs and signals; everything else is numbered."""
        system, outputs = self.program.system, self.graph.outputs
        names: dict[int, str] = {}
        joints = [joint.name for joint in system.joints]

        def name(nodes: Sequence[int], labels: Sequence[str]) -> None:
            for i, label in zip(nodes, labels, strict=True):
                if self.graph.nodes[i].binding is not Binding.CONSTANT:
                    names.setdefault(i, label)

        base = [c.symbol for c in COORDINATES]
        for i, node in enumerate(self.graph.nodes):
            kind, k = node.source
            if node.op is None and kind == "x":
                names[i] = f"{('q1', 'dq1', 'q2', 'dq2')[k // system.n]}_{joints[k % system.n]}"
            elif node.op is None and kind == "u":
                names[i] = f"u_{joints[k]}"
        signal = [f"{q}_{j}" for q in ("q1d", "dq1d", "ddq1d") for j in joints]
        name(outputs["signals"][0], signal + [f"{d}{c}" for d in ("", "d_", "dd_") for c in base])
        for part, label in zip(outputs["control"], ("command", "e", "sigma"), strict=True):
            name(part, [f"{label}_{j}" for j in joints])
        return names

    def _keep(self, wanted: Sequence[int], binding: Binding) -> None:
        """Note which values of earlier binding times a function that computes `wanted` has to be given."""
        nodes = self.graph.nodes
        inside = self.graph.needed(wanted, binding)
        for i in sorted({a for k in inside for a in nodes[k].arguments} | set(wanted)):
            node = nodes[i]
            if node.op is not None and node.binding in self.slots and not self.graph.computed_at(node, binding):
                self.slots[node.binding].setdefault(i, len(self.slots[node.binding]))
            elif node.op is None and node.source[0] in ("t", "d") and binding is Binding.STATE:
                self.slots[Binding.UNIFORM].setdefault(i, len(self.slots[Binding.UNIFORM]))

    # -- order ------------------------------------------------------------------------------------------------

    def _schedule(self, needed: Sequence[int]) -> list[int]:
        """Topological order, longest remaining chain first."""
        nodes = self.graph.nodes
        inside = set(needed)
        users: dict[int, list[int]] = {i: [] for i in needed}
        waiting = {}
        for i in needed:
            arguments = {a for a in nodes[i].arguments if a in inside}
            waiting[i] = len(arguments)
            for a in arguments:
                users[a].append(i)
        height: dict[int, int] = {}
        for i in reversed(needed):
            op = nodes[i].op
            own = _LATENCY.get(op if op is not None else -1, _SIMPLE_LATENCY)
            height[i] = own + max((height[user] for user in users[i]), default=0)
        ready = [(-height[i], i) for i in needed if waiting[i] == 0]
        heapq.heapify(ready)
        order = []
        while ready:
            _, i = heapq.heappop(ready)
            order.append(i)
            for user in users[i]:
                waiting[user] -= 1
                if waiting[user] == 0:
                    heapq.heappush(ready, (-height[user], user))
        return order

    # -- expressions ------------------------------------------------------------------------------------------

    def _label(self, i: int, suffix: str) -> str:
        return self.names.get(i, f"a{i}") + suffix

    def _expression(self, i: int, ref: Callable[[int], str], mask: Callable[[int], str]) -> str:
        node = self.graph.nodes[i]
        op, arguments = node.op, node.arguments
        assert op is not None
        if op in _INFIX:
            return f"{ref(arguments[0])} {_INFIX[op]} {ref(arguments[1])}"
        if op == ca.OP_NEG:
            return f"-{ref(arguments[0])}"
        if op == ca.OP_SQ:
            return f"{ref(arguments[0])} * {ref(arguments[0])}"
        if op == ca.OP_TWICE:
            return f"slv_set(2.0) * {ref(arguments[0])}"
        if op == ca.OP_INV:
            return f"slv_set(1.0) / {ref(arguments[0])}"
        if op in (ca.OP_POW, ca.OP_CONSTPOW):
            exponent = self.graph.nodes[arguments[1]]
            if exponent.binding is Binding.CONSTANT and exponent.value in SPECIAL_POWERS:
                return f"slv_pow_{SPECIAL_POWERS[exponent.value]}({ref(arguments[0])})"
        if op in _VECTOR_CALLS:
            return f"slv_{_VECTOR_CALLS[op]}({', '.join(ref(a) for a in arguments)})"
        if op in _COMPARISONS:
            return f"{ref(arguments[0])} {_COMPARISONS[op]} {ref(arguments[1])}"
        if op in _LOGIC:
            return f"{mask(arguments[0])} {_LOGIC[op]} {mask(arguments[1])}"
        if op == ca.OP_NOT:
            return f"slv_not({mask(arguments[0])})"
        if op == ca.OP_IF_ELSE_ZERO:
            return f"slv_if({mask(arguments[0])}, {ref(arguments[1])})"
        raise UnprintableOperation(f"the lane emitter cannot print the operation {_NAMES.get(op, op)}; "
                                   "sl_math.h has no function for it")

    def body(self, wanted: Sequence[int], binding: Binding, load: Callable[[int, str], str], groups: int,
             store: Callable[[int, int, str, str], str], indent: str = "  ") -> tuple[list[str], int]:
        """Statements that compute `wanted` and store them.

        load(node, group)  C expression of a value that is given;  store(position, node, value, group) a statement
        Returns the lines and the number of operations per run.
        """
        nodes = self.graph.nodes
        order = self._schedule(self.graph.needed(wanted, binding))
        done: set[int] = set()
        lines: list[str] = []
        pending = list(order)
        loaded: set[int] = set()
        suffixes = [f"_{g}" if groups > 1 else "" for g in range(groups)]
        angles = {nodes[i].arguments[0]: set() for i in order if nodes[i].op in (ca.OP_SIN, ca.OP_COS)}  # type: dict[int, set[int]]
        for i in order:
            if nodes[i].op in (ca.OP_SIN, ca.OP_COS):
                angles[nodes[i].arguments[0]].add(i)

        def group(suffix: str) -> str:
            return suffix[1:] if suffix else "0" if groups == 1 and binding is Binding.STATE else "g"

        def reference(suffix: str) -> Callable[[int], str]:
            def ref(i: int) -> str:
                node = nodes[i]
                if node.binding is Binding.CONSTANT:
                    return f"slv_set({literal(node.value)})"
                label = self._label(i, suffix)
                return f"slv_true({label})" if node.op in _MASKS and i in done else label
            return ref

        def truth(suffix: str) -> Callable[[int], str]:
            def mask(i: int) -> str:
                if nodes[i].op in _MASKS and i in done:
                    return self._label(i, suffix)
                return f"({reference(suffix)(i)} != slv_set(0.0))"
            return mask

        def ensure_loaded(i: int) -> None:
            if i in done or i in loaded or nodes[i].binding is Binding.CONSTANT:
                return
            loaded.add(i)
            lines.extend(f"{indent}const sl_v {self._label(i, s)} = {load(i, group(s))};" for s in suffixes)

        for i in pending:
            if i in done:
                continue
            node = nodes[i]
            for a in node.arguments:
                ensure_loaded(a)
            if node.op in (ca.OP_SIN, ca.OP_COS) and len(angles[node.arguments[0]]) == 2:
                a = node.arguments[0]
                sine, cosine = sorted(angles[a], key=lambda k: nodes[k].op != ca.OP_SIN)
                for k, function in ((sine, "sin"), (cosine, "cos")):
                    if k not in self.names and a in self.names:
                        self.names[k] = f"{function}_{self.names[a]}"
                for s in suffixes:
                    lines.append(f"{indent}sl_v {self._label(sine, s)}, {self._label(cosine, s)};")
                for s in suffixes:
                    lines.append(f"{indent}slv_sincos({reference(s)(a)}, &{self._label(sine, s)}, &{self._label(cosine, s)});")
                done |= {sine, cosine}
                continue
            kind = "sl_m" if node.op in _MASKS else "sl_v"
            for s in suffixes:
                lines.append(f"{indent}const {kind} {self._label(i, s)} = {self._expression(i, reference(s), truth(s))};")
            done.add(i)
        for i in wanted:
            ensure_loaded(i)
        for position, i in enumerate(wanted):
            lines.extend(indent + store(position, i, reference(s)(i), group(s)) for s in suffixes)
        return lines, len(order)

    # -- functions --------------------------------------------------------------------------------------------

    def _given(self, i: int, group: str) -> str:
        """C expression of a value from an earlier binding time, or of an input, for a group of runs."""
        node = self.graph.nodes[i]
        if node.op is None:
            name, k = node.source
            if name in ("p", "x", "u"):
                return f"{name}[{k}][{group}]"
        if node.binding is Binding.RUN:
            return f"r[{self.slots[Binding.RUN][i]}][{group}]"
        if node.binding is Binding.UNIFORM:
            return f"slv_set(now.uniform[{self.slots[Binding.UNIFORM][i]} * SL_W])"
        return f"now.varying[{self.slots[Binding.VARYING][i]}][{group}]"

    def _per_group(self, name: str, signature: str, wanted: Sequence[int], binding: Binding,
                   target: str, load: Callable[[int, str], str] | None = None, before: str = "") -> str:
        """A rarely called function: one loop over the groups."""
        lines, self.counts[name] = self.body(
            wanted, binding, load or self._given, 1,
            lambda position, _i, value, group: f"{target}[{position}][g] = {value};", indent="    ")
        body = "\n".join([f"  for (g = 0; g < SL_G; g++) {{{before}", *lines, "  }"]) if wanted else ""
        unused = ", ".join(f"(void){word.split('*')[-1].split()[-1]}" for word in signature.split(", "))
        return f"static inline void kernel_{name}({signature}) {{\n  int g;\n{body}\n  (void)g, {unused};\n}}\n".replace(
            "  int g;\n\n  (void)g, ", "  ")

    def text(self) -> str:
        """All functions of the kernel."""
        system, outputs = self.program.system, self.graph.outputs
        n = system.n
        given = "const sl_group *p, const sl_group *r"
        run_wanted = list(self.slots[Binding.RUN])
        pieces = [
            "/* ---- once per run ---- */\n",
            self._per_group("run", "const sl_group *p, sl_group *r", run_wanted, Binding.RUN, "r",
                            load=lambda i, g: f"p[{self.graph.nodes[i].source[1]}][{g}]"),
            self._per_group("start", f"{given}, sl_group *x", outputs["start"][0], Binding.STATE, "x"),
            "/* ---- once per time ---- */\n",
            self._uniform(),
            self._varying(given),
            self._signals(),
            "/* ---- at every evaluation ---- */\n",
        ]
        control = [("u", n), ("e", n), ("sigma", n)]
        pieces += [
            self._state("closed", "", [("dx", 4 * n), *control]),
            self._state("control", "", control),
            self._state("error", "", control[1:]),
            self._state("plant", "const sl_group *u, ", [("dx", 4 * n)]),
        ]
        return "\n".join(pieces)

    def _state(self, name: str, inputs: str, results: Sequence[tuple[str, int]]) -> str:
        targets = [f"{result}[{i}]" for result, count in results for i in range(count)]
        lines, count = self.body(self.state_functions[name], Binding.STATE, self._given, self.groups,
                                 lambda position, _i, value, group: f"{targets[position]}[{group}] = {value};")
        self.counts[name] = count
        arguments = ", ".join(f"sl_group *{result}" for result, _ in results)
        unused = ", ".join(f"(void){word}" for word in ("now", "x", *(["u"] if inputs else []), "p", "r"))
        return (f"/* {count} operations a run */\n"
                f"static inline void kernel_{name}(sl_time now, const sl_group *x, {inputs}const sl_group *p, "
                f"const sl_group *r,\n    {arguments}) {{\n" + "\n".join(lines) + f"\n  {unused};\n}}\n")

    def _uniform(self) -> str:
        """Values that all runs share, for SL_W times at once."""
        wanted = list(self.slots[Binding.UNIFORM])

        def load(i: int, _group: str) -> str:
            name, k = self.graph.nodes[i].source
            return "slv_load(t)" if name == "t" else f"slv_load(d + {k} * SL_W)"

        lines, self.counts["uniform"] = self.body(wanted, Binding.UNIFORM, load, 1,
                                                  lambda position, _i, value, _g: f"uniform[{position}] = {value};")
        return ("static inline void kernel_uniform(const double *t, const double *d, sl_v *uniform) {\n"
                + "\n".join(lines) + "\n  (void)t, (void)d, (void)uniform;\n}\n")

    def _varying(self, given: str) -> str:
        """Values that depend on time and on a run's own parameters."""
        wanted = list(self.slots[Binding.VARYING])

        def load(i: int, group: str) -> str:
            node = self.graph.nodes[i]
            if node.op is None and node.source[0] == "t":
                return "slv_set(t)"
            if node.op is None and node.source[0] == "d":
                return f"slv_set(d[{node.source[1]}])"
            if node.binding is Binding.UNIFORM:
                return f"slv_set(uniform[{self.slots[Binding.UNIFORM][i]} * SL_W])"
            return self._given(i, group)

        return self._per_group("varying", f"double t, const double *d, const double *uniform, {given}, sl_group *varying",
                               wanted, Binding.VARYING, "varying", load)

    def _signals(self) -> str:
        n = self.program.system.n
        lines = []
        for position, i in enumerate(self.observed):
            target = f"q1d[{position}]" if position < n else f"b[{position - n}]"
            node = self.graph.nodes[i]
            value = f"slv_set({literal(node.value)})" if node.binding is Binding.CONSTANT else self._given(i, "g")
            lines.append(f"    {target}[g] = {value};")
        return ("static inline void kernel_signals(sl_time now, const sl_group *p, const sl_group *r, sl_group *q1d, sl_group *b) {\n  int g;\n"
                "  for (g = 0; g < SL_G; g++) {\n" + "\n".join(lines) + "\n  }\n  (void)now, (void)p, (void)r;\n}\n")


def emit(program: Program, baked: Mapping[str, float], groups: int) -> Emission:
    """Print the kernel of a Program.

    baked   slot key -> value of the parameters that become constants; the others are read per run
    groups  vectors that each statement is printed for
    Raises UnprintableOperation, naming the operation.
    """
    emitter = _Emitter(program, baked, groups)
    text = emitter.text()
    sizes = {"p": len(emitter.graph.tunable), "r": len(emitter.slots[Binding.RUN]),
             "uniform": len(emitter.slots[Binding.UNIFORM]), "varying": len(emitter.slots[Binding.VARYING])}
    return Emission(text, sizes, emitter.graph.tunable, emitter.counts)
