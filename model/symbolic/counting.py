"""How much an expression costs."""

from __future__ import annotations

from springline.model import lazy_casadi as ca


def operations(expression: ca.SX, symbols: ca.SX, changing: ca.SX) -> int:
    """Operations of `expression` that depend on `changing`; equal ones count once.

    symbols   column of all free symbols
    changing  column of some of them: what depends on the others alone is computed beforehand
    """
    flat = ca.cse(ca.densify(ca.vec(expression)))
    others = [item for item in ca.symvar(symbols) if not ca.depends_on(item, changing)]
    function = ca.Function("counted", [ca.vertcat(*others), changing], [flat])
    varies: dict[int, bool] = {}
    count = 0
    for k in range(function.n_instructions()):
        op, into, source = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_INPUT:
            varies[into[0]] = source[0] == 1
        elif op == ca.OP_CONST:
            varies[into[0]] = False
        elif op != ca.OP_OUTPUT:
            varies[into[0]] = any(varies[i] for i in source)
            count += varies[into[0]] and op != ca.OP_PARAMETER
    return count
