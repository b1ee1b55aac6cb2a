"""The style of all figures: what a line, a label and a legend become."""

import numpy as np
import pytest

from springline.runner.report import draw, house_style, label, legend_above, panels
from springline.runner.report.style import envelope


def test_envelope_keeps_ends_and_extremes() -> None:
    t = np.linspace(0.0, 1.0, 100_000)
    y = np.sin(5e4 * t)
    y[54_321] = 7.0
    thin_t, thin_y = envelope(t, y, 100)
    assert len(thin_y) <= 202
    assert thin_y.max() == 7.0 and thin_y.min() == y.min()
    assert (thin_t[0], thin_t[-1]) == (0.0, 1.0)
    assert np.all(np.diff(thin_t) > 0)
    assert np.all(np.interp(thin_t, t, y) == thin_y)


def test_envelope_leaves_a_short_record_alone() -> None:
    t = np.arange(10.0)
    assert np.array_equal(envelope(t, t**2), (t, t**2))


@pytest.mark.parametrize(
    ("unit", "expected"),
    [("m/s^2", "x [m/s²]"), ("N m", "x [N · m]"), ("1", "x"), ("", "x"), ("kg m^2", "x [kg · m²]")],
)
def test_label(unit: str, expected: str) -> None:
    assert label("x", unit) == expected


def test_legend_lists_a_name_once_and_only_named_lines() -> None:
    with house_style():
        figure, grid = panels(2)
        for axes in grid[:, 0]:
            draw(axes, np.arange(3.0), np.arange(3.0), "named")
            draw(axes, np.arange(3.0), np.arange(3.0))
        legend_above(figure)
    assert [text.get_text() for legend in figure.legends for text in legend.get_texts()] == ["named"]
