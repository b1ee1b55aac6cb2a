"""documentation/index.html of an FMU: what it is, what goes in and out, and how it steps."""

from __future__ import annotations

from html import escape

from springline.codegen.export import Export, provenance
from springline.codegen.export.fmu.settings import FmiVersion, Settings
from springline.codegen.export.fmu.variables import NO_LIMIT, Interface, base_is_input

_STYLE = """
body { font: 16px/1.5 sans-serif; max-width: 60em; margin: 2em auto; padding: 0 1em; color: #1b2733; }
table { border-collapse: collapse; margin: 1em 0; }
th, td { text-align: left; padding: 0.2em 1em 0.2em 0; border-bottom: 1px solid #d5dde4; vertical-align: top; }
code { font-size: 0.95em; }
"""

_CAUSALITIES = {
    "Inputs": "input",
    "Outputs": "output",
    "States of the controller": "local",
    "Parameters": "parameter",
}

_WHAT = {
    "controller": "The control law of an arm on a moving base: references and measurements in, motor commands out.",
    "plant": "An arm on a moving base: motor commands in, its state out.",
    "loop": "An arm on a moving base with its controller and its reference: the whole closed loop.",
}


def description(interface: Interface) -> str:
    """One sentence on a part."""
    return _WHAT[interface.part]


def document(
    export: Export, interface: Interface, settings: Settings, version: FmiVersion, *, name: str, identifier: str
) -> bytes:
    """The page, UTF-8."""
    system = export.system
    unlimited = any(variable.bounds.infinite for variable in interface.variables)
    facts = [
        f"FMI {version}.0 for Co-Simulation, model identifier <code>{identifier}</code>.",
        f"Mechanism {system.mechanism.name}, controller: {system.controller.title}"
        f"{f', reaching law: {system.controller.law.title}' if system.controller.law else ''}.",
        *_stepping(export, interface, settings),
        "Communication steps may have any length and may change. Time counts from the start time of the experiment"
        f"{', the scenario with it' if interface.part != 'controller' else ''}; a start time at which doubles are more "
        "than a hundredth of a step apart is an error.",
        "A parameter out of its range, an input that is not finite and a plant that leaves the finite numbers give an "
        "FMI error with a message in the log category <code>logStatusError</code>; a call that is refused changes "
        "nothing. After an error of a step, reset the instance or restore a state.",
        "Parameters are those of the controller's model of the arm (mechanism, drive, control) and, apart from them, "
        "those of the arm itself (plant): to change both, set both."
        if interface.part == "loop"
        else "Parameters are called as in the scenario.",
        *([f"{NO_LIMIT:g} and greater numbers mean that there is no limit."] if unlimited else []),
        "For a static library, compile <code>sources/all.c</code> as C99 with "
        f"<code>-DFMI{version}_FUNCTION_PREFIX={identifier}_</code>; for a shared one leave the prefix undefined.",
    ]
    sections = []
    for title, causality in _CAUSALITIES.items():
        chosen = [variable for variable in interface.variables if variable.causality == causality]
        if not chosen:
            continue
        more = causality == "parameter"
        head = ["Name", "Unit", "Meaning", *(["Start", "Range", "Changes"] if more else [])]
        rows = [
            [
                f"<code>{escape(v.name)}</code>",
                escape("true or false" if v.boolean else v.unit),
                escape(v.meaning),
                *([repr(v.start), escape(v.expected), v.variability] if more else []),
            ]
            for v in chosen
        ]
        sections.append(f"<h2>{title}</h2>\n{_table(head, rows)}")
    origin = export.system.mechanism.source
    cited = f"<p>The model and its equations: {escape(origin)}</p>\n" if origin else ""
    source = "<br>\n".join(escape(line) for line in provenance(export))
    text = f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{escape(name)}</title>
<style>{_STYLE}</style>
</head>
<body>
<h1>{escape(name)}</h1>
<p>{escape(_WHAT[interface.part])}</p>
<ul>
{"".join(f"<li>{fact}</li>" + chr(10) for fact in facts)}</ul>
{chr(10).join(sections)}
{cited}<p>{source}</p>
</body>
</html>
"""
    return text.encode()


def _stepping(export: Export, interface: Interface, settings: Settings) -> list[str]:
    sampled = f"sampled every {settings.period:g} s and held in between" if settings.period else ""
    if interface.part == "controller":
        return [
            f"The command is {sampled}; at a sample it belongs to the inputs of that time (feedthrough)."
            if sampled
            else "The command belongs to the inputs of its own time (feedthrough); the law has no state."
            if "memory" not in interface.blocks
            else f"The command is computed every {settings.step:g} s, the scenario's step, and held in between; it "
            "belongs to the inputs of its own time (feedthrough). So often the controller's states are moved on.",
            "At a communication point, set the inputs and get the command before the plant steps. A tool that "
            "exchanges values only after a step delays the command by that step, and a delay can make the loop "
            f"unstable: choose a step as short as the default experiment's, {settings.step:g} s, or one of which half "
            "gives the same result.",
        ]
    facts = [
        f"The plant is integrated by steps of {settings.step:g} s ({export.system.tableau.title}), which end at whole "
        "multiples of it; a communication point in between cuts a step in two. Inputs are held over a communication "
        "step."
    ]
    if interface.part == "loop":
        facts.append(f"The control is {sampled}." if sampled else "The control is continuous: part of every stage.")
    facts.append(
        "The importer moves the base, through inputs that start at rest."
        if base_is_input(export.system, interface.part)
        else "The base moves as in the scenario."
    )
    return facts


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = ["<table>", "<tr>" + "".join(f"<th>{cell}</th>" for cell in head) + "</tr>"]
    lines += ["<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows]
    return "\n".join([*lines, "</table>"])
