"""Tables as pandas and Polars have them, with the unit of every column kept. Neither is needed for anything else."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from springline.runner.files.storage import units

if TYPE_CHECKING:
    import pyarrow as pa


def to_pandas(table: pa.Table) -> Any:
    """An Arrow table of springline as a pandas.DataFrame; its ``attrs["units"]`` is {column: unit}.

    table  a trajectory, metrics, or what `batch` and `read_dataset` give
    Raises ImportError, with the line that installs it, if there is no pandas.
    """
    _expect("pandas")
    frame = table.to_pandas()
    frame.attrs["units"] = units(table)
    return frame


def to_polars(table: pa.Table) -> Any:
    """An Arrow table of springline as a polars.DataFrame, each column named with its unit: "q1_lift [m]".

    Polars keeps nothing beside a column but its name. A column that has no unit (a status, a count) keeps its name.

    table  a trajectory, metrics, or what `batch` and `read_dataset` give
    Raises ImportError, with the line that installs it, if there is no Polars.
    """
    polars = _expect("polars")
    named = [f"{name} [{unit}]" if unit else name for name, unit in units(table).items()]
    return polars.from_arrow(table.rename_columns(named))


def _expect(library: str) -> Any:
    try:
        return importlib.import_module(library)
    except ImportError as error:
        raise ImportError(f"to_{library} needs {library}, which is not installed: pip install {library}") from error
