"""Arrow arrays of NumPy's, and back, without pandas.

pa.array and pa.scalar import pandas where that is installed, to ask whether what they are given is pandas', and so do
to_numpy and whatever takes a plain number or text for a scalar: longer than a run takes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray


def arrow_array(values: Any, kind: pa.DataType, *, null: bool = False) -> pa.Array:
    """An array of the type `kind`; NaN and None are null if asked.

    Numbers, truth values and texts are copied as they are; for anything else Arrow is asked, at the price above.
    """
    if kind in {pa.float64(), pa.int64()}:
        return _numbers(np.ascontiguousarray(values, kind.to_pandas_dtype()), kind, null=null and kind == pa.float64())
    if kind == pa.bool_():
        packed = np.packbits(np.asarray(values, np.bool_), bitorder="little")
        return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(packed)])
    if kind == pa.string() and all(isinstance(value, str) for value in values):
        return arrow_texts(values)
    return pa.array(values, kind, from_pandas=null)


def arrow_scalar(value: Any, kind: pa.DataType) -> pa.Scalar:
    """One value of the type `kind`, as `arrow_array` makes many."""
    return arrow_array([value], kind)[0]


def numpy_array(column: pa.Array | pa.ChunkedArray, *, null: float = np.nan) -> NDArray[Any]:
    """A column of numbers or truth values, `null` in place of null; not to be written to, for it may be Arrow's own.

    Raises ValueError for a `null` that is none of the column's type.
    """
    truth = pa.types.is_boolean(column.type)
    whole = column
    if column.null_count:
        if truth and not isinstance(null, bool):
            raise ValueError(f"expected a truth value in place of null, got {null!r}")
        whole = column.fill_null(arrow_scalar(null, column.type))
    if truth:  # eight of them share a byte
        whole = whole.cast(pa.uint8())
    chunks = whole.chunks if isinstance(whole, pa.ChunkedArray) else [whole]
    parts = [np.from_dlpack(chunk) for chunk in chunks]
    made = parts[0] if len(parts) == 1 else np.concatenate([np.zeros(0, whole.type.to_pandas_dtype()), *parts])
    return made.view(np.bool_) if truth else made


def arrow_texts(values: Sequence[str]) -> pa.Array:
    """Texts."""
    parts = [value.encode() for value in values]
    ends = np.cumsum([0, *map(len, parts)], dtype=np.int32)
    return pa.StringArray.from_buffers(len(parts), pa.py_buffer(ends), pa.py_buffer(b"".join(parts)))


def arrow_numbers(values: NDArray[np.float64], *, null: bool = False) -> pa.Array:
    """Doubles as they are, NaN as null if asked."""
    return _numbers(np.ascontiguousarray(values), pa.float64(), null=null)


def _numbers(values: NDArray[Any], kind: pa.DataType, *, null: bool) -> pa.Array:
    missing = np.isnan(values) if null else np.zeros(0, np.bool_)
    valid = pa.py_buffer(np.packbits(~missing, bitorder="little")) if missing.any() else None
    return pa.Array.from_buffers(kind, len(values), [valid, pa.py_buffer(values)])
