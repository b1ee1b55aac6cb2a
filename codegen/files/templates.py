"""Generated text: Jinja2 templates, which stand in `templates/` beside the code that fills them.

A template shows the file that is made of it. What depends on the length of names is laid out by filters, used as blocks
({% filter fitted %} … {% endfilter %}): `wrap` and `comment` fill lines with words, `aligned` puts the comments behind
declarations in a column, `fitted` does so too and breaks C that is too long. `quoted` is a C string, if need be of
several lines.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from functools import cache
from importlib import resources
from itertools import groupby
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined, select_autoescape

LINE = 100
"""Longest line of generated C, in characters."""

_NARROWEST = 20  # columns that a comment behind a declaration needs; with less it stands above
_DECLARATION = re.compile(r"( *)(?!/\*)(\S.*?) +/\* (.*) \*/")
_COMMENT = re.compile(r"( *)/\* (.*) \*/")
_WHOLE = re.compile(r'"(?:[^"\\]|\\.)*"|/\*.*?\*/')  # nothing breaks inside a string or a comment


def render(folder: str, template: str, **values: Any) -> str:
    """The text of a template, filled with `values`.

    folder    the package whose folder templates/ has it: "springline.codegen.export.c"
    template  its file name; what is put into an .html.j2 or .xml.j2 is escaped
    Raises jinja2.UndefinedError for a name that has no value.
    """
    return _environment(folder).get_template(template).render(values)


@cache
def _environment(folder: str) -> Environment:
    templates = resources.files(folder) / "templates"

    def load(name: str) -> tuple[str, str, None]:
        """Text, and the file that an error message names."""
        return (templates / name).read_text(encoding="utf-8"), str(templates / name), None

    environment = Environment(
        loader=FunctionLoader(load),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=select_autoescape(["html.j2", "xml.j2"]),
    )
    environment.filters |= {each.__name__: each for each in (wrap, comment, aligned, fitted, quoted)}
    return environment


def wrap(text: str, start: str = "", later: str | None = None) -> str:
    """The words of a text on full lines, the first of which begins with `start` and the others with `later`."""
    wrapped = textwrap.wrap(
        text,
        LINE,
        initial_indent=start,
        subsequent_indent=start if later is None else later,
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "".join(f"{line}\n" for line in wrapped)


def comment(text: str, indent: int = 0) -> str:
    """A C comment of the words of a text: on one line if there is room, else in the middle of lines of its own."""
    margin = " " * indent
    line = f"{margin}/* {' '.join(text.split())} */"
    return f"{line}\n" if len(line) <= LINE else f"{margin}/*\n{wrap(text, f'{margin} * ')}{margin} */\n"


def aligned(text: str) -> str:
    """Lines of C: the comments behind declarations that follow each other begin in one column."""
    stripped = [line.rstrip() for line in text.strip("\n").splitlines()]
    lines: list[str] = []
    for declare, run in groupby(stripped, lambda line: _DECLARATION.fullmatch(line) is not None):
        block = list(run)
        lines += _column(block) if declare else block
    return "".join(f"{line}\n" for line in lines)


def _column(lines: list[str]) -> Iterator[str]:
    run = [match for line in lines if (match := _DECLARATION.fullmatch(line))]
    column = max(len(match[1] + match[2]) for match in run) + 1
    room = LINE - column - len("/*  */")
    for match in run:
        declaration = match[1] + match[2]
        if room < max(_NARROWEST, *map(len, match[3].split())):
            yield from comment(match[3], len(match[1])).splitlines()
            yield declaration
            continue
        first, *more = textwrap.wrap(match[3], room, break_long_words=False, break_on_hyphens=False)
        below = [" " * (column + 3) + part for part in more]
        yield from [f"{declaration:{column}}/* {first}", *below[:-1]] if below else []
        yield f"{below[-1] if below else f'{declaration:{column}}/* {first}'} */"


def fitted(text: str) -> str:
    """Lines of C, those that are too long broken between words, and their comments aligned."""
    lines = (part for line in aligned(text).splitlines() for part in _broken(line))
    return "".join(f"{line}\n" for line in lines)


def _broken(line: str) -> Iterator[str]:
    if alone := _COMMENT.fullmatch(line):
        yield from comment(alone[2], len(alone[1])).splitlines()
        return
    indent = len(line) - len(line.lstrip()) + 4
    mark = " \\" if line.startswith("#") else ""  # a directive ends with its line
    while len(line) > LINE:
        whole = [match.span() for match in _WHOLE.finditer(line)]
        end = next(
            (
                i
                for i in range(LINE - len(mark), indent, -1)
                if (line[i] == " " or line[i - 1] == "(") and not any(start < i < stop for start, stop in whole)
            ),
            None,
        )
        if end is None:
            break
        yield line[:end].rstrip() + mark
        line = " " * indent + line[end:].lstrip()
    yield line


def quoted(text: str, indent: int) -> str:
    """A C string literal, over as many lines as it needs.

    text    what stands between the quotes, escaped as C wants it
    indent  column of the first quote
    """
    words = textwrap.wrap(text, LINE - indent - 4, break_long_words=False, break_on_hyphens=False)
    parts = [*(f"{part} " for part in words[:-1]), *words[-1:]]
    return f"\n{' ' * indent}".join(f'"{part}"' for part in parts)
