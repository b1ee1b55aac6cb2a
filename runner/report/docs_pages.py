"""What is computed for docs/: where it goes in a page, and the command line that puts it there."""

from __future__ import annotations

import argparse
from pathlib import Path


def put(page: str, name: str, table: str) -> str:
    """`page` with `table` (lines that end in a newline) between the comments "name: begin" and "name: end".

    Raises ValueError if the page does not have these two comments, in this order.
    """
    begin, end = f"<!-- {name}: begin -->\n", f"<!-- {name}: end -->\n"
    before, found, rest = page.partition(begin)
    _, closed, after = rest.partition(end)
    if not (found and closed):
        raise ValueError(f"no place for the table {name!r}: expected {begin.strip()} and, below it, {end.strip()}")
    return before + begin + table + end + after


def asked_to_write(description: str | None, what: str, place: Path) -> bool:
    """Whether a command that computes something for docs/ was told to put it there, by --write.

    description  docstring of the command;  what: it puts there, for its help;  place: a page, or a folder of pictures
    Ends the process with 2 for other arguments, and where there is no such place.
    """
    parser = argparse.ArgumentParser(description=(description or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help=f"put {what} into docs/{place.name}")
    write = bool(parser.parse_args().write)
    if write and not place.exists():
        parser.error(f"there is no {place}: run it in a checkout")
    return write
