"""The lane emitter: a Program printed as C on vectors, one run per lane.

Works on the value graph of the frozen Functions, so it computes what CasADi's C computes, bit for bit. What it adds is
where: parameter-only values once per run, time-only values once for all runs. These functions know every rare case;
the steps themselves are printed as blocks of the common case (steps.py), in an order that keeps the processor busy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from springline.codegen.kernel.loop_values import LoopValues
from springline.codegen.kernel.metrics import print_metrics
from springline.codegen.program import MASKS, POWERS, Binding, Program, formula, literal, print_operation

_FORMULA_DEPTH = 4

_GIVEN = "const sl_group *p, const sl_group *r"


@dataclass(frozen=True, slots=True)
class Emission:
    """The printed kernel and what it works on.

    text     body of kernel.h after the preamble
    sizes    numbers of tunable parameters and of run, uniform and varying values
    tunable  slot keys, in the order of the parameter columns
    counts   operations of each function, per run
    values   what the blocks of its steps are made of
    """

    text: str
    sizes: dict[str, int]
    tunable: tuple[str, ...]
    counts: dict[str, int]
    values: LoopValues


class _Emitter:
    def __init__(self, values: LoopValues) -> None:
        self.values = values
        self.graph = values.graph
        self.program = values.program
        self.counts: dict[str, int] = {}

    # -- expressions ------------------------------------------------------------------------------------------

    def _label(self, i: int) -> str:
        return self.values.names.get(i, f"a{i}")

    def _formula(self, i: int, depth: int = 0) -> str:
        """What a staged value is, in the model's names, for a comment; other staged values stand by their own."""
        node = self.graph.nodes[i]
        if node.binding is Binding.CONSTANT:
            return f"{node.value:.6g}"
        if node.op is None or (depth and (i in self.values.names or depth > _FORMULA_DEPTH)):
            return self.values.names.get(i, "...")
        parts = [self._formula(a, depth + 1) for a in node.arguments]
        return formula(node.op, parts)

    def _expression(self, i: int, ref: Callable[[int], str], mask: Callable[[int], str]) -> str:
        """C expression of an operation."""
        node = self.graph.nodes[i]
        assert node.op is not None
        power = self.graph.nodes[node.arguments[1]] if node.op in POWERS else None
        return print_operation(
            node.op,
            node.arguments,
            library="slv",
            value=ref,
            truth=mask,
            constant=lambda number: f"slv_set({literal(number)})",
            exponent=power.value if power is not None and power.binding is Binding.CONSTANT else None,
            call=lambda name, operands: f"slv_{name}({', '.join(operands)})",
            origin=node.origin,
        )

    def _body(
        self,
        wanted: Sequence[int],
        binding: Binding,
        load: Callable[[int], str],
        store: Callable[[int, str], str],
        indent: str,
    ) -> tuple[list[str], int]:
        """Statements that compute `wanted` and store them, and how many operations that takes per run.

        load    node -> C expression of a value that is given
        store   (position in wanted, value) -> a statement
        """
        nodes = self.graph.nodes
        order = self.graph.needed(wanted, binding)
        computed = set(order)
        present: set[int] = set()
        lines: list[str] = []

        def reference(i: int) -> str:
            node = nodes[i]
            if node.binding is Binding.CONSTANT:
                return f"slv_set({literal(node.value)})"
            label = self._label(i)
            return f"slv_true({label})" if node.op in MASKS and i in computed else label

        def mask(i: int) -> str:
            if nodes[i].op in MASKS and i in computed:
                return self._label(i)
            return f"({reference(i)} != slv_set(0.0))"

        def fetch(i: int) -> None:
            if i in computed or i in present or nodes[i].binding is Binding.CONSTANT:
                return
            present.add(i)
            lines.append(f"{indent}const sl_v {self._label(i)} = {load(i)};")

        sines = {nodes[i].arguments[0]: i for i in order if nodes[i].op == ca.OP_SIN}
        cosines = {nodes[i].arguments[0]: i for i in order if nodes[i].op == ca.OP_COS}
        for i in order:
            if i in present:
                continue
            op, arguments = nodes[i].op, nodes[i].arguments
            for a in arguments:
                fetch(a)
            angle = arguments[0]
            if op in (ca.OP_SIN, ca.OP_COS) and angle in sines and angle in cosines:
                pair = (sines[angle], cosines[angle])
                for k, function in zip(pair, ("sin", "cos"), strict=True):
                    if angle in self.values.names:
                        self.values.names.setdefault(k, f"{function}_{self.values.names[angle]}")
                sine, cosine = map(self._label, pair)
                lines.append(f"{indent}sl_v {sine}, {cosine};")
                lines.append(f"{indent}slv_sincos({reference(angle)}, &{sine}, &{cosine});")
                present.update(pair)
                continue
            kind = "sl_m" if op in MASKS else "sl_v"
            lines.append(f"{indent}const {kind} {self._label(i)} = {self._expression(i, reference, mask)};")
            present.add(i)
        for i in wanted:
            fetch(i)
        lines.extend(indent + store(position, reference(i)) for position, i in enumerate(wanted))
        return lines, len(order)

    # -- functions --------------------------------------------------------------------------------------------

    def _given(self, i: int) -> str:
        """C expression of an input, or of a value from an earlier binding time, for group g of runs."""
        node = self.graph.nodes[i]
        name, k = node.source
        if name in ("p", "x", "u", "noise", "arrived", "m"):
            return f"{name}[{k}][g]"
        if name == "z":  # behind the plant's state
            return f"x[{self.program.size('x') + k}][g]"
        if name in ("h", "step"):
            return "slv_set(period)" if name == "h" else "slv_set(step)"
        if name in ("begin", "first"):
            return "slv_set(time)" if name == "begin" else f"slv_set(data[{k}])"
        if node.binding is Binding.RUN:
            return f"r[{self.values.slots[Binding.RUN][i]}][g]"
        if node.binding is Binding.UNIFORM:
            return f"slv_set(now.uniform[{self.values.slots[Binding.UNIFORM][i]} * SL_W])"
        return f"now.varying[{self.values.slots[Binding.VARYING][i]}][g]"

    def _given_at_one_time(self, i: int) -> str:
        """As `_given`, in the function that computes what varies from run to run at one time t."""
        node = self.graph.nodes[i]
        name, k = node.source
        if name in ("t", "d"):
            return "slv_set(time)" if name == "t" else f"slv_set(data[{k}])"
        if node.binding is Binding.UNIFORM:
            return f"slv_set(uniform[{self.values.slots[Binding.UNIFORM][i]} * SL_W])"
        return self._given(i)

    def _given_at_many_times(self, i: int) -> str:
        """As `_given`, in the function that computes what all runs share, at SL_W times in one vector."""
        name, k = self.graph.nodes[i].source
        return "slv_load(times)" if name == "t" else f"slv_load(data + {k} * SL_W)"

    def _function(
        self,
        name: str,
        signature: str,
        wanted: Sequence[int],
        binding: Binding,
        target: Callable[[int], str],
        load: Callable[[int], str] | None = None,
        *,
        shared: bool = False,
    ) -> str:
        """One C function, on the groups of a pack one after the other, or `shared` by all of them."""
        indent = "  " if shared else "    "
        lines, count = self._body(
            wanted, binding, load or self._given, lambda k, value: f"{target(k)} = {value};", indent
        )
        self.counts[name] = count
        if not shared:
            lines = ["  int g;", "  for (g = 0; g < SL_G; g++) {", *lines, "  }"] if lines else []
        head = f"/* {count} operations a run */\nstatic inline void kernel_{name}({signature}) {{"
        return "\n".join([head, *lines, "}\n"])

    def _staged(self, name: str, binding: Binding, load: Callable[[int], str], signature: str) -> str:
        """The function of all values of a binding time, each with what it is as a comment."""
        nodes = list(self.values.slots[binding])
        shared = binding is Binding.UNIFORM
        element, indent = ("", "  ") if shared else ("[g]", "    ")

        def target(k: int) -> str:
            return f"/* {self._formula(nodes[k])} */\n{indent}{name}[{k}]{element}"

        return self._function(binding.name.lower(), signature, nodes, binding, target, load, shared=shared)

    def _complete(self, name: str, signature: str, results: Mapping[str, int]) -> str:
        """A function of the state for where a block does not hold, and for the end of a run."""
        targets = [f"{result}[{i}][g]" for result, count in results.items() for i in range(count)]
        arguments = f"{signature}, {_GIVEN},\n    {', '.join(f'sl_group *{result}' for result in results)}"
        text = self._function(name, arguments, self.values.wanted[name], Binding.STATE, targets.__getitem__)
        return text.replace("static inline", "SL_RARE")

    def _actuate(self) -> str:
        """What motors are driven by in a step, and what they remember then, for which m may be the place."""
        results = {"acting": len(self.graph.outputs["actuate"][0]), "ahead": self.program.size("m")}
        signature = "double step, const sl_group *arrived, const sl_group *m"
        return self._complete("actuate", signature, results).replace("SL_RARE", "static inline")

    def text(self) -> str:
        """All functions of the kernel but its steps."""
        n, states, outputs = self.program.system.n, self.program.size("x"), self.graph.outputs
        memory = self.program.size("z")
        now = "sl_time now, const sl_group *x"
        control = {"u": n, "e": n, "sigma": n, "wished": n, "a_law": n}
        measured, actuated = self.program.size("measured"), bool(self.program.size("commanded"))
        sampling = f"{now}, const sl_group *noise" if measured else now
        sample = control | ({"measured": measured} if measured else {}) | ({"ahead": memory} if memory else {})
        sampling += ", double period" if memory else ""
        differenced = self.program.system.structure.differenced
        sampled = measured or actuated or differenced  # whatever it is, it is of samples
        times = "double step, " * actuated + "double period, " * differenced
        begun = [*outputs["start"][0], *map(self.graph.constant, self.program.system.z_start)]
        at_time = f"double time, const double *data, {_GIVEN}"
        at_row = f"double time, const double *data, const sl_group *x, {_GIVEN}, sl_group *tip"

        def into(name: str) -> Callable[[int], str]:
            return lambda k: f"{name}[{k}][g]"

        def observed(k: int) -> str:
            return f"q1d[{k}][g]" if k < n else f"b[{k - n}][g]"

        parts = [
            "/* ---- once per run ---- */\n",
            self._staged("r", Binding.RUN, self._given, f"const sl_group *p, {times}sl_group *r"),
            self._function("start", f"{at_time}, sl_group *x", begun, Binding.STATE, into("x")),
            "/* ---- once per time: for all runs, then for each ---- */\n",
            self._staged(
                "uniform",
                Binding.UNIFORM,
                self._given_at_many_times,
                "const double *times, const double *data, sl_v *uniform",
            ),
            self._staged(
                "varying",
                Binding.VARYING,
                self._given_at_one_time,
                f"double time, const double *data, const double *uniform, {_GIVEN},\n    sl_group *varying",
            ),
            self._function(
                "signals",
                f"sl_time now, {_GIVEN}, sl_group *q1d, sl_group *b",
                self.values.observed,
                Binding.STATE,
                observed,
            ),
        ]
        if self.values.tip:
            parts.append(self._function("tip", at_row, self.values.tip, Binding.STATE, into("tip")))
        return "\n".join([
            *parts,
            "/* ---- at every evaluation, where a block does not hold ---- */\n",
            *([] if sampled else [self._complete("closed", now, {"dx": states + memory, **control})]),
            self._complete("control", sampling, sample),
            self._complete("error", now, {"e": n, "sigma": n}),
            self._complete("plant", f"{now}, const sl_group *u", {"dx": states}),
            *([self._actuate()] if actuated else []),
        ])  # fmt: skip


def emit(program: Program, baked: Mapping[str, float]) -> Emission:
    """Print the complete functions of a Program's kernel, which decide its bits.

    baked  slot key -> value of the parameters that become constants; the others are read per run
    Raises UnprintableOperation, naming the operation.
    """
    values = LoopValues(program, baked)
    emitter = _Emitter(values)
    text = f"{emitter.text()}\n{print_metrics(program.system)}"
    sizes = {
        "p": len(values.graph.tunable),
        "r": len(values.slots[Binding.RUN]),
        "uniform": len(values.slots[Binding.UNIFORM]),
        "varying": len(values.slots[Binding.VARYING]),
    }
    return Emission(text, sizes, values.graph.tunable, emitter.counts, values)
