"""A document written once, as Markdown beside its pictures and as one HTML file that holds everything.

In text, `code`, **strong** and [[badge]] are marked up; everything else is printed as it stands.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib import resources

_MARK = re.compile(r"(`[^`]+`|\*\*[^*]+\*\*|\[\[[^\]]+\]\])")
_BADGE = re.compile(r"\[\[([^\]]+)\]\]")


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading of level 2 or 3; its text identifies it."""

    text: str
    level: int = 2


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph."""

    text: str


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list; `marked` says that its items bring marks of their own."""

    items: Sequence[str]
    marked: bool = False


@dataclass(frozen=True, slots=True)
class Table:
    """Cells as text, row by row, as long as `columns`; the first `labels` columns are words, the others numbers."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    labels: int = 1


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure: its file without extension (relative to the document), its SVG, and what is seen in it."""

    path: str
    svg: bytes
    caption: str


Block = Heading | Text | Bullets | Table | Picture


@dataclass(frozen=True, slots=True)
class Document:
    """Title, a sentence below it, and blocks in reading order."""

    title: str
    subtitle: str
    blocks: Sequence[Block]


def to_markdown(document: Document) -> str:
    """The document as Markdown (CommonMark with tables); pictures are links to PNG files, with the SVG beside."""
    parts = [f"# {document.title}", document.subtitle]
    for block in document.blocks:
        match block:
            case Heading(text, level):
                parts.append("#" * level + " " + _BADGE.sub(r"(\1)", text))
            case Text(text):
                parts.append(_BADGE.sub(r"**\1**", text))
            case Bullets(items):
                parts.append("\n".join(f"- {item}" for item in items))
            case Table():
                parts.append(_markdown_table(block))
            case Picture(path, _, caption):
                parts.append(f"![{_plain(caption)}]({path}.png)\n\n{caption} ([vector file]({path}.svg))")
    return "\n\n".join(parts) + "\n"


def to_html(document: Document) -> str:
    """The document as one HTML file: pictures and style inside, no script, nothing to fetch."""
    headings = [block for block in document.blocks if isinstance(block, Heading) and block.level == 2]
    contents = "".join(f'<li><a href="#{_anchor(h.text)}">{_inline(h.text)}</a></li>' for h in headings)
    body = "\n".join(_html_block(block) for block in document.blocks)
    style = (resources.files("springline.runner.report") / "report.css").read_text(encoding="utf-8")
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{html.escape(document.title)}</title>
<style>
{style}</style>
</head>
<body>
<nav aria-label="Contents"><ol>{contents}</ol></nav>
<main>
<h1>{_inline(document.title)}</h1>
<p class="subtitle">{_inline(document.subtitle)}</p>
{body}
</main>
</body>
</html>
"""


def _markdown_table(table: Table) -> str:
    def line(cells: Iterable[str]) -> str:
        return "| " + " | ".join(_BADGE.sub(r"**\1**", cell.replace("|", "\\|")) for cell in cells) + " |"

    align = [":--" if i < table.labels else "--:" for i in range(len(table.columns))]
    text = "\n".join(map(line, (table.columns, align, *table.rows)))
    return f"{table.caption}\n\n{text}" if table.caption else text


def _html_block(block: Block) -> str:
    match block:
        case Heading(text, level):
            return f'<h{level} id="{_anchor(text)}">{_inline(text)}</h{level}>'
        case Text(text):
            return f"<p>{_inline(text)}</p>"
        case Bullets(items, marked):
            entries = "".join(f"<li>{_inline(item)}</li>" for item in items)
            return f'<ul class="marked">{entries}</ul>' if marked else f"<ul>{entries}</ul>"
        case Table():
            return _html_table(block)
        case Picture(_, svg, caption):
            data = base64.b64encode(svg).decode("ascii")
            return (
                f'<figure><img alt="{html.escape(_plain(caption))}" src="data:image/svg+xml;base64,{data}">'
                f"<figcaption>{_inline(caption)}</figcaption></figure>"
            )


def _html_table(table: Table) -> str:
    def row(cells: Iterable[str], tag: str) -> str:
        kinds = ("" if i < table.labels else ' class="number"' for i in range(len(table.columns)))
        return "<tr>" + "".join(f"<{tag}{k}>{_inline(c)}</{tag}>" for c, k in zip(cells, kinds, strict=True)) + "</tr>"

    caption = f"<caption>{_inline(table.caption)}</caption>" if table.caption else ""
    body = "".join(row(cells, "td") for cells in table.rows)
    return (
        f'<div class="wide"><table>{caption}<thead>{row(table.columns, "th")}</thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _inline(text: str) -> str:
    parts = []
    for piece in _MARK.split(text):
        if piece.startswith("`"):
            parts.append(f"<code>{html.escape(piece[1:-1])}</code>")
        elif piece.startswith("**"):
            parts.append(f"<strong>{html.escape(piece[2:-2])}</strong>")
        elif piece.startswith("[["):
            parts.append(f'<span class="badge {_anchor(piece)}">{html.escape(piece[2:-2])}</span>')
        else:
            parts.append(html.escape(piece))
    return "".join(parts)


def _plain(text: str) -> str:
    return text.replace("`", "").replace("**", "")


def _anchor(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
