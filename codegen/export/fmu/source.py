"""The C sources of an FMU: the typed interface, templates/, and the fixed files of runtime/fmu/."""

from __future__ import annotations

import math
from importlib import resources
from typing import Any

from springline.codegen.elementary import math_header
from springline.codegen.export import Export, check_files, provenance
from springline.codegen.export.c import TypedInterface, text_files
from springline.codegen.export.fmu.settings import FmiVersion, Settings
from springline.codegen.export.fmu.variables import (
    NO_LIMIT,
    Interface,
    Variable,
    base_is_input,
    force_is_input,
    structures_of,
)
from springline.codegen.files import render
from springline.codegen.program import constant_expression, scalar_points, scalar_slopes, scalar_stages

_HEADERS = {
    2: ("fmi2FunctionTypes.h", "fmi2Functions.h", "fmi2TypesPlatform.h"),
    3: ("fmi3FunctionTypes.h", "fmi3Functions.h", "fmi3PlatformTypes.h"),
}


def sources(
    export: Export,
    typed: TypedInterface,
    interface: Interface,
    settings: Settings,
    version: FmiVersion,
) -> dict[str, bytes]:
    """The files of sources/ by name, but for fmu_token.h; all.c includes the others and is the one to compile."""
    stem, part = export.prefix, interface.part
    texts = text_files(export, typed)
    own = {path.rpartition("/")[2]: text for path, text in texts.items() if path.startswith(("include/", "src/"))}
    files = {name: own.pop(name) for name in [*own] if name.startswith("sl_")}
    runtime = resources.files("springline.codegen") / "runtime"
    files["sl_math.h"] = math_header().encode()
    for name in (*_HEADERS[version], f"fmi{version}.c"):
        files[name] = (runtime / "fmu" / name).read_bytes()
    steps = [f"{part}.c", *([] if part == "controller" else ["stepping.c"])]
    after = [] if part == "controller" else ["fmu_glue.h"]
    values = _values(export, typed, interface, settings)
    values["includes"] = ["fmu_model.h", f"{stem}.c", "state.h", *after, *steps, f"fmi{version}.c"]
    for name in ("fmu_model.h", "state.h", *after, *steps, "instance.h", "all.c"):
        files[name] = render("springline.codegen.export.fmu", f"{name}.j2", **values).encode()
    check_files(stem, own, [*files, "fmu_token.h"])
    return dict(sorted((files | own).items()))


def _values(export: Export, typed: TypedInterface, interface: Interface, settings: Settings) -> dict[str, Any]:
    """What the templates print."""
    part, system, blocks = interface.part, export.system, interface.blocks
    if part == "controller":  # its signals come from outside
        # The states of a controller go on once a sample: without samples, once a step of the scenario.
        grid = settings.period or (settings.step if "memory" in blocks else 0.0)
        until = math.inf
    else:
        grid, until = settings.step, settings.until
    reads, writes = _copies(interface)
    return {
        "prefix": export.prefix,
        "PREFIX": export.prefix.upper(),
        "provenance": provenance(export),
        "part": part,
        "structures": structures_of(typed),
        "tunable": export.tunable_slots,
        "variables": [_row(variable) for variable in interface.variables],
        "blocks": blocks,
        "grid": constant_expression(grid),
        "bound": constant_expression(settings.bound),
        "until": constant_expression(until),
        "no_limit": constant_expression(NO_LIMIT),
        "hold": settings.hold,
        "base_is_input": base_is_input(system, part),
        "measured_base": typed.measured_base,
        "force_is_input": force_is_input(system, part),
        "tip": typed.tip,
        "sensed": part != "controller" and bool(system.measured),
        "judged": typed.judged,
        "noisy": bool(system.noise.numel()),
        "driven": part != "controller" and bool(system.commanded),
        "motors": typed.structures.get("motors", ()) if part != "controller" else (),
        "delay": system.structure.delay if part != "controller" else 0,
        "joints_count": system.n,
        "limits": [[constant_expression(value) for value in pair] for pair in settings.limits],
        "memory": len(system.memory) if "memory" in blocks else 0,
        "current": (1 + len(system.sliding)) * system.n,
        "reads": reads,
        "writes": writes,
        "rates": typed.rates,
        "scratch": [*scalar_points(system.tableau)[1:-1], *scalar_slopes(system.tableau)],
        # Where the law is part of the differential equation.
        "closed_step": _closed_step(export, typed) if part == "loop" and settings.period == 0.0 else [],
    }


def _row(variable: Variable) -> dict[str, Any]:
    """A variable, its numbers as C."""
    bounds = variable.bounds
    numbers = (constant_expression(x) for x in (variable.start or 0.0, bounds.low, bounds.high))
    flags = (bounds.low_open, bounds.high_open, bounds.even, bounds.infinite)
    return {
        "name": variable.name,
        "causality": variable.causality.upper(),
        "kind": [int(variable.boolean), int(variable.fixed)],
        "numbers": list(numbers),
        "flags": [int(flag) for flag in flags],
        "expected": variable.expected,
    }


def _copies(interface: Interface) -> tuple[list[str], list[str]]:
    """Structures of the C interface that this part reads from blocks of values, and that it writes to them."""
    around = [name for name in ("base", "disturbance") if name in interface.blocks]
    given = [name for name in around if interface.variables[interface.blocks[name]].causality == "input"]
    shown = [name for name in around if name not in given]
    reads = {
        "controller": ["reference", "measurement"],
        "plant": ["command", "state", *given],
        "loop": ["state", *given],
    }
    writes = {
        "controller": ["command", "diagnostics"],
        "plant": ["state", *shown],
        "loop": ["reference", "command", "diagnostics", "state", *shown],
    }
    memory = ["memory"] if "memory" in interface.blocks else []
    return [*reads[interface.part], *memory], [*writes[interface.part], *memory]


def _closed_step(export: Export, typed: TypedInterface) -> list[str]:
    """Statements of a step in which every stage has a command of its own, with the bits of the simulation loop."""
    tableau, plant, memory = export.system.tableau, len(typed.structures["state"]), len(export.system.memory)
    prefix = export.prefix
    failed = f"if (status != {prefix.upper()}_OK) return status;"

    def evaluate(when: int, at: str, slope: str) -> list[str]:
        rates = [f"status = fmu_rates(fmu, &reference[{when}], {at}, {slope} + FMU_STATES);", failed]
        return [
            f"status = fmu_control(fmu, &reference[{when}], {at}, NULL, &command, &diagnostics);",
            failed,
            f"{prefix}_evaluate_plant(&fmu->controller, &base[{when}], {at}, &command, {slope});",
            *(rates if memory else []),
        ]

    return list(scalar_stages(tableau, export.real, plant + memory, evaluate))
