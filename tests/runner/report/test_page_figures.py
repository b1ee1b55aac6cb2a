"""Figures on a page: the same picture as the file, small, and readable on a dark page and with every kind of eyes."""

from __future__ import annotations

import itertools
import re
from importlib import resources
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.patches import Rectangle

from springline.runner.report import LINES, Document, Picture, draw, figure_files, house_style, panels, to_html
from springline.runner.report.page_figures import DARK, INK, PAPER, PageFigures, dark_colour

CSS = (resources.files("springline.runner.report") / "templates" / "report.css").read_text(encoding="utf-8")


def drawn(scale: float = 1.0) -> bytes:
    """A figure with a line that leaves its axes, markers, a hatch and letters."""
    with house_style():
        figure, grid = panels()
        axes = grid[0, 0]
        t = np.linspace(0.0, 1.0, 50)
        draw(axes, t, scale * t**3, "a line", **LINES[0])
        axes.plot(t, t, ".", color=LINES[1]["color"])
        axes.add_patch(Rectangle((0.2, 0.2), 0.3, 0.3, hatch="///", facecolor="0.9"))
        axes.set_ylim(0.0, 0.5)
        axes.set_xlabel("time [s]")
        return figure_files("figure", figure)["figure.svg"]


def on_a_page(*files: bytes) -> tuple[list[ElementTree.Element], ElementTree.Element, PageFigures]:
    """The figures as a page has them, and the shapes that they share."""
    figures = PageFigures()
    shown = [figures.put(svg, "a < b & c") for svg in files]
    parsed = [ElementTree.fromstring(text) for text in (*shown, figures.shared)]  # noqa: S314 - ours
    return parsed[:-1], parsed[-1], figures


def test_references_lead_to_shapes_of_their_kind() -> None:
    """A clip that lost its name was once a line across title and legend."""
    (figure,), shared, made = on_a_page(drawn())
    kinds = {element.attrib["id"]: element.tag for element in shared.iter() if "id" in element.attrib}
    clips = {found for e in figure.iter() if (found := e.attrib.get("clip-path"))}
    uses = {e.attrib["href"] for e in figure.iter("use")}
    assert clips and uses
    assert {kinds[clip.removeprefix("url(#").removesuffix(")")] for clip in clips} == {"clipPath"}
    assert {kinds[use.removeprefix("#")] for use in uses} == {"path"}
    hatches = re.findall(r"fill:url\(#(\w+)\)", made.style)
    assert hatches and {kinds[name] for name in hatches} == {"pattern"}
    assert all(c.startswith("k") for e in figure.iter() if (c := e.attrib.get("class")))
    assert set(re.findall(r"\.(k\d+)\{", made.style)) >= {
        e.attrib["class"] for e in figure.iter() if "class" in e.attrib
    }


def test_paths_are_those_of_the_file_to_a_hundredth_of_a_point() -> None:
    def courses(root: ElementTree.Element) -> list[list[float]]:
        found = [e.attrib["d"] for e in root.iter() if e.tag.endswith("path") and "M" in e.attrib.get("d", "")]
        return sorted([float(x) for x in re.findall(r"-?\d+(?:\.\d+)?", text)] for text in found)

    (figure,), shared, _ = on_a_page(drawn())
    file = courses(ElementTree.fromstring(drawn()))  # noqa: S314 - ours
    page = courses(figure) + courses(shared)
    distinct = [list(course) for course in dict.fromkeys(map(tuple, file))]
    for course in distinct:
        assert any(len(course) == len(other) and np.allclose(course, other, rtol=0, atol=0.00501) for other in page)


def test_what_figures_have_in_common_is_there_once() -> None:
    _, one, _ = on_a_page(drawn())
    (first, second), two, _ = on_a_page(drawn(), drawn(0.9))
    assert len(two[0]) <= len(one[0]) + 1  # the clips are the same, but for another layout
    assert first.attrib["aria-label"] == "a < b & c"
    assert first.attrib["class"] == second.attrib["class"]


def test_a_page_of_figures_is_small_and_the_same_each_time() -> None:
    files = [drawn(0.5 + 0.01 * k) for k in range(20)]
    page = to_html(Document("t", "s", [Picture(f"f{k}", svg, "c") for k, svg in enumerate(files)]))
    assert page.count('role="img"') == 20
    assert len(page) < 0.4 * sum(map(len, files))
    assert page == to_html(Document("t", "s", [Picture(f"f{k}", svg, "c") for k, svg in enumerate(files)]))


# Colours


def linear(colour: str) -> np.ndarray:
    """Of "#rrggbb" or "#rgb": linear red, green and blue."""
    digits = colour.removeprefix("#")
    digits = digits if len(digits) == 6 else "".join(2 * d for d in digits)
    parts = np.array([int(digits[at : at + 2], 16) / 255 for at in (0, 2, 4)])
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def contrast(one: str, other: str) -> float:
    """The contrast ratio of WCAG 2, from 1 to 21."""
    low, high = sorted(float(linear(colour) @ (0.2126, 0.7152, 0.0722)) for colour in (one, other))
    return (high + 0.05) / (low + 0.05)


def palette(dark: bool) -> dict[str, str]:
    """The named colours of the page's style."""
    before, found, after = CSS.partition("prefers-color-scheme: dark")
    assert found
    return dict(re.findall(r"--([\w-]+): (#\w+)", after if dark else before))


def test_the_contrast_of_black_and_white() -> None:
    assert contrast("#000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#fff") == pytest.approx(4.48, abs=0.01)  # as WCAG's own examples have it


@pytest.mark.parametrize("dark", [False, True])
def test_text_can_be_read_on_what_is_behind_it(dark: bool) -> None:
    """WCAG AA: 4.5 for text; badges, links and quiet text included."""
    colours = palette(dark)
    for behind in ("paper", "stripe", "sheet"):
        for text in ("ink", "quiet", "link"):
            assert contrast(colours[text], colours[behind]) >= 4.5, (text, behind)
    for badge in ("holds", "partly", "fails"):
        assert contrast(colours[badge], colours[f"{badge}-back"]) >= 4.5, badge
        assert contrast(colours["ink"], colours[f"{badge}-back"]) >= 4.5, badge


def test_the_figures_of_a_dark_page_have_its_colours() -> None:
    colours = palette(dark=True)
    assert (colours["paper"], colours["sheet"], colours["ink"]) == (PAPER, PAPER, INK)
    assert (dark_colour("#ffffff"), dark_colour("#000000")) == (PAPER, INK)


def test_lines_are_seen_on_a_dark_page() -> None:
    """WCAG asks for 3 of what is no text."""
    assert set(DARK) == {line["color"].lower() for line in LINES}
    assert all(contrast(colour, PAPER) >= 4.5 for colour in DARK.values())


@pytest.mark.parametrize("ink", ["#1c2024", "#000000"])
@pytest.mark.parametrize("back", ["#d5e6f5", "#fbe0cd", "#d6eedf", "#ececec", "#ffffff"])
def test_words_in_coloured_boxes_stay_readable(ink: str, back: str) -> None:
    """The block diagram's: pale boxes become deep ones."""
    assert contrast(dark_colour(ink), dark_colour(back)) >= 4.5


def test_the_colours_of_a_map_stay() -> None:
    for colour in ("#440154", "#fde725", "#21918c"):  # viridis
        assert dark_colour(colour) == colour


SEEN = {
    "every colour": np.eye(3),
    "no red": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "no green": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]]
    ),
    "no blue": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]]
    ),
}
"""Kinds of eyes: how they see linear colours (Machado, Oliveira and Fernandes 2009, severity 1)."""


def lab(rgb: np.ndarray) -> np.ndarray:
    """CIE L*a*b* under D65 of linear colours."""
    xyz = np.array(
        [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.072175], [0.0193339, 0.119192, 0.9503041]]
    )
    f = np.cbrt(np.clip(xyz @ rgb / (xyz @ np.ones(3)), 0.00886, None))
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def nearest(colours: list[str], eyes: np.ndarray) -> float:
    """The least distance between two of some colours."""
    seen = [lab(np.clip(eyes @ linear(colour), 0.0, 1.0)) for colour in colours]
    return min(float(np.linalg.norm(a - b)) for a, b in itertools.combinations(seen, 2))


@pytest.mark.parametrize("eyes", SEEN)
def test_lines_can_be_told_apart_by_every_kind_of_eyes(eyes: str) -> None:
    """On a dark page nearly as well as Okabe and Ito's own colours on a light one; dashes tell them besides."""
    own = nearest(list(DARK), SEEN[eyes])
    assert nearest(list(DARK.values()), SEEN[eyes]) >= 0.75 * own
