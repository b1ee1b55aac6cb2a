"""The C sources of an FMU: the typed interface, the fixed files of runtime/fmu/, and what is particular to this one."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Sequence
from importlib import resources

from springline.codegen.baking import print_baked
from springline.codegen.export import Export, comment, provenance
from springline.codegen.export_text import text_files
from springline.codegen.fmu_settings import FmiVersion, Settings
from springline.codegen.fmu_variables import NO_LIMIT, Interface, Variable, base_is_input
from springline.codegen.kernel import Table
from springline.codegen.names import check_files
from springline.codegen.scalar import literal
from springline.codegen.typed import TypedInterface, literal_constant

_HEADERS = {
    2: ("fmi2FunctionTypes.h", "fmi2Functions.h", "fmi2TypesPlatform.h"),
    3: ("fmi3FunctionTypes.h", "fmi3Functions.h", "fmi3PlatformTypes.h"),
}


def sources(
    export: Export,
    typed: TypedInterface,
    interface: Interface,
    settings: Settings,
    tables: Sequence[Table],
    version: FmiVersion,
) -> dict[str, bytes]:
    """The files of sources/ by name, but for fmu_token.h; all.c includes the others and is the one to compile."""
    stem, part = export.prefix, interface.part
    texts = text_files(export, typed)
    own = {f"{stem}.h": texts[f"include/{stem}.h"], f"{stem}.c": texts[f"src/{stem}.c"]}
    files = {}
    runtime = resources.files("springline.codegen") / "runtime"
    files["sl_math.h"] = (runtime / "sl_math.h").read_bytes()
    for name in _HEADERS[version]:
        files[name] = (runtime / "fmu" / name).read_bytes()
    steps = [f"{part}.c", *([] if part == "controller" else ["stepping.c"])]
    fixed = ["state.h", *steps, "instance.h", f"fmi{version}.c"]
    printed = _functions(export, interface, settings, bool(tables))
    after = []
    if printed:
        files["sl_casadi.h"] = (runtime / "sl_casadi.h").read_bytes()
        files["functions.c"] = (comment(provenance(export)) + printed).encode()
        after.append("functions.c")
    if tables:
        fixed.append("tables.c")
        after.append("tables.c")
    for name in fixed:
        files[name] = _named((runtime / "fmu" / name).read_text(encoding="utf-8"), stem).encode()
    model = _model(export, typed, interface, settings, tables)
    files["fmu_model.h"] = (comment(provenance(export)) + _named(model, stem)).encode()
    if part != "controller":
        glue = _glue(export, typed, interface, settings, bool(tables))
        files["fmu_glue.h"] = (comment(provenance(export)) + _named(glue, stem)).encode()
        after.append("fmu_glue.h")
    includes = ["fmu_model.h", "state.h", *after, *steps, f"fmi{version}.c", f"{stem}.c"]
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
    tables: Sequence[Table],
) -> str:
    part, system = interface.part, export.system
    if part == "controller":  # its signals come from outside
        grid, grid_meaning = settings.period, "s, sample period; 0: at every time"
        until = math.inf
    else:
        grid, grid_meaning = settings.step, "s, step of the integrator"
        until = settings.until
    hold = round(settings.period / settings.step)
    lines = [
        "#include <stdint.h>",
        "",
        f'#include "{export.prefix}.h"',
        '#include "fmu_token.h"',
        '#include "sl_math.h"',
        "",
        *(
            f"#define {name} ({literal_constant(value, 'double')}) /* {meaning} */"
            for name, value, meaning in (
                ("FMU_GRID", grid, grid_meaning),
                ("FMU_BOUND", settings.bound, "the plant may not leave it, SI"),
                ("FMU_UNTIL", until, "s since the start, where the scenario's signals end"),
                ("FMU_NO_LIMIT", NO_LIMIT, "stands for infinity, as do greater numbers"),
            )
        ),
        f"#define FMU_HOLD {hold} /* steps per sample of the control, 0: continuous */",
        f"#define FMU_BASE_IS_INPUT {int(base_is_input(system, part))}",
        "",
        "enum {",
        f"  FMU_VALUES = {len(interface.variables)},",
        f"  FMU_STATES = {len(typed.structures['state'])},",
        f"  FMU_JOINTS = {system.n},",
        f"  FMU_DIAGNOSTICS = {len(typed.structures['diagnostics'])},",
        f"  FMU_TABLES = {len(tables)},",
        ",\n".join(f"  FMU_AT_{name.upper()} = {place}" for name, place in interface.blocks.items()),
        "};",
        "",
        "enum { FMU_INDEPENDENT, FMU_PARAMETER, FMU_INPUT, FMU_OUTPUT };",
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
    return "\n".join([*lines, *copies, *_tables(tables)])


def _row(variable: Variable) -> str:
    bounds = variable.bounds
    numbers = (literal_constant(x, "double") for x in (variable.start or 0.0, bounds.low, bounds.high))
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
    lines = []
    for name in names:
        direction, _, structure = name.partition("_")
        lines += _copy(typed, structure, direction == "get")
    if interface.part == "loop":
        lines += ["#if FMU_HOLD > 0", *_copy(typed, "command", True), *_copy(typed, "state", True), "#endif", ""]
        order = [field.name for field in typed.structures["state"]]
        lines += [
            "static void fmu_measure(const double *x, springline_measurement *s) {",
            *(f"  s->{f.name} = x[{order.index(f.name)}];" for f in typed.structures["measurement"]),
            "}",
            "",
        ]
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


def _tables(tables: Sequence[Table]) -> list[str]:
    if not tables:
        return []
    lines = [
        "typedef struct {",
        "  double t0, dt; /* s */",
        "  int64_t intervals;",
        "  int channels, periodic;",
        "  const double *coefficients; /* intervals x channels x 4 */",
        "} fmu_table;",
        "",
    ]
    rows = []
    for i, table in enumerate(tables):
        intervals, channels, _ = table.coefficients.shape
        lines.append(f"static const double fmu_coefficients_{i}[] = {{")
        lines += [
            "  " + ", ".join(literal(float(c), "double") for c in interval.ravel()) + ","
            for interval in table.coefficients
        ]
        lines += ["};", ""]
        start = f"{literal(table.t0, 'double')}, {literal(table.dt, 'double')}"
        rows.append(f"  {{{start}, {intervals}, {channels}, {int(table.periodic)}, fmu_coefficients_{i}}},")
    return [*lines, "static const fmu_table fmu_tables[FMU_TABLES] = {", *rows, "};", ""]


# --- functions that the C interface does not have ----------------------------------------------------------


def _wants_slope(interface: Interface, settings: Settings) -> bool:
    """Whether the law is part of the differential equation: then its right-hand side is needed by itself."""
    return interface.part == "loop" and settings.period == 0.0


def _functions(export: Export, interface: Interface, settings: Settings, tables: bool) -> str:
    wanted = []
    if _wants_slope(interface, settings):
        wanted.append((f"{export.prefix}_slope", export.system.function("plant")))
    if tables:
        wanted.append((f"{export.prefix}_table_signals", export.system.function("signals")))
    if not wanted:
        return ""
    printed = print_baked(wanted, export.tunable, export.values, "functions", ("sl_casadi.h",))
    return (
        "#define CASADI_SYMBOL_EXPORT static\n"
        "#if defined(__GNUC__) /* entry points that CasADi adds and nobody here calls */\n"
        '#pragma GCC diagnostic ignored "-Wunused-function"\n'
        '#pragma GCC diagnostic ignored "-Wunused-parameter"\n'
        "#endif\n"
        f"{printed}"
    )


def _glue(export: Export, typed: TypedInterface, interface: Interface, settings: Settings, tables: bool) -> str:
    """fmu_glue.h: signals and the plant's right-hand side, in the form that plant.c and loop.c expect."""
    reference, base = ([f"{name}->{field.name}" for field in typed.structures[name]] for name in ("reference", "base"))
    p = ", parameters" if export.tunable else ""
    outside = (
        ["  fmu_get_base(fmu->now.values + FMU_AT_BASE, base);"] if base_is_input(export.system, interface.part) else []
    )
    lines = [
        "/* Reference and base motion: the scenario's, or what the importer makes of the base. */",
        "static int fmu_surroundings(const fmu_core *fmu, double t, springline_reference *reference,",
        "                            springline_base *base) {",
    ]
    if tables:
        lines += [
            f"  double d[{export.system.d.numel()}], w[{export.system.w.numel()}];",
            "  const double *parameters = fmu->now.values + FMU_AT_PARAMETERS;",
            f"  const double *arg[] = {{&t, d{p}}};",
            "  double *res[] = {w};",
            "  (void)parameters;",
            "  fmu_table_data(t, d);",
            "  (void)springline_table_signals(arg, res, 0, 0, 0);",
            *(f"  {name} = w[{k}];" for k, name in enumerate([*reference, *base])),
            *outside,
            "  return SPRINGLINE_OK;",
            "}",
        ]
    else:
        lines += [
            "  const int status = springline_signals(&fmu->controller, t, reference, base);",
            *outside,
            "  return status;",
            "}",
        ]
    if _wants_slope(interface, settings):
        commands = ", ".join(f"command->{field.name}" for field in typed.structures["command"])
        third = len(base) // 3
        lines += [
            "",
            "static void fmu_slope(const double *parameters, const springline_base *base, const double *x,",
            "                      const springline_command *command, double *slope) {",
            "  const double b[] = {",
            *textwrap.wrap(", ".join(base) + "};", 110, initial_indent="    ", subsequent_indent="    "),
            f"  const double u[] = {{{commands}}};",
            f"  const double *arg[] = {{b, b + {third}, b + {2 * third}, x, u{p}}};",
            "  double *res[] = {slope};",
            "  (void)parameters;",
            "  (void)springline_slope(arg, res, 0, 0, 0);",
            "}",
        ]
    return "\n".join([*lines, ""])
