r"""The one table of symbols: how the reproduction's texts write them, and what they are in TeX.

Sentences, labels of numbers and names of experiments stand in numbers.json, in a terminal, in the report and in
figures. They are written in plain letters; `typeset` puts TeX between dollars in their place, which a Document and
Matplotlib both set.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from springline.model.quantities import SIGMA, U_F, U_S, E, U
from springline.runner.report import Block, Bullets, Heading, Picture, Table, Text

SYMBOLS: Mapping[str, str] = {
    # Of the mechanism and the drives
    "H⁻¹S": "H^{-1} S",
    "H^-1 S": "H^{-1} S",
    "M1⁻¹S": "M_1^{-1} S",
    "S̄0": r"\bar{S}_0",
    "S != 0": r"S \neq 0",
    "ÿ": r"\ddot{y}",
    "θ3": r"\theta_3",
    "m3": "m_3",
    "L3²": "L_3^2",
    "L3": "L_3",
    "L1": "L_1",
    # Of the control
    "e = 0": f"{E.symbol} = 0",
    "σ̇": rf"\dot{{{SIGMA.symbol}}}",
    "σ": SIGMA.symbol,
    "sigma": SIGMA.symbol,
    "|σ|^α": rf"|{SIGMA.symbol}|^\alpha",
    "|sigma|^zeta": rf"|{SIGMA.symbol}|^\zeta",
    "U": U.symbol,
    "U_s": U_S.symbol,
    "U_f": U_F.symbol,
    "K_f": "K_f",
    "k1": "k_1",
    "k2": "k_2",
    "k3": "k_3",
    "δ": r"\delta",
    "delta": r"\delta",
    "a_max": r"a_\mathrm{max}",
    "U_max": r"U_\mathrm{max}",
    # Of the theory
    "c1": "c_1",
    "t_smax": r"t_{s\,\mathrm{max}}",
    "t_q": "t_q",
    "t_a": "t_a",
    ">=": r"\geq",
}
"""As written -> TeX."""

_WORDS = "|".join(map(re.escape, sorted(SYMBOLS, key=len, reverse=True)))
_WRITTEN = re.compile(rf"(?P<set>`[^`]*`|\$[^$]*\$)|(?<![\w'^]){_WORDS.join(('(?:', ')'))}(?![\w'’])")


def typeset(text: str) -> str:
    """The text with symbols as TeX between dollars; what stands between dollars or grave accents is left."""
    return _WRITTEN.sub(lambda found: found[0] if found["set"] else f"${SYMBOLS[found[0]]}$", text)


def typeset_block(block: Block) -> Block:
    """A block of a document with its symbols set."""
    match block:
        case Heading():
            return replace(block, text=typeset(block.text))
        case Text():
            return replace(block, text=typeset(block.text))
        case Bullets():
            return replace(block, items=_all(block.items))
        case Table():
            rows = [_all(row) for row in block.rows]
            over = [(typeset(title), span) for title, span in block.over]
            caption = typeset(block.caption)
            return replace(block, columns=_all(block.columns), rows=rows, over=over, caption=caption)
        case Picture():
            return replace(block, caption=typeset(block.caption))
    return block


def _all(texts: Sequence[str]) -> list[str]:
    return [typeset(text) for text in texts]
