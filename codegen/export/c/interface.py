"""The typed C interface of an export: what its structures hold and how its functions compute."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from springline.codegen.export import Body, Export, ScalarPrinter, port_entries, remembered
from springline.codegen.program import literal
from springline.model.parameters import Slot
from springline.model.quantities import A_LIMITED, DISTURBANCE, REFERENCE, SATURATED, E, Quantity, U, entries

_MATH_STACK = 160  # bytes below the deepest elementary function, as measured on Cortex-M7

_MEMORY = "controller->z."


@dataclass(frozen=True, slots=True)
class Field:
    """A member of a structure: its name, its unit, what it is, and whether it is an integer."""

    name: str
    unit: str
    meaning: str
    integer: bool = False


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of a joint, as C.

    unlimited  whether its command has no limit and never will
    a_law      the acceleration that the reaching law asks for, "" without a law
    a_max      the limit on it, "" where there is none and never will be
    """

    name: str
    unlimited: bool
    a_law: str
    a_max: str


class TypedInterface:
    """Structures and function bodies of an export's C interface.

    tip     where the arm's end is and how fast it moves, into tip[0], tip[1], …; None unless asked for, or without one
    judged  error and sliding variable of the state as it is, into judged[0], judged[1], …; None unless asked for, or
            where the controller sees no others
    """

    def __init__(self, export: Export, *, with_tip: bool = False, with_judged: bool = False) -> None:
        self.export = export
        system = export.system
        names = ["measure", "control", "plant", "start", "signals"]
        shows_tip = with_tip and system.tip is not None
        names += ["tip"] if shows_tip else []
        names += ["loop_actuate"] if system.commanded else []
        remembers, integrates = bool(system.memory), "rates" in system.functions
        names += ["rates"] if integrates else []
        shows_judged = with_judged and system.judges
        names += ["judged"] if shows_judged else []
        functions, constants = [system.function(name) for name in names], {"h": export.period} if remembers else {}
        self._printer = ScalarPrinter(export, functions, hoist=True, constants=constants)
        if remembers:
            self._printer.join("control", system.function("update"))
        if system.controller.law:
            self._printer.compose("control", "sigma", system.function(f"law_{system.controller.law.name}"), "dsigma")
        read = self._printer.reads("control") | (self._printer.reads("rates") if integrates else frozenset())

        def declared(*quantities: Quantity, integer: bool = False) -> tuple[Field, ...]:
            found = entries(quantities, system.joints)
            return tuple(Field(entry.name, entry.unit, entry.meaning, integer) for entry in found)

        numbers = declared(E, *system.sliding, *system.command_parts)
        limits = (SATURATED, A_LIMITED) if system.controller.law else (SATURATED,)
        self.structures: dict[str, tuple[Field, ...]] = {
            "reference": declared(*REFERENCE, *system.measured_base),
            "measurement": tuple(f for k, f in enumerate(declared(*system.drive.state)) if ("x", k) in read),
            "command": declared(U),
            "diagnostics": (*numbers, *declared(*limits, integer=True)),
            "state": declared(*system.drive.state),
            **({"motors": self._motors()} if system.actuators else {}),
            "base": declared(*system.base_motion, *system.forces),
        }
        if remembers:
            self.structures["memory"] = declared(*system.controller_states)
        if export.tunable:
            self.structures["parameters"] = tuple(
                Field(slot.symbol, slot.unit, slot.meaning) for slot in export.tunable_slots
            )
        self.derived = self._printer.derived

        state, base = self.structures["state"], self.structures["base"]
        command = self.structures["command"]
        signals = [f"reference->{f.name}" for f in declared(*REFERENCE)] + [f"base->{f.name}" for f in base]
        first = (1 + len(system.sliding)) * system.n  # of the command's parts
        seen = [f"diagnostics->{f.name}" for f in (*numbers[first:], *numbers[:first])]
        seen += [f"ahead->{f.name}" for f in self.structures.get("memory", ())]
        seeing = dict.fromkeys(("q1d", "dq1d", "ddq1d"), "reference->") | {"x": "measurement->", "z": _MEMORY}
        seeing |= dict.fromkeys(("b", "db", "ddb"), "reference->measured_")
        measured = {field.name for field in self.structures["measurement"]}
        around = dict.fromkeys(("b", "db", "ddb", DISTURBANCE.name), "base->")
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
                [slot.symbol for slot in self.export.slots if self._is_asked(slot.key)],
            ),
            "plant": self._printer.body(
                "plant",
                self._load(around | {"u": "command->"}, x_is_array=True),
                [f"dx[{k}]" for k in range(len(state))],
            ),
            "start": self._printer.body("start", self._load({"t": ""}), [f"state->{f.name}" for f in state]),
            "signals": self._printer.body("signals", self._load({"t": ""}), signals),
        }
        self.actuate: Body | None = None
        """What motors are driven by at the nodes of a step, into acting[0], …, and what they remember after it."""
        if system.commanded:
            outputs = [f"acting[{k}]" for k in range(len(system.tableau.nodes) * system.n)]
            outputs += [f"remembered[{k}]" for k in range(system.m.numel())]
            load = self._load({"m": "state->", "step": ""})
            self.actuate = self._printer.body("loop_actuate", load, outputs)
        targets = [f"tip[{k}]" for k in range(len(system.observed))]
        load = self._load(around, x_is_array=True)
        self.tip: Body | None = self._printer.body("tip", load, targets) if shows_tip else None
        targets = [f"judged[{k}]" for k in range((1 + len(system.sliding)) * system.n)]
        load = self._load(seeing | {"x": "state->"})
        self.judged: Body | None = self._printer.body("judged", load, targets) if shows_judged else None
        self.rates: Body | None = None
        """Rates of the controller's states, into dz[0], dz[1], …: for those that integrate them with the plant."""
        if integrates:
            targets = [f"dz[{k}]" for k in range(len(system.memory))]
            self.rates = self._printer.body("rates", self._load(seeing), targets)

    def _motors(self) -> tuple[Field, ...]:
        """What the plant's state has of its motors."""
        meanings = {
            "U_last": "command behind the rate limit, of the last step",
            "a": "force of the motor behind its lag",
        }
        return tuple(
            Field(f"{name}_{joint.name}", joint.force, f"{meanings[name]} ({joint.name})")
            for name in remembered(self.export.system)
            for joint in self.export.system.joints
        )

    def _load(self, owners: dict[str, str], *, x_is_array: bool = False) -> Callable[[str, int], str]:
        """C of the inputs: members of the structures they come in."""
        ports = port_entries(self.export.system)
        symbols = [slot.symbol for slot in self.export.tunable_slots]

        def load(name: str, k: int) -> str:
            if name == "derived":
                return f"controller->derived[{k}]"
            if name == "p":
                return f"controller->config.parameters.{symbols[k]}"
            if (name == "x" and x_is_array) or name in ("d", "noise", "arrived"):
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

    @property
    def joint_limits(self) -> list[JointLimits]:
        """Per joint what the limits on its command and its reaching law are compared with."""
        system = self.export.system
        laws = self.bodies["control"].values[-system.n :] if system.controller.law else [""] * system.n
        return [
            JointLimits(
                joint.name,
                self._is_unlimited(f"control.U_max.{k}"),
                a_law,
                self._parameter(f"control.a_max.{k}") if a_law and not self._is_unlimited(f"control.a_max.{k}") else "",
            )
            for k, (joint, a_law) in enumerate(zip(system.joints, laws, strict=True))
        ]

    def reads_tables(self, name: str) -> bool:
        """Whether body `name` needs data of the exported tables."""
        return any(source == "d" for source, _ in self._printer.reads(name))

    @property
    def measured_base(self) -> list[str]:
        """Names of the base's motion that the controller is told of, by "measured_<name>" of its reference."""
        system = self.export.system
        return [entry.name for entry in entries(system.base_motion, system.joints)] if system.measured_base else []

    @property
    def missing_tables(self) -> str:
        """A sentence on the signals that come from tables, which are not exported; empty where there are none."""
        structure = self.export.system.structure
        signals = (
            ("reference", structure.reference),
            ("base motion", structure.base_motion),
            ("disturbance", structure.disturbance),
        )
        tables = [name for name, shape in signals if shape.kind == "table"]
        if not tables or self.export.tables:
            return ""
        noun = "tables are" if len(tables) > 1 else "table is"
        return f"The scenario's {' and '.join(tables)} {noun} not part of the export: zero here."

    def _is_unlimited(self, key: str) -> bool:
        """Whether a limit is a constant, and none."""
        k = [slot.key for slot in self.export.slots].index(key)
        return k not in self.export.tunable and math.isinf(self.export.values[k])

    def _is_asked(self, key: str) -> bool:
        """Whether a parameter is a limit on the reaching law, which a flag compares with."""
        has_law = self.export.system.controller.law is not None
        return has_law and key.startswith("control.a_max.") and not self._is_unlimited(key)

    def _parameter(self, key: str) -> str:
        """C of a parameter's value behind the statements of the control: its name where they define it."""
        k = [slot.key for slot in self.export.slots].index(key)
        if self.export.slots[k].symbol in self.bodies["control"].constants:
            return self.export.slots[k].symbol
        if k in self.export.tunable:
            return f"controller->config.parameters.{self.export.slots[k].symbol}"
        return literal(self.export.values[k], self.export.real)

    def parameter_tests(self) -> list[str]:
        """C conditions on the parameters *p that hold if and only if all may be set; NaN never may."""
        return [test for slot in self.export.tunable_slots for test in self._bounds_tests(slot)]

    def _bounds_tests(self, slot: Slot) -> Iterator[str]:
        value, bounds, real = f"p->{slot.symbol}", slot.bounds, self.export.real
        if not bounds.infinite:
            yield f"{self.export.prefix}_is_finite({value})"
        if not math.isinf(bounds.low):
            yield f"({value} {'>' if bounds.low_open else '>='} {literal(bounds.low, real)})"
        if not math.isinf(bounds.high):
            yield f"({value} {'<' if bounds.high_open else '<='} {literal(bounds.high, real)})"
        if bounds.even:
            half = f"{literal(0.5, real)} * {value}"
            yield f"({'slf' if real == 'float' else 'sl'}_floor({half}) >= ({half}))"


def _padded(size: int, alignment: int) -> int:
    return -(-size // alignment) * alignment
