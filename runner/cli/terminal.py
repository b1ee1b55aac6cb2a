"""What a command says: tables for people, JSON for programs, a progress bar where somebody watches."""

from __future__ import annotations

import json
import math
import os
import re
import sys
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from threading import Lock, Timer
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.console import Console

_PIPED_WIDTH = 10_000
_PATIENCE = 1.0
_GAP = 3  # characters between two columns of a table
# Control characters, marks that turn the direction of writing, halves of characters: they steer a terminal, or cannot
# be written to it.
_STEERING = ("Cc", "Cf", "Cs", "Zl", "Zp")


def console() -> Console:
    """Where to write, made anew for each use, for tests and shells replace sys.stdout.

    A pipe has no width to fold lines at, so what reads it gets whole lines, unless COLUMNS says how wide they may be.
    """
    from rich.console import Console

    return Console(width=_width(sys.stdout.isatty()), highlight=False, markup=False)


def _width(terminal: bool) -> int | None:
    """Columns to print in; None: those of the terminal."""
    asked = os.environ.get("COLUMNS", "")
    if re.fullmatch("[0-9]{1,4}", asked) and int(asked) > 0:
        return int(asked)
    return None if terminal else _PIPED_WIDTH


def printable(text: str) -> str:
    """`text` with everything that would steer a terminal escaped as in Python ("\\x1b"); lines and tabs stay.

    Keys, values and file names are a user's, or whoever's the user has them from.
    """
    return "".join(
        c.encode("unicode_escape").decode() if c not in "\n\t" and unicodedata.category(c) in _STEERING else c
        for c in text
    )


def say(text: str) -> None:
    """A line on stdout. Not by Rich, for which a command that only says something would wait."""
    _write_line(sys.stdout, text)


def complain(text: str) -> None:
    """A line on stderr."""
    with suppress(OSError):  # nobody can be told, and the exit code says it too
        _write_line(sys.stderr, text)


def _write_line(stream: TextIO, text: str) -> None:
    stream.write(f"{printable(text)}\n")
    stream.flush()


def print_table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, right: Sequence[str] = ()) -> None:
    """A table on stdout, as wide as there is room; the columns named in `right` are numbers, aligned right.

    Cells are folded between words. Where even that is too wide each row becomes a block of lines, one a cell.
    """
    from rich import box
    from rich.table import Table

    cells = [[printable(cell) for cell in row] for row in rows]
    screen = console()
    widths = _column_widths(columns, cells, right, screen.width)
    if widths is None:
        table = Table.grid(padding=(0, _GAP, 0, 0))
        table.add_column(no_wrap=True)
        table.add_column(overflow="fold")
        for k, row in enumerate(cells):
            if k:
                table.add_row()
            for column, cell in zip(columns, row, strict=True):
                table.add_row(column, cell)
    else:
        table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
        for column, width in zip(columns, widths, strict=True):
            table.add_column(column, justify="right" if column in right else "left", width=width)
        for row in cells:
            table.add_row(*row)
    with screen.capture() as captured:
        screen.print(table)
    lines = captured.get().splitlines()
    sys.stdout.write("\n".join(["", *(line.rstrip() for line in lines), "", ""]))


def _column_widths(
    columns: Sequence[str], rows: Sequence[Sequence[str]], right: Sequence[str], room: int
) -> list[int] | None:
    """How wide each column is, so that all of them fit into `room` and no word is cut; None if they cannot."""
    from rich.cells import cell_len

    room -= _GAP * (len(columns) - 1)
    widths, wanted = [], []
    for k, column in enumerate(columns):
        texts = [column, *(row[k] for row in rows)]
        whole = max((cell_len(line) for text in texts for line in text.splitlines()), default=0)
        words = max((cell_len(word) for text in texts for word in text.split()), default=0)
        wanted.append(max(whole, 1))
        widths.append(max(whole if column in right else words, 1))  # a number stays with its unit
    if sum(widths) > room:
        return None
    while sum(widths) < min(room, sum(wanted)):
        narrowest = max(range(len(widths)), key=lambda k: wanted[k] / widths[k])
        widths[narrowest] += 1
    return widths


def print_json(
    command: str, rows: Sequence[Mapping[str, Any]], units: Mapping[str, str], status: str = "ok", **more: object
) -> None:
    """The one JSON object of a command on stdout, `more` after what every command has.

    NaN becomes null, infinity "inf", for JSON has neither.
    """
    from springline.runner.version import __version__

    answer = {"command": command, "version": __version__, "status": status, "rows": rows, "units": units} | more
    text = json.dumps(_plain(answer), indent=2, ensure_ascii=False, allow_nan=False)
    sys.stdout.write("".join(json.dumps(c)[1:-1] if c != "\n" and printable(c) != c else c for c in text) + "\n")


def number(value: float | None, unit: str = "") -> str:
    """A number for people: four significant digits and its unit, "–" where there is none."""
    if value is None or math.isnan(value):
        return "–"
    return f"{value:.4g}" if unit in {"", "1"} else f"{value:.4g} {unit}"


@contextmanager
def progress(text: str, *, quiet: bool = False) -> Iterator[Callable[[float], None]]:
    """Context with a function that takes the share done (0 .. 1).

    A bar appears on stdout if that is a terminal and the work takes longer than a second; it goes when done.
    """
    if quiet or not sys.stdout.isatty():
        yield lambda share: None
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console(),
        transient=True,
    )
    task = bar.add_task(printable(text), total=None)  # it pulses until the first share is known
    guard = Lock()
    state = "waiting"

    def appear() -> None:
        nonlocal state
        with guard:
            if state == "waiting":
                bar.start()
                state = "shown"

    timer = Timer(_PATIENCE, appear)
    timer.daemon = True
    timer.start()
    try:
        yield lambda share: bar.update(task, total=1.0, completed=share)
    finally:
        timer.cancel()
        with guard:
            if state == "shown":
                bar.stop()
            state = "over"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else ("inf" if value > 0 else "-inf")
    return value
