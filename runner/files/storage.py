"""Tables on disk: Parquet (or CSV) with a unit for every column, written whole or not at all.

Parquet   the unit stands in each field's metadata under the key ``unit``
CSV       the first line is the plain column names, so that every reader takes it without options; the units stand
          beside it, ``trajectory.csv`` -> ``trajectory.units.json`` ({column: unit}). Numbers are the shortest text
          that reads back to the same bits; an empty cell is null

The same table gives the same bytes: no time of writing, no host, no user is recorded.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Literal

import pyarrow as pa
from pyarrow import csv, parquet

from springline.codegen.files import change_folder

Format = Literal["parquet", "csv"]


def units(table: pa.Table) -> dict[str, str]:
    """Column name -> SI unit, in the order of the columns; "" for a column that has none (a status, a count)."""
    return {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in table.schema}


def table_files(name: str, table: pa.Table, form: Format = "parquet") -> dict[str, bytes]:
    """The files that hold `table`, by file name: ``name.parquet``, or ``name.csv`` and ``name.units.json``."""
    if form == "parquet":
        return {f"{name}.parquet": parquet_bytes(table)}
    return {f"{name}.csv": csv_bytes(table), f"{name}.units.json": _json(units(table))}


def parquet_bytes(table: pa.Table) -> bytes:
    """A Parquet file, zstd-compressed, with the units in its schema."""
    sink = io.BytesIO()
    # A dictionary of doubles, which hardly repeat, is a second copy of them; words do repeat.
    words = [field.name for field in table.schema if pa.types.is_string(field.type)]
    parquet.write_table(table, sink, compression="zstd", use_dictionary=words)
    return sink.getvalue()


def csv_bytes(table: pa.Table) -> bytes:
    """A CSV file: one line of column names, then one line a row."""
    sink = io.BytesIO()
    sink.write((",".join(table.column_names) + "\n").encode())
    csv.write_csv(table, sink, csv.WriteOptions(include_header=False, quoting_style="needed"))
    return sink.getvalue()


def write_folder(folder: Path, files: Mapping[str, bytes], replaces: Iterable[str] = ()) -> None:
    """Write a folder of results, whole or not at all.

    files     path inside the folder (``/`` between parts) -> content
    replaces  glob patterns, inside the folder, of earlier results that go when the new ones come

    Files of the same name are replaced, others stay where they are. Raises OSError if the disk refuses; then all is as
    it was, and a new folder is not there.
    """
    earlier = {path.relative_to(folder).as_posix() for pattern in replaces for path in folder.glob(pattern)}
    change_folder(folder, files, sorted(earlier - files.keys()))


def _json(value: object) -> bytes:
    return (json.dumps(value, indent=2, ensure_ascii=False) + "\n").encode()
