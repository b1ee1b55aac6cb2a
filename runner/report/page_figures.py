"""Figures as parts of a page: SVG within it that takes the page's colours, and has in common what all have.

Matplotlib's files bring every letter's outline, a style at every line and millionths of a point. On a page outlines and
styles stand once for all figures, and lengths end at a hundredth of a point, which no screen and no paper shows: so
thirty figures take a fraction of their files. Colours become variables of the page's style, which turns black on white
into light on dark where the reader's screen is dark.
"""

from __future__ import annotations

import colorsys
import re
from collections.abc import Iterator, Mapping
from html import escape
from xml.etree import ElementTree

PAPER, INK = "#14171a", "#e4e7ea"
"""Of a dark page (report.css): what white and black become."""

DARK: Mapping[str, str] = {
    "#0072b2": "#4a9fe3",
    "#d55e00": "#ee7a34",
    "#009e73": "#22b48a",
    "#cc79a7": "#d993bb",
    "#e69f00": "#f3b83c",
    "#56b4e9": "#a8dcfa",
}
"""The colours of lines on a dark page."""

_GREYISH = 0.25
"""Of colours whose parts differ by less the lightness is turned over; stronger ones, as those of a map, stay."""

_BASE = "fill: #000000; stroke-linejoin: round"
"""What holds in Matplotlib's files where nothing else is said."""

_COLOUR = re.compile(r"#[0-9a-f]{6}\b")
_REFERENCE = re.compile(r"#([^)]+)(?=\)|$)")
_LONG = re.compile(r"-?\d+\.\d{3,}(?:e-?\d+)?")
_GAP = re.compile(r"\s*([A-Za-z])\s*|\s+")
_SHIFT = re.compile(r"(?<=translate\()[^)]*")
_LENGTHS = frozenset({"d", "x", "y", "width", "height"})
_UNSEEN = frozenset({"defs", "metadata", "style"})


class PageFigures:
    """The figures of one page; `shared` and `style` are what those that were put in so far need."""

    def __init__(self) -> None:
        self._shapes: dict[str, str] = {}
        self._styles: dict[str, str] = {}
        self._colours: set[str] = set()

    def put(self, svg: bytes, title: str) -> str:
        """The element that shows a figure.

        svg    as Matplotlib writes it;  title  what is seen in it, in words
        Raises xml.etree.ElementTree.ParseError for what is no XML, KeyError for a reference to what is not there.
        """
        root = ElementTree.fromstring(svg)  # noqa: S314 - a figure that was drawn just now
        named = {element.attrib["id"]: element for element in root.iter() if "id" in element.attrib}
        inside = "".join(self._markup(child, named) for child in root)
        return (
            f'<svg viewBox="{root.attrib["viewBox"]}" class="{self._class(_BASE, named)}" role="img" '
            f'aria-label="{escape(title)}">{inside}</svg>'
        )

    @property
    def shared(self) -> str:
        """The element with the shapes that figures refer to; it shows nothing."""
        shapes = "".join(re.sub(r"^<\w+", rf'\g<0> id="{name}"', text) for text, name in self._shapes.items())
        return f'<svg class="shapes" width="0" height="0" aria-hidden="true"><defs>{shapes}</defs></svg>'

    @property
    def style(self) -> str:
        """The rules that figures need, in CSS."""
        light, dark = (
            "".join(f"{_variable(colour)}:{become(colour)};" for colour in sorted(self._colours))
            for become in (str, dark_colour)
        )
        rules = "\n".join(f".{name}{{{text}}}" for text, name in self._styles.items())
        return f":root{{{light}}}\n@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n{rules}\n"

    def _markup(self, element: ElementTree.Element, named: Mapping[str, ElementTree.Element]) -> str:
        """An element of a file with what is in it, as it stands on the page."""
        tag = _local(element.tag)
        if tag in _UNSEEN:
            return ""
        attributes = "".join(f' {name}="{escape(value)}"' for name, value in self._attributes(element, named))
        inside = "".join(self._markup(child, named) for child in element)
        if tag == "g" and not attributes:
            return inside
        return f"<{tag}{attributes}>{inside}</{tag}>" if inside else f"<{tag}{attributes}/>"

    def _attributes(
        self, element: ElementTree.Element, named: Mapping[str, ElementTree.Element]
    ) -> Iterator[tuple[str, str]]:
        for key, value in element.attrib.items():
            name = _local(key)
            if name == "style":
                yield "class", self._class(value, named)
            elif name in _LENGTHS:
                yield name, _short(value)
            elif name == "transform":
                yield name, _SHIFT.sub(lambda found: _short(found[0]), value)
            elif name == "clip-path" or (name == "href" and value.startswith("#")):
                yield name, self._referring(value, named)
            elif name != "id":
                yield name, value

    def _class(self, style: str, named: Mapping[str, ElementTree.Element]) -> str:
        """The class that stands for declarations."""
        text = re.sub(r"\s*([:;,])\s*", r"\1", style.strip().rstrip(";"))
        text = self._referring(text, named) if "url(" in text else text
        self._colours |= set(_COLOUR.findall(text))
        text = _COLOUR.sub(lambda found: f"var({_variable(found[0])})", text)
        return self._styles.setdefault(text, f"k{len(self._styles)}")

    def _referring(self, text: str, named: Mapping[str, ElementTree.Element]) -> str:
        """A text with references to a file's shapes, which lead to the page's."""

        def lead(found: re.Match[str]) -> str:
            shape = self._markup(named[found[1]], named)
            return f"#{self._shapes.setdefault(shape, f'_{len(self._shapes)}')}"  # no heading's anchor begins so

        return _REFERENCE.sub(lead, text)


def dark_colour(colour: str) -> str:
    """What a colour "#rrggbb" of a figure becomes on a dark page."""
    if colour in DARK:
        return DARK[colour]
    paper, ink, own = (_rgb(each) for each in (PAPER, INK, colour))
    hue, lightness, saturation = colorsys.rgb_to_hls(*own)
    if max(own) - min(own) > _GREYISH:
        return colour
    if not saturation:
        return _hex(tuple(b + (p - b) * lightness for p, b in zip(paper, ink, strict=True)))
    darkest, lightest = (colorsys.rgb_to_hls(*each)[1] for each in (paper, ink))
    return _hex(colorsys.hls_to_rgb(hue, lightest + (darkest - lightest) * lightness, saturation))


def _rgb(colour: str) -> tuple[float, ...]:
    return tuple(int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5))


def _hex(rgb: tuple[float, ...]) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb)


def _variable(colour: str) -> str:
    return f"--x{colour[1:]}"


def _local(name: str) -> str:
    """A name without its namespace."""
    return name.rpartition("}")[2]


def _short(text: str) -> str:
    """Lengths, or the course of a path, to a hundredth and without needless space."""
    rounded = _LONG.sub(lambda found: f"{round(float(found[0]), 2) + 0.0:.2f}".rstrip("0").rstrip("."), text)
    return _GAP.sub(lambda found: found[1] or " ", rounded.strip())
