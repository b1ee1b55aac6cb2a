"""One house style for every figure.

Figures fit a paper's column (86 mm), and their lines can be told apart without colours: each has a colour of Okabe and
Ito's palette and a dash pattern of its own. Legends stand above the axes, where there is no data. Labels are plain
Unicode, for mathtext takes three times as long. The same numbers give the same bytes: fonts come with Matplotlib, SVG
identifiers from a fixed salt, and nothing records a date.
"""

from __future__ import annotations

import io
import itertools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter
from numpy.typing import NDArray

from springline.model.quantities import Quantity, T
from springline.runner.report.scale import prefixed, tick_texts, unit_text

Floats = NDArray[np.float64]


Line = Mapping[str, Any]
"""Keyword arguments of Axes.plot."""

COLUMN = 3.39
"""Width of a paper's column, inches (86 mm)."""
PAGE = 7.0
"""Width of a figure across both columns, inches."""

LINES: tuple[Line, ...] = (
    {"color": "#0072B2", "linestyle": "-"},
    {"color": "#D55E00", "linestyle": (0, (5, 1.5))},
    {"color": "#009E73", "linestyle": (0, (5, 1.5, 1, 1.5))},
    {"color": "#CC79A7", "linestyle": (0, (1, 1.2))},
    {"color": "#E69F00", "linestyle": (0, (8, 2))},
    {"color": "#56B4E9", "linestyle": (0, (3, 1, 1, 1, 1, 1))},
)
"""The k-th line of a figure: blue, vermillion, green, purple, orange, sky blue."""

REFERENCE: Line = {"color": "black", "linestyle": (0, (4, 2)), "linewidth": 0.8}
"""A desired trajectory."""

STYLE: Mapping[Any, Any] = {
    "axes.axisbelow": True,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.useoffset": False,
    "axes.grid": True,
    "axes.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 8,
    "axes.xmargin": 0.0,
    "figure.constrained_layout.use": True,
    "font.family": "DejaVu Sans",  # the font that comes with Matplotlib
    "font.size": 8,
    "grid.alpha": 0.3,
    "grid.linewidth": 0.5,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "lines.linewidth": 1.1,
    "savefig.dpi": 250,
    "svg.fonttype": "path",  # looks the same wherever it is opened
    "svg.hashsalt": "springline",
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
}

_BUCKETS = 1500


@contextmanager
def house_style() -> Iterator[None]:
    """Context in which figures are made and drawn in the house style, whatever the user's matplotlibrc says."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


class NotebookFigure(Figure):
    """A figure that a notebook shows by itself: pyplot, which else has it do so, need not have been used before."""

    def _repr_png_(self) -> tuple[bytes, dict[str, int]]:
        """PNG with two pixels for each that it takes on the page, and its width and height there."""
        width, height = (round(inches * self.dpi) for inches in self.get_size_inches())
        pixels = io.BytesIO()
        with house_style():
            self.savefig(pixels, format="png", dpi=2 * self.dpi)
        return pixels.getvalue(), {"width": width, "height": height}


def panels(
    rows: int = 1,
    columns: int = 1,
    *,
    width: float = COLUMN,
    height: float = 1.5,
    share_x: bool | Literal["col"] = True,
) -> tuple[Figure, NDArray[Any]]:
    """A figure and its (rows, columns) array of Axes; width of the figure and height of a row in inches."""
    figure = NotebookFigure(figsize=(width, height * rows + 0.5))
    return figure, figure.subplots(rows, columns, sharex=share_x, squeeze=False)


def label(quantity: str, unit: str) -> str:
    """Axis label "quantity [unit]", powers raised; "1" and "" are no unit."""
    return quantity if unit in {"", "1"} else f"{quantity} [{unit_text(unit)}]"


class _Scaled(Formatter):
    """Ticks of a linear axis times a factor, all with the same decimals, and no power of ten beside the axis."""

    def __init__(self, factor: float) -> None:
        self._factor = factor

    def __call__(self, x: float, pos: int | None = None) -> str:
        """The text of one value."""
        return tick_texts([*self.locs, x], self._factor)[-1]

    def format_ticks(self, values: Sequence[float]) -> list[str]:
        """The texts of all ticks."""
        self.set_locs(list(values))
        return tick_texts(values, self._factor)


class _Decades(Formatter):
    """Ticks of a logarithmic axis times a factor, written out."""

    def __init__(self, factor: float) -> None:
        self._factor = factor

    def __call__(self, x: float, pos: int | None = None) -> str:
        """The text of one value."""
        return f"{x * self._factor:.6g}"


def name_axis(axis: Axis, quantity: str, unit: str) -> None:
    """Label an axis, with the SI prefix that its numbers call for ("error [mm]"): once all is drawn.

    A logarithmic axis gets it too; its locator stays.
    """
    scale = axis.get_scale()
    low, high = axis.get_view_interval() if scale == "log" else _limits(axis)
    size = float(np.sqrt(low * high)) if scale == "log" else max(abs(low), abs(high))
    factor, shown = (1.0, unit) if scale not in {"linear", "log"} else prefixed(unit, size)
    axis.set_label_text(label(quantity, shown))
    if factor != 1.0:
        axis.set_major_formatter(_Scaled(factor) if scale == "linear" else _Decades(factor))


def _limits(axis: Axis) -> tuple[float, float]:
    """The ends of an axis, its data taken in."""
    axes = axis.axes
    low, high = axes.get_xlim() if axis is axes.xaxis else axes.get_ylim()
    return float(low), float(high)


def symbol(quantity: Quantity) -> str:
    """A quantity's symbol in a label: plain Unicode where that can write it, else TeX's mathematics."""
    plain = quantity.symbol
    for tex, text in ((r"\sigma", "σ"), ("_1", "₁"), ("_2", "₂")):
        plain = plain.replace(tex, text)
    return plain if plain.isalnum() else f"${quantity.symbol}$"


TIME = label(T.meaning, T.unit)


def draw(axes: Axes, t: Floats, y: Floats, name: str = "", **style: Any) -> None:
    """Plot y over t; of a long record the extremes of each of 1500 intervals, which look the same and keep files small.

    t, y  (rows,), one unit each;  name  legend entry;  style  keyword arguments of Axes.plot
    """
    axes.plot(*envelope(t, y), label=name or "_", **style)


def envelope(t: Floats, y: Floats, buckets: int = _BUCKETS) -> tuple[Floats, Floats]:
    """The rows at which y is least and greatest in each of `buckets` equal parts, in the order of time; ends kept."""
    if len(y) <= 4 * buckets:
        return t, y
    edges = np.linspace(0, len(y), buckets + 1).astype(int)
    picked = {0, len(y) - 1}
    for first, last in itertools.pairwise(edges):
        part = y[first:last]
        picked |= {first + int(np.argmin(part)), first + int(np.argmax(part))}
    rows = np.array(sorted(picked))
    return t[rows], y[rows]


def legend_above(figure: Figure, columns: int = 2) -> None:
    """One legend for the whole figure, above all axes; lines of the same name are listed once."""
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, name in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(name, handle)
    if entries:
        figure.legend(entries.values(), entries.keys(), loc="outside upper center", ncols=min(columns, len(entries)))


def figure_files(name: str, figure: Figure) -> dict[str, bytes]:
    """The figure as ``name.png`` and ``name.svg``, by file name; the same figure gives the same bytes.

    Its layout is final after that.
    """
    with house_style():
        engine = figure.get_layout_engine()
        if engine is not None:
            engine.execute(figure)
            figure.set_layout_engine("none")  # or every file is laid out anew
        # Not by savefig, which draws each file twice: once to lay it out.
        figure.set_dpi(STYLE["savefig.dpi"])
        pixels, vectors = io.BytesIO(), io.BytesIO()
        FigureCanvasAgg(figure).print_png(pixels, metadata={"Software": None})  # type: ignore[no-untyped-call]
        FigureCanvasSVG(figure).print_svg(vectors, metadata={"Date": None, "Creator": None})  # type: ignore[no-untyped-call]
        return {f"{name}.png": pixels.getvalue(), f"{name}.svg": vectors.getvalue()}
