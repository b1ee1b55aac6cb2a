"""Formulas as MathML, which browsers set by themselves: no script, no font, no picture.

A formula's number is its \\tag{…}, as on the code host; it is the anchor equation-<number>.
"""

from __future__ import annotations

import re
from html import escape

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.writers.html5 import HTML5Translator

TAG = re.compile(r"\\tag\{([^}]*)\}")


def mathml(latex: str, display: str) -> str:
    """A formula as MathML. Raises ExtensionError for a command that is not known: it would be shown as it stands."""
    latex = re.sub(r"\\(cos|sin|ln)(?=\\)", r"\\\1\\,", latex)  # TeX's space between a function and its argument
    text = convert(latex.replace("{aligned}", "{split}"), display=display)  # latex2mathml has no other name for it
    unknown = re.findall(r"\\[a-zA-Z]*|>&<", text)
    if unknown:
        raise ExtensionError(f"no MathML for {unknown} in {latex}")
    # A bar is an operator to MathML, with space on one side.
    return re.sub(r"<mo[^>]*>(&#x0007C;|\|)</mo>", '<mo lspace="0" rspace="0" stretchy="false">|</mo>', text)


def inline(writer: HTML5Translator, node: nodes.math) -> None:
    """A formula within the text."""
    writer.body.append(mathml(node.astext(), "inline"))
    raise nodes.SkipNode


def block(writer: HTML5Translator, node: nodes.math_block) -> None:
    """A formula that stands by itself, with its number."""
    latex = node.astext()
    tag = TAG.search(latex)
    name, number = "", ""
    if tag:
        name = f' id="equation-{escape(tag[1])}"'
        number = f'<span class="equation-number">({escape(tag[1])})</span>'
    writer.body.append(f'<div class="equation"{name}>{mathml(TAG.sub("", latex).strip(), "block")}{number}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
