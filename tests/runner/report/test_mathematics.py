"""Formulas: one TeX, set for a page, for a line of text, and in Unicode."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from springline.runner.report import Document, Equation, Table, Text, to_html, to_markdown
from springline.runner.report.mathematics import to_inline, to_mathml, to_text


@pytest.mark.parametrize(
    ("tex", "text", "inline"),
    [
        (r"a_\mathrm{max}", "a_max", "<i>a</i><sub>max</sub>"),
        ("H^{-1} S", "H⁻¹S", "<i>H</i><sup>−1</sup><i>S</i>"),
        (r"\dot{\sigma}", "σ̇", "<i>σ̇</i>"),
        (r"q_{1d}", "q_1d", "<i>q</i><sub>1<i>d</i></sub>"),
        (r"|\sigma|^\alpha \geq 1", "|σ|^α ≥ 1", "|<i>σ</i>|<sup><i>α</i></sup> ≥ 1"),
        (r"\frac{a - b}{c}", "(a − b)/c", "(<i>a</i> − <i>b</i>)/<i>c</i>"),
        (r"x < -k_1", "x < −k₁", "<i>x</i> &lt; −<i>k</i><sub>1</sub>"),
    ],
)
def test_a_formula_in_a_line(tex: str, text: str, inline: str) -> None:
    assert to_text(tex) == text
    assert to_inline(tex) == f'<span class="math">{inline}</span>'


def test_a_formula_by_itself_is_mathml() -> None:
    math = ElementTree.fromstring(to_mathml(r"\ddot{e} = -\frac{q_1^2}{\ln(2 h)}"))  # noqa: S314 - ours
    assert math.get("display") == "block"
    tags = " ".join(each.tag for each in math.iter())
    assert tags == "math mrow mi mo mo mfrac msubsup mi mn mn mrow mi mo mn mi mo"
    accented, equals, minus = list(math[0])[:3]
    assert accented.text == "\N{MATHEMATICAL ITALIC SMALL E}\N{COMBINING DIAERESIS}"
    assert (equals.text, minus.text, minus.get("form")) == ("=", "−", "prefix")


@pytest.mark.parametrize(
    ("tex", "tags"), [("q_1", "msub mi mn"), ("x^2", "msup mi mn"), ("H^{-1}", "msup mi mrow mo mn")]
)
def test_what_stands_below_and_above_in_mathml(tex: str, tags: str) -> None:
    math = ElementTree.fromstring(to_mathml(tex))  # noqa: S314 - ours
    assert " ".join(each.tag for each in math[0][0].iter()) == tags


@pytest.mark.parametrize(
    ("tex", "told"),
    [
        (r"\integral x", r"\integral is not known"),
        ("{a", "a brace is not closed"),
        ("a}", "a closing brace too many"),
        ("^2", "without what it belongs to"),
        (r"\frac{a}", "where an argument should stand"),
    ],
)
def test_what_is_no_formula_is_refused(tex: str, told: str) -> None:
    with pytest.raises(ValueError, match=told.replace("\\", r"\\")):
        to_mathml(tex)


def test_a_document_sets_formulas_and_headings_over_columns() -> None:
    table = Table(
        ("case", "paper", "ours"), [("shake", "1", r"$\sigma$ 2")], over=(("", 1), (r"$a_\mathrm{max}$ [m]", 2))
    )
    document = Document("T", "", [Text("`$HOME` and $H^{-1} S$"), Equation(r"\sigma = 1", "(22)"), table])
    html, markdown = to_html(document), to_markdown(document)
    assert '<p><code>$HOME</code> and <span class="math"><i>H</i><sup>−1</sup><i>S</i></span></p>' in html
    assert '<div class="equation"><math display="block">' in html
    assert "<span>(22)</span></div>" in html
    assert '<th colspan="2"><span class="math"><i>a</i><sub>max</sub></span> [m]</th>' in html
    assert "`$HOME` and H⁻¹S" in markdown
    assert "$$\n\\sigma = 1 \\qquad \\text{(22)}\n$$" in markdown
    assert "| case | a<sub>max</sub> [m]: paper | a<sub>max</sub> [m]: ours |" in markdown
    assert "| shake | 1 | σ 2 |" in markdown
