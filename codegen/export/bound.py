"""What an export is printed from: a system with its numbers bound, the names to use, and a hash of all of it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from importlib.metadata import version
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from springline.codegen.export.names import check_prefix
from springline.codegen.files import canonical_json
from springline.codegen.nearest import nearest
from springline.codegen.numbers import real as number
from springline.codegen.program import Real, SignalTable, count_operations
from springline.model.drive import COULOMB_VELOCITY, FRICTION
from springline.model.hardware import SENSORS
from springline.model.parameters import Slot
from springline.model.quantities import DDQ1, DERIVATIVES, DISTURBANCE, REFERENCE, SIGMA, E, Quantity, T, entries
from springline.model.structure import Structure
from springline.model.system import System, system_of

PERIOD = 1e-3
"""s between two commands, unless an Export says otherwise."""

MODEL_FUNCTIONS = (
    "mass_matrix",
    "coriolis",
    "gravity",
    "base_disturbance",
    "plant",
    "slow_dynamics",
    "fast_dynamics",
    "quasi_steady_force",
    "slow_control",
    "fast_control",
    "control",
    "rates",
    "update",
)
"""Functions of a System that an export offers under <prefix>_<name>, beside law_<name> of its reaching law."""


@dataclass(frozen=True, slots=True)
class Port:
    """An input or output of a function: shape (rows, columns), and per entry (column by column) name and SI unit."""

    name: str
    shape: tuple[int, int]
    labels: tuple[str, ...]
    units: tuple[str, ...]


@dataclass(frozen=True)
class Export:
    """A system whose parameters are bound: tunable (an argument of the C) or baked (a constant in it).

    values   of all slots, in their order
    tunable  indices of the slots that stay arguments, ascending
    prefix   of every public name
    real     number type of the C
    tables   data of the system's table signals, in the order of System.tables; () leaves them out, they are zero then
    period   s between two commands: what the states of a controller that has some are moved on by
    seed, run  what the noise of sensors goes by
    timing   sentences on the sample periods and delays that the loop bears, for those who embed it
    """

    system: System
    values: tuple[float, ...]
    tunable: tuple[int, ...]
    prefix: str = "springline"
    real: Real = "double"
    tables: tuple[SignalTable, ...] = ()
    period: float = PERIOD
    seed: int = 0
    run: int = 0
    timing: tuple[str, ...] = ()

    @property
    def slots(self) -> tuple[Slot, ...]:
        """All parameters."""
        return self.system.slots

    @property
    def tunable_slots(self) -> tuple[Slot, ...]:
        """The parameters that stay arguments, in the order of the packed p."""
        return tuple(self.slots[i] for i in self.tunable)

    @cached_property
    def baked(self) -> tuple[int, ...]:
        """Indices of the slots that become constants, ascending."""
        return tuple(i for i in range(len(self.slots)) if i not in set(self.tunable))

    def value(self, key: str) -> float:
        """Number of a slot."""
        return self.values[[slot.key for slot in self.slots].index(key)]

    def model_functions(self) -> Iterator[tuple[str, ca.Function]]:
        """Public name and frozen Function (last input p: all slots) of MODEL_FUNCTIONS that it has, and its law."""
        law = self.system.controller.law
        names = (*MODEL_FUNCTIONS, *([f"law_{law.name}"] if law else []))
        for name in (name for name in names if name in self.system.functions):
            yield f"{self.prefix}_{name}", self.system.function(name)

    def inputs(self, function: ca.Function) -> list[Port]:
        """Inputs of a Function as exported: p holds the tunable slots alone and is left out where there are none."""
        ports = [
            self._port(function.name_in(i), function.size_in(i))
            for i in range(function.n_in())
            if function.name_in(i) != "p"
        ]
        if self.tunable:
            labels = tuple(slot.symbol for slot in self.tunable_slots)
            units = tuple(slot.unit for slot in self.tunable_slots)
            ports.append(Port("p", (len(labels), 1), labels, units))
        return ports

    def outputs(self, function: ca.Function) -> list[Port]:
        """Outputs of a Function."""
        return [self._port(function.name_out(i), function.size_out(i)) for i in range(function.n_out())]

    def _port(self, name: str, shape: tuple[int, int]) -> Port:
        entries = port_entries(self.system)[name]
        if len(entries) != shape[0] * shape[1]:  # a reaching law works on one joint, whichever it is
            entries = [(name, "1/s of the joint's unit" if name == "sigma" else "1/s^2 of the joint's unit")]
        return Port(name, shape, tuple(label for label, _ in entries), tuple(unit for _, unit in entries))

    @cached_property
    def sha256(self) -> str:
        """Hash of model, parameters and options: it changes if and only if the exported files may."""
        identity: dict[str, object] = {
            # A hash of what a structure does not have would be another one with each thing that it could have.
            "structure": {
                k: v for k, v in asdict(self.system.structure).items() if v or k not in ("delay", "differenced")
            },
            "parameters": {slot.key: value for slot, value in zip(self.slots, self.values, strict=True)},
            "tunable": [slot.key for slot in self.tunable_slots],
            "prefix": self.prefix,
            "real": self.real,
            "tables": [
                [table.t0, table.dt, table.periodic, hashlib.sha256(table.coefficients.tobytes()).hexdigest()]
                for table in self.tables
            ],
        }
        if self.system.memory:  # nothing else depends on it
            identity["period"] = self.period
        if self.system.noise.numel():
            identity |= {"seed": self.seed, "run": self.run}
        if self.timing:
            identity["timing"] = self.timing
        digest = hashlib.sha256(canonical_json(identity))
        for function in self.system.functions.values():
            digest.update(_instructions(function))
        return digest.hexdigest()


def remembered(system: System) -> list[str]:
    """What a plant's state calls that which its motors remember, in the order of m."""
    return [{"rate_limit": "U_last", "lag": "a"}[name] for name in system.actuators]


def port_entries(system: System) -> dict[str, list[tuple[str, str]]]:
    """Name and SI unit of each entry, column by column, of every input and output that a System's Functions have."""
    joints = system.joints

    def of(*declared: Quantity) -> list[tuple[str, str]]:
        return [(entry.name, entry.unit) for entry in entries(declared, joints)]

    def force(name: str, suffix: str = "") -> list[tuple[str, str]]:
        return [(f"{name}_{j.name}", j.force + suffix) for j in joints]

    state = of(*system.drive.state)
    return {
        **{item.name: of(item) for item in (*system.drive.state, DDQ1, *REFERENCE, E, SIGMA)},
        "z": [(entry.name, entry.unit) for entry in system.memory],
        "z_next": [(f"{entry.name}_next", entry.unit) for entry in system.memory],
        "dz": [(f"d{entry.name}", f"{entry.unit}/s") for entry in system.memory],
        "h": [("h", "s")],
        **{item.name.lower(): force(item.name.lower()) for item in system.command_parts},
        **{name: force(name) for name in ("u", "u_s", "G", "C_dq1", "S", "z_bar", "eta", "u_f")},
        "dsigma": [(f"d{name}", f"{unit}^2") for name, unit in of(SIGMA)],
        "ddeta": force("ddeta", "/s^2"),
        **{name: of(item) for name, item in zip(("b", "db", "ddb"), system.base_motion, strict=True)},
        "t": of(T),
        "d": [(f"d{k}", "") for k in range(system.d.numel())],
        "w": of(*REFERENCE, *system.base_motion, *system.forces),
        "tip": of(*system.observed),
        DISTURBANCE.name: of(DISTURBANCE),
        "x": state,
        "y": [(f"measured_{name}", unit) for name, unit in state],
        "arrived": force("arrived"),
        "m": [(f"{name}_{j.name}", j.force) for name in remembered(system) for j in joints],
        "m_next": [(f"{name}_{j.name}_next", j.force) for name in remembered(system) for j in joints],
        "step": [("step", "s")],
        "acting": [(f"U_{k}_{j.name}", j.force) for k in range(len(system.tableau.nodes)) for j in joints],
        "noise": [(f"noise_{name}", "1") for name, _ in state],
        "dx": of(*(DERIVATIVES[item] for item in system.drive.state)),
        "M1": [
            (f"M1_{row.name}_{column.name}", f"{row.force} s^2/{column.unit}") for column in joints for row in joints
        ],
    }


def bind(
    structure: Structure,
    values: NDArray[np.float64],
    *,
    tunable: Sequence[str] | Literal["all", "none"] = "none",
    prefix: str = "springline",
    real: Real = "double",
    tables: Sequence[SignalTable] = (),
    period: float = PERIOD,
    seed: int = 0,
    run: int = 0,
    timing: Sequence[str] = (),
) -> Export:
    """The Export of a structure with these numbers.

    structure  what the system consists of
    values     its numbers, one per System.slots entry, SI
    tunable    parameters that stay arguments: slot keys, or what stands for several ("control", "control.mu")
    prefix     of every public name
    real       number type of the C
    tables     data of the table signals, in the order of System.tables, for real = "double"; () leaves them out
    period     s between two commands, which the states of a controller go by
    seed, run  what the noise of sensors goes by
    timing     sentences to print on the sample periods and delays that the loop bears
    Raises ValueError for a wrong number of values or tables, a value out of its bounds, an unknown name or an unusable
    prefix.
    """
    system = system_of(structure)
    if np.shape(values) != (len(system.slots),):
        raise ValueError(f"values have shape {np.shape(values)}, expected ({len(system.slots)},)")
    numbers = tuple(float(value) for value in values)
    for slot, value in zip(system.slots, numbers, strict=True):
        if not slot.bounds.holds(value):
            raise ValueError(f"{slot.key} is {value!r}, expected {slot.bounds}")
    check_prefix(prefix)
    if real not in ("double", "float"):
        raise ValueError(f"real is {real!r}, expected 'double' or 'float'")
    if tables and (len(tables) != len(system.tables) or real != "double"):
        raise ValueError(f"{len(tables)} tables in {real}, expected {len(system.tables)} in double")
    seconds = number("period", period, positive=True)
    free, tabled = _tunable(system.slots, tunable), tuple(tables)
    return Export(system, numbers, free, prefix, real, tabled, seconds, seed, run, tuple(timing))


_STRUCTURAL = ("law", "controller", "observer", "feedforward", "log_form", "mode", "period", "fast", "l", "m", "p", "r")
_STRUCTURE = frozenset(f"control.{key}" for key in _STRUCTURAL)

_FRICTIONS = "|".join(item.name for item in FRICTION)
_SENSORS = "|".join(item.name for effect in SENSORS for item in effect.parameters)
_ABSENT_AT_ZERO = re.compile(rf"((drive|plant)\.({_FRICTIONS})|sensor\.({_SENSORS})|base_motion\.mount(_rpy)?)(\.\d+)?")
_NEEDS_COULOMB = re.compile(rf"(drive|plant)\.{COULOMB_VELOCITY.name}(\.\d+)?")


def _tunable(slots: Sequence[Slot], names: Sequence[str] | str) -> tuple[int, ...]:
    if names == "all":
        return tuple(range(len(slots)))
    if names == "none":
        return ()
    if isinstance(names, str):
        names = [names]
    chosen: set[int] = set()
    for name in names:
        found = {i for i, slot in enumerate(slots) if f"{slot.key}.".startswith(f"{name}.")}
        if not found:
            if name in _STRUCTURE:
                raise ValueError(f"{name!r} is structure and never tunable: export once for each of its values")
            if _ABSENT_AT_ZERO.fullmatch(name):
                text = "is zero in this scenario, and what is zero is absent from the C: give it a value other than 0"
                raise ValueError(f"{name!r} {text}")
            if _NEEDS_COULOMB.fullmatch(name):
                raise ValueError(f"{name!r} only counts beside a Coulomb friction, and there is none in this scenario")
            near = nearest(name, (slot.key for slot in slots), 0.0)
            raise ValueError(f"no parameter {name!r}; the nearest name is {near!r}")
        chosen |= found
    return tuple(sorted(chosen))


def _instructions(function: ca.Function) -> bytes:
    """A Function as text: a line with its signature, then one per instruction, constants in hexadecimal."""
    lines = [str(function)]
    for k in range(function.n_instructions()):
        op = function.instruction_id(k)
        row = f"{op} {function.instruction_output(k)} {function.instruction_input(k)}"
        lines.append(f"{row} {function.instruction_constant(k).hex()}" if op == ca.OP_CONST else row)
    return "\n".join([*lines, ""]).encode()


def provenance(export: Export) -> list[str]:
    """The lines that every generated file starts with."""
    return [
        f"Generated by springline {version('springline')} with CasADi {version('casadi')}; do not edit.",
        f"SHA-256 of model and options: {export.sha256}",
    ]


def comment(lines: Sequence[str]) -> str:
    """A C block comment."""
    body = "\n".join(f" * {line}".rstrip() for line in lines)
    return f"/*\n{body}\n */\n"


def operations(export: Export) -> dict[str, int]:
    """Arithmetic operations of each model function, by public name."""
    return {name: count_operations(function) for name, function in export.model_functions()}
