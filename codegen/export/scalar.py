"""An export's functions as plain scalar C, double or float, printed from the value graph of the frozen Functions.

What CasADi's C computes, to the last bit (in double): equal values are computed once, what depends on parameters only
is computed when they are set, sin and cos of one angle become one call. The statements stay in the order of the frozen
lists, which keeps few values alive at a time: on a small processor that is what counts.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import casadi as ca

from springline.codegen.export.bound import Export, port_entries
from springline.codegen.program import (
    KEYWORDS,
    MASKS,
    POWERS,
    SPECIAL_POWERS,
    Binding,
    Node,
    Real,
    ValueGraph,
    formula,
    literal,
    print_operation,
)
from springline.model.control import LARGEST_EXPONENT, TINY
from springline.model.parameters import Slot

# Guards among the model's constants that a float cannot hold, and what does their duty there: 1e-24**(-4/3), the
# steepest power on the control's way, and exp(85) times a gain of 20 are still finite.
_SINGLE = {TINY: 1e-24, LARGEST_EXPONENT: 85.0}


class _SinglePrecision:
    """A Function whose own constants are such that floats can hold them; parameters are left alone."""

    def __init__(self, function: ca.Function) -> None:
        self._function = function

    def __getattr__(self, name: str) -> Any:
        return getattr(self._function, name)

    def instruction_constant(self, k: int) -> float:
        """The constant of instruction k."""
        value = float(self._function.instruction_constant(k))
        return _SINGLE.get(value, value)


# Of the formula of a constant that comes from several parameters: longer than that, nobody reads it, and those of a
# chain in space would fill megabytes. The symbols that it has tell more.
_LONGEST = 120


@dataclass(frozen=True, slots=True)
class _Constant:
    """A constant that comes from parameters.

    name     what it is called, "" where it comes from several
    text     what it is: unit and meaning, or a formula; "" where that would be too long
    symbols  of the parameters that it comes from, in their order
    """

    name: str
    text: str
    symbols: tuple[str, ...]

    @property
    def told(self) -> str:
        """What a reader of the C is told."""
        if self.text:
            return self.text
        shown = [symbol for k, symbol in enumerate(self.symbols) if len(", ".join(self.symbols[: k + 1])) <= _LONGEST]
        more = len(self.symbols) - len(shown)
        return f"from {', '.join(shown)}" + (f" and {more} more" if more else "")


class _Values(ValueGraph):
    """Value graph of an export: references, measurements, base motion and commands come from outside.

    constants  inputs that are numbers, by name
    """

    def __init__(self, export: Export, constants: Mapping[str, float]) -> None:
        super().__init__()
        self._single = export.real == "float"
        self.tunable = tuple(slot.key for slot in export.tunable_slots)
        column = {slot: k for k, slot in enumerate(export.tunable)}
        self.constants: dict[int, _Constant] = {}
        """Constants that come from parameters, by node."""
        self._places = {slot.symbol: i for i, slot in enumerate(export.slots)}
        self._known = {
            "p": [
                self.leaf("p", column[i], Binding.RUN, varies=True) if i in column else self._baked(slot, value)
                for i, (slot, value) in enumerate(zip(export.slots, export.values, strict=True))
            ],
        }
        self._known |= {name: [self.constant(value)] for name, value in constants.items()}
        if not export.tables:
            self._known["d"] = [self.constant(0.0)] * export.system.d.numel()

    def _baked(self, slot: Slot, value: float) -> int:
        """The constant of a parameter: one of its own, whatever else is equal to it."""
        node = self._intern(("baked", slot.key), Node(None, (), Binding.CONSTANT, value=value, source=("baked", 0)))
        self.constants[node] = _Constant(slot.symbol, f"{slot.unit}; {slot.meaning}", (slot.symbol,))
        return node

    def _folded(self, op: int, arguments: tuple[int, ...], value: float) -> int:
        if not any(i in self.constants for i in arguments):
            return super()._folded(op, arguments, value)
        node = self._intern(
            ("folded", op, arguments), Node(None, (), Binding.CONSTANT, value=value, source=("folded", 0))
        )
        if node not in self.constants:
            several = [self.constants[i] for i in arguments if i in self.constants]
            symbols = tuple(sorted({s for constant in several for s in constant.symbols}, key=self._places.__getitem__))
            formula = all(constant.text for constant in several) and _formula(op, [self._text(i) for i in arguments])
            self.constants[node] = _Constant("", formula if formula and len(formula) <= _LONGEST else "", symbols)
        return node

    def _text(self, i: int) -> str:
        """A constant in the formula of another."""
        if i in self.constants:
            name, text = self.constants[i].name, self.constants[i].text
        else:
            value = self.nodes[i].value
            short = f"{value:g}"
            name, text = short if float(short) == value else f"{value!r}", ""
        return name or (text if text.replace("_", "").isalnum() else f"({text})")

    def _operation(self, op: int, arguments: tuple[int, ...], origin: str) -> int:
        exponent = self.nodes[arguments[1]] if op in POWERS else None
        if exponent is not None and exponent.binding is Binding.CONSTANT and exponent.value in SPECIAL_POWERS:
            arguments = arguments[0], self.constant(exponent.value)  # one function, wherever its exponent comes from
        return super()._operation(op, arguments, origin)

    def apply(self, function: ca.Function, **given: list[int]) -> list[int]:
        """Add a Function; the nodes of all its outputs' entries. Inputs not given are leaves of their own names."""
        names = [function.name_in(i) for i in range(function.n_in())]
        known = self._known | given
        inputs = [
            known[name] if name in known else [self.leaf(name, k, Binding.STATE) for k in range(function.numel_in(i))]
            for i, name in enumerate(names)
        ]
        printed = cast(ca.Function, _SinglePrecision(function)) if self._single else function
        return [i for output in self.add(function.name(), printed, inputs) for i in output]


_SIGNS = {ca.OP_ADD: " + ", ca.OP_SUB: " - ", ca.OP_MUL: " ", ca.OP_DIV: " / "}


def _formula(op: int, texts: Sequence[str]) -> str:
    """An operation on constants, for a comment."""
    if op in _SIGNS:
        return _SIGNS[op].join(texts)
    if op == ca.OP_SQ:
        return f"{texts[0]}^2"
    return f"-{texts[0]}" if op == ca.OP_NEG else formula(op, texts)


# What the printed functions call their own: numbered values, sines and cosines, what they are given, their mathematics.
_OWN = re.compile(r"[acr]\d+|sin_\w+|cos_\w+|slf?_\w+")
_GIVEN = frozenset({
    *("controller", "reference", "measurement", "command", "diagnostics", "base", "state", "config", "parameters"),
    *("derived", "ahead", "motion", "step", "next", "x", "dx", "u", "z", "dz", "d", "t", "p", "noise"),
})  # fmt: skip


def _is_taken(label: str) -> bool:
    """Whether a name of the model's would be another one's in C; the value then has a number, as if it had no name."""
    return label in _GIVEN or label in KEYWORDS or _OWN.fullmatch(label) is not None


@dataclass(frozen=True, slots=True)
class Section:
    """A part of a function for its reader: what it is, and the nodes that it computes, by what they are called."""

    title: str
    names: tuple[tuple[int, str], ...]


@dataclass(frozen=True, slots=True)
class Body:
    """Statements of a function and what they cost.

    values      C of the outputs' entries, where `lines` have run
    operations  arithmetic operations and calls of elementary functions
    live        most values that are alive at once
    constants   names of the constants that `lines` begin with; a parameter's is its symbol
    """

    lines: tuple[str, ...]
    values: tuple[str, ...]
    operations: int
    live: int
    constants: frozenset[str]


class ScalarPrinter:
    """Prints Functions of an export as C statements; they share one value graph.

    functions  Functions of the System, each input named for what it is ("x", "q1d", …); p and d are the System's
    hoist      values that depend on parameters only are not computed by the functions but by `derive`
    constants  inputs that are numbers, by name
    """

    def __init__(
        self,
        export: Export,
        functions: Sequence[ca.Function],
        *,
        hoist: bool,
        constants: Mapping[str, float] | None = None,
    ) -> None:
        self._export = export
        self._real: Real = export.real
        self._math = "slf" if export.real == "float" else "sl"
        self._hoist = hoist
        self._graph = _Values(export, constants or {})
        beginning = {"t": [self._graph.constant(0.0)]}
        self._wanted = {
            function.name(): self._graph.apply(function, **(beginning if function.name() == "start" else {}))
            for function in functions
        }
        self._labels = {
            function.name(): [label for port in export.outputs(function) for label in port.labels]
            for function in functions
        }
        self._sections = {
            function.name(): self._explained(function.name())
            for function in functions
            if export.system.terms(function.name())
        }
        self._name_inputs()

    def _explained(self, name: str) -> list[Section]:
        """The parts of Function `name` that the model has words for, in its order."""
        system = self._export.system
        nodes = iter(self._graph.apply(system.function(f"{name}_terms")))
        joints = tuple(joint.name for joint in system.joints)
        found: dict[tuple[str, str], list[tuple[int, str]]] = {}
        for term in system.terms(name):
            found.setdefault(term.section, []).extend((next(nodes), label) for label in term.labels(joints))
        return [
            Section(f"{title}, {equations}" if equations else title, tuple(names))
            for (title, equations), names in found.items()
            if title
        ]

    def _name_inputs(self) -> None:
        entries = port_entries(self._export.system)
        self._names = {}
        for i, node in enumerate(self._graph.nodes):
            source, k = node.source
            if node.op is None and node.binding is not Binding.CONSTANT:
                is_p = source == "p"
                self._names[i] = self._export.tunable_slots[k].symbol if is_p else entries[source][k][0]

    def join(self, name: str, function: ca.Function) -> None:
        """Let Function `name` also compute the outputs of `function`, after its own."""
        self._wanted[name] += self._graph.apply(function)
        self._labels[name] += [label for port in self._export.outputs(function) for label in port.labels]
        self._name_inputs()

    def compose(self, name: str, port: str, function: ca.Function, quantity: str) -> None:
        """Let Function `name` also compute the scalar `function` of every entry of its output `port`.

        The results come after its own outputs, under the names that `quantity` has; what both compute is computed once.
        """
        labels = [label for label, _ in port_entries(self._export.system)[port]]
        places = [self._labels[name].index(label) for label in labels]
        [argument] = (function.name_in(i) for i in range(function.n_in()) if function.name_in(i) != "p")
        for place in places:
            self._wanted[name] += self._graph.apply(function, **{argument: [self._wanted[name][place]]})
        self._labels[name] += [label for label, _ in port_entries(self._export.system)[quantity]]

    @cached_property
    def _derived(self) -> dict[int, int]:
        """Place among the derived values of each node that depends on parameters only and is needed by a function."""
        places: dict[int, int] = {}
        if self._hoist:
            for wanted in self._wanted.values():
                for i in self._given(wanted):
                    if self._graph.nodes[i].op is not None:
                        places.setdefault(i, len(places))
        return places

    @property
    def derived(self) -> int:
        """How many values depend on parameters only, are no constants, and are needed by a function."""
        return len(self._derived)

    def reads(self, name: str) -> frozenset[tuple[str, int]]:
        """The inputs (name, entry) that Function `name` reads."""
        sources = (self._graph.nodes[i].source for i in self._given(self._wanted[name]))
        return frozenset(source for source in sources if source[0])

    def body(
        self, name: str, load: Callable[[str, int], str], targets: Sequence[str], defined: Sequence[str] = ()
    ) -> Body:
        """Function `name`; load(input, entry) is the C of an input ("derived" is one).

        targets  take its outputs, the first of them where there are more outputs than targets; "" takes none
        defined  symbols of baked parameters that are constants of the body whether it reads them or not
        """
        wanted, labels = self._wanted[name], self._labels[name]
        if "" in targets:
            taken = [k for k, target in enumerate(targets) if target]
            wanted, labels = [wanted[k] for k in taken], [labels[k] for k in taken]
            targets = [targets[k] for k in taken]
        sections = self._sections.get(name, ())
        return self._body(wanted, self._needed(wanted), load, targets, labels, sections=sections, defined=defined)

    def derive(self, load: Callable[[str, int], str], target: str) -> Body:
        """What `functions` expect under target[0], target[1], …"""
        wanted = list(self._derived)
        needed = self._graph.needed(wanted, Binding.RUN)
        targets = [f"{target}[{k}]" for k in range(len(wanted))]
        return self._body(wanted, needed, load, targets, [f"r{k}" for k in range(len(wanted))], deriving=True)

    def _is_input(self, i: int) -> bool:
        node = self._graph.nodes[i]
        return node.op is None and node.binding is not Binding.CONSTANT

    def _needed(self, wanted: Sequence[int]) -> list[int]:
        found = self._graph.needed(wanted, Binding.STATE)
        if self._hoist:
            return found
        arguments = [a for i in found for a in self._graph.nodes[i].arguments]
        return sorted({*found, *self._graph.needed([*wanted, *arguments], Binding.RUN)})

    def _given(self, wanted: Sequence[int]) -> list[int]:
        """Values that come from outside when `wanted` is computed."""
        needed = self._needed(wanted)
        used = {*wanted, *(a for i in needed for a in self._graph.nodes[i].arguments)} - set(needed)
        return sorted(i for i in used if self._graph.nodes[i].binding is not Binding.CONSTANT)

    def _body(
        self,
        wanted: Sequence[int],
        needed: Sequence[int],
        load: Callable[[str, int], str],
        targets: Sequence[str],
        labels: Sequence[str],
        *,
        deriving: bool = False,
        sections: Sequence[Section] = (),
        defined: Sequence[str] = (),
    ) -> Body:
        nodes = self._graph.nodes
        lines: list[str] = []
        ready: set[int] = set()
        places = self._parts(needed, sections)
        needed = sorted(needed, key=lambda i: places[i])  # stable: within a part the order of the frozen lists
        names = self._named(wanted, needed, labels, sections)
        constants: dict[int, str] = {}
        part = -1
        pairs = {(nodes[i].op, nodes[i].arguments[0]): i for i in needed if nodes[i].op in (ca.OP_SIN, ca.OP_COS)}

        def given(i: int) -> str:
            derived = not deriving and i in self._derived
            return load("derived", self._derived[i]) if derived else load(*nodes[i].source)

        def value(i: int) -> str:
            node = nodes[i]
            if node.binding is Binding.CONSTANT:
                if i not in self._graph.constants:
                    return literal(node.value, self._real)
                unnamed = sum(_OWN.fullmatch(name) is not None for name in constants.values())
                return constants.setdefault(i, self._graph.constants[i].name or names.get(i) or f"c{unnamed}")
            if i not in ready:
                ready.add(i)
                if given(i) != names[i]:
                    lines.append(f"const {self._real} {names[i]} = {given(i)};")
            return f"{self._math}_true({names[i]})" if is_mask(i) else names[i]

        def is_mask(i: int) -> bool:
            """Whether it is a truth value in C: one that depends on parameters only is kept as a number."""
            return nodes[i].op in MASKS and (deriving or i not in self._derived)

        def truth(i: int) -> str:
            text = value(i)
            return names[i] if is_mask(i) else f"({text} != {literal(0.0, self._real)})"

        for i in needed:
            node = nodes[i]
            if i in ready:
                continue
            if sections and places[i] != part:
                part = places[i]
                lines += ["", f"/* {sections[part].title} */"] if part < len(sections) else [""]
            if node.op in (ca.OP_SIN, ca.OP_COS) and len({(op, a) for op, a in pairs if a == node.arguments[0]}) == 2:
                sine, cosine = pairs[ca.OP_SIN, node.arguments[0]], pairs[ca.OP_COS, node.arguments[0]]
                argument = value(node.arguments[0])
                lines += [f"{self._real} {names[k]};" for k in (sine, cosine)]
                lines.append(f"{self._math}_sincos({argument}, &{names[sine]}, &{names[cosine]});")
                ready |= {sine, cosine}
                continue
            text = self._expression(i, value, truth)
            kind = "int" if node.op in MASKS else self._real
            lines.append(f"const {kind} {names[i]} = {text};")
            ready.add(i)
        for i, constant in self._graph.constants.items():
            if constant.name in defined:
                value(i)
        # What is only handed on needs no name.
        values = [given(i) if self._is_input(i) and i not in ready else value(i) for i in wanted]
        lines += [""] if sections else []
        lines += [f"{target} = {text};" for target, text in zip(targets, values[: len(targets)], strict=True)]
        lines = [*self._constant_lines(constants), *lines]
        live = self._live(wanted, needed)
        return Body(tuple(lines), tuple(values), len(needed), live, frozenset(constants.values()))

    def _constant_lines(self, used: Mapping[int, str]) -> list[str]:
        """Definitions of the constants that come from parameters, each with what it is; parameters first."""
        known = self._graph.constants
        nodes = sorted(used, key=lambda i: (not known[i].name, i if known[i].name else 0))
        values = [literal(self._graph.nodes[i].value, self._real) for i in nodes]
        texts = [f"const {self._real} {used[i]} = {value};" for i, value in zip(nodes, values, strict=True)]
        width = max(map(len, texts), default=0)
        return [f"{text:{width}} /* {known[i].told} */" for text, i in zip(texts, nodes, strict=True)]

    def _parts(self, needed: Sequence[int], sections: Sequence[Section]) -> dict[int, int]:
        """In which section each node is computed: in the first that needs it; what none needs comes last."""
        places = dict.fromkeys(needed, len(sections))
        for part, section in enumerate(sections):
            stack = [i for i, _ in section.names]
            while stack:
                i = stack.pop()
                if places.get(i) == len(sections):
                    places[i] = part
                    stack.extend(self._graph.nodes[i].arguments)
        return places

    def _named(
        self, wanted: Sequence[int], needed: Sequence[int], labels: Sequence[str], sections: Sequence[Section]
    ) -> dict[int, str]:
        """What each value is called: by the model where it has a word for it, else a0, a1, … in order.

        So is a constant that comes from several parameters; the others have names of their own.
        """
        nodes = self._graph.nodes
        names = dict(self._names)
        for i, label in zip(wanted, labels, strict=True):
            names.setdefault(i, label)
        taken = {*names.values(), *(constant.name for constant in self._graph.constants.values() if constant.name)}
        for i, label in (pair for section in sections for pair in section.names):
            if label not in taken and not _is_taken(label) and names.setdefault(i, label) == label:
                taken.add(label)
        for i, k in self._derived.items():
            names.setdefault(i, f"r{k}")
        for position, i in enumerate(needed):
            if nodes[i].op in (ca.OP_SIN, ca.OP_COS) and nodes[i].arguments[0] in self._names:
                function = "sin" if nodes[i].op == ca.OP_SIN else "cos"
                names.setdefault(i, f"{function}_{names[nodes[i].arguments[0]]}")
            names.setdefault(i, f"a{position}")
        return names

    def _live(self, wanted: Sequence[int], needed: Sequence[int]) -> int:
        """Most values alive at once when each is computed in order and outputs are kept to the end."""
        last = {a: position for position, i in enumerate(needed) for a in self._graph.nodes[i].arguments}
        last |= dict.fromkeys(wanted, len(needed))
        alive: set[int] = set()
        most = 0
        for position, i in enumerate(needed):
            alive |= {i, *(a for a in self._graph.nodes[i].arguments if self._graph.nodes[a].op is not None)}
            most = max(most, len(alive))
            alive = {k for k in alive if last.get(k, -1) > position}
        return most

    def _expression(self, i: int, value: Callable[[int], str], truth: Callable[[int], str]) -> str:
        node = self._graph.nodes[i]
        assert node.op is not None
        exponent: float | None = None
        if node.op in POWERS and self._graph.nodes[node.arguments[1]].binding is Binding.CONSTANT:
            exponent = self._graph.nodes[node.arguments[1]].value
        return print_operation(
            node.op,
            node.arguments,
            library=self._math,
            value=value,
            truth=truth,
            constant=lambda number: literal(number, self._real),
            exponent=exponent,
            call=lambda name, operands: f"{self._math}_{name}({', '.join(operands)})",
            origin=node.origin,
        )
