"""What the value graph does to a Function before it is printed."""

import math

import casadi as ca
import pytest

from springline.codegen.program import Binding, ValueGraph


def limited(limit: float) -> list[int | None]:
    """Operations that are left of fmin(fmax(x, -limit), limit), outermost first."""
    graph, x, p = ValueGraph(), ca.SX.sym("x"), ca.SX.sym("p")
    function = ca.Function("limited", [x, p], [ca.fmin(ca.fmax(x, -p), p)])
    [[i]] = graph.add("limited", function, [[graph.leaf("x", 0, Binding.STATE)], [graph.constant(limit)]])
    left = [graph.nodes[i].op]
    while left[-1] is not None:
        i = graph.nodes[i].arguments[0]
        left.append(graph.nodes[i].op)
    assert graph.nodes[i].source == ("x", 0)
    return left[:-1]


def test_a_limit_at_infinity_is_no_operation() -> None:
    assert limited(math.inf) == []


@pytest.mark.parametrize("limit", [200.0, 1.7976931348623157e308, 0.0, -math.inf])
def test_any_other_limit_is_left(limit: float) -> None:
    assert limited(limit) == [ca.OP_FMIN, ca.OP_FMAX]
