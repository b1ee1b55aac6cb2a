"""Generated text: what a template may not do, how its filters lay out, and how long a line of generated C gets."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import jinja2
import pytest

from springline.codegen.export import LONGEST as LONGEST_NAME
from springline.codegen.export import LONGEST_LINKED, bind, check_linked
from springline.codegen.export.c.interface import TypedInterface
from springline.codegen.export.c.texts import text_files
from springline.codegen.export.fmu.settings import FmiVersion, Settings
from springline.codegen.export.fmu.source import sources
from springline.codegen.export.fmu.variables import PARTS, Part, interface, part_parameters
from springline.codegen.files.templates import LINE, aligned, comment, fitted, quoted, render, wrap
from springline.runner import load_scenario
from springline.runner.scenario import kernel_tables

LONGEST = "w" * LONGEST_LINKED
LONGEST_FMU = "w" * LONGEST_NAME
INTEGRAL = """
from springline.model import Control, Controller, Parameter, Quantity

class Integral(Controller):
    '''Computed torque with an integral.'''
    parameters = (Parameter("w", "1/s", 12.0, "bandwidth", per_joint=True),)
    states = (Quantity("xi", "xi", "{q} s", "integral of error"),)

    def control(self, r, y, z, model, p):
        arm, e = model(y.q1, y.dq1), r.q - y.q1
        u = arm.H @ (r.ddq + 3 * p.w * (r.dq - y.dq1) + 3 * p.w**2 * e + p.w**3 * z.xi)
        return Control(u + arm.c + arm.G, e, {"xi": e})
"""


CASES: dict[str, dict[str, Any]] = {
    "plain": {},
    "float": {"real": "float"},
    "tunable": {"tunable": "all"},
    "float_tunable": {"real": "float", "tunable": "all"},
    "tables": {"tunable": ["control"]},
    "memory": {"tunable": "all"},
    "float_memory": {"real": "float"},
}


def exported(prefix: str, case: str, folder: Path) -> dict[str, str]:
    """What the templates print for an export, by path."""
    (folder / "integral.py").write_text(INTEGRAL)
    changes = {"control.controller": f"{folder}/integral.py:Integral"} if "memory" in case else {}
    scenario = load_scenario("ship/vessel_10hz" if case == "tables" else "paper/nominal", changes)
    options = CASES[case]
    if case == "tables":
        options = options | {"tables": kernel_tables(scenario.tables())}
    export = bind(scenario.structure(), scenario.values(), prefix=prefix, **options)
    return {path: text.decode() for path, text in text_files(export, TypedInterface(export)).items()}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("prefix", ["a", "springline", LONGEST])
def test_no_line_of_generated_c_is_too_long(prefix: str, case: str, tmp_path: Path) -> None:
    check_linked(prefix)
    files = exported(prefix, case, tmp_path)
    assert ("src/" + prefix + "_tables.h" in files) == (case == "tables")
    assert ("_initial_memory" in files[f"src/{prefix}.c"]) == ("memory" in case)
    for path, text in files.items():
        lines = text.splitlines()
        if path == "README.md":  # the paragraphs are a mechanism's too, and tables have one line a row
            lines = [
                line for block in re.findall(r"^```\w+\n(.*?)^```", text, re.M | re.S) for line in block.splitlines()
            ]
            assert len(lines) > 15
        if path != "src/sl_tables.h":  # not printed
            assert [line for line in lines if len(line) > LINE] == [], path
            assert not re.search(r"[ \t]$|\{\{|\}\}(?!;)|\{%", "\n".join(lines), re.M), path


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("prefix", ["springline", LONGEST_FMU])
def test_no_line_of_an_fmus_c_is_too_long(prefix: str, part: Part) -> None:
    scenario = load_scenario("paper/nominal")
    system = scenario.system()
    keys = [system.slots[i].key for i in part_parameters(system, part)]
    export = bind(scenario.structure(), scenario.values(), tunable=keys, prefix=prefix)
    typed = TypedInterface(export)
    cases: tuple[tuple[FmiVersion, float], ...] = ((2, 0.0), (3, 1e-3))
    for version, period in cases:
        shown = interface(export, typed, part, sampled=True)
        for name, text in sources(export, typed, shown, Settings(4.0, 1e-4, period), version).items():
            if not name.startswith(("sl_", *(f"fmi{version}{kind}" for kind in "FTP"))):  # fixed; the standard's own
                assert [line for line in text.decode().splitlines() if len(line) > LINE] == [], name


@pytest.mark.parametrize("case", ["plain", "float_tunable", "memory"])
@pytest.mark.parametrize("prefix", ["a", "springline", LONGEST])
def test_comments_of_a_structure_stand_in_one_column(prefix: str, case: str, tmp_path: Path) -> None:
    header = exported(prefix, case, tmp_path)[f"include/{prefix}.h"]
    structures = re.findall(r"^typedef struct (\w+) \{\n(.*?)^\} \1;$", header, re.M | re.S)
    assert len(structures) >= 8
    for name, body in structures:
        declared = [line for line in body.splitlines() if re.match(r"  \w+ \w+;", line)]
        if name not in (f"{prefix}_controller", f"{prefix}_config"):  # of structures, which say what they are
            assert len({line.find("/*") for line in declared}) == 1, name


def test_the_readme_begins_with_what_one_needs(tmp_path: Path) -> None:
    """What it is in two lines, the files, the calls; what is long comes last."""
    text = exported("arm", "tunable", tmp_path)["README.md"]
    title, _, *what = text.splitlines()[:5]
    assert title == "# arm: controller and plant in C" and what[-1] == "" and all(len(line) < 121 for line in what[:2])
    order = [
        text.index(part) for part in ("| `include/arm.h`", "arm_init(&", "arm_step(&", "## Building", "| `ARM_OK`")
    ]
    order += [text.index(f"## {title}") for title in ("Cost", "Structures", "Parameters")]
    assert order == sorted(order) and text.count("\n## ") == 8


# --- the filters -----------------------------------------------------------------------------------------------


def test_a_comment_is_one_line_or_a_block() -> None:
    assert comment("a few\nwords") == "/* a few words */\n"
    fits = "/* " + "word " * 18 + "1234 */\n"
    assert len(fits) == 101 and comment("word " * 18 + "1234") == fits
    assert comment("word " * 18 + "12345") == "/*\n * " + "word " * 18 + "12345\n */\n"
    assert (
        comment("word " * 25, 2)
        == "  /*\n   * " + ("word " * 19).rstrip() + "\n   * " + ("word " * 6).rstrip() + "\n   */\n"
    )


def test_words_are_wrapped_under_each_other() -> None:
    assert wrap("word " * 21, "# ", "#   ") == "# " + ("word " * 19).rstrip() + "\n#   word word\n"


def test_comments_are_aligned_and_continued_behind_their_declarations() -> None:
    text = f"  int a; /* short */\n  double name; /* {'word ' * 20}*/\n  return a;\n\n  int b; /* alone */\n"
    assert aligned(text) == (
        "  int a;       /* short */\n"
        f"  double name; /* {('word ' * 16).rstrip()}\n"
        f"                  {'word ' * 4}*/\n"
        "  return a;\n\n"
        "  int b; /* alone */\n"
    )


def test_a_comment_without_room_behind_its_declaration_stands_above() -> None:
    name = "n" * 70
    assert aligned(f"  int {name}; /* {'word ' * 4}*/\n") == f"  /* {'word ' * 4}*/\n  int {name};\n"
    assert aligned(f"  int a; /* {name}{name} */\n") == f"  /*\n   * {name}{name}\n   */\n  int a;\n"


def test_c_is_broken_where_a_word_ends() -> None:
    call = f'  call("{"a b " * 10}", {"x" * 30}, {"y" * 30});'
    assert fitted(call + "\n") == f'  call("{"a b " * 10}", {"x" * 30},\n      {"y" * 30});\n'
    assert fitted("#define " + "N" * 50 + ' "' + "v" * 60 + '"\n') == (
        "#define " + "N" * 50 + ' \\\n    "' + "v" * 60 + '"\n'
    )
    assert fitted(f"{'f' * 60}({'g' * 60});\n") == f"{'f' * 60}(\n    {'g' * 60});\n"


def test_return_stays_with_its_value() -> None:
    assert fitted(f"  if ({'a' * 50}) return {'b' * 40};\n") == f"  if ({'a' * 50})\n      return {'b' * 40};\n"


def test_a_string_is_continued() -> None:
    assert quoted("some words", 10) == '"some words"'
    assert quoted("word " * 17 + "12345", 10) == '"' + "word " * 17 + '"\n          "12345"'


# --- templates -------------------------------------------------------------------------------------------------


def test_a_name_without_a_value_is_an_error() -> None:
    with pytest.raises(jinja2.UndefinedError, match="'provenance' is undefined"):
        render("springline.codegen.export.c", "springline.pc.in.j2", prefix="arm")


def test_what_is_put_into_html_is_escaped_and_into_c_is_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pages" / "templates").mkdir(parents=True)
    (tmp_path / "pages" / "__init__.py").touch()
    for name in ("page.html.j2", "code.c.j2"):
        (tmp_path / "pages" / "templates" / name).write_text("{{ text }}")
    monkeypatch.syspath_prepend(tmp_path)
    assert render("pages", "page.html.j2", text="a < b & c") == "a &lt; b &amp; c"
    assert render("pages", "code.c.j2", text="a < b & c") == "a < b & c"
