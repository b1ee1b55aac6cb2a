"""The continuous loop at frozen times: its spectrum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from springline.runner.analysis.loop import LinearLoop

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]


def spectrum(loop: LinearLoop) -> Complex:
    """Eigenvalues of the continuous closed loop, (runs, times, states), 1/s, in no order."""
    found: Complex = np.linalg.eigvals(loop.closed()).astype(complex)
    return found


def growth(loop: LinearLoop) -> Floats:
    """Largest real part of the continuous closed loop's eigenvalues over the times, (runs,), 1/s: unstable above 0."""
    largest: Floats = spectrum(loop).real.max(axis=(1, 2))
    return largest
