"""Numbers with SI prefixes: 1.69 µm instead of 1.69e-06 m, in tables and on axes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

_UP = ("k", "M", "G", "T")
_DOWN = ("m", "µ", "n", "p")
_TAKE_PREFIX = frozenset({"m", "rad", "N", "s", "J", "W"})
_LEAST, _MOST = 0.1, 1e4
_FINEST = 9
"""Decimals at most."""


def prefixed(unit: str, size: float) -> tuple[float, str]:
    """Factor and unit with which numbers up to `size` are read best: (1e3, "mm") for 0.05 m.

    From 0.1 to 10 000 a number stays as it is. In a unit of several parts the first takes the prefix ("mm/s"); a power,
    a mass and a plain number take none.
    """
    first = unit.replace("/", " ").partition(" ")[0]
    if first not in _TAKE_PREFIX or not math.isfinite(size) or size == 0.0 or _LEAST <= size < _MOST:
        return 1.0, unit
    if size < _LEAST:
        smaller = ((10.0 ** (3 * k), prefix) for k, prefix in enumerate(_DOWN, 1))
        return next(((factor, prefix + unit) for factor, prefix in smaller if size * factor >= _LEAST), (1.0, unit))
    larger = ((10.0 ** (-3 * k), prefix) for k, prefix in enumerate(_UP, 1))
    return next(((factor, prefix + unit) for factor, prefix in larger if size * factor < _MOST), (1.0, unit))


def unit_text(unit: str) -> str:
    """A unit for people: powers raised, a dot between factors; of a number that any joint may have, "m or rad"."""
    raised = unit.replace("^2", "²").replace("^3", "³")
    return "" if unit == "1" else " or ".join(part.replace(" ", " · ") for part in raised.split(" or "))


def figure_text(value: float, digits: int = 4) -> str:
    """A number for people: significant digits, a minus sign, a power of ten where it is very large or small."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    return (mantissa + (f" · 10{_raised(int(exponent))}" if exponent else "")).replace("-", "−")


def quantity_text(value: float | None, unit: str, digits: int = 4) -> str:
    """A number with the unit and the prefix that suit it; "–" for none."""
    if value is None or math.isnan(value):
        return "–"
    factor, shown = prefixed(unit, abs(value))
    return f"{figure_text(value * factor, digits)} {unit_text(shown)}".rstrip()


def tick_texts(ticks: Sequence[float], factor: float) -> list[str]:
    """Ticks of an axis times `factor`, all with as many decimals as tell them."""
    scaled = [tick * factor for tick in ticks]
    gaps = (b - a for a, b in itertools.pairwise(scaled) if b > a)
    gap = min(gaps, default=max(map(abs, scaled), default=1.0))
    decimals = next(
        (d for d in range(_FINEST) if all(abs(round(value, d) - value) <= 1e-4 * gap for value in scaled)), _FINEST
    )
    return [f"{round(value, decimals) + 0.0:.{decimals}f}".replace("-", "−") for value in scaled]


def _raised(number: int) -> str:
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
