"""Binding times: split expressions so that each value is computed when its last argument becomes known.

A parameter is bound once per run, a signal once per time, the state at every evaluation. `split` cuts the values that
an earlier stage can compute out of a later stage's expressions and puts symbols in their place. The operations
themselves, and with them every bit of every result, stay the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from springline.model.symbolic import as_written


@dataclass(frozen=True, slots=True)
class Stage:
    """Values that become computable with one binding time: `symbols` stand for `values` in all later stages."""

    symbols: ca.SX
    values: ca.SX


def split(expressions: Sequence[ca.SX], levels: Sequence[tuple[str, ca.SX]]) -> tuple[list[Stage], list[ca.SX]]:
    """Split `expressions` by binding time.

    expressions  dense SX matrices, the last stage's results
    levels       (prefix, symbols) from the earliest binding time to the latest: what becomes known there; a value
                 belongs to the first level at which all its arguments are known. Symbols in no level are bound last.
    Returns one Stage per level (symbols named prefix0, prefix1, …) and the expressions rewritten in terms of them.
    """
    shapes = [e.shape for e in expressions]
    with as_written():
        rest = ca.cse(ca.vertcat(*(ca.vec(ca.densify(e)) for e in expressions)))
        known: list[ca.SX] = []
        stages: list[Stage] = []
        for prefix, symbols in levels:
            known.append(symbols)
            rest, cut, values = ca.extract_parametric(rest, ca.vertcat(*known), {})
            names = ca.SX.sym(prefix, len(cut))
            rest = ca.substitute(rest, ca.vertcat(*cut), names) if cut else rest
            stages.append(Stage(names, ca.vertcat(*values) if values else ca.SX(0, 1)))
            known.append(names)
        pieces, start = [], 0
        for rows, columns in shapes:
            pieces.append(ca.reshape(rest[start : start + rows * columns], rows, columns))
            start += rows * columns
    return stages, pieces
