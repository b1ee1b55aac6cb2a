"""A document written once, as Markdown beside its pictures and as one HTML file that holds everything.

In text, `code`, **strong**, [[badge]] and $TeX$ (a formula) are marked up; everything else is printed as it stands.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from springline.codegen.files import render
from springline.runner.report.mathematics import to_inline, to_mathml, to_text
from springline.runner.report.page_figures import PageFigures

_SHORT = 24
"""Letters of a cell up to which its column's lines are not broken."""

_MANY = 8
"""Columns from which on a table is set with less space between them."""

_MARK = re.compile(r"(`[^`]+`|\*\*[^*]+\*\*|\[\[[^\]]+\]\]|\$[^$]+\$)")


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading of level 2 or 3; its text identifies it."""

    kind: ClassVar[str] = "heading"
    text: str
    level: int = 2


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph."""

    kind: ClassVar[str] = "text"
    text: str


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list; `marked` says that its items bring marks of their own."""

    kind: ClassVar[str] = "bullets"
    items: Sequence[str]
    marked: bool = False


@dataclass(frozen=True, slots=True)
class Equation:
    """A formula on a line of its own, in TeX, with its number or what else stands beside it."""

    kind: ClassVar[str] = "equation"
    tex: str
    label: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """Cells as text, row by row, as long as `columns`; the first `labels` columns are words, the others numbers.

    words   places of further columns of words
    shades  (row, column) -> class of the page's style by which a cell is shaded
    over    headings above those of the columns, each with the number of columns that it spans; together they span all
    """

    kind: ClassVar[str] = "table"
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    labels: int = 1
    words: Sequence[int] = ()
    shades: Mapping[tuple[int, int], str] = field(default_factory=dict)
    over: Sequence[tuple[str, int]] = ()

    @property
    def full_columns(self) -> Sequence[str]:
        """Headings for a table that has one row of them: "over: column"."""
        above = [title for title, span in self.over for _ in range(span)] or [""] * len(self.columns)
        return [f"{a}: {b}" if a and b else a or b for a, b in zip(above, self.columns, strict=True)]

    @property
    def kinds(self) -> str:
        """The table's classes in the page's style: "told" where its last column is sentences, which a narrow page sets
        below the other cells; "dense" where there are many columns.
        """
        last = len(self.columns) - 1
        told = not self.is_number(last) and any(len(_plain(cells[last])) > _SHORT for cells in self.rows)
        return " ".join(filter(None, ("told" if told else "", "dense" if last >= _MANY else "")))

    def beside(self, column: int) -> str:
        """What a narrow page sets before a column's cells, which have no heading there; "" for nothing."""
        return _plain(self.columns[column]) if "told" in self.kinds and self.is_number(column) else ""

    def is_number(self, column: int) -> bool:
        """Whether a column is set as numbers are."""
        return column >= self.labels and column not in self.words

    def classes(self, row: int, column: int) -> str:
        """The classes of a cell in the page's style: number, short (where no cell of its column is long), its shade."""
        short = all(len(_plain(cells[column])) <= _SHORT for cells in self.rows)
        found = (
            "number" if self.is_number(column) else "",
            "short" if short else "",
            self.shades.get((row, column), ""),
        )
        return " ".join(filter(None, found))


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure: its file without extension (relative to the document), its SVG, and what is seen in it."""

    kind: ClassVar[str] = "picture"
    path: str
    svg: bytes
    caption: str


@dataclass(frozen=True, slots=True)
class Source:
    """A file's text as it stands, folded away on a page."""

    kind: ClassVar[str] = "source"
    title: str
    text: str


Block = Heading | Text | Bullets | Equation | Table | Picture | Source


@dataclass(frozen=True, slots=True)
class Document:
    """Title, a sentence below it, and blocks in reading order."""

    title: str
    subtitle: str
    blocks: Sequence[Block]


def to_markdown(document: Document) -> str:
    """The document as Markdown (CommonMark with tables); pictures are links to PNG files, with the SVG beside."""
    return render(
        "springline.runner.report", "report.md.j2", document=document, pieces=_pieces, plain=_plain, formula=_tagged
    )


def to_html(document: Document) -> str:
    """The document as one HTML file: pictures and style inside, no script, nothing to fetch.

    Raises xml.etree.ElementTree.ParseError for a picture that is no SVG.
    """
    figures = PageFigures()
    drawn = {
        block.path: figures.put(block.svg, _plain(block.caption))
        for block in document.blocks
        if isinstance(block, Picture)
    }
    return render(
        "springline.runner.report",
        "report.html.j2",
        document=document,
        drawn=drawn,
        figures=figures,
        pieces=_pieces,
        anchor=_anchor,
        formula=to_inline,
        mathml=to_mathml,
    )


def _pieces(text: str) -> Iterator[tuple[str, str]]:
    """What a text consists of: "code", "strong", "badge", "formula" or "text", and what is marked so."""
    for piece in _MARK.split(text):
        if piece.startswith("`"):
            yield "code", piece[1:-1]
        elif piece.startswith("**"):
            yield "strong", piece[2:-2]
        elif piece.startswith("[["):
            yield "badge", piece[2:-2]
        elif piece.startswith("$"):
            yield "formula", piece[1:-1]
        elif piece:
            yield "text", piece


def _plain(text: str) -> str:
    return "".join(to_text(piece) if kind == "formula" else piece for kind, piece in _pieces(text))


def _tagged(tex: str) -> str:
    return to_text(tex, tags=True)


def _anchor(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", _plain(text).lower()).strip("-")
