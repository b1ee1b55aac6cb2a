"""Columns between Arrow and NumPy: the same values as by Arrow's own ways, which wait for pandas."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from springline.runner.files import arrow_array, arrow_scalar, numpy_array

KINDS = {
    pa.float64(): st.floats(),
    pa.int64(): st.integers(-(2**63), 2**63 - 1),
    pa.bool_(): st.booleans(),
}


@given(st.data(), st.sampled_from(list(KINDS)), st.integers(0, 3))
def test_a_column_is_the_same_values_whatever_its_chunks(data: st.DataObject, kind: pa.DataType, skipped: int) -> None:
    """Slices too, which begin in the middle of a byte of truth values."""
    chunks = data.draw(st.lists(st.lists(KINDS[kind], max_size=20), max_size=3))
    column = pa.chunked_array([pa.array(chunk, kind) for chunk in chunks], kind)[skipped:]
    found = numpy_array(column)
    assert found.dtype == kind.to_pandas_dtype()
    np.testing.assert_array_equal(found, [value for chunk in chunks for value in chunk][skipped:])
    if chunks:
        np.testing.assert_array_equal(numpy_array(pa.array(chunks[0], kind)[skipped:]), chunks[0][skipped:])


@pytest.mark.parametrize(
    ("kind", "null"), [(pa.float64(), 0.5), (pa.int64(), 7), (pa.bool_(), True), (pa.bool_(), False)]
)
def test_null_becomes_what_is_asked_for(kind: pa.DataType, null: float) -> None:
    column = pa.array([None, 0, 1, None]).cast(kind)
    np.testing.assert_array_equal(numpy_array(column, null=null), [null, 0, 1, null])
    assert numpy_array(column, null=null).dtype == kind.to_pandas_dtype()


def test_null_is_nan_unless_the_column_has_none() -> None:
    np.testing.assert_array_equal(numpy_array(pa.array([1.5, None])), [1.5, np.nan])
    for kind in (pa.int64(), pa.bool_()):
        with pytest.raises(ValueError, match=r"NaN to integer|expected a truth value in place of null, got nan"):
            numpy_array(pa.array([1, None]).cast(kind))


def test_a_scalar_is_what_arrow_makes_of_it() -> None:
    for value, kind in ((1.5, pa.float64()), (-3, pa.int64()), (True, pa.bool_()), ("aü", pa.string())):
        assert arrow_scalar(value, kind).equals(pa.scalar(value, kind))
        assert arrow_array([value, value], kind).equals(pa.array([value, value], kind))
