"""The files of an export that are printed from templates/: the interface, its programs, build files and README."""

from __future__ import annotations

import math
from functools import partial
from importlib import resources
from importlib.metadata import version
from typing import Any

from springline.codegen.export import PERIOD, Export, provenance
from springline.codegen.export.c.interface import TypedInterface
from springline.codegen.export.c.statuses import statuses
from springline.codegen.export.c.vectors import TIME_STEP, control_outputs
from springline.codegen.files import render
from springline.codegen.program import (
    constant_expression,
    literal,
    print_tables,
    scalar_points,
    scalar_slopes,
    scalar_stages,
)

_ROW = 0.01  # s between the rows that main prints


def text_files(export: Export, interface: TypedInterface) -> dict[str, bytes]:
    """README, build files, main, self-check and the typed interface, by path."""
    prefix, values = export.prefix, _values(export, interface)

    def text(template: str, **more: Any) -> bytes:
        return render("springline.codegen.export.c", f"{template}.j2", **values, **more).encode()

    files = {
        f"include/{prefix}.h": text("springline.h"),
        f"src/{prefix}.c": text("springline.c", **_stepping(export, interface)),
        "main.c": text("main.c", **_main(interface)),
        "self_check.c": text("self_check.c", **_self_check(export, interface)),
        "README.md": text("README.md", **_readme(export, interface)),
        "CMakeLists.txt": text("CMakeLists.txt"),
        f"{prefix}.pc.in": text("springline.pc.in"),
    }
    if export.system.noise.numel():
        runtime = resources.files("springline.codegen") / "runtime"
        files["src/sl_noise.h"] = (runtime / "sl_noise.h").read_bytes()
    if export.tables:
        name = f"{prefix}_tables"
        runtime = resources.files("springline.codegen") / "runtime"
        files[f"src/{name}.h"] = text("tables.h", lines=list(print_tables(export.tables, name)))
        files["src/sl_tables.h"] = (runtime / "sl_tables.h").read_bytes()
    return files


def _values(export: Export, interface: TypedInterface) -> dict[str, Any]:
    """What the templates print: the declarations of the interface, and numbers as C."""
    system, single = export.system, export.real == "float"
    constant = partial(constant_expression, real=export.real)
    return {
        "prefix": export.prefix,
        "PREFIX": export.prefix.upper(),
        "provenance": provenance(export),
        "version": version("springline"),
        "model_hash": export.sha256,
        "real": export.real,
        "f": "f" if single else "",
        "math": "slf" if single else "sl",
        "math_header": "sl_mathf.h" if single else "sl_math.h",
        "zero": literal(0.0, export.real),
        "nan": literal(math.nan, export.real),
        "structures": interface.structures,
        "bodies": interface.bodies,
        "derive": interface.derive,
        "derived": interface.derived,
        "limits": interface.joint_limits,
        "statuses": statuses(export.prefix),
        "states": len(interface.structures["state"]),
        "memory": interface.structures.get("memory", ()),
        "memory_start": [constant(value) for value in system.z_start],
        "sliding": bool(system.sliding),
        "disturbed": bool(system.forces),
        "actuate": interface.actuate,
        "delay": system.structure.delay,
        "motors": interface.structures.get("motors", ()),
        "joints_count": system.n,
        "sensed": bool(system.measured),
        "differenced": system.structure.differenced,
        "noise_pairs": system.noise_pairs,
        "seed": export.seed,
        "run": export.run,
        "has_law": system.controller.law is not None,
        "command_parts": [part.name for part in system.command_parts],
        "tableau": system.tableau,
        "nodes": [literal(node, export.real) for node in system.tableau.nodes],
        "period": f"{export.period:g}",
        "period_ms": f"{1e3 * export.period:g}",
        "tunable": export.tunable_slots,
        "defaults": [constant(export.values[i]) for i in export.tunable],
        "parameter_tests": interface.parameter_tests(),
        "controller_bytes": interface.bytes_of("controller"),
        "tables": len(export.tables),
        "table_data": system.d.numel(),
        "of_tables": [name for name in interface.bodies if interface.reads_tables(name)],
        "measured_base": interface.measured_base,
        "missing_tables": interface.missing_tables,
        "timing": export.timing,
        "main": _timing(export),
    }


def _stepping(export: Export, interface: TypedInterface) -> dict[str, Any]:
    """The statements of a plant step."""
    tableau, states = export.system.tableau, len(interface.structures["state"])

    def evaluate(when: int, at: str, slope: str) -> list[str]:
        command = f"&driven[{when}]" if export.system.commanded else "command"
        return [f"{export.prefix}_evaluate_plant(controller, motion[{when}], {at}, {command}, {slope});"]

    return {
        "points": scalar_points(tableau),
        "slopes": scalar_slopes(tableau),
        "plant_stages": list(scalar_stages(tableau, export.real, states, evaluate)),
    }


def _main(interface: TypedInterface) -> dict[str, Any]:
    """What main prints: structure and field of each column."""
    joints = interface.export.system.joints
    columns = (("state", "q1"), ("reference", "q1d"), ("command", "U"))
    return {
        "digits": 9 if interface.export.real == "float" else 17,
        "shown": [(owner, f"{quantity}_{joint.name}") for owner, quantity in columns for joint in joints],
    }


def _self_check(export: Export, interface: TypedInterface) -> dict[str, Any]:
    """Where the numbers of a test vector go, and come from."""
    structures, system = interface.structures, export.system
    n, outputs = system.n, control_outputs(export)
    measured = [field.name for field in structures["measurement"]]
    states = [field.name for field in structures["state"]]
    memory = [field.name for field in structures.get("memory", ())]
    integers = {field.name for field in structures["diagnostics"] if field.integer}

    def places(**owners: str) -> list[str]:
        return [f"{owner}{field.name}" for name, owner in owners.items() for field in structures[name]]

    diagnostics = outputs[n : len(outputs) - len(memory)]
    casts = [f"({export.prefix}_real)" if name in integers else "" for name in diagnostics]
    first = len(structures["reference"])  # of what is measured, behind the reference
    fed = [f"in + {k}" for k in range(3 * n, first, system.base.b.numel())]
    z = [f"in + {first + len(measured)}"] if memory else []
    z += ["&period"] if system.structure.differenced else []
    return {
        "bits": 32 if export.real == "float" else 64,
        "plant_time_step": literal(TIME_STEP, export.real),
        "sample_period": literal(export.period, export.real),
        "control_outputs": outputs,
        "control_in": places(reference="reference->", measurement="measurement->"),
        "control_out": [
            *(f"command.{name}" for name in outputs[:n]),
            *(f"{cast}diagnostics.{name}" for cast, name in zip(casts, diagnostics, strict=True)),
            *(f"controller->z.{name}" for name in memory),
        ],
        "plant_in": places(base="base[0].", state="state.", command="command."),
        # The model's control gives the command, its parts, error, and sigma where there is one.
        "model_parts": 2 + len(system.command_parts) + len(system.sliding),
        "model_arguments": ["in", f"in + {n}", f"in + {2 * n}", *fed, "x", *z, *(["p"] if export.tunable else [])],
        "measured_places": [(states.index(name), first + k) for k, name in enumerate(measured)],
    }


def _timing(export: Export) -> dict[str, Any]:
    """How main samples and steps: at the period of a controller that has states, else at a usual one."""
    period = export.period if export.system.memory else PERIOD
    steps = max(round(period / TIME_STEP), 1)
    step = TIME_STEP if steps * TIME_STEP == period else period / steps
    return {
        "period_text": f"{1e3 * period:g} ms",
        "step_text": f"{1e3 * step:g} ms",
        "step": "1e-4" if step == TIME_STEP else repr(step),
        "steps_per_sample": steps,
        "samples_per_row": max(round(_ROW / period), 1),
        "samples_per_second": round(1 / period),
    }


def _readme(export: Export, interface: TypedInterface) -> dict[str, Any]:
    tunable = set(export.tunable)
    return {
        "joints": export.system.n,
        "parameters": [
            (slot.key, value, slot.unit, "run" if i in tunable else "baked")
            for i, (slot, value) in enumerate(zip(export.slots, export.values, strict=True))
        ],
        "control_stack": interface.stack("control"),
        "plant_stack": interface.stack("plant"),
    }
