"""Seals: the hash is of what columns hold and of nothing else, and whatever happens to a file is noticed."""

import io
import random
from hashlib import sha256
from struct import pack

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from springline.runner.sweep.seal import Seal, content_hash

SCHEMA = pa.schema([("run", pa.int64()), ("x", pa.float64()), ("on", pa.bool_()), ("law", pa.string())])
TABLE = pa.table(
    [pa.array([7, 8, 9]), pa.array([1.5, None, -0.0]), pa.array([True, None, False]), pa.array(["a", None, "ü"])],
    schema=SCHEMA,
)
SEAL = Seal("sweep", (7, 9))


def opened(content: bytes, seal: Seal = SEAL, schema: pa.Schema = SCHEMA, rows: int | None = 3) -> tuple[bool, str]:
    """Whether a file's content can be used, and its flaw."""
    found = seal.open(io.BytesIO(content), schema, rows)
    return found.table is not None, found.flaw


def test_the_hash_is_the_one_that_is_defined() -> None:
    valid = b"\x01\x00\x01"
    expected = b"int64 3\n\x01\x01\x01" + pack("<3q", 7, 8, 9)
    expected += b"double 3\n" + valid + pack("<3d", 1.5, 0.0, -0.0)
    expected += b"bool 3\n" + valid + b"\x01\x00\x00"
    expected += b"string 3\n" + valid + pack("<3q", 1, 0, 2) + "aü".encode()
    assert content_hash(TABLE) == sha256(expected).hexdigest()


def test_the_hash_does_not_depend_on_chunks_nor_on_what_lies_under_a_null() -> None:
    assert content_hash(pa.concat_tables([TABLE[:1], TABLE[1:]])) == content_hash(TABLE)
    assert content_hash(pa.concat_tables([TABLE, TABLE])[3:]) == content_hash(TABLE)
    other = pa.array(np.array([1.5, 99.0, -0.0]), mask=np.array([False, True, False]))
    assert content_hash(TABLE.set_column(1, SCHEMA.field("x"), other)) == content_hash(TABLE)


@pytest.mark.parametrize(
    ("column", "values"),
    [(0, [7, 9, 8]), (1, [1.5, None, 0.0]), (1, [1.5, 0.0, -0.0]), (2, [True, None, True]), (3, ["aü", None, ""])],
)
def test_the_hash_tells_contents_apart(column: int, values: list[object]) -> None:
    """Signs of zero, nulls and where one text ends too."""
    changed = TABLE.set_column(column, SCHEMA.field(column), pa.array(values, SCHEMA.field(column).type))
    assert content_hash(changed) != content_hash(TABLE)


def test_a_sealed_file_is_whole_and_its_content_survives_another_encoding() -> None:
    content = SEAL.close(TABLE)
    found = SEAL.open(io.BytesIO(content), SCHEMA, 3)
    assert (found.flaw, found.better) == ("", b"")
    assert found.table.equals(TABLE, check_metadata=True)
    again = io.BytesIO()
    parquet.write_table(parquet.read_table(io.BytesIO(content)), again, compression="none", row_group_size=2)
    assert SEAL.open(io.BytesIO(again.getvalue()), SCHEMA, 3).flaw == ""
    assert SEAL.open(io.BytesIO(again.getvalue()), SCHEMA, 3).better == content


def test_files_that_are_not_what_was_written_are_told_apart() -> None:
    content = SEAL.close(TABLE)
    assert opened(content, Seal("another", (7, 9))) == (True, "is of another sweep")
    assert opened(content, Seal("sweep", (0, 2))) == (True, "holds other runs")
    assert opened(content, rows=4) == (False, "has 3 rows, expected 4")
    assert opened(content, schema=SCHEMA.remove(1)) == (False, "has other columns than the runs of this sweep")
    unit = SCHEMA.set(1, SCHEMA.field(1).with_metadata({"unit": "m"}))
    assert opened(content, schema=unit)[1] == "has other columns than the runs of this sweep"
    told = parquet.read_table(io.BytesIO(content)).schema.metadata
    other = io.BytesIO()
    parquet.write_table(TABLE.set_column(0, "run", pa.array([7, 8, 10])).replace_schema_metadata(told), other)
    assert opened(other.getvalue())[1].startswith("has content that is not what was written")
    for nothing in (b"", b"PAR1", b"PAR1PAR1", b"x" * 1000, content[:-1], content[1:]):
        usable, flaw = opened(nothing)
        assert not usable
        assert flaw.startswith("is no Parquet file that can be read")


def test_no_damage_goes_unnoticed() -> None:
    """A flaw, or other bytes that hold the same: then those that should be there are known."""
    content, chance = SEAL.close(TABLE), random.Random(4)  # noqa: S311 - no secret
    for _ in range(400):
        damaged = bytearray(content)
        for _ in range(chance.choice((1, 1, 2, 60))):
            damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
        if damaged == content:
            continue
        found = SEAL.open(io.BytesIO(bytes(damaged)), SCHEMA, 3)
        assert found.flaw or found.better == content
