"""Reads the tables that springline has stored, for tests."""

import json
from pathlib import Path

import pyarrow as pa
from pyarrow import csv, parquet


def read_table(path: Path) -> pa.Table:
    """Read a ``.parquet`` or ``.csv`` file that `table_files` wrote, with its units.

    A CSV without its ``.units.json`` is read without units, and the types are what its cells look like.
    Raises OSError if there is no such file, pyarrow.ArrowInvalid if it is not what its name says.
    """
    if path.suffix == ".parquet":
        return parquet.read_table(path)
    sidecar = path.with_suffix(".units.json")
    unit: dict[str, str] = json.loads(sidecar.read_bytes()) if sidecar.exists() else {}
    # Cells alone do not tell that a column of whole numbers, or an empty one, holds doubles: what has a unit does.
    doubles = {name: pa.float64() for name, text in unit.items() if text}
    table = csv.read_csv(path, convert_options=csv.ConvertOptions(column_types=doubles))
    fields = [f.with_metadata({"unit": unit[f.name]}) if f.name in unit else f for f in table.schema]
    return table.cast(pa.schema(fields))
