"""The reference, printed from the code in Markdown: commands, keys of scenarios, columns, the C interface, Python.

Whatever stands in it is said elsewhere, once: in the commands' help, the schema of scenarios and the model's
declarations, the comments of the generated header, the docstrings of what the rooms' doors let through.
"""

from __future__ import annotations

import dataclasses
import importlib.util
import inspect
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, get_args

import typer.main
from pydantic_core import PydanticUndefined
from sphinx.pycode import ModuleAnalyzer

from springline.model.base_motion import MOTIONS
from springline.model.control import CONTROLLERS, LAWS, OBSERVERS, VELOCITY_CUTOFF
from springline.model.drive import DRIVES, EPSILON, friction_parameters
from springline.model.hardware import ACTUATORS, SENSORS
from springline.model.mechanisms import MECHANISMS
from springline.model.parameters import Parameter
from springline.model.system import control_parameters
from springline.runner.cli import app
from springline.runner.report import docs_tables
from springline.runner.scenario.schema import Leaf, Section, given_text, schema

ROOT = Path(__file__).parents[2]
HEADER = ROOT / "generated" / "include" / "springline.h"

TITLES = {
    "commands": "Commands",
    "scenario-keys": "Keys of a scenario",
    "columns": "Columns and metrics",
    "c-api": "The C interface",
}

CALLED = (
    "load_scenario",
    "simulate",
    "analyze",
    "batch",
    "to_pandas",
    "to_polars",
    "InputError",
    "without_code",
)
"""The names of `springline` in the order in which a user meets them."""

GIVEN = {
    "load_scenario": ("springline.runner.scenario", "Scenario"),
    "simulate": ("springline.runner.run", "Result"),
    "analyze": ("springline.runner.analysis", "Analysis"),
}
"""Of what some of them give: the room and the class."""

PACKAGES = ("springline.runner", "springline.model", "springline.codegen")
"""The packages behind `springline`; each lists its rooms below it."""

MEANINGS = {
    "mechanism.name": "the arm",
    "mechanism.n": "number of joints",
    "mechanism.limits": "where each joint may go",
    "control.controller": "the controller",
    "control.observer": "observer of disturbances",
    "control.feedforward": "what is fed forward of the base's measured motion",
    "control.law": "reaching law",
    "control.log_form": "how the logarithms of (18) are read",
    "control.l": "surface exponent l/m of (22), its numerator",
    "control.m": "its denominator",
    "control.p": "surface exponent p/r of (22), its numerator",
    "control.r": "its denominator",
    "control.fast": "whether there is fast control (33)",
    "control.mode": "whether the command follows the inputs or is sampled and held",
    "control.period": "sample period; asked for where the mode is sampled",
    "input": "what drives the observer",
    "sensor.velocity": "where the controller has rates from",
    "sensor.seed": "of the noise",
    "sensor.run": "number of the run, which a batch sets",
    "actuator.delay": "from a command to the motors, whole steps",
    "kind": "of the table",
    "offset": "constant part",
    "amplitude": "of a sine term",
    "omega": "angular frequency of a sine term",
    "phase": "of a sine term",
    "t": "times of the via points",
    "q": "joint coordinates at these times",
    "path": "the CSV file, from the scenario's folder",
    "columns": "name of the file's column for this",
    "units": "unit of that column, where it is not SI",
    "scale": "factor on that column",
    "t0": "time in the file at which the run begins",
    "ends": "what is beyond the file's ends",
    "max_gap": "longest time between two rows",
    "mount": "where the arm stands on the base",
    "mount_rpy": "how it is turned there",
    "initial.q": "joint coordinates",
    "initial.dq": "joint rates",
    "initial.q_motor": "how the springs stand",
    "initial.on_reference": "start on the reference, with its rates and accelerations",
    "analysis.sigma_amplitude": "of the sliding variable, at which the law counts as a gain",
    "simulation.duration": "of the run",
    "simulation.step": "of the integrator",
    "simulation.integrator": "the integrator",
    "simulation.output_every": "steps a row of the trajectory",
    "simulation.bound": "a run ends when any state is larger",
    "simulation.response_band": "band of the response time, a fraction of the initial error",
    "simulation.settling_band": "band of the settling time, a fraction of the initial error",
    "simulation.response_error": "in its place, an error",
    "simulation.settling_error": "in its place, an error",
}
"""What keys mean that are no declared numbers, by dotted key or, wherever it stands, by the last or a middle name."""


def pages() -> dict[str, str]:
    """The pages of the reference by file name."""
    made = {
        "commands.md": commands(),
        "scenario-keys.md": scenario_keys(),
        "columns.md": columns(),
        "c-api.md": c_api(),
    }
    made |= {f"python-{name}.md": python_page(name) for name in doors()}
    for package in PACKAGES:
        page = f"python-{package}.md"
        made[page] = made.get(page, python_head(package)) + rooms_of(package)
    return made


def contents() -> Iterator[str]:
    """Hidden tables of contents of these pages, but for those of `nested`."""
    listed = {
        "Reference": TITLES,
        "Python": {"python-springline": ", ".join(CALLED[:4]) + " …"},
        "Python, room by room": {f"python-{name}": name.removeprefix("springline.") for name in PACKAGES},
    }
    for caption, entries in listed.items():
        places = {f"reference/{name}": title for name, title in entries.items()}
        yield toctree(places, f":caption: {caption}\n")


def nested() -> set[str]:
    """The pages that stand in the table of contents of another one."""
    return {f"reference/python-{name}" for package in PACKAGES for name in rooms(package)}


def toctree(places: Mapping[str, str], options: str = "") -> str:
    """A hidden table of contents: page -> title."""
    lines = "\n".join(f"{title} <{place}>" for place, title in places.items())
    return f"\n```{{toctree}}\n:hidden:\n{options}\n{lines}\n```\n"


def table(titles: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown."""
    titles = list(titles)
    lines = [titles, ["---"] * len(titles), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


# --- commands ---------------------------------------------------------------------------------------------


def commands() -> str:
    """Every command with its arguments and options."""
    parts = [f"# {TITLES['commands']}\n\nWhat `springline COMMAND --help` says.\n"]
    for name, command, context in walk(typer.main.get_command(app), None, "springline"):
        usage = re.sub(r"[{}]", "", " ".join([name, *command.collect_usage_pieces(context)]))
        parts.append(f"\n## {name}\n\n{paragraphs(command.help or '')}\n\n```text\n{usage}\n```\n\n")
        records = [parameter.get_help_record(context) for parameter in command.get_params(context)]
        rows = [(code(names), cell(text)) for names, text in filter(None, records)]
        parts.append(table(("argument or option", "what"), rows))
        if epilog := getattr(command, "epilog", None):
            parts.append(f"\n{paragraphs(epilog)}\n")
    return "".join(parts)


def walk(command: Any, parent: Any, name: str) -> Iterator[tuple[str, Any, Any]]:
    """A command and those below it, each with its full name and a context to ask it in."""
    context = command.make_context(name, [], parent=parent, resilient_parsing=True)
    yield name, command, context
    for below in getattr(command, "list_commands", lambda _: [])(context):
        yield from walk(command.get_command(context, below), context, f"{name} {below}")


def paragraphs(text: str) -> str:
    """Help as Markdown: lines that begin with a command are code."""
    return re.sub(r"^\s*(springline .*)$", r"    \1", inspect.cleandoc(text), flags=re.MULTILINE)


def cell(text: str) -> str:
    """Plain text as it stands in a cell of a table in Markdown."""
    return plain(" ".join(text.split()))


def code(text: str) -> str:
    """Code in such a cell."""
    return f"`{' '.join(text.split())}`".replace("|", r"\|")


# --- keys of a scenario -----------------------------------------------------------------------------------


def scenario_keys() -> str:
    """Every key of every table, for the packaged arm, and the tables of each controller, law and observer."""
    whole = schema("transfer_manipulator", "elastic")
    known = declared(
        [
            *MECHANISMS["transfer_manipulator"].parameters,
            *control_parameters(MECHANISMS["transfer_manipulator"]),
            *(item for effect in (*SENSORS, *ACTUATORS) for item in effect.parameters),
            *(
                item
                for kind in DRIVES
                for item in (*DRIVES[kind].parameters(MECHANISMS["transfer_manipulator"]), *friction_parameters(kind))
            ),
            VELOCITY_CUTOFF,
            EPSILON,
            *(item for kind in MOTIONS for item in MOTIONS[kind].parameters),
        ]
    )
    parts = [
        f"# {TITLES['scenario-keys']}\n\nFor the packaged two-joint arm; `<joint>` is `lift` or `rotation`. "
        "Another arm has keys of its own: `springline list parameters SCENARIO`. What the tables are for: "
        "[scenarios](../scenarios.md).\n"
    ]
    for name, section in whole.sections.items():
        parts.append(section_part(name, section, f"[{name}]", known))
    for name, kinds in whole.kinds.items():
        for kind, section in kinds.items():
            parts.append(section_part(name, section, f'[{name}], kind = "{kind}"', known))
    for key, registry in (("controller", CONTROLLERS), ("law", LAWS), ("observer", OBSERVERS)):
        for name, item in registry.items():
            made = schema("transfer_manipulator", "elastic", **{key: name}).sections["control"]
            own = made.model_fields.get(getattr(item, "name", name))
            if own is None:
                continue
            title = f'[control.{item.name}], {key} = "{name}"'
            parts.append(section_part(f"control.{item.name}", own.annotation, title, declared(item.parameters)))
    return "".join(parts)


def declared(parameters: Iterable[Parameter]) -> dict[str, str]:
    """Meanings of declared numbers by name."""
    return {item.name: item.meaning for item in parameters}


def section_part(name: str, section: Any, title: str, known: Mapping[str, str]) -> str:
    """A table of a scenario under its heading."""
    rows = []
    for key, leaf, default in keys(section, name):
        rows.append((f"`{key.partition(name + '.')[2]}`", cell(leaf), default_text(default), cell(meaning(key, known))))
    rows = list(dict.fromkeys(rows))
    if not rows:
        return ""
    if not any(default for _, _, default, _ in rows):
        return f"\n## {title}\n\n{table(('key', 'value', 'meaning'), [(k, v, said) for k, v, _, said in rows])}"
    return f"\n## {title}\n\n{table(('key', 'value', 'default', 'meaning'), rows)}"


def keys(section: type[Section], path: str) -> Iterator[tuple[str, str, Any]]:
    """Dotted key, what is expected and default of all in a section and the sections in it."""
    for name, field in section.model_fields.items():
        shown = "<joint>" if name in {"lift", "rotation"} else name
        inner = next(iter(get_args(field.annotation)), field.annotation)
        if inspect.isclass(inner) and issubclass(inner, Section):
            if path == "control":  # tables of their own
                continue
            yield from keys(inner, f"{path}.{shown}")
            continue
        leaf = next((item for item in field.metadata if isinstance(item, Leaf)), None)
        expected = leaf.expected if leaf else " or ".join(f'"{item}"' for item in get_args(field.annotation))
        yield f"{path}.{shown}", expected, field.default


def default_text(default: Any) -> str:
    """A default as in TOML; what has none is left empty."""
    if default is None or default is PydanticUndefined:
        return ""
    return code(given_text(default))


def meaning(key: str, known: Mapping[str, str]) -> str:
    """What a key means. Raises KeyError for one that nothing tells of."""
    names = key.split(".")
    if key in MEANINGS:
        return MEANINGS[key]
    if names[-1] in known:
        return known[names[-1]]
    for name in (*names[1:-1], names[-1]):
        if name in MEANINGS:
            return MEANINGS[name]
    raise KeyError(f"{key} has no meaning: give it one in MEANINGS of {Path(__file__).name}")


# --- columns and metrics ----------------------------------------------------------------------------------


def columns() -> str:
    """The tables that stand in docs/scenarios.md, too."""
    tables = docs_tables.tables()
    return (
        f"# {TITLES['columns']}\n\nWhen each is there: [what a run writes](../scenarios.md#what-a-run-writes).\n\n"
        f"## Trajectory\n\n{tables['trajectory']}\n## Metrics\n\n{tables['metrics']}"
    )


# --- the C interface --------------------------------------------------------------------------------------


def c_api() -> str:
    """The header of the default scenario: each declaration under its name, with its comment."""
    text = HEADER.read_text(encoding="utf-8").partition('extern "C" {\n#endif\n')[2].partition("#ifdef __cplusplus")[0]
    parts = [
        f"# {TITLES['c-api']}\n\n`springline.h` of the default scenario: `springline export c` gives the same "
        "with the joints, gains and prefix of yours. How it is used: [embedding](../embedding.md).\n"
    ]
    for comment, code in declarations(text):
        name = c_name(code)
        parts.append(f"\n## `{name}`\n\n{comment}\n\n```c\n{code}\n```\n")
    return "".join(parts)


def declarations(text: str) -> Iterator[tuple[str, str]]:
    """Comment and code of each piece of a header; pieces are apart by an empty line."""
    for piece in re.split(r"\n{2,}", text.strip()):
        comment = re.match(r"/\*(.*?)\*/\n", piece, re.DOTALL)
        said = re.sub(r"\n \* ?", "\n", comment[1]).strip() if comment else ""
        yield cell(said), piece[comment.end() :] if comment else piece


def c_name(code: str) -> str:
    """What a piece of a header declares."""
    for pattern in (r"struct (\w+)", r"(\w+)\(", r"#define (\w+)", r"(\w+)(?:\[\d*\])?;$"):
        found = re.search(pattern, code, re.MULTILINE)
        if found:
            return found[1]
    first, *_, last = re.findall(r"^\s+(\w+) =", code, re.MULTILINE)
    return f"{first} … {last}"


# --- Python -----------------------------------------------------------------------------------------------


@cache
def doors() -> dict[str, dict[str, Any]]:
    """Module -> public name -> object, for the face and every room that has a door, in the order of its list."""
    found = {}
    for stub in sorted([*ROOT.glob("springline/__init__.pyi"), *ROOT.glob("[mcr]*/**/__init__.pyi")]):
        module = ".".join(stub.parent.relative_to(ROOT).parts)
        module = module if module == "springline" else f"springline.{module}"
        names = re.findall(r" import \w+ as (\w+)$", stub.read_text(encoding="utf-8"), re.MULTILINE)
        room = importlib.import_module(module)
        found[module] = {
            name: getattr(room, name) for name in sorted(set(names), key=lambda name: (name.lower(), name))
        }
    order = ("springline", *PACKAGES)
    return dict(
        sorted(found.items(), key=lambda item: (item[0] != order[0], *(not item[0].startswith(o) for o in order[1:])))
    )


def python_page(module: str) -> str:
    """What a room's door lets through, each name with its signature and docstring."""
    parts, names = [python_head(module)], list(doors()[module])
    if module == "springline":
        parts.append(called())
        names = [*CALLED, *(name for name in names if name not in CALLED)]
    for name in names:
        item = doors()[module][name]
        first = next(other for other, names in doors().items() if names.get(name) is item)
        seen = f"As [`{first}.{name}`](python-{first}.md#{name.lower()}).\n"
        parts.append(f"\n## `{name}`\n\n{entry(module, name, item) if first == module else seen}")
    return "".join(parts)


def python_head(module: str) -> str:
    """What a page of a module begins with: its name and its docstring."""
    said = escaped(inspect.getdoc(importlib.import_module(module)) or "")
    return f"# {module}\n\n{said}\n\n```{{py:currentmodule}} {module}\n```\n"


def called() -> str:
    """What users call, in the order in which they meet it, and what that gives. Raises KeyError for a name that is not
    there, or that CALLED lacks.
    """
    names = doors()["springline"]
    if set(CALLED) != set(names) - {"__version__"}:
        raise KeyError(f"CALLED of {Path(__file__).name} is not what springline has: {sorted(names)}")
    rows = []
    for name in CALLED:
        room, given = GIVEN.get(name, ("", ""))
        link = f"[`{given}`](python-{room}.md#{given.lower()})" if given else ""
        rows.append((f"[`sl.{name}`](#{name.lower()})", brief(names[name]), link))
    return f"\n{table(('call', 'what it does', 'gives'), rows)}"


def rooms(package: str) -> list[str]:
    """The rooms of a package that have a door."""
    return [name for name in doors() if name.startswith(f"{package}.")]


def rooms_of(package: str) -> str:
    """The rooms of a package: what each is for, and their pages below its own in the table of contents."""
    within = rooms(package)
    rows = [(f"[`{name}`](python-{name}.md)", brief(importlib.import_module(name))) for name in within]
    listed = toctree({f"python-{name}": name.removeprefix(f"{package}.") for name in within})
    return f"\n## Its rooms\n\n{table(('room', 'what it is for'), rows)}{listed}"


def brief(item: Any) -> str:
    """The first sentence of a docstring."""
    first = (inspect.getdoc(item) or "").partition("\n\n")[0].replace("\n", " ")
    return cell(re.split(r"(?<=\.)\s", first)[0])


def entry(module: str, name: str, item: Any) -> str:
    """A function, class, module or value, as an object of Sphinx's Python domain."""
    if inspect.ismodule(item):
        return f"The module `{item.__name__}`.\n\n{escaped(inspect.getdoc(item) or '')}\n"
    if inspect.isclass(item):
        inside = "".join(members(item))
        return directive("py:class", f"{name}{signature(item)}", f"{escaped(own_doc(item))}\n\n{inside}", 6)
    if callable(item):
        return directive("py:function", f"{name}{signature(item)}", escaped(inspect.getdoc(item) or ""), 4)
    return directive("py:data", name, escaped(value_doc(module, name)), 4)


def members(item: type) -> Iterator[str]:
    """Public methods and properties that a class says something of."""
    for name, value in vars(item).items():
        function = value.fget if isinstance(value, property) else getattr(value, "__func__", value)
        if name.startswith("_") or not inspect.isroutine(function) or not function.__doc__:
            continue
        text = escaped(inspect.getdoc(function) or "")
        if isinstance(value, property):
            yield directive("py:property", name, text, 4)
        else:
            yield directive("py:method", f"{name}{signature(function)}", text, 4)


def directive(kind: str, head: str, body: str, fence: int) -> str:
    """A block of MyST with Markdown in it."""
    return f"{'`' * fence}{{{kind}}} {head}\n\n{body}\n{'`' * fence}\n\n"


def signature(item: Any) -> str:
    """A signature as it stands in the code; empty for what has none."""
    try:
        found = inspect.signature(item)
    except (TypeError, ValueError):
        return ""
    shown = [
        each.replace(annotation=text_of(each.annotation), default=Shown(each.default))
        if each.default is not each.empty
        else each.replace(annotation=text_of(each.annotation))
        for each in found.parameters.values()
    ]
    text = str(found.replace(parameters=shown, return_annotation=text_of(found.return_annotation)))
    return (
        " ".join(text.replace("'", "").removesuffix(" -> None").split())
        if inspect.isclass(item)
        else " ".join(text.replace("'", "").split())
    )


class Shown:
    """A default as it is shown: without addresses, which are others each time, and short."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def __repr__(self) -> str:
        text = repr(self.value)
        return "…" if len(text) > 30 or text.startswith("<") else text.replace("'", '"')


def text_of(annotation: Any) -> Any:
    """An annotation as text, or none."""
    if annotation is inspect.Parameter.empty or isinstance(annotation, str):
        return annotation
    return getattr(annotation, "__name__", str(annotation))


def own_doc(item: type) -> str:
    """A class's docstring, unless dataclasses made it."""
    text = inspect.getdoc(item) or ""
    return "" if dataclasses.is_dataclass(item) and text.startswith(f"{item.__name__}(") else text


def value_doc(module: str, name: str) -> str:
    """The text below a value where it is defined, else what it is."""
    value = doors()[module][name]
    stub = (ROOT / Path(*module.split(".")[1:]) if module != "springline" else ROOT / "springline") / "__init__.pyi"
    source = re.search(rf"^from (\S+) import (\w+) as {name}$", stub.read_text(encoding="utf-8"), re.MULTILINE)
    assert source is not None
    place = importlib.util.resolve_name(source[1], module) if source[1] != "." else module
    said = ModuleAnalyzer.for_module(place).find_attr_docs().get(("", source[2]))
    if said:
        return " ".join(said).strip()
    text = repr(value)
    return f"`{text}`" if len(text) < 200 and " at 0x" not in text else f"A value of type `{type(value).__name__}`."


def escaped(text: str) -> str:
    """A docstring as Markdown: columns of names and meanings keep their lines, signs of Markdown their look."""
    lines, in_list = [], False
    for line in text.splitlines():
        code = line.startswith("    ")
        pair = re.match(r"(\S+(?: = \S+|, \S+)*)\s{2,}(\S.*)$", line) if not code else None
        if pair:
            lines += ([] if in_list else [""]) + [f"- `{pair[1].strip('`')}`: {plain(pair[2])}"]
            in_list = True
            continue
        if in_list and not (line.startswith(" ") and line.strip()):
            lines += [""]
            in_list = False
        lines.append(
            line if code and not in_list else f"{'  ' if in_list else ''}{plain(line.strip() if in_list else line)}"
        )
    return "\n".join(lines)


def plain(text: str) -> str:
    """Signs that Markdown would take for its own, outside of code."""
    parts = re.split(r"(``.*?``|`[^`]*`)", text)
    return "".join(part if part.startswith("`") else re.sub(r"([*_<\[\]|$#])", r"\\\1", part) for part in parts)
