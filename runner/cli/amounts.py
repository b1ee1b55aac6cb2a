"""Amounts of time and of bytes as people say them."""

from __future__ import annotations

import math


def time_text(seconds: float) -> str:
    """A duration for people: "7 ms", "40 s", "12 min", "3.5 h", "2.1 days"."""
    scales = (
        (0.1, 1e-3, "ms"),
        (90.0, 1.0, "s"),
        (5400.0, 60.0, "min"),
        (172800.0, 3600.0, "h"),
        (math.inf, 86400.0, "days"),
    )
    unit, name = next((unit, name) for limit, unit, name in scales if seconds < limit)
    return f"{seconds / unit:.2g} {name}" if seconds / unit < 10 else f"{seconds / unit:.0f} {name}"


def size_text(count: float) -> str:
    """Bytes for people: "12 kB", "3.4 GB"."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"
