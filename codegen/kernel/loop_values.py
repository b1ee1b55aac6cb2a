"""The values of a loop by binding time: when each is computed, what later functions are given, what it is called."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from springline.codegen.program import KEYWORDS, SPECIAL_POWERS, Binding, LoopGraph, Program
from springline.model.quantities import entries

# What the printed functions call their own: numbered values, sines and cosines, masks, arguments, their mathematics.
_OWN = re.compile(r"[adrsv]\d+(_\d+)?|(begin|first)\d+|sin_\w+|cos_\w+|(sl|slv|kernel)_\w+|ok(_\d+)?")
_GIVEN = frozenset({
    *("now", "x", "p", "r", "u", "g", "t", "b", "dx", "q1d", "e", "sigma", "wished", "a_law", "ahead", "period"),
    *("time", "times", "data", "noise", "measured", "acting", "arrived", "m", "step", "uniform", "varying", "from"),
    *("next", "at", "kept", "gains"),
})  # fmt: skip


class LoopValues:
    """The values of a loop.

    graph     all of them
    slots     of a binding time, the values that later functions are given, and under which number
    names     what the model calls a value, or a number
    wanted    what the functions of the state compute: closed, control, error, plant
    observed  what rows show of the signals;  tip: of the arm's tip
    """

    def __init__(self, program: Program, baked: Mapping[str, float]) -> None:
        self.program = program
        self.graph = LoopGraph(program, baked)
        self._speculate = not baked
        self._defaults = [slot.default for slot in program.system.slots]
        self.slots: dict[Binding, dict[int, int]] = {
            Binding.RUN: {},
            Binding.UNIFORM: {},
            Binding.VARYING: {},
        }
        self.names = self._names()
        outputs = self.graph.outputs
        # Later functions are visited first: they decide which earlier values are kept.
        dz, ahead = ([i for part in outputs.get(name, ()) for i in part] for name in ("rates", "update"))
        self.wanted = {
            "closed": [*outputs["closed"][0], *dz, *(i for part in outputs["control"] for i in part)],
            "control": [*(i for part in outputs["control"] for i in part), *ahead],
            "error": [i for part in outputs["error"] for i in part],
            "plant": list(outputs["plant"][0]),
        }
        if "actuate" in outputs:
            self.wanted["actuate"] = [i for part in outputs["actuate"] for i in part]
        n = program.system.n
        w = outputs["signals"][0]
        self.observed = [*w[:n], *w[3 * n : 3 * n + program.system.base.b.numel()]]
        self.observed += w[len(w) - len(entries(program.system.forces, program.system.joints)) :]
        self.tip = outputs["tip"][0] if "tip" in outputs else []
        for wanted in (*self.wanted.values(), self.observed, outputs["start"][0], self.tip):
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
            elif node.op is None and kind == "noise":
                names[i] = f"noise_{states[k]}"
            elif node.op is None and kind == "step":
                names[i] = "whole_step"
            elif node.op is None and kind == "arrived":
                names[i] = f"arrived_{joints[k]}"
            elif node.op is None and kind == "m":
                names[i] = f"last_{system.actuators[k // len(joints)]}_{joints[k % len(joints)]}"
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
        for part, label in zip(outputs["control"][:5], ("command", "e", "sigma", "wished", "a_law"), strict=True):
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

    def given(self, wanted: Sequence[int], binding: Binding) -> list[tuple[Binding, int]]:
        """The values of earlier binding times that a function which computes `wanted` has to be given."""
        nodes, found = self.graph.nodes, []
        inside = self.graph.needed(wanted, binding)
        for i in sorted({a for k in inside for a in nodes[k].arguments} | set(wanted)):
            node = nodes[i]
            if node.op is not None and node.binding in self.slots and not self.graph.computed_at(node, binding):
                found.append((node.binding, i))
            elif node.op is None and node.source[0] in ("t", "d") and binding is Binding.STATE:
                found.append((Binding.UNIFORM, i))
        return found

    def _keep(self, wanted: Sequence[int], binding: Binding) -> None:
        for earlier, i in self.given(wanted, binding):
            self.slots[earlier].setdefault(i, len(self.slots[earlier]))

    def assumed_power(self, exponent: int) -> float | None:
        """The special exponent that a run-time exponent has at the parameters' default values, if it has one."""
        if not self._speculate or self.graph.nodes[exponent].binding is not Binding.RUN:
            return None
        value = self.graph.value_at(exponent, self._defaults)
        return value if value in SPECIAL_POWERS else None
