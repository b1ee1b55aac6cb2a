r"""Formulas, written once in TeX, set as MathML, as HTML within a line, as Unicode, or by Matplotlib as they stand.

TeX's mathematics as far as these formulas go: letters, numbers and operators, the commands below, ^ and _, \frac, dots
and bars, and \mathrm or \operatorname for what stands upright.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from html import escape
from typing import Literal

_GREEK = dict(
    zip(
        ("alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu", "nu", "pi"),
        "αβγδϵζηθκλμνπ",
        strict=True,
    )
) | {"rho": "ρ", "sigma": "σ", "tau": "τ", "varphi": "φ", "omega": "ω", "varepsilon": "ε"}

_OPERATORS = {
    "cdot": "·",
    "pm": "±",
    "leq": "≤",
    "geq": "≥",
    "neq": "≠",
    "infty": "∞",
    "rightarrow": "→",
    "quad": "\u2003",
}

_SPACES = {"\u2009": 0.17, "\u2003": 2}
"""Space -> its width on a line of its own, em."""

_FUNCTIONS = ("ln", "max", "min", "sin", "cos")

_ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "bar": "\u0304"}
"""Command -> combining mark."""

_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_SUPERSCRIPTS = str.maketrans("0123456789−", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")

_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\d+(?:\.\d+)?|\s+|.", re.DOTALL)


@dataclass(frozen=True, slots=True)
class _Leaf:
    kind: Literal["letter", "number", "upright", "operator"]
    text: str


@dataclass(frozen=True, slots=True)
class _Row:
    parts: tuple[_Node, ...]


@dataclass(frozen=True, slots=True)
class _Accent:
    base: _Node
    name: str


@dataclass(frozen=True, slots=True)
class _Fraction:
    above: _Node
    below: _Node


@dataclass(frozen=True, slots=True)
class _Script:
    base: _Node
    sub: _Node | None
    sup: _Node | None


_Node = _Leaf | _Row | _Accent | _Fraction | _Script


def to_mathml(tex: str) -> str:
    """The formula as a MathML element on a line of its own. Raises ValueError for TeX that is not known here."""
    return f'<math display="block">{_mathml(_parse(tex))}</math>'


def to_inline(tex: str) -> str:
    """The formula as HTML within a line of text: letters in italics, indices lowered and raised."""
    return f'<span class="math">{_inline(_parse(tex)).strip()}</span>'


def to_text(tex: str, *, tags: bool = False) -> str:
    """The formula in Unicode; indices that Unicode does not have after _ and ^, or within HTML's tags."""
    return _text(_parse(tex), tags).strip()


# Reading


def _parse(tex: str) -> _Row:
    tokens = [token for token in _TOKEN.findall(tex) if not token.isspace()]
    row, rest = _row(tokens)
    if rest:
        raise ValueError(f"formula {tex!r}: a closing brace too many")
    return row


def _row(tokens: list[str]) -> tuple[_Row, list[str]]:
    """Parts up to a closing brace or the end, and what follows them."""
    parts: list[_Node] = []
    while tokens and tokens[0] != "}":
        if tokens[0] in "^_":
            if not parts:
                raise ValueError("formula: an index without what it belongs to")
            mark, (index, tokens) = tokens[0], _part(tokens[1:])
            old = parts.pop()
            base, sub, sup = (old.base, old.sub, old.sup) if isinstance(old, _Script) else (old, None, None)
            parts.append(_Script(base, index if mark == "_" else sub, index if mark == "^" else sup))
        else:
            part, tokens = _part(tokens)
            parts.append(part)
    return _Row(tuple(parts)), tokens


def _part(tokens: list[str]) -> tuple[_Node, list[str]]:
    if not tokens:
        raise ValueError("formula: it ends where an argument should stand")
    first, rest = tokens[0], tokens[1:]
    if first == "{":
        row, rest = _row(rest)
        if not rest:
            raise ValueError("formula: a brace is not closed")
        return (row.parts[0] if len(row.parts) == 1 else row), rest[1:]
    name = first[1:]
    if name == "frac":
        above, rest = _part(rest)
        below, rest = _part(rest)
        return _Fraction(above, below), rest
    if first.startswith("\\") and name in _ACCENTS:
        base, rest = _part(rest)
        return _Accent(base, name), rest
    if name in {"mathrm", "operatorname"}:
        words, rest = _part(rest)
        return _Leaf("upright", _text(words, tags=False)), rest
    return _leaf(first), rest


def _leaf(token: str) -> _Leaf:
    name = token[1:]
    if token.startswith("\\"):
        if name in _GREEK:
            return _Leaf("letter", _GREEK[name])
        if name in _FUNCTIONS:
            return _Leaf("upright", name)
        if name == ",":
            return _Leaf("operator", "\u2009")
        if name in _OPERATORS:
            return _Leaf("operator", _OPERATORS[name])
        raise ValueError(f"formula: {token} is not known here")
    if token[0].isdigit():
        return _Leaf("number", token)
    return _Leaf("letter", token) if token.isalpha() else _Leaf("operator", token.replace("-", "−"))


# Writing


def _is_sign(parts: tuple[_Node, ...], k: int) -> bool:
    """Whether the k-th part is a minus that belongs to what follows: nothing stands before that it could subtract."""
    before = parts[k - 1] if k else None
    return parts[k] == _Leaf("operator", "−") and (
        before is None or (isinstance(before, _Leaf) and before.kind == "operator" and before.text not in ")]|")
    )


def _mathml(node: _Node) -> str:
    match node:
        case _Leaf("letter", text):
            return f"<mi>{text}</mi>"
        case _Leaf("upright", text):
            plain = ' mathvariant="normal"' if len(text) == 1 else ""
            return f"<mi{plain}>{escape(text)}</mi>"
        case _Leaf("number", text):
            return f"<mn>{text}</mn>"
        case _Leaf("operator", "|"):
            return '<mo stretchy="false" lspace="0" rspace="0">|</mo>'
        case _Leaf("operator", "/"):
            return '<mo lspace="0" rspace="0">/</mo>'
        case _Leaf("operator", "(" | ")" | "[" | "]" as fence):
            return f'<mo stretchy="false">{fence}</mo>'
        case _Leaf("operator", text) if text in _SPACES:
            return f'<mspace width="{_SPACES[text]}em"></mspace>'
        case _Leaf(_, text):
            return f"<mo>{escape(text)}</mo>"
        case _Row(parts):
            signed = ('<mo form="prefix">−</mo>' if _is_sign(parts, k) else _mathml(p) for k, p in enumerate(parts))
            return f"<mrow>{''.join(signed)}</mrow>"
        case _Accent(base, name):
            # Of one character, for browsers set a mark of its own too low or too far to the left.
            return f"<mi>{_italic(_text(base, tags=False))}{_ACCENTS[name]}</mi>"
        case _Fraction(above, below):
            return f"<mfrac>{_mathml(above)}{_mathml(below)}</mfrac>"
        case _Script(base, sub, None) if sub is not None:
            return f"<msub>{_mathml(base)}{_mathml(sub)}</msub>"
        case _Script(base, None, sup) if sup is not None:
            return f"<msup>{_mathml(base)}{_mathml(sup)}</msup>"
        case _Script(base, sub, sup) if sub is not None and sup is not None:
            return f"<msubsup>{_mathml(base)}{_mathml(sub)}{_mathml(sup)}</msubsup>"
    raise AssertionError(node)


def _italic(letter: str) -> str:
    """A letter as Unicode's mathematical italic one."""
    for first, last, italic in (("a", "z", 0x1D44E), ("A", "Z", 0x1D434), ("α", "ω", 0x1D6FC)):
        if first <= letter <= last:
            return chr(italic + ord(letter) - ord(first))
    raise ValueError(f"formula: {letter!r} takes no accent")


def _inline(node: _Node) -> str:
    match node:
        case _Leaf("letter", text):
            return f"<i>{text}</i>"
        case _Row(parts):
            return "".join(escape(s) if s else _inline(p) for p, s in zip(parts, _spaced(parts), strict=True))
        case _Accent(base, name):
            return f"<i>{_text(base, tags=False)}{_ACCENTS[name]}</i>"
        case _Script(base, sub, sup):
            low = f"<sub>{_inline(sub)}</sub>" if sub is not None else ""
            high = f"<sup>{_inline(sup)}</sup>" if sup is not None else ""
            return f"{_inline(base)}{low}{high}"
        case _Fraction(above, below):
            return f"{_grouped(above, _inline(above))}/{_grouped(below, _inline(below))}"
        case _Leaf(_, text):
            return escape(text)


def _text(node: _Node, tags: bool) -> str:
    match node:
        case _Leaf(_, text):
            return text
        case _Row(parts):
            return "".join(s or _text(p, tags) for p, s in zip(parts, _spaced(parts), strict=True))
        case _Accent(base, name):
            return _text(base, tags) + _ACCENTS[name]
        case _Script(base, sub, sup):
            low, high = (_text(index, tags) if index is not None else "" for index in (sub, sup))
            return _text(base, tags) + _index(low, "_", "sub", _SUBSCRIPTS, tags) + _raised(high, tags)
        case _Fraction(above, below):
            return f"{_grouped(above, _text(above, tags))}/{_grouped(below, _text(below, tags))}"


def _raised(text: str, tags: bool) -> str:
    return _index(text, "^", "sup", _SUPERSCRIPTS, tags)


def _index(text: str, mark: str, tag: str, letters: dict[int, int], tags: bool) -> str:
    if all(ord(letter) in letters for letter in text):
        return text.translate(letters)
    if tags:
        return f"<{tag}>{text}</{tag}>"
    return f"{mark}{text}" if text.isalnum() else f"{mark}({text})"


def _grouped(node: _Node, shown: str) -> str:
    """A part of a fraction on one line: in parentheses, if it is a sum."""
    sums = isinstance(node, _Row) and any(p in (_Leaf("operator", "+"), _Leaf("operator", "−")) for p in node.parts)
    return f"({shown})" if sums else shown


def _spaced(parts: tuple[_Node, ...]) -> list[str]:
    """For each part its text, where it is an operator with room on both sides; else ""."""
    return [
        f" {part.text} "
        if isinstance(part, _Leaf) and part.kind == "operator" and part.text in "=<>+−≤≥≠→" and not _is_sign(parts, k)
        else ""
        for k, part in enumerate(parts)
    ]
