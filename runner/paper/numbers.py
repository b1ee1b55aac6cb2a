"""Numbers as text, for people and for JSON."""

from __future__ import annotations

import math

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plain(value: float | None) -> float | str | None:
    """A number for JSON: None for NaN, "inf" for infinity."""
    if value is None or math.isnan(value):
        return None
    return value if math.isfinite(value) else "inf" if value > 0 else "-inf"


def number(value: float | None, digits: int = 3) -> str:
    """A measured number for people, with all its digits, zeros at the end too; "–" where there is none."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if value == 0:
        return "0"
    if 1e-4 <= abs(value) < 1e5:
        text = f"{value:#.{digits}g}".rstrip(".") if abs(value) < 10**digits else f"{value:.0f}"
        return text.replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(_SUPERSCRIPTS)}".replace("-", "−")


def exact(value: float) -> str:
    """A number that is given and not measured, without zeros at its end."""
    if math.isinf(value):
        return number(value)
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        return f"{value:.4g}".replace("-", "−")
    mantissa, exponent = f"{value:.3e}".split("e")
    digits = mantissa.rstrip("0").rstrip(".")
    power = f"10{str(int(exponent)).translate(_SUPERSCRIPTS)}"
    return power if digits == "1" else f"{digits}·{power}".replace("-", "−")


def change(difference: float | None, of: float) -> str:
    """A difference for people, with its sign; what is less than 1e-9 of the number itself is rounding, and 0."""
    if difference is not None and abs(difference) < 1e-9 * abs(of):
        return "0"
    text = number(difference, 2)
    return f"+{text}" if difference is not None and difference > 0 else text


def percent(share: float) -> str:
    """A share for people, to two digits."""
    return f"{number(100 * share, 2)} %"
