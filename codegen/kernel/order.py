"""In which order the statements of a kernel stand: long chains begin early, so that short ones fill their waiting."""

from __future__ import annotations

import heapq
from collections.abc import Sequence

import casadi as ca

from springline.codegen.program import Node

# Rough latencies in cycles: they only decide the order of statements.
_LATENCY = {
    ca.OP_DIV: 13,
    ca.OP_INV: 13,
    ca.OP_SQRT: 20,
    ca.OP_EXP: 45,
    ca.OP_LOG: 55,
    ca.OP_LOG1P: 60,
    ca.OP_EXPM1: 60,
    ca.OP_SIN: 45,
    ca.OP_COS: 45,
    ca.OP_TAN: 60,
    ca.OP_POW: 110,
    ca.OP_CONSTPOW: 60,
    ca.OP_HYPOT: 40,
}
_SIMPLE_LATENCY = 3


def longest_chain_first(nodes: Sequence[Node], needed: Sequence[int]) -> list[int]:
    """`needed`, indices of nodes, in topological order: first what most follows on."""
    inside = set(needed)
    users: dict[int, list[int]] = {i: [] for i in needed}
    waiting = {}
    for i in needed:
        arguments = {a for a in nodes[i].arguments if a in inside}
        waiting[i] = len(arguments)
        for a in arguments:
            users[a].append(i)
    height: dict[int, int] = {}
    for i in reversed(needed):
        op = nodes[i].op
        own = _LATENCY.get(op if op is not None else -1, _SIMPLE_LATENCY)
        height[i] = own + max((height[user] for user in users[i]), default=0)
    ready = [(-height[i], i) for i in needed if waiting[i] == 0]
    heapq.heapify(ready)
    order = []
    while ready:
        _, i = heapq.heappop(ready)
        order.append(i)
        for user in users[i]:
            waiting[user] -= 1
            if waiting[user] == 0:
                heapq.heappush(ready, (-height[user], user))
    return order
