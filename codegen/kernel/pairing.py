"""Joints in lanes: operations of a block that one run does twice become one on both lanes of a vector."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Hashable, Iterator, Sequence

from springline.codegen.elementary import COMMUTATIVE, Kind, Op
from springline.codegen.kernel.block import Block, Primitive

_CONSTANTS = (Op.REAL_CONSTANT, Op.BITS_CONSTANT)
_ALIASES = (Op.REAL, Op.BITS)
_LEAVES = (Op.INPUT, *_CONSTANTS)
_DEPTH = 8


def pairs_of(block: Block, joints: int) -> "Pairing":
    found = Pairing(block)
    element = re.compile(r"(.*)\[(\d+)\]\[@\]")
    stores = {}
    for text, place in block.stores:
        m = element.fullmatch(text)
        if m:
            stores[m[1], int(m[2])] = place
    for (name, k), place in stores.items():
        if (k % joints) % 2 == 0 and k % joints + 1 < joints and (name, k + 1) in stores:
            found.walk(place, stores[name, k + 1])
    found.by_shape()
    found.prune()
    return found


_PAIRED = {Kind.REAL: Op.PAIR, Kind.BITS: Op.PAIR, Kind.MASK: Op.PAIR_MASKS}


def paired(block: Block, joints: int) -> Block:
    return _Rebuilt(pairs_of(block, joints)).block


class _Rebuilt:
    """A block anew. A value is the same in both lanes, or meant in the low one alone, or one of two in a vector."""

    def __init__(self, pairing: "Pairing") -> None:
        self.pairing = pairing
        self.old, self.block = pairing.block, Block()
        self.done: dict[int, int] = {}  # base -> place of its vector
        self.low: set[int] = set()  # places whose high lane means nothing
        old = self.old
        for i in self._order():
            self._rebuild(i)
        for text, place in old.stores:
            self.block.stores.append((text, self._both(place)))
        for place in old.fine:
            base = pairing.base[place]
            if base in pairing.partner:
                self.block.require(self.done[base])
            else:
                self.block.require(self._both(place))

    def _order(self):
        pairing = self.pairing
        seen, order = set(), []
        members = lambda i: pairing.partner.get(i, (i,))  # noqa
        stack = [(pairing.base[i], False) for i in (*(k for _, k in self.old.stores), *self.old.fine)]
        while stack:
            i, ready = stack.pop()
            first = members(i)[0]
            if ready:
                order.append(first)
                continue
            if first in seen:
                continue
            seen.add(first)
            stack.append((first, True))
            stack.extend((a, False) for m in members(first) for a in pairing.operands[m])
        return order

    def _cast(self, place, kind):
        node = self.block.nodes[place]
        if node.op.kind is kind:
            return place
        if node.op in _ALIASES and self.block.nodes[node.arguments[0]].op.kind is kind:
            return node.arguments[0]
        return self.block.add(Op.REAL if kind is Kind.REAL else Op.BITS, place)

    def _kind(self, place):
        return self.old.nodes[place].op.kind

    def _pair(self, a, i, b, j, kind):
        op = Op.PAIR
        if kind is Kind.MASK:
            op = Op.PAIR_MASKS
        else:
            a, b = self._cast(a, Kind.REAL), self._cast(b, Kind.REAL)
        place = self.block.add(op, a, b, number=i + 2 * j)
        return place if kind is Kind.MASK else self._cast(place, kind)

    def _single(self, old):
        """Place of what is right at least in the low lane."""
        base, kind = self.pairing.base[old], self._kind(old)
        pair = self.pairing.partner.get(base)
        if pair is not None and pair[1] == base:
            return self._both(old)
        return self._cast(self.done[base], kind)

    def _alone(self, old):
        base = self.pairing.base[old]
        return base in self.pairing.partner and self.pairing.partner[base][0] == base or self.done[base] in self.low

    def _both(self, old):
        base, kind = self.pairing.base[old], self._kind(old)
        pair, place = self.pairing.partner.get(base), self._cast(self.done[base], kind)
        if pair is not None:
            lane = int(pair[1] == base)
            return self._pair(place, lane, place, lane, kind)
        if self.done[base] in self.low:
            return self._pair(place, 0, place, 0, kind)
        return place

    def _vector(self, left, right):
        pairing, kind = self.pairing, self._kind(left)
        i, j = pairing.base[left], pairing.base[right]
        if i == j:
            return self._both(left)
        a, b = self.old.nodes[i], self.old.nodes[j]
        if a.op in _CONSTANTS and a.op is b.op:
            return self._cast(self.block.add(a.op, number=a.number, second=b.number), kind)
        if pairing.partner.get(i) == (i, j):
            return self._cast(self.done[i], kind)
        lanes = [int(k in pairing.partner and pairing.partner[k][1] == k) for k in (i, j)]
        x, y = self._cast(self.done[i], kind), self._cast(self.done[j], kind)
        return self._pair(x, lanes[0], y, lanes[1], kind)

    def _rebuild(self, i):
        node, pairing, block = self.old.nodes[i], self.pairing, self.block
        pair = pairing.partner.get(i)
        if pair is None:
            arguments = [self._single(a) for a in node.arguments]
            self.done[i] = block.add(node.op, *arguments, number=node.number, text=node.text)
            if any(self._alone(a) for a in node.arguments):
                self.low.add(self.done[i])
            if i in self.old.labels:
                block.name(self.done[i], self.old.labels[i])
            return
        low, high = pair
        arguments = [self._vector(a, b) for a, b in zip(pairing.order[low], pairing.order[high])]
        self.done[low] = self.done[high] = block.add(node.op, *arguments, number=node.number)
        if low in self.old.labels and high in self.old.labels:
            block.name(self.done[low], f"{self.old.labels[low]}_and_{self.old.labels[high]}")


class Pairing:
    def __init__(self, block: Block) -> None:
        self.block = block
        nodes = block.nodes
        self.base = []
        for i, node in enumerate(nodes):
            self.base.append(self.base[node.arguments[0]] if node.op in _ALIASES else i)
        self.operands = [[self.base[a] for a in node.arguments] for node in nodes]
        needed = set()
        stack = [self.base[i] for i in (*(k for _, k in block.stores), *block.fine)]
        while stack:
            i = stack.pop()
            if i not in needed:
                needed.add(i)
                stack.extend(self.operands[i])
        self.needed = sorted(needed)
        self.computed = [i for i in self.needed if nodes[i].op not in _LEAVES]
        self.users = {i: [] for i in self.needed}
        for i in self.computed:
            for a in set(self.operands[i]):
                self.users[a].append(i)
        self.above = {}  # bits of what a node needs, itself included
        for i in self.needed:
            bits = 1 << i
            for a in self.operands[i]:
                bits |= self.above[a]
            self.above[i] = bits
        self.below = {i: 1 << i for i in self.needed}
        for i in reversed(self.needed):
            for u in self.users[i]:
                self.below[i] |= self.below[u]
        from springline.codegen.kernel.schedule import _LATENCY
        import os
        self.latency = {i: 0 if nodes[i].op in _LEAVES else _LATENCY.get(nodes[i].op, 1) for i in self.needed}
        self.depth, self.height = {}, {}  # cycles to its end, and from there on
        for i in self.needed:
            self.depth[i] = max((self.depth[a] for a in self.operands[i]), default=0) + self.latency[i]
        for i in reversed(self.needed):
            self.height[i] = max((self.height[u] + self.latency[u] for u in self.users[i]), default=0)
        self.longest = max(self.depth.values()) * float(os.environ.get("TOL", "1.0"))
        self.partner = {}  # node -> (its pair (low, high))
        self.pairs = []
        self.order = {}  # node -> arguments as aligned
        h = {i: hash((nodes[i].op if nodes[i].op not in _CONSTANTS else 0)) for i in self.needed}
        self.shapes = [h]
        for _ in range(_DEPTH):
            g = {}
            for i in self.needed:
                n = nodes[i]
                if n.op in _LEAVES:
                    g[i] = h[i]
                    continue
                below = [h[a] for a in self.operands[i]]
                if n.op in COMMUTATIVE:
                    below.sort()
                g[i] = hash((n.op, n.number, *below))
            h = g
            self.shapes.append(h)

    def similar(self, i, j):
        if i == j:
            return _DEPTH + 1
        if self.partner.get(i) == (i, j) and i in self.partner:
            return _DEPTH + 2
        k = 0
        while k <= _DEPTH and self.shapes[k][i] == self.shapes[k][j]:
            k += 1
        return k

    def _independent(self, i, j):
        return not (self.above[i] >> j & 1 or self.above[j] >> i & 1)

    def _late(self, i, j):
        """Whether both together would make the longest way longer."""
        return max(self.depth[i], self.depth[j]) + max(self.height[i], self.height[j]) > self.longest

    def _delay(self, i, j):
        depth, height, latency = self.depth, self.height, self.latency
        work = []
        for one, other in ((i, j), (j, i)):
            if depth[one] < depth[other]:
                depth[one] = depth[other]
                work.append(one)
        while work:
            k = work.pop()
            for u in self.users[k]:
                for m in self.partner.get(u, (u,)):
                    if depth[m] < depth[k] + latency[m]:
                        depth[m] = depth[k] + latency[m]
                        work.append(m)
        for one, other in ((i, j), (j, i)):
            if height[one] < height[other]:
                height[one] = height[other]
                work.append(one)
        while work:
            k = work.pop()
            for a in self.operands[k]:
                for m in self.partner.get(a, (a,)):
                    if height[m] < height[k] + latency[k]:
                        height[m] = height[k] + latency[k]
                        work.append(m)

    def _merge(self, i, j):
        above, below = self.above[i] | self.above[j], self.below[i] | self.below[j]
        up, down = above, below
        bits = below
        while bits:
            low = bits & -bits
            self.above[low.bit_length() - 1] |= above
            bits ^= low
        bits = above
        while bits:
            low = bits & -bits
            self.below[low.bit_length() - 1] |= below
            bits ^= low

    def walk(self, i, j):
        stack = [(self.base[i], self.base[j])]
        nodes = self.block.nodes
        while stack:
            i, j = stack.pop()
            if i == j or i in self.partner or j in self.partner:
                continue
            a, b = nodes[i], nodes[j]
            if a.op is not b.op or a.op in _LEAVES or a.number != b.number or not self._independent(i, j) or self._late(i, j):
                continue
            left, right = list(a.arguments), list(b.arguments)
            if a.op in COMMUTATIVE:
                s = self.similar
                straight = s(self.base[left[0]], self.base[right[0]]) + s(self.base[left[1]], self.base[right[1]])
                crossed = s(self.base[left[0]], self.base[right[1]]) + s(self.base[left[1]], self.base[right[0]])
                if crossed > straight:
                    right.reverse()
            self._merge(i, j)
            self.partner[i] = self.partner[j] = (i, j)
            self._delay(i, j)
            self.pairs.append((i, j))
            self.order[i], self.order[j] = left, right
            stack.extend((self.base[x], self.base[y]) for x, y in reversed(list(zip(left, right))))

    def by_shape(self):
        for depth in (_DEPTH, 6, 4):
            groups = {}
            for i in reversed(self.computed):
                if i not in self.partner:
                    groups.setdefault(self.shapes[depth][i], []).append(i)
            for members in groups.values():
                members.reverse()
                free = [m for m in members if m not in self.partner]
                k = 0
                while k + 1 < len(free):
                    before = len(self.pairs)
                    self.walk(free[k], free[k + 1])
                    k += 2 if len(self.pairs) > before else 1

    # cost
    def _vector(self, i, j):
        """Demand of a vector of i and j."""
        nodes = self.block.nodes
        if i == j:
            if i in self.partner and nodes[i].op not in _LEAVES:
                yield ("both", i), 1
            return
        if nodes[i].op in _CONSTANTS and nodes[j].op in _CONSTANTS:
            return
        if self.partner.get(i) == (i, j):
            return
        loads = (nodes[i].op is Op.INPUT) + (nodes[j].op is Op.INPUT)
        yield ("pack", i, j), 1 + (loads == 2)

    def _single(self, i):
        if i in self.partner and self.partner[i][1] == i:
            yield ("both", i), 1

    def demands(self, i) -> Iterator:
        """Of a node, or of a pair named by its low node."""
        pair = self.partner.get(i)
        yield ("op", pair or i), 1
        if pair is not None:
            for x, y in zip(self.order[pair[0]], self.order[pair[1]]):
                yield from self._vector(self.base[x], self.base[y])
        else:
            for a in self.operands[i]:
                yield from self._single(a)

    def prune(self):
        stored = [self.base[i] for _, i in self.block.stores]
        count, price = Counter(), {}

        def put(i, sign):
            delta = 0
            for key, cost in self.demands(i):
                count[key] += sign
                if sign > 0 and count[key] == 1:
                    delta += cost
                elif sign < 0 and count[key] == 0:
                    delta -= cost
            return delta

        def affected(pairs):
            found = set()
            for i, j in pairs:
                for k in (i, j):
                    found.add(k)
                    found.update(self.users[k])
            return found

        def toggle(pairs, on):
            nodes = affected(pairs)
            delta = sum(put(i, -1) for i in nodes)
            for i, j in pairs:
                # stores
                for k in (i, j):
                    delta += (1 if on else -1) * (k in in_store)
                if on:
                    self.partner[i] = self.partner[j] = (i, j)
                else:
                    del self.partner[i], self.partner[j]
            return delta + sum(put(i, 1) for i in nodes)

        in_store = set(stored)
        self.cost = sum(put(i, 1) for i in self.computed) + sum(k in self.partner for k in in_store)
        self.before = len(self.computed)
        self.first = (self.cost, len(self.pairs))
        active = set(self.pairs)
        for _ in range(6):
            changed = False
            # components
            links = {p: p for p in active}

            def root(p):
                while links[p] != p:
                    links[p] = links[links[p]]
                    p = links[p]
                return p

            for p in active:
                for x, y in zip(self.order[p[0]], self.order[p[1]]):
                    q = self.partner.get(self.base[x])
                    if q == (self.base[x], self.base[y]):
                        links[root(p)] = root(q)
            components = {}
            for p in self.pairs:
                if p in active:
                    components.setdefault(root(p), []).append(p)
            for members in components.values():
                delta = toggle(members, False)
                if delta <= 0:
                    self.cost += delta
                    active.difference_update(members)
                    changed = True
                else:
                    toggle(members, True)
            for p in self.pairs:
                on = p not in active
                delta = toggle([p], on)
                if delta < 0 or (delta == 0 and not on):
                    self.cost += delta
                    (active.add if on else active.discard)(p)
                    changed = True
                else:
                    toggle([p], not on)
            if not changed:
                break
        self.active = active
