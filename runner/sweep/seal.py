"""Seals: what tells a table file that is whole from one that is damaged, of other runs, or of another sweep.

A sealed file carries three entries in its Parquet metadata: the identity of the sweep, which runs it holds, and a
SHA-256 of what its columns hold. The hash is of values, not of bytes on the disk, so it survives another compression,
another division into row groups, and a new version of the library that writes the file.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from hashlib import sha256
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from springline.runner.files import arrow_scalar, numpy_array, parquet_bytes

_SWEEP, _RUNS, _CONTENT = b"springline.sweep", b"springline.runs", b"springline.sha256"


@dataclass(frozen=True, slots=True)
class Seal:
    """What a file should be: some runs of one sweep.

    sweep  identity of the sweep;  runs  first and last run
    """

    sweep: str
    runs: tuple[int, int]

    @property
    def _runs_text(self) -> str:
        return "{}-{}".format(*self.runs)

    def close(self, table: pa.Table) -> bytes:
        """The file of `table`, sealed."""
        return self._closed(table, content_hash(table))

    def _closed(self, table: pa.Table, content: str) -> bytes:
        told = {_SWEEP: self.sweep, _RUNS: self._runs_text, _CONTENT: content}
        return parquet_bytes(table.replace_schema_metadata(told))

    def open(self, file: Any, schema: pa.Schema, rows: int | None = None) -> Opened:
        """What a file holds, which should be a table with this schema and number of rows (None: any).

        file  an open binary file
        No content, however damaged or foreign, raises; only what reading itself raises comes through.
        """
        content = file.read()
        try:
            stored = parquet.ParquetFile(io.BytesIO(content))
            # Before anything is decoded: what is not ours may be of any size.
            if not stored.schema_arrow.remove_metadata().equals(schema, check_metadata=True):
                return Opened(None, "has other columns than the runs of this sweep")
            if rows not in (None, stored.metadata.num_rows):
                return Opened(None, f"has {stored.metadata.num_rows} rows, expected {rows}")
            # One thread: a column of a part is too little for more, and each would keep memory of its own.
            table = stored.read(use_threads=False)
            table.validate(full=True)
            told = table.schema.metadata or {}
            table = table.replace_schema_metadata(None)
            found = content_hash(table)
        except (pa.ArrowException, OSError, ValueError, OverflowError) as error:  # all that Arrow has for damage
            return Opened(None, f"is no Parquet file that can be read ({_first_line(error)})")
        if told.get(_RUNS, b"") != self._runs_text.encode():
            return Opened(table, "holds other runs")
        if told.get(_SWEEP, b"") != self.sweep.encode():
            return Opened(table, "is of another sweep")
        if told.get(_CONTENT, b"") != found.encode():
            return Opened(table, "has content that is not what was written (its SHA-256 differs)")
        sound = self._closed(table, found)
        return Opened(table, "", b"" if sound == content else sound)


@dataclass(frozen=True, slots=True)
class Opened:
    """What a file holds.

    table   its content; None if it is no table of the right shape
    flaw    why it is not whole, "" if it is
    better  the bytes that a file with this content should have, b"" if it has them: whole content can stand in a file
            whose statistics or padding are damaged, or that another version of the library wrote
    """

    table: pa.Table | None
    flaw: str
    better: bytes = b""


def content_hash(table: pa.Table) -> str:
    """SHA-256 of the columns of a table, in the order of its schema; of each

        its type's name and the number of rows as text, a line
        one byte a row: 1 for a value, 0 for null
        its values, little-endian (truth values as bytes), zero where null; of texts first their lengths in bytes as
        64-bit integers, then all texts in UTF-8 one after the other

    It depends neither on how columns are divided into chunks nor on what lies under a null.
    Raises TypeError for a column that is none of 64-bit numbers, truth values and texts.
    """
    digest = sha256()
    for field, chunked in zip(table.schema, table.columns, strict=True):
        digest.update(f"{field.type} {len(chunked)}\n".encode())
        column = chunked.combine_chunks()
        digest.update(numpy_array(column.is_valid()).tobytes())
        if pa.types.is_string(field.type):
            texts = [text.encode() for text in column.fill_null(arrow_scalar("", pa.string())).to_pylist()]
            digest.update(np.array([len(text) for text in texts], dtype="<i8").tobytes())
            digest.update(b"".join(texts))
        elif pa.types.is_boolean(field.type):
            digest.update(numpy_array(column, null=False).tobytes())
        elif field.type in (pa.float64(), pa.int64()):
            values = numpy_array(column, null=0)
            digest.update(np.ascontiguousarray(values, values.dtype.newbyteorder("<")).tobytes())
        else:
            raise TypeError(f"{field.name}: a column of {field.type} has no place in a dataset")
    return digest.hexdigest()


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:100]
