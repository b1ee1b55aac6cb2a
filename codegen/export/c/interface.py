"""The typed C interface of an export: what its structures hold and how its functions compute."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from springline.codegen.export import Body, Export, ScalarPrinter, port_entries
from springline.codegen.program import Real, constant_expression, literal, scalar_slopes, scalar_stages
from springline.model.parameters import Bounds
from springline.model.quantities import A_LIMITED, BASE, REFERENCE, SATURATED, E, Quantity, U, entries

STATUS = (
    ("OK", "done"),
    ("NULL_ARGUMENT", "a pointer was NULL that may not be: pass the structures that springline.h names"),
    ("NOT_INITIALIZED", "the controller is not ready: call springline_init first and check what it returns"),
    ("BAD_FALLBACK", "config.fallback is neither SPRINGLINE_FALLBACK_ZERO nor SPRINGLINE_FALLBACK_LAST: set it"),
    ("BAD_PARAMETER", "a parameter is out of its range (springline.h): correct it and pass the configuration again"),
    ("BAD_REFERENCE", "a reference is not a finite number: check the trajectory generator; the fallback is commanded"),
    ("BAD_MEASUREMENT", "a measurement is not a finite number: check the sensors; the fallback is commanded"),
    ("OVERFLOW", "the law left the finite numbers: check its gains and the reference; the fallback is commanded"),
    ("BAD_PLANT_INPUT", "state, command, base motion or step not finite, or step not positive: the state was kept"),
    ("DIVERGED", "the plant left the finite numbers: take a smaller step or check the commands; the state was kept"),
    ("BAD_TIME", "the time is not a finite number: correct it"),
)
"""Statuses in the order of their values: name, and what happened and what to do about it."""

_LINE = 120  # characters
_MATH_STACK = 160  # bytes below the deepest elementary function, as measured on Cortex-M7

_MEMORY = "controller->z."

# Placeholders of what is there only for a controller that has states.
_OF_MEMORY = (
    "memory_struct",
    "controller_memory",
    "initial_memory",
    "forget",
    "ahead_parameter",
    "ahead_checked",
    "ahead_local",
    "ahead_argument",
    "keep_ahead",
)


@dataclass(frozen=True, slots=True)
class Field:
    """A member of a structure: its name, its unit, what it is, and whether it is an integer."""

    name: str
    unit: str
    meaning: str
    integer: bool = False


class TypedInterface:
    """Structures and function bodies of an export's C interface."""

    def __init__(self, export: Export) -> None:
        self.export = export
        system = export.system
        names = ["measure", "control", "plant", "start", "signals"]
        remembers = bool(system.memory)
        names += ["rates"] if remembers else []
        self._printer = ScalarPrinter(export, [system.function(name) for name in names], hoist=True)
        if remembers:
            self._printer.join("control", system.function("update"), h=export.period)
        if system.controller.law:
            self._printer.compose("control", "sigma", system.function(f"law_{system.controller.law.name}"), "dsigma")
        read = self._printer.reads("control") | (self._printer.reads("rates") if remembers else frozenset())

        def declared(*quantities: Quantity, integer: bool = False) -> tuple[Field, ...]:
            found = entries(quantities, system.joints)
            return tuple(Field(entry.name, entry.unit, entry.meaning, integer) for entry in found)

        numbers = declared(E, *system.sliding, *system.command_parts)
        limits = (SATURATED, A_LIMITED) if system.controller.law else (SATURATED,)
        self.structures: dict[str, tuple[Field, ...]] = {
            "reference": declared(*REFERENCE),
            "measurement": tuple(f for k, f in enumerate(declared(*system.drive.state)) if ("x", k) in read),
            "command": declared(U),
            "diagnostics": (*numbers, *declared(*limits, integer=True)),
            "state": declared(*system.drive.state),
            "base": declared(*BASE),
        }
        if remembers:
            self.structures["memory"] = declared(*system.controller_states)
        if export.tunable:
            self.structures["parameters"] = tuple(
                Field(slot.symbol, slot.unit, slot.meaning) for slot in export.tunable_slots
            )
        self.derived = self._printer.derived

        state, base = self.structures["state"], self.structures["base"]
        reference, command = self.structures["reference"], self.structures["command"]
        signals = [f"reference->{f.name}" for f in reference] + [f"base->{f.name}" for f in base]
        first = (1 + len(system.sliding)) * system.n  # of the command's parts
        seen = [f"diagnostics->{f.name}" for f in (*numbers[first:], *numbers[:first])]
        seen += [f"ahead->{f.name}" for f in self.structures.get("memory", ())]
        seeing = dict.fromkeys(("q1d", "dq1d", "ddq1d"), "reference->") | {"x": "measurement->", "z": _MEMORY}
        measured = {field.name for field in self.structures["measurement"]}
        self.bodies: dict[str, Body] = {
            "measure": self._printer.body(
                "measure",
                self._load({"x": "state->"}),
                [f"measurement->{f.name}" if f.name in measured else "" for f in state],
            ),
            "control": self._printer.body(
                "control",
                self._load(seeing),
                [*(f"command->{f.name}" for f in command), *seen],
            ),
            "plant": self._printer.body(
                "plant",
                self._load({"b": "base->", "db": "base->", "ddb": "base->", "u": "command->"}, x_is_array=True),
                [f"dx[{k}]" for k in range(len(state))],
            ),
            "start": self._printer.body("start", self._load({"t": ""}), [f"state->{f.name}" for f in state]),
            "signals": self._printer.body("signals", self._load({"t": ""}), signals),
        }
        self.rates: Body | None = None
        """Rates of the controller's states, into dz[0], dz[1], …: for those that integrate them with the plant."""
        if remembers:
            targets = [f"dz[{k}]" for k in range(len(system.memory))]
            self.rates = self._printer.body("rates", self._load(seeing), targets)

    def _load(self, owners: dict[str, str], *, x_is_array: bool = False) -> Callable[[str, int], str]:
        """C of the inputs: members of the structures they come in."""
        ports = port_entries(self.export.system)
        symbols = [slot.symbol for slot in self.export.tunable_slots]

        def load(name: str, k: int) -> str:
            if name == "derived":
                return f"controller->derived[{k}]"
            if name == "p":
                return f"controller->config.parameters.{symbols[k]}"
            if (name == "x" and x_is_array) or name == "d":
                return f"{name}[{k}]"
            label = ports[name][k][0]
            return owners[name] + (label.replace("u_", "U_", 1) if name == "u" else label)

        return load

    @property
    def derive(self) -> Body:
        """What springline_init and springline_set_parameters compute from the parameters."""
        symbols = [slot.symbol for slot in self.export.tunable_slots]
        return self._printer.derive(lambda _, k: f"parameters->{symbols[k]}", "derived")

    def bytes_of(self, name: str) -> int:
        """sizeof of a structure, or of springline_controller."""
        real = 8 if self.export.real == "double" else 4
        if name != "controller":
            members = self.structures[name]
            integers = sum(field.integer for field in members)
            return _padded(real * (len(members) - integers) + 4 * integers, real)
        config = real if "parameters" in self.structures else 4  # the fallback, padded before numbers
        config += real * len(self.structures.get("parameters", ()))
        return _padded(_padded(config, real) + real * self.derived + self._past + 4, real)

    @property
    def _past(self) -> int:
        """Bytes of what springline_controller keeps from step to step."""
        return self.bytes_of("command") + (self.bytes_of("memory") if "memory" in self.structures else 0)

    def stack(self, name: str) -> int:
        """Estimated bytes of stack of springline_step ("control") or springline_plant_step ("plant")."""
        real = 8 if self.export.real == "double" else 4
        local = self._past + self.bytes_of("diagnostics") if name == "control" else 4 * self.bytes_of("state")
        return _padded(real * self.bodies[name].live + local + _MATH_STACK, 16)

    # -- blocks of the templates --------------------------------------------------------------------------------

    def blocks(self) -> dict[str, str]:
        """Text for the placeholders of springline.h and springline.c."""
        export, real = self.export, self.export.real
        system = export.system
        blocks = {f"{name}_fields": self._fields(name) for name in self.structures if name != "parameters"}
        blocks |= {
            f"{name}_is_finite": _all(f"springline_is_finite({name}->{field.name})" for field in self.structures[name])
            for name in ("reference", "measurement", "command", "base")
        }
        diagnostics = self.structures["diagnostics"]
        sums = [
            " + ".join(f"diagnostics->{part.name}_{j.name}" for part in system.command_parts) for j in system.joints
        ]
        values = [f"diagnostics->{field.name}" for field in diagnostics if not field.integer]
        ahead = [f"ahead->{field.name}" for field in self.structures.get("memory", ())]
        asked = self.bodies["control"].values[-system.n :] if system.controller.law else []
        flags = [
            f"  diagnostics->saturated_{j.name} = "
            + (
                "0;"
                if self._is_unlimited(f"control.U_max.{k}")
                else f"command->U_{j.name} < {total} ||\n      command->U_{j.name} > {total};"
            )
            for k, (j, total) in enumerate(zip(system.joints, sums, strict=True))
        ]
        for k, a_law in enumerate(asked):
            limit = self._parameter(f"control.a_max.{k}")
            name = system.joints[k].name
            told = f"{a_law} < -{limit} || {a_law} > {limit}"
            flags.append(
                f"  diagnostics->a_limited_{name} = {0 if self._is_unlimited(f'control.a_max.{k}') else told};"
            )
        flags.append(f"  return {_all(f'springline_is_finite({a_law})' for a_law in asked) or '1'};")
        state = self.structures["state"]
        blocks |= {
            "status_enum": ",\n".join(f"  SPRINGLINE_{name} = {value}" for value, (name, _) in enumerate(STATUS)),
            "status_cases": "\n".join(f'    case SPRINGLINE_{name}: return "{text}";' for name, text in STATUS),
            "zero_command": self._zeros("command"),
            "zero_diagnostics": self._zeros("diagnostics"),
            "zero_base": self._zeros("base"),
            "control_is_finite": _all(f"springline_is_finite({value})" for value in (*values, *sums, *ahead)),
            "control": "\n".join(["  (void)controller;", *self._lines("control"), *flags]),
            "plant": "\n".join(["  (void)controller, (void)base;", *self._lines("plant")]),
            "measure": "\n".join(self._lines("measure")),
            "start": "\n".join([*self._table_data("start", "0.0"), *self._lines("start")]),
            "signals": "\n".join(f"  {line}" for line in [*self._table_data("signals", "t"), *self._lines("signals")]),
            "tables": f'#include "{export.prefix}_tables.h"\n' if export.tables else "",
            "state_to_x": "\n".join(f"  x[{k}] = state->{field.name};" for k, field in enumerate(state)),
            "next_to_state": "\n".join(f"  state->{field.name} = next[{k}];" for k, field in enumerate(state)),
            "states": str(len(state)),
            **self._stepping(),
            **self._remembering(),
            "diagnostics_meaning": self._diagnostics_meaning(),
            "control_operations": str(self.bodies["control"].operations),
            "plant_operations": str(self.bodies["plant"].operations),
            "signals_meaning": self._signals_meaning(),
            "controller_bytes": str(self.bytes_of("controller")),
        }
        derived, tunable = self.derived, export.tunable_slots
        derive = [f"  {line}" for line in self.derive.lines]
        given = "const springline_parameters *parameters, " if tunable else ""
        signature = f"static void springline_derive({given}springline_real *derived) {{\n"
        argument = "&config->parameters, " if tunable else ""
        defaults = ", ".join(constant_expression(export.values[i], real) for i in export.tunable)
        blocks |= {
            "parameter_struct": self._parameter_struct(),
            "config_parameters": "  springline_parameters parameters;\n" if tunable else "",
            "controller_derived": f"  springline_real derived[{derived}]; /* from the parameters */\n"
            if derived
            else "",
            "default_config_meaning": "Zero force as fallback" + (", the exported parameters." if tunable else "."),
            "default_config": "{SPRINGLINE_FALLBACK_ZERO" + (f", {{{defaults}}}" if tunable else "") + "}",
            "derive": "\n".join(["/* What depends on parameters only. */", signature + "\n".join(derive), "}", "", ""])
            if derived
            else "",
            "take_derived": f"  springline_derive({argument}controller->derived);\n" if derived else "",
            "what_may_change": "Parameters and fallback may change."
            if tunable
            else "All parameters are constants here,\n"
            " * so only the fallback can change (--tunable NAMES makes parameters that can).",
            "parameters_check": self._parameters_check(),
            "judge_parameters": "  if (!springline_parameters_are_good(&config->parameters)) {\n"
            "    return SPRINGLINE_BAD_PARAMETER;\n"
            "  }\n"
            if tunable
            else "",
        }
        return blocks

    def _stepping(self) -> dict[str, str]:
        """The integrator: its nodes, and the stages of a plant step."""
        tableau, real = self.export.system.tableau, self.export.real
        states = len(self.structures["state"])

        def evaluate(when: int, at: str, slope: str) -> list[str]:
            return [f"springline_evaluate_plant(controller, motion[{when}], {at}, command, {slope});"]

        lines = scalar_stages(tableau, real, states, evaluate)
        nodes = ", ".join(literal(node, real) for node in tableau.nodes)
        return {
            "slopes": "".join(f", {name}[{states}]" for name in scalar_slopes(tableau)),
            "plant_stages": "\n".join(f"  {line}".rstrip() for line in lines),
            "base_nodes": str(len(tableau.nodes)),
            "base_node_values": "{" + nodes + "}",
            "integrator": f"{tableau.title}, order {tableau.order}",
        }

    def _remembering(self) -> dict[str, str]:
        """What there is of the controller's states in springline.h and springline.c: nothing where it has none."""
        system, period = self.export.system, f"{self.export.period:g} s"
        outcome = (
            "Whatever happens *command is set: to the fallback if the status is not SPRINGLINE_OK. diagnostics may be "
            "NULL; it is zero if the status is not SPRINGLINE_OK."
        )
        late = "too slowly, or with its command too late, it leaves its reference or diverges (README.md says more)."
        forgets = "Forgets the past of a controller, not its configuration: the last command is zero"
        if not system.memory:
            keeps = f"The law keeps no state from step to step, but the arm does: sampled {late}"
            return {
                **dict.fromkeys(_OF_MEMORY, ""),
                "step_meaning": _wrapped(f"Computes the command for one sample. {keeps} {outcome}"),
                "kept": "The last command is kept.",
                "forgetting": _wrapped(f"{forgets}, as after springline_init."),
            }
        start = ", ".join(constant_expression(value, self.export.real) for value in system.z_start)
        texts = (
            "/* The controller's states: what it remembers from sample to sample. */\n"
            f"typedef struct springline_memory {{\n{self._fields('memory')}\n}} springline_memory;\n\n",
            "  springline_memory z;\n",
            f"static const springline_memory springline_initial_memory = {{{start}}};\n",
            "  controller->z = springline_initial_memory;\n",
            ", springline_memory *ahead",
            ", const springline_memory *ahead",
            "  springline_memory ahead = springline_initial_memory;\n",
            ", &ahead",
            "    controller->z = ahead;\n",
        )
        moves = (
            f"Computes the command for one sample and moves the controller's states on by {period}: call it at this "
            f"period, the exported scenario's. The arm goes on in between: sampled {late}"
        )
        return {
            **dict(zip(_OF_MEMORY, texts, strict=True)),
            "step_meaning": _wrapped(f"{moves} {outcome} In that case the states stay as they were."),
            "kept": "The last command and the controller's states are kept.",
            "forgetting": _wrapped(f"{forgets} and the states are the initial ones, as after springline_init."),
        }

    def _diagnostics_meaning(self) -> str:
        system = self.export.system
        parts = len(system.command_parts)
        shown = ["tracking error e", *(["sliding variable sigma"] if system.sliding else [])]
        shown.append("the two parts of U" if parts == 2 else "the parts of U" if parts > 1 else "U before its limit")
        limits = "saturated where U_max has limited U"
        if system.controller.law:
            limits += ", a_limited where a_max has limited the acceleration that the reaching law wished"
        return _wrapped(f"Why: {', '.join(shown)}, and whether a limit was met (0 or 1): {limits}.")

    def _table_data(self, name: str, time: str) -> list[str]:
        """Statements that look up what body `name` reads of the tables."""
        if not any(source == "d" for source, _ in self._printer.reads(name)):
            return []
        tables = f"springline_tables, {len(self.export.tables)}"
        return [f"  double d[{self.export.system.d.numel()}];", f"  sl_table_data({tables}, {time}, d, 1);"]

    def _lines(self, name: str) -> list[str]:
        return [f"  {line}".rstrip() for line in self.bodies[name].lines]

    def _is_unlimited(self, key: str) -> bool:
        """Whether a limit is a constant, and none."""
        k = [slot.key for slot in self.export.slots].index(key)
        return k not in self.export.tunable and math.isinf(self.export.values[k])

    def _parameter(self, key: str) -> str:
        """C of a parameter's value behind the statements of the control: its name where they define it."""
        k = [slot.key for slot in self.export.slots].index(key)
        if self.export.slots[k].symbol in self.bodies["control"].constants:
            return self.export.slots[k].symbol
        if k in self.export.tunable:
            return f"controller->config.parameters.{self.export.slots[k].symbol}"
        return literal(self.export.values[k], self.export.real)

    def _fields(self, name: str) -> str:
        members = self.structures[name]
        declarations = [f"{'int32_t' if field.integer else 'springline_real'} {field.name};" for field in members]
        width = max(map(len, declarations))
        lines = [
            (f"  {text:{width}} /* {field.unit}", f"; {field.meaning}")
            for text, field in zip(declarations, members, strict=True)
        ]
        return "\n".join(f"{start}{rest if len(start + rest) + 3 <= _LINE else ''} */" for start, rest in lines)

    def _zeros(self, name: str) -> str:
        zero = literal(0.0, self.export.real)
        return "{" + ", ".join("0" if field.integer else zero for field in self.structures[name]) + "}"

    def _parameter_struct(self) -> str:
        slots = self.export.tunable_slots
        if not slots:
            return ""
        width = max(len(slot.symbol) for slot in slots) + 1
        lines = [
            f"  springline_real {slot.symbol + ';':{width}} /* {slot.unit}; {slot.meaning}; {slot.bounds} */"
            for slot in slots
        ]
        body = "\n".join(lines)
        opening = "/* Numbers that may be set. */\ntypedef struct springline_parameters {"
        return f"{opening}\n{body}\n}} springline_parameters;\n\n"

    def _parameters_check(self) -> str:
        slots = self.export.tunable_slots
        if not slots:
            return ""
        tests = [text for s in slots for text in bounds_tests(f"p->{s.symbol}", s.bounds, self.export.real)]
        opening = "static int springline_parameters_are_good(const springline_parameters *p) {"
        return f"{opening}\n  return {_all(tests)};\n}}\n\n"

    def _signals_meaning(self) -> str:
        text = "Reference and base motion of the exported scenario at time t, s."
        return f"{text} {self.missing_tables}".rstrip()

    @property
    def missing_tables(self) -> str:
        """A sentence on the signals that come from tables, which are not exported; empty where there are none."""
        structure = self.export.system.structure
        signals = (("reference", structure.reference), ("base motion", structure.base_motion))
        tables = [name for name, shape in signals if shape.kind == "table"]
        if not tables or self.export.tables:
            return ""
        noun = "tables are" if len(tables) > 1 else "table is"
        return f"The scenario's {' and '.join(tables)} {noun} not part of the export: zero here."


def bounds_tests(expression: str, bounds: Bounds, real: Real) -> list[str]:
    """C conditions that hold if and only if the value is admissible; NaN never is."""
    tests = [] if bounds.infinite else [f"springline_is_finite({expression})"]
    if not math.isinf(bounds.low):
        tests.append(f"{expression} {'>' if bounds.low_open else '>='} {literal(bounds.low, real)}")
    if not math.isinf(bounds.high):
        tests.append(f"{expression} {'<' if bounds.high_open else '<='} {literal(bounds.high, real)}")
    if bounds.even:
        half = f"{literal(0.5, real)} * {expression}"
        tests.append(f"{'slf' if real == 'float' else 'sl'}_floor({half}) >= {half}")
    return tests


def _wrapped(text: str) -> str:
    """The text of a C comment, on lines that are no longer than others."""
    return "\n * ".join(textwrap.wrap(text, _LINE - 5))


def _all(tests: Iterable[str]) -> str:
    return " &&\n         ".join(tests)


def _padded(size: int, alignment: int) -> int:
    return -(-size // alignment) * alignment
