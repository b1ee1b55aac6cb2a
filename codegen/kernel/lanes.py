"""The lane emitter: a Program printed as C on vectors, one run per lane, several vectors at once.

Works on the value graph of the frozen Functions, so it computes what CasADi's C computes, bit for bit. What it adds is
where and in which order: parameter-only values once per run, time-only values once for all runs, the rest in an order
that starts long chains first and puts the same operation of both joints and of all groups side by side, so that the
processor always has something independent to do.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import casadi as ca

from springline.codegen.kernel.blocks import Block, Translator, printed, tableau_step
from springline.codegen.kernel.order import longest_chain_first
from springline.codegen.kernel.schedule import scheduled
from springline.codegen.program import (
    KEYWORDS,
    MASKS,
    POWERS,
    SPECIAL_POWERS,
    Binding,
    LoopGraph,
    Program,
    formula,
    kept_slopes,
    literal,
    print_operation,
)
from springline.model.quantities import entries

# Functions with rare cases outside their fast path; slv_<name>_fast(x, &ok) clears ok where that does not hold.
_FAST = frozenset({
    "exp", "expm1", "log", "log1p", "sin", "cos", "sincos", "tan", "hypot", "pow",
    *(f"pow_{power}" for power in ("p1_3", "m1_3", "p2_3", "m2_3", "p1_2", "m1_2", "p3_2")),
})  # fmt: skip


_FORMULA_DEPTH = 4

# What the printed functions call their own: numbered values, sines and cosines, masks, arguments, their mathematics.
_OWN = re.compile(r"[adrsv]\d+|(begin|first)\d+|sin_\w+|cos_\w+|(sl|slv|kernel)_\w+|ok(_\d+)?")
_GIVEN = frozenset({
    *("now", "x", "p", "r", "u", "g", "t", "b", "dx", "q1d", "e", "sigma", "wished", "a_law", "ahead", "period"),
    *("time", "times", "data", "uniform", "varying"),
})  # fmt: skip

Load = Callable[[int, str], str]
Store = Callable[[int, str, str], str]


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


class _Emitter:
    def __init__(self, program: Program, baked: Mapping[str, float], groups: int) -> None:
        self.program = program
        self.graph = LoopGraph(program, baked)
        self.groups = groups
        self.speculate = not baked
        self.defaults = [slot.default for slot in program.system.slots]
        self.slots: dict[Binding, dict[int, int]] = {
            Binding.RUN: {},
            Binding.UNIFORM: {},
            Binding.VARYING: {},
        }
        self.names = self._names()
        self.counts: dict[str, int] = {}
        outputs = self.graph.outputs
        # Later functions are visited first: they decide which earlier values are kept.
        dz, ahead = ([*outputs["rates"][0]], [*outputs["update"][0]]) if program.size("z") else ([], [])
        self.state_functions = {
            "closed": [*outputs["closed"][0], *dz, *(i for part in outputs["control"] for i in part)],
            "control": [*(i for part in outputs["control"] for i in part), *ahead],
            "error": [i for part in outputs["error"] for i in part],
            "plant": list(outputs["plant"][0]),
        }
        n = program.system.n
        w = outputs["signals"][0]
        self.observed = [*w[:n], *w[3 * n : 3 * n + program.system.base.b.numel()]]
        self.observed += w[len(w) - len(entries(program.system.forces, program.system.joints)) :]
        self.tip = outputs["tip"][0] if "tip" in outputs else []
        for wanted in (*self.state_functions.values(), self.observed, outputs["start"][0], self.tip):
            self._keep(wanted, Binding.STATE)
        self._keep(list(self.slots[Binding.VARYING]), Binding.VARYING)
        self._keep(list(self.slots[Binding.UNIFORM]), Binding.UNIFORM)
        for binding, letter in ((Binding.RUN, "r"), (Binding.UNIFORM, "s"), (Binding.VARYING, "v")):
            for i, k in self.slots[binding].items():
                self.names.setdefault(i, f"{letter}{k}")

    def _names(self) -> dict[int, str]:
        """Names of the model for inputs, outputs and signals; everything else is numbered."""
        system, outputs = self.program.system, self.graph.outputs
        names: dict[int, str] = {}
        joints = [joint.name for joint in system.joints]
        states = [entry.name for entry in entries(system.drive.state, system.joints)]

        def name(nodes: Sequence[int], labels: Sequence[str]) -> None:
            for i, label in zip(nodes, labels, strict=True):
                if self.graph.nodes[i].binding is not Binding.CONSTANT:
                    names.setdefault(i, label)

        base = [c.symbol for c in system.structure.base_coordinates]
        symbols = {slot.key: slot.symbol for slot in system.slots}
        for i, node in enumerate(self.graph.nodes):
            kind, k = node.source
            if node.op is None and kind == "x":
                names[i] = states[k]
            elif node.op is None and kind == "z":
                names[i] = system.memory[k].name
            elif node.op is None and kind == "u":
                names[i] = f"u_{joints[k]}"
            elif node.op is None and kind == "p":
                names[i] = symbols[self.graph.tunable[k]]
            elif node.op is None and kind == "t":
                names[i] = "t"
            elif node.op is None and kind == "d":
                names[i] = f"d{k}"
            elif node.op is None and kind in ("begin", "first"):
                names[i] = f"{kind}{k}"
        signal = [f"{q}_{j}" for q in ("q1d", "dq1d", "ddq1d") for j in joints]
        signal += [f"{d}{c}" for d in ("", "d_", "dd_") for c in base]
        name(outputs["signals"][0], signal + [entry.name for entry in entries(system.forces, system.joints)])
        for part, label in zip(outputs["control"], ("command", "e", "sigma", "wished", "a_law"), strict=True):
            name(part, [f"{label}_{j}" for j in joints])
        self._name_parts(names)
        return names

    def _name_parts(self, names: dict[int, str]) -> None:
        """Add what the model calls the parts of its formulas, as far as nothing else is called so."""
        labels, taken = self.graph.labels, set(names.values())
        for i, label in (*labels["control"], *labels["plant"]):
            own = label in _GIVEN or label in KEYWORDS or _OWN.fullmatch(label) is not None
            if own or label in taken or self.graph.nodes[i].binding is Binding.CONSTANT:
                continue
            if names.setdefault(i, label) == label:
                taken.add(label)
        # The same of another command: a function has the one or the other.
        for (i, label), (k, _) in zip(labels["plant"], labels["closed"], strict=True):
            if names.get(i) == label and self.graph.nodes[k].binding is not Binding.CONSTANT:
                names.setdefault(k, label)

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

    # -- expressions ------------------------------------------------------------------------------------------

    def _label(self, i: int, suffix: str) -> str:
        return self.names.get(i, f"a{i}") + suffix

    def _formula(self, i: int, depth: int = 0) -> str:
        """What a staged value is, in the model's names, for a comment; other staged values stand by their own."""
        node = self.graph.nodes[i]
        if node.binding is Binding.CONSTANT:
            return f"{node.value:.6g}"
        if node.op is None or (depth and (i in self.names or depth > _FORMULA_DEPTH)):
            return self.names.get(i, "...")
        parts = [self._formula(a, depth + 1) for a in node.arguments]
        return formula(node.op, parts)

    def _assumed_power(self, exponent: int) -> float | None:
        """The special exponent that a run-time exponent has at the parameters' default values, if it has one."""
        if not self.speculate or self.graph.nodes[exponent].binding is not Binding.RUN:
            return None
        value = self.graph.value_at(exponent, self.defaults)
        return value if value in SPECIAL_POWERS else None

    def _call(self, name: str, arguments: Sequence[str], ok: str | None) -> str:
        if ok is not None and name in _FAST:
            return f"slv_{name}_fast({', '.join([*arguments, f'&{ok}'])})"
        return f"slv_{name}({', '.join(arguments)})"

    def _expression(self, i: int, ref: Callable[[int], str], mask: Callable[[int], str], ok: str | None) -> str:
        """C expression of an operation; with `ok`, fast paths that clear it in the lanes where they do not hold."""
        node = self.graph.nodes[i]
        assert node.op is not None
        exponent: float | None = None
        if node.op in POWERS:
            power = self.graph.nodes[node.arguments[1]]
            exponent = power.value if power.binding is Binding.CONSTANT else None
            if ok is not None and exponent not in SPECIAL_POWERS:
                exponent = self._assumed_power(node.arguments[1])
        return print_operation(
            node.op,
            node.arguments,
            library="slv",
            value=ref,
            truth=mask,
            constant=lambda number: f"slv_set({literal(number)})",
            exponent=exponent,
            call=lambda name, operands: self._call(name, operands, ok),
            origin=node.origin,
        )

    def _body(
        self,
        wanted: Sequence[int],
        binding: Binding,
        load: Load,
        store: Store,
        groups: Sequence[str],
        indent: str,
        fast: bool = False,
        at_once: Sequence[int] = (),
    ) -> tuple[list[str], int]:
        """Statements that compute `wanted` and store them, and how many operations that takes per run.

        load    (node, group) -> C expression of a value that is given
        store   (position in wanted, value, group) -> a statement
        groups  C expressions of the group index that each statement is printed for, side by side
        fast    fast paths only; the masks ok, ok_0, ... tell where they hold
        at_once  positions in wanted that are stored as soon as they are computed, so that no register keeps them
        """
        nodes = self.graph.nodes
        order = longest_chain_first(nodes, self.graph.needed(wanted, binding))
        suffixes = [f"_{g}" if len(groups) > 1 else "" for g in groups]
        computed = set(order)
        present: set[int] = set()
        tested: set[int] = set()
        lines: list[str] = []
        waiting: dict[int, list[int]] = {}
        for position in at_once:
            waiting.setdefault(wanted[position], []).append(position)
        stored: set[int] = set()

        def store_all(positions: Sequence[int]) -> None:
            for position in positions:
                value = partial(reference, wanted[position])
                lines.extend(indent + store(position, value(s), g) for s, g in zip(suffixes, groups, strict=True))
            stored.update(positions)

        def reference(i: int, suffix: str) -> str:
            node = nodes[i]
            if node.binding is Binding.CONSTANT:
                return f"slv_set({literal(node.value)})"
            label = self._label(i, suffix)
            return f"slv_true({label})" if node.op in MASKS and i in computed else label

        def mask(i: int, suffix: str) -> str:
            if nodes[i].op in MASKS and i in computed:
                return self._label(i, suffix)
            return f"({reference(i, suffix)} != slv_set(0.0))"

        def fetch(i: int) -> None:
            if i in computed or i in present or nodes[i].binding is Binding.CONSTANT:
                return
            present.add(i)
            lines.extend(
                f"{indent}const sl_v {self._label(i, s)} = {load(i, g)};" for s, g in zip(suffixes, groups, strict=True)
            )

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
                    if angle in self.names:
                        self.names.setdefault(k, f"{function}_{self.names[angle]}")
                for s in suffixes:
                    sine, cosine = (self._label(k, s) for k in pair)
                    lines.append(f"{indent}sl_v {sine}, {cosine};")
                    call = self._call(
                        "sincos", [reference(angle, s), f"&{sine}", f"&{cosine}"], f"ok{s}" if fast else None
                    )
                    lines.append(f"{indent}{call};")
                present.update(pair)
                continue
            if fast and op in POWERS:
                assumed = self._assumed_power(arguments[1])
                if assumed is not None and arguments[1] not in tested:
                    tested.add(arguments[1])
                    lines.extend(
                        f"{indent}ok{s} = ok{s} & ({reference(arguments[1], s)} == slv_set({literal(assumed)}));"
                        for s in suffixes
                    )
            kind = "sl_m" if op in MASKS else "sl_v"
            for s in suffixes:
                ok = f"ok{s}" if fast else None
                expression = self._expression(i, partial(reference, suffix=s), partial(mask, suffix=s), ok)
                lines.append(f"{indent}const {kind} {self._label(i, s)} = {expression};")
            present.add(i)
            store_all(waiting.get(i, ()))
        for i in wanted:
            fetch(i)
        store_all([position for position in range(len(wanted)) if position not in stored])
        return lines, len(order)

    # -- functions --------------------------------------------------------------------------------------------

    def _given(self, i: int, group: str) -> str:
        """C expression of an input, or of a value from an earlier binding time, for a group of runs."""
        node = self.graph.nodes[i]
        name, k = node.source
        if name in ("p", "x", "u"):
            return f"{name}[{k}][{group}]"
        if name == "z":  # behind the plant's state
            return f"x[{self.program.size('x') + k}][{group}]"
        if name == "h":
            return "slv_set(period)"
        if name in ("begin", "first"):
            return "slv_set(time)" if name == "begin" else f"slv_set(data[{k}])"
        if node.binding is Binding.RUN:
            return f"r[{self.slots[Binding.RUN][i]}][{group}]"
        if node.binding is Binding.UNIFORM:
            return f"slv_set(now.uniform[{self.slots[Binding.UNIFORM][i]} * SL_W])"
        return f"now.varying[{self.slots[Binding.VARYING][i]}][{group}]"

    def _given_at_one_time(self, i: int, group: str) -> str:
        """As `_given`, in the function that computes what varies from run to run at one time t."""
        node = self.graph.nodes[i]
        name, k = node.source
        if name in ("t", "d"):
            return "slv_set(time)" if name == "t" else f"slv_set(data[{k}])"
        if node.binding is Binding.UNIFORM:
            return f"slv_set(uniform[{self.slots[Binding.UNIFORM][i]} * SL_W])"
        return self._given(i, group)

    def _given_at_many_times(self, i: int, _group: str) -> str:
        """As `_given`, in the function that computes what all runs share, at SL_W times in one vector."""
        name, k = self.graph.nodes[i].source
        return "slv_load(times)" if name == "t" else f"slv_load(data + {k} * SL_W)"

    def _staged(self, name: str, binding: Binding) -> Callable[[int, str], str]:
        """Where a staged value is kept, with what it is as a comment."""
        nodes = list(self.slots[binding])
        indent = "    " if binding is not Binding.UNIFORM else "  "
        return lambda k, g: f"/* {self._formula(nodes[k])} */\n{indent}{name}[{k}]" + (f"[{g}]" if g else "")

    def _function(
        self,
        name: str,
        signature: str,
        wanted: Sequence[int],
        binding: Binding,
        target: Callable[[int, str], str],
        load: Load,
        groups: Sequence[str],
    ) -> str:
        """One C function; with groups ["g"] its body is a loop over the groups of a pack."""
        looped = list(groups) == ["g"]
        lines, count = self._body(
            wanted, binding, load, lambda k, value, g: f"{target(k, g)} = {value};", groups, "    " if looped else "  "
        )
        self.counts[name] = count
        if looped:
            lines = ["  int g;", "  for (g = 0; g < SL_G; g++) {", *lines, "  }"] if lines else []
        head = f"/* {count} operations a run */\nstatic inline void kernel_{name}({signature}) {{"
        return "\n".join([head, *lines, "}\n"])

    def text(self) -> str:
        """All functions of the kernel."""
        n, states, outputs = self.program.system.n, self.program.size("x"), self.graph.outputs
        run, uniform, varying = (list(self.slots[b]) for b in (Binding.RUN, Binding.UNIFORM, Binding.VARYING))
        given = "const sl_group *p, const sl_group *r"
        now = "sl_time now, const sl_group *x"
        memory = self.program.size("z")
        control = {"u": n, "e": n, "sigma": n, "wished": n, "a_law": n}
        sampling, sample = (f"{now}, double period", control | {"ahead": memory}) if memory else (now, control)
        begun = [*outputs["start"][0], *map(self.graph.constant, self.program.system.z_start)]

        def into(name: str) -> Callable[[int, str], str]:
            return lambda k, g: f"{name}[{k}][{g}]"

        def state(name: str, signature: str, results: Mapping[str, int]) -> str:
            """The complete function, for where a block does not hold, and for the end of a run."""
            targets = [f"{result}[{i}]" for result, count in results.items() for i in range(count)]
            arguments = f"{signature}, {given},\n    {', '.join(f'sl_group *{result}' for result in results)}"
            printed = self._function(
                name, arguments, self.state_functions[name], Binding.STATE, lambda k, g: f"{targets[k]}[{g}]",
                self._given, ["g"],
            )
            return printed.replace("static inline", "SL_RARE")

        at_row = f"double time, const double *data, const sl_group *x, {given}, sl_group *tip"
        tip = (
            [self._function("tip", at_row, self.tip, Binding.STATE, into("tip"), self._given, ["g"])]
            if self.tip
            else []
        )
        return "\n".join(
            [
                "/* ---- once per run ---- */\n",
                self._function(
                    "run",
                    "const sl_group *p, sl_group *r",
                    run,
                    Binding.RUN,
                    self._staged("r", Binding.RUN),
                    self._given,
                    ["g"],
                ),
                self._function(
                    "start",
                    f"double time, const double *data, {given}, sl_group *x",
                    begun,
                    Binding.STATE,
                    into("x"),
                    self._given,
                    ["g"],
                ),
                "/* ---- once per time: for all runs, then for each ---- */\n",
                self._function(
                    "uniform",
                    "const double *times, const double *data, sl_v *uniform",
                    uniform,
                    Binding.UNIFORM,
                    self._staged("uniform", Binding.UNIFORM),
                    self._given_at_many_times,
                    [""],
                ),
                self._function(
                    "varying",
                    f"double time, const double *data, const double *uniform, {given},\n    sl_group *varying",
                    varying,
                    Binding.VARYING,
                    self._staged("varying", Binding.VARYING),
                    self._given_at_one_time,
                    ["g"],
                ),
                self._function(
                    "signals",
                    f"sl_time now, {given}, sl_group *q1d, sl_group *b",
                    self.observed,
                    Binding.STATE,
                    lambda k, g: f"q1d[{k}][{g}]" if k < n else f"b[{k - n}][{g}]",
                    self._given,
                    ["g"],
                ),
                *tip,
                "/* ---- at every evaluation ---- */\n",
                state("closed", now, {"dx": states + memory, **control}),
                state("control", sampling, sample),
                state("error", now, {"e": n, "sigma": n}),
                state("plant", f"{now}, const sl_group *u", {"dx": states}),
                *self._blocks(),
            ]
        )

    # -- blocks -----------------------------------------------------------------------------------------------

    def _blocks(self) -> list[str]:
        """The functions that take packs through a step, block by block, and the table of them."""
        tableau = self.program.system.tableau
        every = range(tableau.stages)
        spans = [list(every)] if self.span == "step" else [[k] for k in every]
        factors: dict[float, int] = {}
        variants = ("sample", "held") if self.sampled else ("closed",)
        functions = []
        for number, stages in enumerate(spans):
            for variant in variants if number == 0 else variants[:1]:
                functions.append(self._block(f"{variant}_{number}", variant, stages, factors))
        names = [f"kernel_{variants[0]}_{number}" for number in range(len(spans))]
        text = [
            f"enum {{ SL_BLOCKS = {len(spans)}, SL_PER_BLOCK = {len(spans[0])}, SL_GAINS = {len(factors)} }};",
            f"static const double sl_gain[SL_GAINS] = {{{', '.join(map(literal, factors))}}};",
            *functions,
            f"static const sl_block sl_blocks[SL_BLOCKS] = {{{', '.join(names)}}};",
        ]
        if self.sampled:
            text.append("static const sl_block sl_held = kernel_held_0;")
        return text

    def _block(self, name: str, variant: str, stages: Sequence[int], factors: dict[float, int]) -> str:
        program, system, outputs = self.program, self.program.system, self.graph.outputs
        n, plant, memory = system.n, program.size("x"), program.size("z")
        block = Block()

        def load(i: int, instant: int) -> str:
            node = self.graph.nodes[i]
            source, k = node.source
            if source in ("p", "u"):
                return f"{source}[{k}][@]"
            if source == "z":  # sampled: held, so only ever those at the beginning of the step
                return f"x[{plant + k}][@]"
            if source == "x":
                return f"x[{k}][@]"
            if source == "h":
                return "slv_set(period)"
            if node.binding is Binding.RUN:
                return f"r[{self.slots[Binding.RUN][i]}][@]"
            if node.binding is Binding.UNIFORM:
                return f"slv_set(times[{instant}].uniform[{self.slots[Binding.UNIFORM][i]} * SL_W])"
            return f"times[{instant}].varying[{self.slots[Binding.VARYING][i]}][@]"

        translator = Translator(block, self.graph, load, self._assumed_power, {})
        kept = kept_slopes(system.tableau)
        command: list[int] = [block.load(f"u[{k}][@]") for k in range(n)] if self.sampled else []

        def store_all(targets: Mapping[str, Sequence[int]]) -> None:
            for vector, places in targets.items():
                block.stores += [(f"{vector}[{k}][@]", place) for k, place in enumerate(places)]

        def slope(stage: int, at: Sequence[int]) -> Sequence[int]:
            nonlocal command
            where = {("x", k): at[k] for k in range(plant)} | {("z", k): at[plant + k] for k in range(len(at) - plant)}
            when = system.tableau.when[stage]
            shown = ("u", "e", "sigma", "wished", "a_law")
            if not self.sampled:
                dx = self.state_functions["closed"]
                places = translator.stage(dx if stage == 0 else dx[: len(at)], where, when)
                if stage == 0:
                    rest = places[len(at) :]
                    store_all({q: rest[k * n : (k + 1) * n] for k, q in enumerate(shown)})
                return places[: len(at)]
            if stage == 0:
                sample = variant == "sample"
                wanted = self.state_functions["control" if sample else "error"]
                places = translator.stage(wanted, where, when)
                names = shown if sample else ("e", "sigma")
                store_all({q: places[k * n : (k + 1) * n] for k, q in enumerate(names)})
                if sample:
                    command = places[:n]
                    block.stores += [(f"next[{plant + k}][@]", p) for k, p in enumerate(places[5 * n :])]
                else:
                    block.stores += [(f"next[{plant + k}][@]", block.load(f"x[{plant + k}][@]")) for k in range(memory)]
            given = where | {("u", k): command[k] for k in range(n)}
            return translator.stage(list(outputs["plant"][0]), given, when)

        def vector(what: str, i: int) -> str:
            if what.startswith("slope_"):
                return f"kept[{kept.index(int(what.removeprefix('slope_')))}][{i}][@]"
            return f"{what}[{i}][@]"

        tableau_step(
            block,
            system.tableau,
            stages,
            plant + (0 if self.sampled else memory),
            load=lambda what, i: block.load(vector({"at": "from"}.get(what, what), i)),
            slope=slope,
            gain=lambda factor: block.load(f"gains[{factors.setdefault(factor, len(factors))}]"),
            store=lambda what, i, place: block.stores.append((vector(what, i), place)),
        )
        order = scheduled(block, self.most)
        self.counts[name] = len(order.places)
        lines = printed(block, order.places, self.groups, "  ")
        masks = [f"ok_{g}" if self.groups > 1 else "ok" for g in range(self.groups)]
        return "\n".join(
            [
                f"/* {self.counts[name]} operations a run, {order.alive} values at once */",
                f"SL_BLOCK_FUNCTION int kernel_{name}(SL_BLOCK_ARGUMENTS) {{",
                *(f"  sl_m {mask} = slv_yes();" for mask in masks),
                *lines,
                f"  return slv_all({' & '.join(masks)});",
                "}\n",
            ]
        )


def emit(
    program: Program, baked: Mapping[str, float], groups: int, *, sampled: bool, span: str = "stage", most: int = 12
) -> Emission:
    """Print the kernel of a Program.

    baked   slot key -> value of the parameters that become constants; the others are read per run
    groups  vectors that each statement is printed for
    Raises UnprintableOperation, naming the operation.
    """
    emitter = _Emitter(program, baked, groups)
    emitter.sampled, emitter.span, emitter.most = sampled, span, most
    text = emitter.text()
    sizes = {
        "p": len(emitter.graph.tunable),
        "r": len(emitter.slots[Binding.RUN]),
        "uniform": len(emitter.slots[Binding.UNIFORM]),
        "varying": len(emitter.slots[Binding.VARYING]),
    }
    return Emission(text, sizes, emitter.graph.tunable, emitter.counts)
