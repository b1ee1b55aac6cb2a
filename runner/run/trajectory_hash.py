"""One number for all the bits of a trajectory, by which two machines or two versions compare what they computed."""

from __future__ import annotations

import hashlib

import numpy as np
import pyarrow as pa

from springline.runner.files import numpy_array

_NAN = np.uint64(0x7FF8000000000000)


def trajectory_hash(trajectory: pa.Table) -> str:
    """SHA-256, as 64 hexadecimal digits, of the float64 columns of a table.

    They follow each other in the order of the table, t included, each one whole, as little-endian doubles. Null is the
    quiet NaN 0x7ff8000000000000, and so is every NaN: its sign and payload are the processor's.
    """
    digest = hashlib.sha256()
    for column in trajectory.columns:
        if column.type == pa.float64():
            bits = np.array(numpy_array(column)).view(np.uint64)
            bits[np.isnan(bits.view(np.float64))] = _NAN
            digest.update(bits.astype("<u8").tobytes())
    return digest.hexdigest()
