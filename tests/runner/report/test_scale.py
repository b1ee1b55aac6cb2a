"""Numbers for people: prefixes, signs and decimals."""

import math

import pytest

from springline.runner.report import figure_text, prefixed, quantity_text
from springline.runner.report.scale import tick_texts


@pytest.mark.parametrize(
    ("unit", "size", "expected"),
    [
        ("m", 0.05, "mm"),
        ("m", 0.1, "m"),
        ("rad", 2e-6, "µrad"),
        ("rad/s", 2e-3, "mrad/s"),
        ("N m", 9999.0, "N m"),
        ("N m", 1e4, "kN m"),
        ("N", 3.7e7, "MN"),
        ("m/s", 1e-13, "pm/s"),
        ("m", 1e-15, "m"),
        ("kg", 1e-3, "kg"),
        ("m^2", 1e-3, "m^2"),
        ("1/s", 1e-3, "1/s"),
        ("m", 0.0, "m"),
        ("m", math.inf, "m"),
    ],
)
def test_a_unit_takes_the_prefix_that_its_numbers_call_for(unit: str, size: float, expected: str) -> None:
    factor, shown = prefixed(unit, size)
    assert shown == expected
    assert factor == pytest.approx(
        {"m": 1e3, "µ": 1e6, "p": 1e12, "k": 1e-3, "M": 1e-6}[expected[0]] if shown != unit else 1.0
    )


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (0.00168712, "m", "1.687 mm"),
        (-0.25, "rad", "−0.25 rad"),
        (12345.0, "N m", "12.35 kN · m"),
        (1.5, "m/s^2", "1.5 m/s²"),
        (None, "m", "–"),
        (math.nan, "m", "–"),
        (math.inf, "N", "∞ N"),
        (0.5, "1", "0.5"),
    ],
)
def test_a_quantity_for_people(value: float | None, unit: str, expected: str) -> None:
    assert quantity_text(value, unit) == expected


def test_very_large_and_small_numbers_have_a_power_of_ten() -> None:
    assert figure_text(1.234567e20) == "1.235 · 10²⁰"
    assert figure_text(-1e-7) == "−1 · 10⁻⁷"


def test_ticks_have_as_many_decimals_as_tell_them() -> None:
    assert tick_texts([-5e-4, 0.0, 5e-4], 1e3) == ["−0.5", "0.0", "0.5"]
    assert tick_texts([0.00025, 0.0005], 1e3) == ["0.25", "0.50"]
    assert tick_texts([2e-6, 4e-6], 1e6) == ["2", "4"]
