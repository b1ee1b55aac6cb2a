"""Joints in lanes: what a run alone computes for two joints becomes one operation on both lanes of a vector.

Superword-level parallelism, as compilers call it: from results that belong together down to their operands, as long as
both sides do the same. Each lane does the operations it would do by itself, so no bit changes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from springline.codegen.elementary import COMMUTATIVE, Kind, Op
from springline.codegen.kernel.block import Block
from springline.codegen.kernel.schedule import LEAVES, aliases, latency

_CONSTANTS = frozenset({Op.REAL_CONSTANT, Op.BITS_CONSTANT})
_DEPTH = 8  # to which shapes of expressions are told apart
_STORED = re.compile(r"(.*)\[(\d+)\]\[@\]")

Pair = tuple[int, int]
"""Operations of the low and the high lane."""


def paired(block: Block, joints: int) -> Block:
    """The block with two operations in one vector wherever that saves more than it costs to bring them together.

    joints  how many there are: results are stored joint by joint
    """
    return _Rebuilt(_Pairs(block, joints)).block


class _Pairs:
    """Which operations of a block go together.

    same      for each primitive that whose value it is another name of
    operands  of each, by `same`
    partners  of an operation: its pair
    aligned   the arguments of an operation in a pair, as they meet those of the other
    """

    def __init__(self, block: Block, joints: int) -> None:
        self.block, nodes = block, block.nodes
        self.same = aliases(block)
        self.operands = [[self.same[a] for a in node.arguments] for node in nodes]
        self.results = [self.same[i] for i in (*(i for _, i in block.stores), *block.fine)]
        needed = self._needed()
        self.partners: dict[int, Pair] = {}
        self.aligned: dict[int, Sequence[int]] = {}
        self._users: dict[int, list[int]] = {i: [] for i in needed}
        for i in needed:
            for a in set(self.operands[i]):
                self._users[a].append(i)
        # Cycles from the beginning of the block to the end of an operation, and from there to the end of the block.
        self._latency = {i: latency(nodes[i].op) for i in needed}
        self._before: dict[int, int] = {}
        self._after: dict[int, int] = {}
        for i in needed:
            self._before[i] = self._latency[i] + max((self._before[a] for a in self.operands[i]), default=0)
        for i in reversed(needed):
            self._after[i] = max((self._after[u] + self._latency[u] for u in self._users[i]), default=0)
        self._longest = max(self._before.values(), default=0)
        self._shapes = self._shapes_of(needed)
        self._pair_results(joints)
        for depth in (_DEPTH, _DEPTH // 2):
            self._pair_alike([i for i in needed if nodes[i].op not in LEAVES], depth)
        self._part_what_costs()

    def _needed(self) -> list[int]:
        found: set[int] = set()
        stack = list(self.results)
        while stack:
            i = stack.pop()
            if i not in found:
                found.add(i)
                stack.extend(self.operands[i])
        return sorted(found)

    def _shapes_of(self, needed: Sequence[int]) -> list[dict[int, int]]:
        """For each depth, a number that operations share whose expressions are alike down to there."""
        nodes, numbers = self.block.nodes, dict[object, int]()

        def number(key: object) -> int:
            return numbers.setdefault(key, len(numbers))

        shapes = [{i: number("constant" if nodes[i].op in _CONSTANTS else nodes[i].op.name) for i in needed}]
        for _ in range(_DEPTH):
            last, shape = shapes[-1], dict[int, int]()
            for i in needed:
                node, below = nodes[i], [last[a] for a in self.operands[i]]
                if node.op in COMMUTATIVE:
                    below.sort()
                shape[i] = last[i] if node.op in LEAVES else number((node.op.name, node.number, *below))
            shapes.append(shape)
        return shapes

    def _likeness(self, i: int, j: int) -> int:
        """Down to which depth two expressions are alike."""
        if i == j or self.partners.get(i) == (i, j):
            return _DEPTH + 1
        return next((k for k, shape in enumerate(self._shapes) if shape[i] != shape[j]), _DEPTH)

    def _pair_results(self, joints: int) -> None:
        """Pair what is stored for neighbouring joints, down from there."""
        stored: dict[tuple[str, int], int] = {}
        for text, place in self.block.stores:
            if found := _STORED.fullmatch(text):
                stored[found[1], int(found[2])] = place
        for (name, k), place in stored.items():
            if k % joints % 2 == 0 and k % joints + 1 < joints and (name, k + 1) in stored:
                self._pair(self.same[place], self.same[stored[name, k + 1]])

    def _pair_alike(self, computed: Sequence[int], depth: int) -> None:
        """Pair what is left and alike to a depth, down from there."""
        groups: dict[int, list[int]] = {}
        for i in computed:
            if i not in self.partners:
                groups.setdefault(self._shapes[depth][i], []).append(i)
        for members in sorted(groups.values(), key=lambda group: -group[-1]):
            left = [i for i in members if i not in self.partners]
            while len(left) > 1:
                self._pair(left[0], left[1])
                del left[: 2 if left[0] in self.partners else 1]

    def _pair(self, low: int, high: int) -> None:
        """Pair two operations and, as far as they do the same, their operands."""
        nodes, stack = self.block.nodes, [(low, high)]
        while stack:
            i, j = stack.pop()
            a, b = nodes[i], nodes[j]
            if i == j or i in self.partners or j in self.partners or a.op in LEAVES:
                continue
            if a.op is not b.op or a.number != b.number or not self._fit(i, j):
                continue
            left, right = a.arguments, b.arguments
            if a.op in COMMUTATIVE:
                first, second = (self.same[x] for x in left)
                other, another = (self.same[x] for x in right)
                straight = self._likeness(first, other) + self._likeness(second, another)
                if self._likeness(first, another) + self._likeness(second, other) > straight:
                    right = right[::-1]
            self.partners[i] = self.partners[j] = (i, j)
            self.aligned[i], self.aligned[j] = left, right
            self._wait(i, j)
            stack.extend((self.same[x], self.same[y]) for x, y in zip(left[::-1], right[::-1], strict=True))

    def _together(self, i: int) -> Sequence[int]:
        return self.partners.get(i, (i,))

    def _fit(self, i: int, j: int) -> bool:
        """Whether neither follows from the other, and the longest way through the block stays as it is."""
        before, after = self._before, self._after
        if max(before[i], before[j]) + max(after[i], after[j]) > self._longest:
            return False
        first, last = (i, j) if before[i] < before[j] else (j, i)
        seen, stack = set[int](), [last] if before[first] != before[last] else []
        while stack:
            for k in self._together(stack.pop()):
                for a in self.operands[k]:
                    if a == first:
                        return False
                    if before[a] > before[first] and a not in seen:
                        seen.add(a)
                        stack.append(a)
        return True

    def _wait(self, i: int, j: int) -> None:
        """Let each wait for the other, and all that follows on them."""
        self._before[i] = self._before[j] = max(self._before[i], self._before[j])
        self._after[i] = self._after[j] = max(self._after[i], self._after[j])
        stack = [i, j]
        while stack:
            k = stack.pop()
            for user in self._users[k]:
                for m in self._together(user):
                    if self._before[m] < self._before[k] + self._latency[m]:
                        self._before[m] = self._before[k] + self._latency[m]
                        stack.append(m)
        stack = [i, j]
        while stack:
            k = stack.pop()
            for operand in self.operands[k]:
                for m in self._together(operand):
                    if self._after[m] < self._after[k] + self._latency[k]:
                        self._after[m] = self._after[k] + self._latency[k]
                        stack.append(m)

    def _part_what_costs(self) -> None:
        """Part connected pairs again that save no more than they cost."""
        pairs = list(dict.fromkeys(self.partners.values()))
        links = {pair: pair for pair in pairs}

        def root(pair: Pair) -> Pair:
            while links[pair] != pair:
                links[pair] = pair = links[links[pair]]
            return pair

        costs: dict[tuple[str, int, int], Pair] = {}  # each once, to whom it falls first
        for pair in pairs:
            for i, j in self._operands_of(pair):
                if self.partners.get(i) == (i, j):
                    links[root((i, j))] = root(pair)
                elif i == j and i in self.partners:
                    costs.setdefault(("both", i, j), self.partners[i])
                elif i != j and not {self.block.nodes[i].op, self.block.nodes[j].op} <= _CONSTANTS:
                    costs.setdefault(("pair", i, j), pair)
            if any(user not in self.partners for user in self._users[pair[1]]):
                costs.setdefault(("both", pair[1], pair[1]), pair)
        for i in self.results:
            if i in self.partners:
                costs.setdefault(("both", i, i), self.partners[i])
        saved = dict.fromkeys(pairs, 0)
        for pair in pairs:
            saved[root(pair)] += 1
        for pair in costs.values():
            saved[root(pair)] -= 1
        for pair in pairs:
            if saved[root(pair)] <= 0:
                del self.partners[pair[0]], self.partners[pair[1]]

    def _operands_of(self, pair: Pair) -> Iterator[Pair]:
        return zip(*([self.same[a] for a in self.aligned[i]] for i in pair), strict=True)


class _Rebuilt:
    """The block anew. A value has the same in both lanes, is one of two in a vector, or right in the low lane alone."""

    def __init__(self, pairs: _Pairs) -> None:
        self.pairs, self.old, self.block = pairs, pairs.block, Block()
        self._places: dict[int, int] = {}  # where the vector is that has an old value
        self._low: set[int] = set()  # new places whose high lanes mean nothing
        for i in self._order():
            self._rebuild(i)
        self.block.stores = [(text, self._both(i)) for text, i in self.old.stores]
        for i in self.old.fine:
            self.block.require(self._places[i] if i in pairs.partners else self._both(i))

    def _order(self) -> list[int]:
        """Old operations, one of each pair, behind what they need."""
        partners, operands = self.pairs.partners, self.pairs.operands
        seen, order = set[int](), list[int]()
        stack = [(i, False) for i in self.pairs.results]
        while stack:
            i, ready = stack.pop()
            together = partners.get(i, (i,))
            if ready:
                order.append(i)
            elif together[0] not in seen:
                seen.add(together[0])
                stack.append((together[0], True))
                stack.extend((a, False) for k in together for a in operands[k])
        return order

    def _rebuild(self, i: int) -> None:
        node, pairs, block, labels = self.old.nodes[i], self.pairs, self.block, self.old.labels
        if i in pairs.partners:
            low, high = pairs.partners[i]
            arguments = [self._vector(a, b) for a, b in zip(pairs.aligned[low], pairs.aligned[high], strict=True)]
            self._places[low] = self._places[high] = block.add(node.op, *arguments, number=node.number)
            if low in labels and high in labels:
                block.name(self._places[low], f"{labels[low]}_and_{labels[high]}")
            return
        arguments = [self._single(a) for a in node.arguments]
        self._places[i] = block.add(node.op, *arguments, number=node.number, text=node.text)
        if any(self._is_low(a) for a in node.arguments):
            self._low.add(self._places[i])
        if i in labels:
            block.name(self._places[i], labels[i])

    def _lane(self, i: int) -> int:
        return int(i in self.pairs.partners and self.pairs.partners[i][1] == i)

    def _is_low(self, old: int) -> bool:
        i = self.pairs.same[old]
        return self._places[i] in self._low or (i in self.pairs.partners and self._lane(i) == 0)

    def _single(self, old: int) -> int:
        """The place of a value, right at least in the low lane."""
        i = self.pairs.same[old]
        return self._both(old) if self._lane(i) else self._of_kind(self._places[i], self.old.nodes[old].op.kind)

    def _both(self, old: int) -> int:
        """The place of a value that is the same in both lanes."""
        i, kind = self.pairs.same[old], self.old.nodes[old].op.kind
        if i in self.pairs.partners or self._places[i] in self._low:
            return self._brought(i, i, kind)
        return self._of_kind(self._places[i], kind)

    def _vector(self, left: int, right: int) -> int:
        """The place of a vector of two old values."""
        kind, i, j = self.old.nodes[left].op.kind, self.pairs.same[left], self.pairs.same[right]
        if i == j:
            return self._both(left)
        if self.pairs.partners.get(i) == (i, j):
            return self._of_kind(self._places[i], kind)
        low, high = self.old.nodes[i], self.old.nodes[j]
        if low.op in _CONSTANTS and low.op is high.op:
            return self._of_kind(self.block.add(low.op, number=low.number, second=high.number), kind)
        return self._brought(i, j, kind)

    def _brought(self, i: int, j: int, kind: Kind) -> int:
        """Two old values brought together from wherever they lie."""
        lanes, found = self._lane(i) + 2 * self._lane(j), (self._places[i], self._places[j])
        if kind is Kind.MASK:
            return self.block.add(Op.PAIR_MASKS, *found, number=lanes)
        real = [self._of_kind(place, Kind.REAL) for place in found]
        return self._of_kind(self.block.add(Op.PAIR, *real, number=lanes), kind)

    def _of_kind(self, place: int, kind: Kind) -> int:
        if self.block.nodes[place].op.kind is kind:
            return place
        return self.block.add(Op.REAL if kind is Kind.REAL else Op.BITS, place)
