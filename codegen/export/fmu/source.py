"""The C sources of an FMU: the typed interface, the fixed files of runtime/fmu/, and what is particular to this one."""

from __future__ import annotations

import math
import re
from importlib import resources

from springline.codegen.export import Export, check_files, comment, provenance
from springline.codegen.export.c import TypedInterface, text_files
from springline.codegen.export.fmu.settings import FmiVersion, Settings
from springline.codegen.export.fmu.variables import NO_LIMIT, Interface, Variable, base_is_input
from springline.codegen.program import constant_expression, scalar_slopes, scalar_stages

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
    files["sl_math.h"] = (runtime / "sl_math.h").read_bytes()
    for name in _HEADERS[version]:
        files[name] = (runtime / "fmu" / name).read_bytes()
    steps = [f"{part}.c", *([] if part == "controller" else ["stepping.c"])]
    fixed = ["state.h", *steps, "instance.h", f"fmi{version}.c"]
    after = []
    for name in fixed:
        files[name] = _named((runtime / "fmu" / name).read_text(encoding="utf-8"), stem).encode()
    model = _model(export, typed, interface, settings)
    files["fmu_model.h"] = (comment(provenance(export)) + _named(model, stem)).encode()
    if part != "controller":
        glue = _glue(export, typed, interface, settings)
        files["fmu_glue.h"] = (comment(provenance(export)) + _named(glue, stem)).encode()
        after.append("fmu_glue.h")
    includes = ["fmu_model.h", f"{stem}.c", "state.h", *after, *steps, f"fmi{version}.c"]
    files["all.c"] = (
        comment([*provenance(export), "", "The whole FMU; compile this file alone, as C99."])
        + "".join(f'#include "{name}"\n' for name in includes)
    ).encode()
    check_files(stem, own, [*files, "fmu_token.h"])
    return dict(sorted((files | own).items()))


def _named(text: str, prefix: str) -> str:
    """A text that calls the C interface, with the names that it has in this export."""
    text = re.sub(r"\bspringline(?=_\w|\.h\b)", prefix, text)
    return re.sub(r"\bSPRINGLINE(?=_\w)", prefix.upper(), text)


# --- fmu_model.h -----------------------------------------------------------------------------------------


def _model(
    export: Export,
    typed: TypedInterface,
    interface: Interface,
    settings: Settings,
) -> str:
    part, system = interface.part, export.system
    if part == "controller":  # its signals come from outside
        # The states of a controller go on once a sample: without samples, once a step of the scenario.
        grid = settings.period or (settings.step if "memory" in interface.blocks else 0.0)
        grid_meaning = "s, sample period; 0: at every time"
        until = math.inf
    else:
        grid, grid_meaning = settings.step, "s, step of the integrator"
        until = settings.until
    memory = len(system.memory) if "memory" in interface.blocks else 0
    lines = [
        "#include <stdint.h>",
        "",
        f'#include "{export.prefix}.h"',
        '#include "fmu_token.h"',
        '#include "sl_math.h"',
        "",
        *(
            f"#define {name} ({constant_expression(value)}) /* {meaning} */"
            for name, value, meaning in (
                ("FMU_GRID", grid, grid_meaning),
                ("FMU_BOUND", settings.bound, "the plant may not leave it, SI"),
                ("FMU_UNTIL", until, "s since the start, where the scenario's signals end"),
                ("FMU_NO_LIMIT", NO_LIMIT, "stands for infinity, as do greater numbers"),
            )
        ),
        f"#define FMU_HOLD {settings.hold} /* steps per sample of the control, 0: continuous */",
        f"#define FMU_BASE_IS_INPUT {int(base_is_input(system, part))}",
        f"#define FMU_MEMORY {memory} /* states of the controller */",
        "",
        "enum {",
        f"  FMU_VALUES = {len(interface.variables)},",
        f"  FMU_STATES = {len(typed.structures['state'])},",
        f"  FMU_DIAGNOSTICS = {len(typed.structures['diagnostics'])},",
        f"  FMU_CURRENT = {(1 + len(system.sliding)) * system.n}, /* the first diagnostics, e and sigma: never held */",
        ",\n".join(f"  FMU_AT_{name.upper()} = {place}" for name, place in interface.blocks.items()),
        "};",
        "",
        "enum { FMU_INDEPENDENT, FMU_PARAMETER, FMU_INPUT, FMU_OUTPUT, FMU_LOCAL };",
        "",
        "typedef struct {",
        "  const char *name;",
        "  int causality;",
        "  int boolean, fixed;",
        "  double start, low, high;",
        "  int low_open, high_open, even, infinite;",
        "  const char *expected;",
        "} fmu_variable;",
        "",
        "/* By value reference. */",
        "static const fmu_variable fmu_variables[FMU_VALUES] = {",
        *(f"  {_row(variable)}," for variable in interface.variables),
        "};",
        "",
    ]
    copies = _copies(export, typed, interface)
    return "\n".join([*lines, *copies])


def _row(variable: Variable) -> str:
    bounds = variable.bounds
    numbers = (constant_expression(x) for x in (variable.start or 0.0, bounds.low, bounds.high))
    flags = (bounds.low_open, bounds.high_open, bounds.even, bounds.infinite)
    return (
        f'{{"{variable.name}", FMU_{variable.causality.upper()}, {int(variable.boolean)}, {int(variable.fixed)}, '
        f"{', '.join(numbers)}, "
        f'{", ".join(str(int(flag)) for flag in flags)}, "{variable.expected}"}}'
    )


def _copies(export: Export, typed: TypedInterface, interface: Interface) -> list[str]:
    """Functions between blocks of values and the structures of the C interface: those that this part calls."""
    inside = not base_is_input(export.system, interface.part)
    names = {
        "controller": ["get_reference", "get_measurement", "put_command", "put_diagnostics"],
        "plant": ["get_command", "get_state", "put_state", "put_base" if inside else "get_base"],
        "loop": ["put_reference", "put_command", "put_diagnostics", "put_state", "put_base" if inside else "get_base"],
    }[interface.part]
    if "memory" in interface.blocks:
        names += ["get_memory", "put_memory"]
    lines = []
    for name in names:
        direction, _, structure = name.partition("_")
        lines += _copy(typed, structure, direction == "get")
    if interface.part == "loop":
        lines += ["#if FMU_HOLD > 0", *_copy(typed, "command", True), "#endif", "", *_copy(typed, "state", True)]
    lines.append("static void fmu_get_parameters(const double *v, springline_config *config) {")
    if export.tunable:
        for k, slot in enumerate(export.tunable_slots):
            value = f"v[{k}] >= FMU_NO_LIMIT ? SL_INF : v[{k}]" if slot.bounds.infinite else f"v[{k}]"
            lines.append(f"  config->parameters.{slot.symbol} = {value};")
    else:
        lines.append("  (void)v, (void)config;")
    return [*lines, "}", ""]


def _copy(typed: TypedInterface, structure: str, get: bool) -> list[str]:
    fields = typed.structures[structure]
    if get:
        head = f"static void fmu_get_{structure}(const double *v, springline_{structure} *s) {{"
        body = [f"  s->{field.name} = v[{k}];" for k, field in enumerate(fields)]
    else:
        head = f"static void fmu_put_{structure}(double *v, const springline_{structure} *s) {{"
        body = [f"  v[{k}] = s->{field.name};" for k, field in enumerate(fields)]
    return [head, *body, "}", ""]


# --- fmu_glue.h ------------------------------------------------------------------------------------------


def _glue(export: Export, typed: TypedInterface, interface: Interface, settings: Settings) -> str:
    """fmu_glue.h: the surroundings, and where the law is part of the differential equation, a step of the loop."""
    outside = (
        ["  fmu_get_base(fmu->now.values + FMU_AT_BASE, base);"] if base_is_input(export.system, interface.part) else []
    )
    lines = [
        "/* Reference and base motion: the scenario's, or what the importer makes of the base. */",
        "static int fmu_surroundings(const fmu_core *fmu, double t, springline_reference *reference,",
        "                            springline_base *base) {",
        "  const int status = springline_signals(&fmu->controller, t, reference, base);",
        *outside,
        "  return status;",
        "}",
    ]
    if interface.part == "loop" and settings.period == 0.0:
        lines += ["", *_closed_step(export, typed)]
    return "\n".join([*lines, ""])


def _closed_step(export: Export, typed: TypedInterface) -> list[str]:
    """A step in which every stage has a command of its own, with the bits of the simulation loop."""
    tableau, plant, memory = export.system.tableau, len(typed.structures["state"]), len(export.system.memory)

    failed = "if (status != SPRINGLINE_OK) return status;"

    def evaluate(when: int, at: str, slope: str) -> list[str]:
        rates = [f"status = fmu_rates(fmu, &reference[{when}], {at}, {slope} + FMU_STATES);", failed]
        return [
            f"status = fmu_control(fmu, &reference[{when}], {at}, NULL, &command, &diagnostics);",
            failed,
            f"springline_evaluate_plant(&fmu->controller, &base[{when}], {at}, &command, {slope});",
            *(rates if memory else []),
        ]

    work = "".join(f", {name}[FMU_STATES + FMU_MEMORY]" for name in ("at", *scalar_slopes(tableau)))
    return [
        "static int fmu_control(fmu_core *fmu, const springline_reference *reference, const double *x, double *ahead,",
        "                       springline_command *command, springline_diagnostics *diagnostics);",
        "",
        *_rates(typed),
        "/* The loop from x to next. */",
        "static int fmu_closed_step(fmu_core *fmu, const springline_reference *reference, const springline_base *base,",
        "                           const double *x, double *next, double step) {",
        "  springline_command command;",
        "  springline_diagnostics diagnostics;",
        f"  double {work.removeprefix(', ')};",
        "  int status, i;",
        *(f"  {line}" for line in scalar_stages(tableau, export.real, plant + memory, evaluate)),
        "  return SPRINGLINE_OK;",
        "}",
    ]


def _rates(typed: TypedInterface) -> list[str]:
    """A function that computes the rates of the controller's states, where it has some."""
    if typed.rates is None:
        return []
    return [
        "/* dz/dt of the controller's states, which stand behind the plant's in x. */",
        "static int fmu_rates(fmu_core *fmu, const springline_reference *reference, const double *x, double *dz) {",
        "  springline_controller *controller = &fmu->controller;",
        "  springline_measurement seen, *measurement = &seen;",
        "  springline_state state;",
        "  int status;",
        "  fmu_get_state(x, &state);",
        "  fmu_get_memory(x + FMU_STATES, &controller->z);",
        "  status = springline_measure(controller, &state, measurement);",
        "  (void)reference;",
        "  if (status != SPRINGLINE_OK) return status;",
        *(f"  {line}" for line in typed.rates.lines),
        "  return SPRINGLINE_OK;",
        "}",
        "",
    ]
