"""Signals as they stand in CSV files: the columns that a scenario names, as numbers in SI units, and where they stood.

A file is read as it is written or refused with the remedy; what it may have meant is not guessed. The separator is a
comma and the decimal sign a point. Rows whose cells are all empty say nothing and are passed over, and the row after
the header may name units: it is held against the scenario's, and never read in their place.
"""

from __future__ import annotations

import csv
import io
import math
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from springline.runner.files import InputError, Problem, unknown

Floats = NDArray[np.float64]

UNITS = {
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "km": 1e3},
    "rad": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180.0},
}
"""SI unit -> the units a column may have instead, and how much of the SI unit one of them is."""

HALF_TURN = {"rad": math.pi, "mrad": 1e3 * math.pi, "deg": 180.0}
"""Unit of an angle -> half a turn in it."""

_KNOWN = frozenset(unit for units in UNITS.values() for unit in units)
# Units in full, as a units row may have them.
_SPELLED = {
    **dict.fromkeys(("sec", "second", "seconds"), "s"),
    **dict.fromkeys(("minute", "minutes"), "min"),
    **dict.fromkeys(("metre", "metres", "meter", "meters"), "m"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("degree", "degrees", "°"), "deg"),
}

# A number as instruments and spreadsheets write it. What Python reads besides (1_000, digits of other scripts) is more
# likely a damaged cell than a number.
_NUMBER = re.compile(r"\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*", re.ASCII)
_DECIMAL_COMMA = re.compile(r"\s*[+-]?[0-9]*,[0-9]+([eE][+-]?[0-9]+)?\s*", re.ASCII)
_OTHER = re.compile(r"[^0-9+.eE\s-]", re.ASCII)
_WHOLE = re.compile(r"\s*[+-]?[0-9]+([eE][+-]?[0-9]+)?\s*", re.ASCII)
_SEPARATORS = {"semicolons": ";", "tabs": "\t"}
# How many lines a note names, and how many lines into the file a header is looked for.
_MOST_LINES = 5
_DEEPEST_HEADER = 50
_BLOCK = 1024  # rows that stay in the processor's cache


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a CSV file.

    name, key  its name there, and the scenario key that asks for it
    factor     what its numbers are multiplied with to be in SI units, negative where they have the other sign
    half_turn  half a turn in its unit if it is an angle, else inf
    unit       its unit by name, "" if that is of no interest
    """

    name: str
    key: str
    factor: float = 1.0
    half_turn: float = math.inf
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Samples:
    """Columns of a CSV file.

    lines    where each row stands, from 1
    numbers  (rows, columns), SI units; angles are unwrapped
    digits   what the last digit of each column's numbers is worth, SI units
    notes    what was made of the file, a sentence each
    """

    lines: list[int]
    numbers: Floats
    digits: list[float]
    notes: list[str]


def read_samples(data: bytes, file: str, columns: Sequence[Column], where: str, key: str) -> Samples:
    """Read some columns of a CSV file with a header row.

    data, file  the file's contents and its name for messages
    where, key  the scenario file and the table that refer to it, for messages
    Raises InputError for what is no such file: another encoding or separator, decimal commas, a column that is missing
    or there twice, rows of another length, a cell that is no finite number, units that are not the scenario's.
    """
    rows = _rows(data, file, where, key)
    header = _header(list(islice(rows, _DEEPEST_HEADER)), data, file, columns, where, key)
    wanted = [header.index(column.name) for column in columns]
    rows, notes = _rows(data, file, where, key), []
    lines: list[int] = []
    blocks: list[Floats] = []
    places = [0.0] * len(columns)
    bad: dict[int, Problem] = {}
    ragged: tuple[int, list[str]] | None = None
    next(rows)

    def chosen(item: tuple[int, list[str]]) -> list[str]:
        row = item[1]
        return [row[place] for place in wanted]

    # A block at a time, for the texts of a long record take many times the memory of its numbers.
    while block := list(islice(rows, _BLOCK)):
        ragged = ragged or next((item for item in block if len(item[1]) != len(header)), None)
        if ragged:
            continue  # to the end, for what is no CSV at all is told first
        if not lines and _names_units(block[0][1]):
            notes = _unit_notes([block[0][1][i] for i in wanted], file, columns, where)
            del block[0]
            if not block:
                continue
        numbers = np.empty((len(block), len(columns)))
        for i, (column, cells) in enumerate(zip(columns, zip(*map(chosen, block), strict=True), strict=True)):
            text = "\n".join(cells)
            found = None if i in bad else _numbers(text, cells)
            if found is not None:
                numbers[:, i] = found
                places[i] = min(places[i], _digit(text))
            elif i not in bad:
                k = next(k for k, cell in enumerate(cells) if not _is_number(cell))
                place = f"{file}, line {block[k][0]}, column {column.name!r}"
                bad[i] = Problem(where, column.key, f"{place}: {_number_expected(cells[k])}", repr(cells[k]))
        lines += [line for line, _ in block]
        blocks.append(numbers)
    if ragged:
        line, row = ragged
        expected = f"{file}, line {line}: expected {len(header)} cells{_ragged_hint(row, len(header))}"
        raise InputError(Problem(where, key, expected, str(len(row))))
    if bad:
        raise InputError(*(bad[i] for i in sorted(bad)))
    numbers = np.concatenate([np.empty((0, len(columns))), *blocks])
    digits = [float(10.0**least) * abs(column.factor) for least, column in zip(places, columns, strict=True)]
    notes += [note for i, column in enumerate(columns) if (note := _unwrap(numbers[:, i], lines, file, column))]
    with np.errstate(over="ignore"):  # told with the rates and accelerations that overflow
        numbers *= [column.factor for column in columns]
    return Samples(lines, numbers, digits, notes)


def _rows(data: bytes, file: str, where: str, key: str) -> Iterator[tuple[int, list[str]]]:
    """Every row that says anything, with its line; the header is the first. Raises InputError for what is no CSV."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        remedy = f"iconv -f UTF-16 -t UTF-8 {shlex.quote(file)} > {shlex.quote(_beside(file, 'utf8'))}"
        raise InputError(Problem(where, key, f"{file} is text in UTF-16: expected UTF-8 ({remedy} writes it so)"))
    try:
        reader = csv.reader(io.TextIOWrapper(io.BytesIO(data), "utf-8-sig", newline=""), strict=True)
        for row in reader:
            if any(map(str.strip, row)):
                yield reader.line_num, row
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(Problem(where, key, f"{file} is no CSV file in UTF-8 ({error})")) from error


def _header(
    rows: list[tuple[int, list[str]]], data: bytes, file: str, columns: Sequence[Column], where: str, key: str
) -> list[str]:
    """The names of a file's columns, from its first rows. Raises InputError where one that is asked for is none."""
    if not rows:
        raise InputError(Problem(where, key, f"{file} is empty: expected a header that names its columns"))
    line, header = rows[0][0], list(map(str.strip, rows[0][1]))
    names = [column.name for column in columns]
    problems = []
    if not set(names) <= set(header):
        layout = _layout(data.decode("utf-8-sig", "replace"), line, rows, names, file)
        if layout:
            raise InputError(Problem(where, key, layout))
    for column in columns:
        if column.name not in header:
            problems.append(unknown(where, column.key, f"column of {file}", column.name, header))
        elif header.count(column.name) > 1:
            problems.append(Problem(where, column.key, f"{file} has more than one column {column.name!r}"))
    if problems:
        raise InputError(*problems)
    return header


def _layout(text: str, line: int, rows: list[tuple[int, list[str]]], names: list[str], file: str) -> str:
    """What makes the file another than one with commas and a header on top, with the remedy; "" if nothing does."""
    header, lines = rows[0][1], text.splitlines()
    first, below = lines[line - 1], lines[line : line + _DEEPEST_HEADER]
    source = shlex.quote(file)
    for kind, mark in _SEPARATORS.items():
        cells = [cell.strip().strip('"') for cell in first.split(mark)]
        if len(cells) > 1 and (len(header) == 1 or set(names) <= set(cells)):
            commas = any(_DECIMAL_COMMA.fullmatch(cell.strip('"')) for row in below for cell in row.split(mark))
            shown = "\\t" if mark == "\t" else mark
            table = f"tr ',{shown}' '.,'" if commas else f"tr '{shown}' ,"
            found = f"{kind} between its cells" + " and decimal commas" * commas
            return (
                f"{file} has {found}: expected commas between cells and decimal points "
                f"({table} < {source} > {shlex.quote(_beside(file, 'commas'))} writes it so)"
            )
    if len(header) == 1 and len(first.split()) > 1 and set(names) <= set(first.split()):
        remedy = f"sed 's/^  *//; s/  */,/g' {source} > {shlex.quote(_beside(file, 'commas'))}"
        return f"{file} has blanks between its cells: expected commas ({remedy} writes it so)"
    for later, row in rows[1:_DEEPEST_HEADER]:
        if set(names) <= {cell.strip() for cell in row}:
            remedy = f"tail -n +{later} {source} > {shlex.quote(_beside(file, 'header'))}"
            return f"{file} has its header in line {later}: expected it in the first line ({remedy} writes it so)"
    return ""


def _beside(file: str, what: str) -> str:
    """A name for the file that a remedy writes."""
    return f"{file.removesuffix('.csv')}_{what}.csv"


def _ragged_hint(row: list[str], expected: int) -> str:
    """What a row of another length than the header's may come from."""
    if row[0].lstrip().startswith("#"):
        return " (CSV has no comments: take the line out)"
    if len(row) > expected and all(map(_WHOLE.fullmatch, row)):
        return (
            " (if its numbers have decimal commas, they cannot be told from the commas between cells: write them with "
            "points)"
        )
    kinds = [kind for kind, mark in _SEPARATORS.items() if any(mark in cell for cell in row)]
    return f" with commas between them (this row has {kinds[0]})" if kinds else ""


def _number_expected(cell: str) -> str:
    if _DECIMAL_COMMA.fullmatch(cell):
        return f"expected a decimal point, {cell.strip().replace(',', '.')}"
    absent = not cell.strip() or not re.search("[0-9]", cell)
    return "expected a finite number such as -1.5e-3" + (
        " (a row without one may be left out: what max_gap allows is bridged)" if absent else ""
    )


def _names_units(row: list[str]) -> bool:
    """Whether the row after the header holds units: no cell is a number, nor anything like one (nan, 1_000, "1,5")."""

    def like_a_number(cell: str) -> bool:
        try:
            float(cell)
        except ValueError:
            return bool(re.match(r"\s*[+-]?[.,]?[0-9]+([:.,_-]|\s*$)", cell))
        return True

    return not any(map(like_a_number, row))


def _unit_notes(cells: list[str], file: str, columns: Sequence[Column], where: str) -> list[str]:
    """Notes on units that are not known. Raises InputError for those that the scenario does not read the column in."""
    notes, problems = [], []
    for cell, column in zip(cells, columns, strict=True):
        told = cell.strip(" \t#[]()")
        unit = _SPELLED.get(told.lower(), told)
        if not column.unit or unit in ("", "-", column.unit):
            continue
        text = f"the units row of {file} has {told!r} for column {column.name!r}, and the scenario reads {column.unit}"
        key = column.key.replace(".columns.", ".units.")
        base = re.split(r"/|\^|\s|·", unit)[0]
        if unit in _KNOWN:
            alike = next((units for units in UNITS.values() if column.unit in units), {})
            remedy = f'say "{unit}" here if it is right' if unit in alike else "name a column of the right kind"
            problems.append(Problem(where, key, f"{text}: {remedy}, or put the units row right"))
        elif _SPELLED.get(base.lower(), base) in _KNOWN:
            problems.append(Problem(where, key, f"{text}: expected a column of positions or angles, not of rates"))
        else:
            notes.append(f"{key}: {text}: the scenario's unit counts")
    if problems:
        raise InputError(*problems)
    return notes


def _is_number(cell: str) -> bool:
    return bool(_NUMBER.fullmatch(cell)) and not math.isinf(float(cell))


def _numbers(text: str, cells: Sequence[str]) -> Floats | None:
    """Cells as numbers, None where one is none; `text`: all of them, a line each.

    Of what is written with these characters alone, Python reads as a number just what _NUMBER says is one.
    """
    if _OTHER.search(text):
        return None
    try:
        found = np.fromiter(map(float, cells), np.float64, len(cells))
    except ValueError:
        return None
    return found if np.isfinite(found).all() else None


def _digit(text: str) -> float:
    """The place of the last digit of numbers, a line each, as a power of ten: -3 for thousandths, at most 0."""
    signs = np.frombuffer(text.encode("ascii"), np.uint8)
    points = np.flatnonzero(signs == ord("."))
    if not ("e" in text or "E" in text):
        ends = np.append(np.flatnonzero(signs <= ord(" ")), len(signs))
        return -float((ends[np.searchsorted(ends, points)] - points).max(initial=1) - 1)
    least = -float(max(map(len, re.findall(r"\.([0-9]*)(?:\s|\Z)", text)), default=0))
    for places, exponent in re.findall(r"(?:\.([0-9]*))?[eE]([+-]?[0-9]+)", text):
        least = min(least, float(exponent) - len(places))
    return least


def _unwrap(samples: Floats, lines: list[int], file: str, column: Column) -> str:
    """Takes whole turns out of the steps of an angle that pass half a turn, in place; a note on it, or ""."""
    if math.isinf(column.half_turn):
        return ""
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that are refused later
        turns = np.round(np.diff(samples) / (2 * column.half_turn))
        wraps = np.flatnonzero(turns)
        if not wraps.size:
            return ""
        samples[1:] -= np.cumsum(turns) * (2 * column.half_turn)
    named = ", ".join(str(lines[k + 1]) for k in wraps[:_MOST_LINES])
    at = f"line {named}" if wraps.size == 1 else f"lines {named}"
    more = f" and {wraps.size - _MOST_LINES} more" if wraps.size > _MOST_LINES else ""
    return (
        f"{column.key}: column {column.name!r} of {file} steps by more than half a turn at {at}{more}: read as an "
        "angle that wraps, and unwrapped (one that does turn that fast needs more samples)"
    )
