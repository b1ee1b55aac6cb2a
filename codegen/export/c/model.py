"""src/<prefix>_model.c and .h: the functions of the model with CasADi's calling convention."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence
from functools import partial
from importlib import resources

from springline.codegen.export import Export, Port, ScalarPrinter, comment, operations, provenance
from springline.codegen.export.c.baking import print_baked
from springline.codegen.files import LINE, broken

_BREAKS = (("{ ",), (", ",), ("(",), (" ",), (",",))  # CasADi's lines are long: between arguments if possible

_CONVENTION = """
Calling convention (CasADi's): arg[i] points to the entries of input i, res[i] to where output i
goes, matrices column by column. An input that is NULL counts as zeros, an output that is NULL is
not written. iw, w and mem are not used by these functions: pass 0.
"""
_CASADI = "<name>_work, _sparsity_in and so on are what casadi.external and other CasADi tools ask for."
_FIVE_ARGUMENTS = """\
#if defined(__GNUC__) /* the convention has five arguments, whether a function needs them or not */
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

"""
_END = """
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif
"""
_ENTRY = "int {name}(const {real}** arg, {real}** res, long long int* iw, {real}* w, int mem)"


def model_files(export: Export) -> dict[str, bytes]:
    """The two files by path: as CasADi prints them, or, since its float C is full of doubles, by our own printer."""
    stem = f"{export.prefix}_model"
    start = [*provenance(export), *_CONVENTION.splitlines()]
    if export.real == "double":
        functions = list(export.model_functions())
        source = print_baked(functions, export.tunable, export.values, stem, (f"{stem}.h", "sl_casadi.h"))
        exported = re.findall(r"^CASADI_SYMBOL_EXPORT (.*?\)) *{", source, re.MULTILINE)
        declarations = [
            re.sub(r"\bcasadi_int\b", "long long int", re.sub(r"\bcasadi_real\b", "double", signature)) + ";"
            for signature in exported
        ]
        source = _self_contained(source)
        start.append(_CASADI)
    else:
        source, declarations = _print_single(export, stem)
    banner = comment([*start, "", *function_table(export)])
    return {
        f"src/{stem}.c": broken(banner + "\n" + _FIVE_ARGUMENTS + source + _END, _BREAKS).encode(),
        f"src/{stem}.h": broken(banner + "\n" + _header(stem, declarations), _BREAKS).encode(),
    }


def _self_contained(source: str) -> str:
    """CasADi's C as one of several in a translation unit, C or C++: no macro outlives it, C++ takes C99's branches."""
    source = source.replace("#if __STDC_VERSION__ < 199901L", "#if !defined(__cplusplus) && __STDC_VERSION__ < 199901L")
    mathematics = (resources.files("springline.codegen") / "runtime" / "sl_casadi.h").read_text(encoding="utf-8")
    macros = [
        *re.findall(r"^ *#define (\w+)", source, re.MULTILINE),
        *re.findall(r"^#define (\w+) sl_\w+$", mathematics, re.MULTILINE),
        "SL_CASADI_H",
    ]
    # These have one meaning wherever CasADi prints them, and whoever compiles may have set them.
    shared = ("casadi_real", "casadi_int", "CASADI_SYMBOL_EXPORT")
    ends = "".join(f"#undef {name}\n" for name in dict.fromkeys(macros) if name not in shared)
    return f"{source}\n/* Another file may follow in the same translation unit. */\n{ends}"


def _print_single(export: Export, stem: str) -> tuple[str, list[str]]:
    """Source and declarations of the model's functions in single precision."""
    pieces = [f'#include "{stem}.h"\n\n#include "sl_mathf.h"\n']
    declarations = []
    for name, function in export.model_functions():
        places = {port.name: i for i, port in enumerate(export.inputs(function))}
        printer = ScalarPrinter(export, [function], hoist=False)
        targets = [
            f"if (res[{i}] != 0) res[{i}][{k}]"
            for i, port in enumerate(export.outputs(function))
            for k in range(len(port.labels))
        ]
        body = printer.body(function.name(), partial(_argument, places), targets)
        entry = _ENTRY.format(name=name, real=export.real)
        declarations.append(f"{entry};")
        lines = "\n".join(f"  {line}" for line in body.lines)
        pieces.append(f"{entry} {{\n{lines}\n  return 0;\n}}\n")
    return "\n".join(pieces), declarations


def _argument(places: Mapping[str, int], name: str, k: int) -> str:
    return f"arg[{places[name]}] ? arg[{places[name]}][{k}] : 0.0f"


def function_table(export: Export) -> list[str]:
    """Inputs, outputs, units and operation counts of the model's functions, as lines of text."""
    counts = operations(export)
    lines = []
    if export.tunable:
        entries = [f"{slot.symbol} ({slot.unit})" for slot in export.tunable_slots]
        lines += ["", *_wrapped(f"p[{len(entries)}]: ", entries)]
    for name, function in export.model_functions():
        lines += ["", f"{name}    {counts[name]} operations"]
        for direction, ports in (("in ", export.inputs(function)), ("out", export.outputs(function))):
            for i, port in enumerate(ports):
                lines += _row(f"  {direction} {i} ", port)
    return lines[1:]


def _row(start: str, port: Port) -> list[str]:
    size = " x ".join(str(k) for k in port.shape if k > 1) or "1"
    entries = [f"{label} ({unit})" for label, unit in zip(port.labels, port.units, strict=True)]
    return _wrapped(f"{start}{port.name}[{size}]: ", ["as above"] if port.name == "p" else entries)


def _wrapped(start: str, entries: Sequence[str]) -> list[str]:
    text = start + ", ".join(entries)
    return textwrap.wrap(text, LINE - len(" * "), subsequent_indent="           ", break_long_words=False)


def _header(stem: str, declarations: Sequence[str]) -> str:
    guard = f"{stem.upper()}_H"
    opening = [f"#ifndef {guard}", f"#define {guard}", "", "#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
    closing = ["", "#ifdef __cplusplus", "}", "#endif", f"#endif /* {guard} */", ""]
    return "\n".join([*opening, *declarations, *closing])
