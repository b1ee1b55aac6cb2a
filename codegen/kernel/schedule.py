"""In which order the operations of a block stand: by cycles of an imagined processor, with few values alive at once.

Compilers see a block of thousands of operations through a small window, and so does the processor. The order is made
here, therefore, and the compiler is told to leave it.
"""

from __future__ import annotations

import heapq
from bisect import insort
from collections.abc import Sequence
from dataclasses import dataclass

from springline.codegen.elementary import Op
from springline.codegen.kernel.block import Block

LEAVES = frozenset({Op.INPUT, Op.REAL_CONSTANT, Op.BITS_CONSTANT, Op.REAL, Op.BITS})
"""What costs nothing where it stands: operands from memory, and other names of the same bits."""

_MULTIPLIER, _ADDER, _SHUFFLER, _LOGIC = range(4)
_PORTS = {
    **dict.fromkeys((Op.MUL, Op.DIV, Op.SQRT), _MULTIPLIER),
    **dict.fromkeys((Op.ADD, Op.SUB, Op.FMIN, Op.FMAX, Op.LT, Op.LE, Op.EQ, Op.NE, Op.BELOW), _ADDER),
    **dict.fromkeys((Op.SHIFT_LEFT, Op.SHIFT_RIGHT, Op.PAIR, Op.PAIR_MASKS), _SHUFFLER),
}
_LATENCY = {
    **dict.fromkeys((Op.MUL, Op.ADD, Op.SUB), 3),
    **dict.fromkeys((Op.LT, Op.LE, Op.EQ, Op.NE, Op.BELOW), 2),
    Op.DIV: 13,
    Op.SQRT: 20,
}
_SLOTS = 4
_PER_PORT = 2
_SEEN = 64  # of what is ready, so many are looked at for one that ends lives


def latency(op: Op) -> int:
    """Cycles until the result of an operation is there."""
    return 0 if op in LEAVES else _LATENCY.get(op, 1)


def aliases(block: Block) -> list[int]:
    """For each primitive that whose value it is another name of, itself where it is none."""
    same: list[int] = []
    for i, node in enumerate(block.nodes):
        same.append(same[node.arguments[0]] if node.op in (Op.REAL, Op.BITS) else i)
    return same


@dataclass(frozen=True, slots=True)
class Order:
    """Places of a block's operations in order, and how many values are alive at most."""

    places: tuple[int, ...]
    alive: int


def scheduled(block: Block, most: int) -> Order:
    """Order the operations of a block: those first that most follows on, as far as their operands are there by then.

    most  values alive from which on operations are preferred that end lives
    """
    nodes = block.nodes
    alias = [-1 if nodes[i].op in LEAVES else i for i in aliases(block)]
    operands = [sorted({alias[a] for a in node.arguments} - {-1}) for node in nodes]
    needed = _needed([*(place for _, place in block.stores), *block.fine], alias, operands)
    users: dict[int, list[int]] = {i: [] for i in needed}
    for i in needed:
        for a in operands[i]:
            users[a].append(i)
    cycles = {i: latency(nodes[i].op) for i in needed}
    port = {i: _PORTS.get(nodes[i].op, _LOGIC) for i in needed}
    rank: dict[int, int] = {}  # less is sooner: minus the longest way to the end
    for i in reversed(needed):
        rank[i] = min((rank[user] for user in users[i]), default=0) - cycles[i]

    waiting = {i: len(operands[i]) for i in needed}
    uses = {i: len(users[i]) for i in needed}
    ready = sorted((rank[i], i) for i in needed if waiting[i] == 0)
    coming: list[tuple[int, int]] = []  # (cycle, place): what becomes ready then
    there = dict.fromkeys(needed, 0)  # the cycle in which its operands are
    order: list[int] = []
    cycle = alive = peak = 0
    while ready or coming:
        while coming and coming[0][0] <= cycle:
            _, i = heapq.heappop(coming)
            insort(ready, (rank[i], i))
        free = [_PER_PORT, _PER_PORT, _PER_PORT, _SLOTS]
        for _ in range(_SLOTS):
            narrow = alive >= most
            found, least = -1, 1 if narrow else 2
            for k, (_, i) in enumerate(ready[:_SEEN] if narrow else ready):
                if free[port[i]] == 0:
                    continue
                if not narrow:
                    found = k
                    break
                change = (uses[i] > 0) - sum(uses[a] == 1 for a in operands[i])
                if change < least:
                    found, least = k, change
                    if change < 0:
                        break
            if found < 0 and narrow and not coming and ready:
                found = next((k for k, (_, i) in enumerate(ready) if free[port[i]]), -1)
            if found < 0:
                break
            i = ready.pop(found)[1]
            free[port[i]] -= 1
            order.append(i)
            for a in operands[i]:
                uses[a] -= 1
                alive -= uses[a] == 0
            alive += uses[i] > 0
            peak = max(peak, alive)
            for user in users[i]:
                there[user] = max(there[user], cycle + cycles[i])
                waiting[user] -= 1
                if waiting[user] == 0:
                    heapq.heappush(coming, (there[user], user))
        cycle += 1
    return Order(tuple(order), peak)


def _needed(wanted: Sequence[int], alias: Sequence[int], operands: Sequence[Sequence[int]]) -> list[int]:
    """What the wanted values need, ascending, they themselves included."""
    found: set[int] = set()
    stack = [alias[i] for i in wanted]
    while stack:
        i = stack.pop()
        if i != -1 and i not in found:
            found.add(i)
            stack.extend(operands[i])
    return sorted(found)
