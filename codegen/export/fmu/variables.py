"""What an FMU shows of itself: the variables of each part, in the order of their value references."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import casadi as ca

from springline.codegen.export import Export
from springline.codegen.export.c import Field, TypedInterface
from springline.model.parameters import REAL, Bounds
from springline.model.quantities import TIP, TIP_RATE, U, entries
from springline.model.system import System

Part = Literal["controller", "plant", "loop"]
Causality = Literal["independent", "parameter", "input", "output", "local"]

PARTS: tuple[Part, ...] = ("controller", "plant", "loop")

NO_LIMIT = 1e300
"""How an FMU writes infinity, and from where on it reads it: FMI's XML has none, and its importers cannot read one."""

_SEEN_FROM_EARTH = frozenset(item.name for item in (*TIP, *TIP_RATE) if item.name.endswith("_inertial"))

_LEAST = 1e-300  # stands for the least number above 0, which is denormal and not every importer's to read


@dataclass(frozen=True, slots=True)
class Variable:
    """A scalar variable of an FMU; its value reference is its place in the list.

    name    a parameter's is the scenario's key, another's that of the trajectory's column
    start   start value, None where it is computed
    fixed   a parameter that counts at initialization only
    sampled  whether it changes at samples only
    """

    name: str
    unit: str
    meaning: str
    causality: Causality
    start: float | None = None
    bounds: Bounds = REAL
    fixed: bool = False
    boolean: bool = False
    sampled: bool = False

    @property
    def variability(self) -> str:
        """FMI's word for when it may change."""
        if self.causality == "parameter":
            return "fixed" if self.fixed else "tunable"
        return "discrete" if self.boolean or self.sampled else "continuous"

    @property
    def expected(self) -> str:
        """What values may be set, in words."""
        if not self.bounds.infinite:
            return str(self.bounds)
        return f"{replace(self.bounds, infinite=False)} ({NO_LIMIT:g} or more means no limit)"

    @property
    def closed_range(self) -> tuple[float | None, float | None]:
        """The least and the greatest value that FMI's inclusive min and max may name, None where there is no limit."""
        low = None if math.isinf(self.bounds.low) else self.bounds.low
        high = None if math.isinf(self.bounds.high) else self.bounds.high
        if low is not None and self.bounds.low_open:
            low = math.nextafter(low, math.inf) if low else _LEAST
        if high is not None and self.bounds.high_open:
            high = math.nextafter(high, -math.inf) if high else -_LEAST
        return low, high


@dataclass(frozen=True)
class Interface:
    """Variables of one part.

    variables  by value reference; 0 is time
    base       how many variables say how the base moves;  fed: whether the controller is told of it
    blocks     name of a structure of the C interface (or "parameters") -> value reference of its first entry; entries
               follow in the structure's order
    """

    part: Part
    variables: tuple[Variable, ...]
    blocks: dict[str, int]
    base: int = 0
    fed: bool = False

    @property
    def depends(self) -> dict[int, list[int]]:
        """Value reference of each output -> those of the inputs of its own time that it depends on.

        The command depends on all; of the plant, whose other outputs are states, the tip as seen from the earth depends
        on the base. Of the loop, what the controller computes does where it is told how the base moves.
        """
        inputs = self.of("input")
        if self.part == "controller":
            return dict.fromkeys(self.of("output"), inputs)
        seen = range(self.blocks["base"], self.blocks["base"] + self.base) if "base" in self.blocks else ()
        moving = [k for k in inputs if k in seen]
        told = range(self.blocks["reference"], len(self.variables)) if self.fed and self.part == "loop" else ()
        return {k: moving if k in told or self.variables[k].name in _SEEN_FROM_EARTH else [] for k in self.of("output")}

    def of(self, *causalities: Causality) -> list[int]:
        """Value references of the variables with one of these causalities."""
        return [i for i, variable in enumerate(self.variables) if variable.causality in causalities]


def base_is_input(system: System, part: Part) -> bool:
    """Whether the importer moves the base: where the scenario does not."""
    return part != "controller" and system.structure.base_motion.kind == "none"


def force_is_input(system: System, part: Part) -> bool:
    """Whether the importer disturbs the links: where the scenario does not."""
    return part != "controller" and system.structure.disturbance.kind == "input"


def structures_of(typed: TypedInterface) -> dict[str, tuple[Field, ...]]:
    """The structures of the C interface, that of the base in two, "base" and "disturbance"; and what the tip is."""
    system = typed.export.system
    base = typed.structures["base"]
    motion = len(base) - len(entries(system.forces, system.joints))
    tip = tuple(Field(entry.name, entry.unit, entry.meaning) for entry in entries(system.observed, system.joints))
    acting = entries((U,), system.joints) if system.commanded else ()
    shown = {entry.name: entry for entry in entries(system.measured, system.joints)}
    places = [f"{quantity.name}_measured_{joint.name}" for quantity in system.drive.state for joint in system.joints]
    names = dict(zip((field.name for field in typed.structures["state"]), places, strict=True))
    seen = [names[field.name] for field in typed.structures["measurement"] if names[field.name] in shown]
    measured = tuple(Field(name, shown[name].unit, shown[name].meaning) for name in seen)
    return {
        **typed.structures,
        "base": base[:motion],
        "disturbance": base[motion:],
        "tip": tip if typed.tip else (),
        "measured": measured,
        "acting": tuple(Field(e.name, e.unit, f"force of the motor ({e.joint.name})") for e in acting if e.joint),
    }


def part_parameters(system: System, part: Part) -> tuple[int, ...]:
    """Indices of the slots that a part depends on, ascending."""
    names = [name for name in ("control", "rates", "update") if name in system.functions]
    control = {i for name in names for i in _read(system, name)}
    if part == "controller":
        return tuple(sorted(control))
    used = {*_read(system, "plant"), *_read(system, "start"), *(_read(system, "tip") if system.observed else ())}
    used |= {*_read(system, "measure"), *(_read(system, "loop_actuate") if system.commanded else ())}
    if part == "loop":
        used |= control
    signals = {
        i for i in _read(system, "signals") if part == "loop" or not system.slots[i].key.startswith("reference.")
    }
    return tuple(sorted(used | signals))


def _read(system: System, name: str) -> tuple[int, ...]:
    """Slots that the frozen Function `name` reads; p is its last input."""
    function = system.function(name)
    reads = (
        function.instruction_input(k)
        for k in range(function.n_instructions())
        if function.instruction_id(k) == ca.OP_INPUT
    )
    return tuple(sorted(entry for source, entry in reads if source == function.n_in() - 1))


def interface(export: Export, typed: TypedInterface, part: Part, *, sampled: bool) -> Interface:
    """The variables of a part: time, its tunable parameters, inputs, outputs, and the states of its controller.

    sampled  whether the controller's states change at samples only
    """
    known = structures_of(typed)
    outside = {
        "base": base_is_input(export.system, part),
        "disturbance": force_is_input(export.system, part),
    }
    given = [name for name, is_input in outside.items() if is_input and known[name]]
    shown = [name for name, is_input in outside.items() if not is_input and known[name]]
    shown += ["tip"] if known["tip"] else []
    shown += ["measured"] if known["measured"] else []
    shown += ["acting"] if known["acting"] and part == "loop" else []
    if part == "loop" and export.system.commanded:
        asked = entries(export.system.commanded, export.system.joints)
        known["command"] = tuple(Field(entry.name, entry.unit, entry.meaning) for entry in asked)
    inputs: dict[Part, Sequence[str]] = {
        "controller": ("reference", "measurement"),
        "plant": ("command", *given),
        "loop": given,
    }
    outputs: dict[Part, Sequence[str]] = {
        "controller": ("command", "diagnostics"),
        "plant": ("state", *shown),
        "loop": ("state", "reference", "command", "diagnostics", *shown),
    }
    # A controller's states stand behind the plant's: what is integrated is one piece.
    last = {"controller": "diagnostics", "plant": "", "loop": "state"}[part]
    variables = [Variable("time", "s", "time", "independent")]
    blocks = {"parameters": len(variables)}
    for slot, i in zip(export.tunable_slots, export.tunable, strict=True):
        fixed = slot.key.startswith("initial.")
        start = min(export.values[i], NO_LIMIT) if slot.bounds.infinite else export.values[i]
        variables.append(Variable(slot.key, slot.unit, slot.meaning, "parameter", start, slot.bounds, fixed))
    groups: Iterable[tuple[Causality, Sequence[str]]] = (("input", inputs[part]), ("output", outputs[part]))
    for causality, structures in groups:
        for structure in structures:
            blocks[structure] = len(variables)
            at_samples = structure == "measured"
            variables += [_signal(field, causality, sampled=at_samples) for field in known[structure]]
            if structure == last and "memory" in typed.structures:
                blocks["memory"] = len(variables)
                variables += [_signal(field, "local", sampled=sampled) for field in typed.structures["memory"]]
    return Interface(part, tuple(variables), blocks, len(known["base"]), bool(typed.measured_base))


def _signal(field: Field, causality: Causality, *, sampled: bool = False) -> Variable:
    start = 0.0 if causality == "input" else None
    unit = "1" if field.integer else field.unit
    return Variable(field.name, unit, field.meaning, causality, start, boolean=field.integer, sampled=sampled)
