"""Generated text: Jinja2 templates, which stand in `templates/` beside the code that fills them.

A template shows the file that is made of it. What depends on the length of names is laid out by filters, used as blocks
({% filter fitted %} … {% endfilter %}): `wrap` and `comment` fill lines with words, `aligned` puts the comments behind
declarations in a column, `fitted` does so too and breaks C that is too long. `quoted` is a C string, if need be of
several lines.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
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
_BEHIND = re.compile(r"(.*; +)/\* (.*) \*/")
_WHOLE = re.compile(r'"(?:[^"\\]|\\.)*"|/\*.*?\*/')  # nothing breaks inside a string or a comment


def render(folder: str, template: str, **values: Any) -> str:
    """The text of a template, filled with `values`.

    folder    the package whose folder templates/ has it: "springline.codegen.export.c"
    template  its file name; what is put into an .html.j2 or .xml.j2 is escaped
    A template that is not there is that of the package above: all targets begin their files with one banner.j2.
    Raises jinja2.TemplateNotFound, and jinja2.UndefinedError for a name that has no value.
    """
    return _environment(folder).get_template(template).render(values)


@cache
def _environment(folder: str) -> Environment:
    def load(name: str) -> tuple[str, str, None] | None:
        """Text, and the file that an error message names."""
        for package in (folder, folder.rpartition(".")[0]):
            file = resources.files(package) / "templates" / name if package else None
            if file is not None and file.is_file():
                return file.read_text(encoding="utf-8"), str(file), None
        return None

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
        yield from _continued(f"{declaration:{column}}", match[3])


def fitted(text: str) -> str:
    """Lines of C, those that are too long broken between words, and their comments aligned."""
    return broken(aligned(text))


def broken(text: str, breaks: Sequence[tuple[str, ...]] = ((" ", "("),)) -> str:
    """Lines of C, those that are too long broken, a comment behind a statement continued in its column.

    breaks  behind what a line may be broken, the better places first
    """
    return "".join(f"{part}\n" for line in text.splitlines() for part in _parts(line, breaks))


def _parts(line: str, breaks: Sequence[tuple[str, ...]]) -> Iterator[str]:
    alone = _COMMENT.fullmatch(line)
    if len(line) > LINE:
        if alone and max(map(len, alone[2].split())) <= LINE - len(alone[1]) - len(" * "):
            yield from comment(alone[2], len(alone[1])).splitlines()
            return
        if behind := _BEHIND.fullmatch(line):
            yield from _continued(behind[1], behind[2])
            return
    indent = len(line) - len(line.lstrip()) + 4
    mark = " \\" if line.startswith("#") else ""  # a directive ends with its line
    while len(line) > LINE:
        room = LINE - len(mark)
        whole = [] if alone else [match.span() for match in _WHOLE.finditer(line)]
        ends = {k: len(line[:k].rstrip()) for k in range(indent + 1, room + 2)}
        places = [
            k
            for k, end in ends.items()
            if end <= room
            and not line.endswith("return", 0, end)  # it stays with its value
            and not any(start < end < stop for start, stop in whole)
        ]
        found = ([k for k in places if line.endswith(signs, indent, k)] for signs in breaks)
        place = max(next(filter(None, found), []), default=None)
        if place is None:
            break
        yield line[:place].rstrip() + mark
        line = " " * indent + line[place:].lstrip()
    yield line


def _continued(statement: str, remark: str) -> Iterator[str]:
    """A statement with the comment behind it, which goes on below itself; `statement` ends where it begins."""
    column = len(statement)
    first, *more = textwrap.wrap(remark, LINE - column - len("/*  */"), break_long_words=False, break_on_hyphens=False)
    lines = [f"{statement}/* {first}", *(" " * (column + 3) + part for part in more)]
    yield from [*lines[:-1], f"{lines[-1]} */"]


def quoted(text: str, indent: int) -> str:
    """A C string literal, over as many lines as it needs.

    text    what stands between the quotes, escaped as C wants it
    indent  column of the first quote
    """
    words = textwrap.wrap(text, LINE - indent - 4, break_long_words=False, break_on_hyphens=False)
    parts = [*(f"{part} " for part in words[:-1]), *words[-1:]]
    return f"\n{' ' * indent}".join(f'"{part}"' for part in parts)
