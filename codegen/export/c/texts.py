"""The files of an export that are mostly fixed text: templates from runtime/export/, their placeholders filled.

A placeholder is {{name}}. The templates say "springline" where the export's prefix goes: in identifiers and file names.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Mapping
from importlib import resources
from importlib.metadata import version

from springline.codegen.export import PERIOD, Export, comment, provenance
from springline.codegen.export.c.interface import STATUS, TypedInterface
from springline.codegen.export.c.vectors import TIME_STEP, control_outputs
from springline.codegen.program import literal, print_tables

_ROW = 0.01  # s between the rows that main prints


def text_files(export: Export, interface: TypedInterface) -> dict[str, bytes]:
    """README, build files, main, self-check and the typed interface, by path."""
    prefix, start = export.prefix, provenance(export)
    single = export.real == "float"
    common = {
        "prefix": prefix,
        "real": export.real,
        "f": "f" if single else "",
        "math": "slf" if single else "sl",
        "math_header": "sl_mathf.h" if single else "sl_math.h",
        "version": version("springline"),
        "model_hash": export.sha256,
        **interface.blocks(),
    }
    banner = comment(start)
    table = comment([*start, "", *interface_table(interface)])
    hashes = "".join(f"# {line}\n" for line in start)
    return {
        **_table_files(export, banner),
        f"include/{prefix}.h": _fill("springline.h", common, prefix, table),
        f"src/{prefix}.c": _fill("springline.c", common, prefix, table),
        "main.c": _fill("main.c", common | _main_blocks(interface), prefix, banner),
        "self_check.c": _fill("self_check.c", common | _check_blocks(export, interface), prefix, banner),
        "README.md": _fill("README.md", common | _readme_blocks(export, interface), prefix),
        "CMakeLists.txt": _fill("CMakeLists.txt", common, prefix, hashes),
        f"{prefix}.pc.in": _fill("springline.pc.in", common, prefix, hashes),
    }


def _table_files(export: Export, banner: str) -> dict[str, bytes]:
    """The scenario's tables, where they are part of the export."""
    if not export.tables:
        return {}
    name = f"{export.prefix}_tables"
    lines = ['#include "sl_tables.h"', "", *print_tables(export.tables, name), ""]
    runtime = resources.files("springline.codegen") / "runtime"
    return {
        f"src/{name}.h": (banner + "\n".join(lines)).encode(),
        "src/sl_tables.h": (runtime / "sl_tables.h").read_bytes(),
    }


def _fill(template: str, blocks: Mapping[str, str], prefix: str, banner: str = "") -> bytes:
    """A template with its placeholders filled and its names carrying the prefix."""
    text = (resources.files("springline.codegen") / "runtime" / "export" / template).read_text(encoding="utf-8")
    text = re.sub(r"\{\{(\w+)\}\}", lambda hole: blocks[hole[1]], text)
    text = re.sub(r"\bspringline(?=_\w|\.(?:h|c|pc)\b)", prefix, text)
    text = re.sub(r"\bSPRINGLINE(?=_\w)", prefix.upper(), text)
    return f"{banner}{text}".encode()


def interface_table(interface: TypedInterface) -> list[str]:
    """Structures, units and operation counts, as lines of text for a comment."""
    lines = [
        f"{name}: " + ", ".join(f"{field.name} ({field.unit})" for field in members)
        for name, members in interface.structures.items()
    ]
    stages = interface.export.system.tableau.stages
    counts = [f"{name} {body.operations}" for name, body in interface.bodies.items()]
    wrapped = [part for line in lines for part in textwrap.wrap(line, 110, subsequent_indent="    ")]
    return [*wrapped, f"operations: {', '.join(counts)} (a plant step takes {stages} plant evaluations)"]


def _main_blocks(interface: TypedInterface) -> dict[str, str]:
    joints = [joint.name for joint in interface.export.system.joints]
    columns = [("state", "q1"), ("reference", "q1d"), ("command", "U")]
    shown = [(owner, f"{quantity}_{joint}") for owner, quantity in columns for joint in joints]
    missing = interface.missing_tables.replace("zero here", "main runs with zero")
    digits = "9" if interface.export.real == "float" else "17"
    return {
        **_timing(interface.export),
        "digits": digits,
        "table_warning": f'  fprintf(stderr, "main: {missing}\\n");\n' if missing else "",
        "csv_header": ",".join(["t", *(name for _, name in shown)]),
        "print_fields": "\n".join(f'  printf(",%.{digits}g", (double){owner}->{name});' for owner, name in shown),
    }


def _check_blocks(export: Export, interface: TypedInterface) -> dict[str, str]:
    single, structures = export.real == "float", interface.structures
    n = export.system.n

    def filled(**owners: str) -> str:
        places = [f"{owner}{field.name}" for name, owner in owners.items() for field in structures[name]]
        return "\n".join(f"  {place} = in[{k}];" for k, place in enumerate(places))

    def taken(places: list[str]) -> str:
        return "\n".join(f"  got[{k}] = {place};" for k, place in enumerate(places))

    outputs = control_outputs(export)
    of_diagnostics = {field.name: field for field in structures["diagnostics"]}
    states = [field.name for field in structures["state"]]
    measured = [field.name for field in structures["measurement"]]
    memory = [field.name for field in structures.get("memory", ())]
    places = [f"command.{name}" for name in outputs[:n]]
    places += [
        f"{'(springline_real)' if of_diagnostics[name].integer else ''}diagnostics.{name}"
        for name in outputs[n : len(outputs) - len(memory)]
    ]
    tunable = export.tunable_slots
    call = [f"  {export.real} x[{len(states)}] = {{{literal(0.0, export.real)}}};"]
    bad_parameter = []
    if tunable:
        bad_parameter = [
            f"  config.parameters.{tunable[0].symbol} = {literal(math.nan, export.real)};",
            "  config.fallback = SPRINGLINE_FALLBACK_ZERO;",
            "  if (springline_set_parameters(controller, &config) != SPRINGLINE_BAD_PARAMETER) {",
            '    printf("self_check: springline_set_parameters took a parameter that is not a number\\n");',
            "    return 1;",
            "  }\n",
        ]
        members = [f"springline_default_config.parameters.{slot.symbol}" for slot in tunable]
        call += [f"  {export.real} p[{len(tunable)}];"]
    # The model's control gives the command, its parts, error, and sigma where there is one.
    parts = 2 + len(export.system.command_parts) + len(export.system.sliding)
    z = [f"in + {3 * n + len(measured)}"] if memory else []
    pointers = [f"in + {k * n}" for k in range(3)] + ["x", *z] + (["p"] if tunable else [])
    call += [
        f"  const {export.real} *arg[{len(pointers)}] = {{0}};",
        f"  {export.real} *res[{parts}] = {{0}};",
        *(f"  x[{states.index(name)}] = in[{3 * n + k}];" for k, name in enumerate(measured)),
        *((f"  p[{k}] = {member};" for k, member in enumerate(members)) if tunable else ()),
        *(f"  arg[{k}] = {pointer};" for k, pointer in enumerate(pointers)),
        *(f"  res[{k}] = got + {k * n};" for k in range(parts)),
        "  if (springline_control(arg, res, 0, 0, 0) != 0) return 1;",
    ]
    return {
        "bits": "32" if single else "64",
        "bits_type": "uint32_t" if single else "uint64_t",
        "strto": "strtof" if single else "strtod",
        "control_in": str(3 * n + len(measured) + len(memory)),
        **_memory_check(memory),
        "control_out": str(len(outputs)),
        "command_out": str(n),
        "model_out": str(parts * n),
        "command_to_vector": taken([f"command.{name}" for name in outputs[:n]]),
        "first_measurement": measured[0],
        "zero": literal(0.0, export.real),
        "NAN": literal(math.nan, export.real),
        "bad_parameter": "\n".join(bad_parameter),
        "control_output_names": ", ".join(f'"{name}"' for name in outputs),
        "plant_in": str(len(structures["base"]) + len(states) + n),
        "plant_out": str(len(states)),
        "plant_output_names": ", ".join(f'"{name}"' for name in states),
        "plant_time_step": literal(TIME_STEP, export.real),
        "control_from_vector": filled(reference="reference->", measurement="measurement->"),
        "control_to_vector": taken(places + [f"controller->z.{name}" for name in memory]),
        "model_call": "\n".join(call),
        "plant_from_vector": filled(base="base[0].", state="state.", command="command."),
        "plant_to_vector": taken([f"state.{name}" for name in states]),
    }


def _calling(export: Export) -> str:
    """How often a controller wants to be called."""
    if not export.system.memory:
        return (
            "How fast to call `springline_step`: the law keeps no state between samples, but the springs do, and a "
            "command that comes too\nseldom or too late destabilises them."
        )
    return (
        f"Call `springline_step` every {1e3 * export.period:g} ms: by so much it moves the controller's states on. A "
        "command that comes too\nseldom or too late destabilises the arm."
    )


def _memory_check(memory: list[str]) -> dict[str, str]:
    """What self_check looks at of a controller's states: before a sample they are those of the vector."""
    names = ("memory_enum", "memory_check", "memory_local", "memory_seen", "kept", "again")
    if not memory:
        return dict.fromkeys(names, "")
    taken = "".join(f"  got[{k}] = controller->z.{name};\n" for k, name in enumerate(memory))
    differ = [f"controller->z.{name} != z.{name}" for name in memory]
    return {
        "memory_enum": f"       MEMORY = {len(memory)},\n",
        "memory_check": taken + '  if (differs("the states before springline_step", line,\n'
        "              control_outputs + CONTROL_OUT - MEMORY, MEMORY, in + CONTROL_IN - MEMORY, got)) {\n"
        "    return 1;\n"
        "  }\n",
        "memory_local": "  springline_memory z;\n",
        "memory_seen": "  z = controller->z;\n",
        "kept": " || ".join(differ) + " ||\n      ",
        "again": "springline_reset(controller) != SPRINGLINE_OK || ",
    }


def _timing(export: Export) -> dict[str, str]:
    """How main samples and steps: at the period of a controller that has states, else at a usual one."""
    period = export.period if export.system.memory else PERIOD
    steps = max(round(period / TIME_STEP), 1)
    step = TIME_STEP if steps * TIME_STEP == period else period / steps
    return {
        "period_text": f"{1e3 * period:g} ms",
        "step_text": f"{1e3 * step:g} ms",
        "step": "1e-4" if step == TIME_STEP else repr(step),
        "steps_per_sample": str(steps),
        "samples_per_row": str(max(round(_ROW / period), 1)),
        "samples_per_second": str(round(1 / period)),
    }


def _readme_blocks(export: Export, interface: TypedInterface) -> dict[str, str]:
    tunable = set(export.tunable)
    single, stages = export.real == "float", export.system.tableau.stages
    cost = {"springline_step": "control", f"one evaluation of the plant, of {stages} in springline_plant_step": "plant"}
    return {
        "table_note": (
            f"{interface.missing_tables.removesuffix('.')}, in `{export.prefix}_signals` and so in what `main.c` runs "
            "with. Put signals of your own in its place."
            if interface.missing_tables
            else f"`{export.prefix}_signals` has the scenario's reference and base motion."
        ),
        "calling": _calling(export),
        "sampled": "millisecond" if _timing(export)["period_text"] == "1 ms" else _timing(export)["period_text"],
        "sampling": f"{export.system.mechanism.sampling}\n" if export.system.mechanism.sampling else "",
        "provenance": "  \n".join(provenance(export)),
        "field_table": "\n".join(
            f"| `springline_{name}` | `{field.name}` | {field.unit} | {field.meaning} |"
            for name, members in interface.structures.items()
            for field in members
        ),
        "status_table": "\n".join(
            f"| `SPRINGLINE_{name}` | {value} | {text} |" for value, (name, text) in enumerate(STATUS)
        ),
        "parameters_text": "The tunable ones are set through `springline_config`, checked by `springline_init`\n"
        "and, while it runs, by `springline_set_parameters`."
        if tunable
        else "All are constants of the C.",
        "parameter_table": "\n".join(
            f"| `{slot.key}` | {value!r} | {slot.unit} | {'run' if i in tunable else 'baked'} |"
            for i, (slot, value) in enumerate(zip(export.slots, export.values, strict=True))
        ),
        "cost_table": "\n".join(
            f"| {name} | {interface.bodies[body].operations} | {interface.bodies[body].live} |"
            for name, body in cost.items()
        ),
        "control_stack": str(interface.stack("control")),
        "plant_stack": str(interface.stack("plant")),
        "model_origin": "printed like the rest in single precision, with CasADi's calling convention"
        if single
        else "as CasADi prints them: `casadi.external` can load them from a shared library",
        "math_files": "`src/sl_mathf.h`" if single else "`src/sl_math.h`, `src/sl_casadi.h`",
    }
