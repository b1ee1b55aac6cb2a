"""Splitting by binding time changes when a value is computed, and no bit of it."""

import casadi as ca
import numpy as np
import pytest

from springline.codegen.program import Program, count_operations
from springline.codegen.program.staging import split

UNARY = [
    ca.sin,
    ca.cos,
    ca.exp,
    ca.fabs,
    ca.sqrt,
    ca.log1p,
    ca.sign,
    ca.floor,
    lambda a: -a,
    lambda a: a**2,
    lambda a: 1 / a,
]
BINARY = [
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: a * b,
    lambda a, b: a / b,
    ca.fmin,
    ca.fmax,
    lambda a, b: ca.fabs(a) ** b,
    lambda a, b: ca.if_else(a < b, a, 2 * b),
    ca.atan2,
    ca.hypot,
]


def random_expressions(rng: np.random.Generator, leaves: list[ca.SX], size: int) -> list[ca.SX]:
    """A random graph over the leaves; its last values."""
    pool = list(leaves)
    for _ in range(size):
        if rng.random() < 0.4:
            pool.append(UNARY[rng.integers(len(UNARY))](pool[rng.integers(len(pool))]))
        else:
            a, b = (pool[i] for i in rng.integers(len(pool), size=2))
            pool.append(BINARY[rng.integers(len(BINARY))](a, b))
    return pool[-5:]


@pytest.mark.parametrize("seed", range(40))
def test_split_keeps_every_bit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, t, x = ca.SX.sym("p", 3), ca.SX.sym("t", 2), ca.SX.sym("x", 3)
    outputs = random_expressions(rng, [*ca.vertsplit(p), *ca.vertsplit(t), *ca.vertsplit(x)], 60)
    whole = ca.Function("whole", [p, t, x], [ca.vertcat(*outputs)])
    stages, late = split([ca.vertcat(*outputs)], [("r", p), ("s", t)])
    run, time = stages
    first = ca.Function("first", [p], [run.values])
    second = ca.Function("second", [p, run.symbols, t], [time.values])
    last = ca.Function("last", [p, run.symbols, t, time.symbols, x], late)
    for _ in range(20):
        a, b, c = rng.normal(size=3), rng.normal(size=2), rng.normal(size=3)
        r = first(a)
        staged = np.array(last(a, r, b, second(a, r, b), c))
        assert staged.tobytes() == np.array(whole(a, b, c)).tobytes()


def test_nothing_that_is_known_earlier_is_left(shaken: Program) -> None:
    """The state's functions hold no operation on parameters, or on parameters and signals, alone."""
    functions = shaken.functions
    for name, early in (("control", {0, 1, 3, 4}), ("plant", {0, 1, 4, 5}), ("time", {1, 2})):
        f = functions[name]
        known: dict[int, bool] = {}
        for k in range(f.n_instructions()):
            op, into, source = f.instruction_id(k), f.instruction_output(k), f.instruction_input(k)
            if op == ca.OP_INPUT:
                known[into[0]] = source[0] in early
            elif op == ca.OP_CONST:
                known[into[0]] = True
            elif op != ca.OP_OUTPUT:
                known[into[0]] = all(known[i] for i in source)
                assert not known[into[0]], f"{name}: instruction {k} could be computed earlier"


def test_the_report_counts_what_was_hoisted(shaken: Program) -> None:
    counts = shaken.operations
    assert counts["run"] > 20 and counts["time"] > 40
    assert counts["control"] + counts["plant"] < 200
    assert counts["control"] == count_operations(shaken.functions["control"])
    unsplit = count_operations(shaken.system.function("control")) + count_operations(shaken.system.function("plant"))
    assert counts["control"] + counts["plant"] < 0.75 * unsplit
