"""What a command says: tables for people, JSON for programs, a progress bar where somebody watches."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed_version
from threading import Lock, Timer
from typing import Any

from rich import box
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

_PIPED_WIDTH = 10_000
_PATIENCE = 1.0


def version() -> str:
    """The version of springline; "unknown" in a source tree that is not installed."""
    try:
        return installed_version("springline")
    except PackageNotFoundError:
        return "unknown"


def console(*, stderr: bool = False) -> Console:
    """Where to write, made anew for each use, for tests and shells replace sys.stdout.

    A pipe has no width to fold lines at, so what reads it gets whole lines.
    """
    piped = not (sys.stderr if stderr else sys.stdout).isatty()
    return Console(stderr=stderr, width=_PIPED_WIDTH if piped else None, highlight=False, markup=False)


def say(text: str) -> None:
    """A line on stdout."""
    console().print(text, soft_wrap=True)


def complain(text: str) -> None:
    """A line on stderr."""
    console(stderr=True).print(text, soft_wrap=True)


def print_table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, right: Sequence[str] = ()) -> None:
    """A table on stdout; the columns named in `right` are aligned right."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for column in columns:
        table.add_column(column, justify="right" if column in right else "left", overflow="fold")
    for row in rows:
        table.add_row(*row)
    console().print(table)


def print_json(command: str, rows: Sequence[Mapping[str, Any]], units: Mapping[str, str], status: str = "ok") -> None:
    """The one JSON object of a command on stdout; NaN becomes null, infinity "inf", for JSON has neither."""
    answer = {"command": command, "version": version(), "status": status, "rows": rows, "units": units}
    sys.stdout.write(json.dumps(_plain(answer), indent=2, ensure_ascii=False, allow_nan=False) + "\n")


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
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console(),
        transient=True,
    )
    task = bar.add_task(text, total=None)  # it pulses until the first share is known
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
