"""Symbols and equations of the reproduction's report: one table, and every place takes from it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from matplotlib.mathtext import MathTextParser

from springline.runner.paper import equations
from springline.runner.paper.claims import CLAIMS
from springline.runner.paper.equations import TESTED, equation
from springline.runner.paper.symbols import SYMBOLS, typeset
from springline.runner.report import Document, Text, to_html, to_markdown

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("written", "shown"),
    [
        ("δ = 0, a_max = 200", "<i>δ</i> = 0, <i>a</i><sub>max</sub> = 200"),
        ("largest |H^-1 S|", "largest |<i>H</i><sup>−1</sup><i>S</i>|"),
        ("largest |H⁻¹S|", "largest |<i>H</i><sup>−1</sup><i>S</i>|"),
        ("|sigma|^zeta >= 1", "|<i>σ</i>|<sup><i>ζ</i></sup> ≥ 1"),
        ("k1 − S̄0", "<i>k</i><sub>1</sub> − <i>S̄</i><sub>0</sub>"),
        ("`control.a_max = 2`", "<code>control.a_max = 2</code>"),
        ("dq2_rotation, Us, 4k1x", "dq2_rotation, Us, 4k1x"),
    ],
)
def test_a_text_in_plain_letters_is_set(written: str, shown: str) -> None:
    html = to_html(Document("T", "", [Text(typeset(written))]))
    assert f"<p>{shown}</p>" in re.sub(r'<span class="math">(.*?)</span>', r"\1", html)


def test_every_symbol_can_be_set_on_a_page_and_in_a_figure() -> None:
    parser = MathTextParser("path")
    for written, tex in SYMBOLS.items():
        parser.parse(f"${tex}$")
        assert typeset(written) == f"${tex}$"
        assert "$" not in to_html(Document("T", "", [Text(f"${tex}$")])).partition("<main>")[2]


def test_setting_is_done_once() -> None:
    for text in ("σ of the lift, a_max and |H^-1 S|", "1 s and U_max"):
        assert typeset(typeset(text)) == typeset(text)


def test_every_claim_says_what_it_tests_with_equations_that_are_there() -> None:
    assert set(TESTED) == {claim.number for claim in CLAIMS}
    for tested in TESTED.values():
        assert tested.equations
        assert not tested.intro.endswith((".", ":"))
        document = Document("T", "", [equation(name) for name in tested.equations])
        assert to_html(document).count("<math ") == len(tested.equations)
        assert to_markdown(document).count("$$\n") == 2 * len(tested.equations)


def test_numbers_of_equations_are_those_of_the_page_on_the_paper() -> None:
    page = (ROOT / "docs/paper.md").read_text(encoding="utf-8")
    numbered = [name for name in equations._TEX if name.isdigit()]
    assert len(numbered) == 12
    for name in numbered:
        assert rf"\tag{{{name}}}" in page, name
