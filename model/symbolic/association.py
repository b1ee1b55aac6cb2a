"""Sums and products of many terms, put together in the order in which their terms are there.

(a + b) + c and a + (b + c) cost the same, but one of them waits longer. Of a sum what depends on constants, parameters
and time alone comes first, so that it is computed before the state is known; then always the two parts that are there
first, so that what is ready last is added last. Products likewise: what is known early becomes one factor, a divisor
that is known early too. A minus sign goes where it costs nothing.

Opened are sums and products that nothing else uses and that are no result: a part that has a name (`named`) is one, and
stays. A value of an earlier binding time than the sum it stands in stays as it is written, whoever uses it.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

from springline.model import lazy_casadi as ca
from springline.model.symbolic.derivation import as_written
from springline.model.symbolic.values import Value, listed, stacked, unstacked, written

_LATENCY = {ca.OP_NEG: 1, ca.OP_FABS: 1, ca.OP_ASSIGN: 0, ca.OP_DIV: 13, ca.OP_INV: 13, ca.OP_SQRT: 20} | dict.fromkeys(
    (ca.OP_EXP, ca.OP_LOG, ca.OP_LOG1P, ca.OP_EXPM1, ca.OP_SIN, ca.OP_COS, ca.OP_TAN, ca.OP_POW, ca.OP_CONSTPOW), 50
)
"""Cycles until the result of an operation is there, as processors of today have it."""
_SHORT = 3
"""Likewise of all others: addition, multiplication, comparison."""
LATE = 1_000_000
"""When what arrives last is there: after everything that does not depend on it."""

_SUMS = (ca.OP_ADD, ca.OP_SUB)
_PRODUCTS = (ca.OP_MUL, ca.OP_TWICE)


def latency(op: int) -> int:
    """Cycles until the result of an operation is there."""
    return _LATENCY.get(op, _SHORT)


@dataclass(slots=True)
class _Factor:
    """A factor of a product: a value by its place (None: two), or one over it."""

    place: int | None
    inverse: bool = False


@dataclass(slots=True)
class _Term:
    """A term of a sum: sign times a product."""

    sign: int
    factors: list[_Factor]


@dataclass(slots=True)
class _Ready:
    """Something written: when it is known (`level`), and of what depends on the state, after how many cycles."""

    level: int
    depth: int
    order: int
    sign: int
    sx: ca.SX

    def __lt__(self, other: _Ready) -> bool:
        return (self.depth, self.order) < (other.depth, other.order)


class _Associated:
    """One rewriting: plan from the results to the arguments, then write from the arguments to the results."""

    def __init__(self, values: Sequence[Value], results: Sequence[int], state: int) -> None:
        """`state`: the level of what depends on the state; groups of symbols from there on are the state's."""
        self._values = values
        self._state = state
        self._kept = {*results}
        self._uses = [0] * len(values)
        self._level = [0] * len(values)
        self._depth = [0] * len(values)
        for i, value in enumerate(values):
            for a in value.arguments:
                self._uses[a] += 1
            if value.op == ca.OP_INPUT:
                self._level[i] = min(value.group + 1, state)
            elif value.arguments:
                self._level[i] = max(self._level[a] for a in value.arguments)
        self._sx: dict[int, ca.SX] = {}
        self._inverse: dict[int, ca.SX] = {}

    # Planning

    def _opens(self, i: int, level: int) -> bool:
        return self._uses[i] == 1 and i not in self._kept and self._level[i] == level

    def _is_sum(self, i: int) -> bool:
        """if_else is the sum of two guarded terms, and remains it."""
        value = self._values[i]
        guarded = any(self._values[a].op == ca.OP_IF_ELSE_ZERO for a in value.arguments)
        return value.op in _SUMS and not guarded

    def _is_product(self, i: int) -> bool:
        value = self._values[i]
        return value.op in _PRODUCTS or (value.op == ca.OP_DIV and self._is_early_divisor(i))

    def _is_early_divisor(self, i: int) -> bool:
        divisor = self._values[i].arguments[1]
        return self._level[divisor] < self._level[i] and self._values[divisor].constant != 0.0

    def plan(self, i: int) -> list[_Term] | None:
        """The terms of the sum that value i is, one for a product; None for what is neither or known early anyway."""
        level = self._level[i]
        if level <= 1 or not (self._is_sum(i) or self._is_product(i) or self._values[i].op == ca.OP_NEG):
            return None
        terms: list[_Term] = []
        stack = [(i, 1)]
        while stack:
            k, sign = stack.pop()
            value = self._values[k]
            opened = k == i or self._opens(k, level)
            if opened and self._is_sum(k):
                left, right = value.arguments
                stack += [(right, sign if value.op == ca.OP_ADD else -sign), (left, sign)]
            elif opened and value.op == ca.OP_NEG:
                stack.append((value.arguments[0], -sign))
            else:
                turned, factors = self._factors(k, level, opened)
                terms.append(_Term(sign * turned, factors))
        return terms

    def _factors(self, i: int, level: int, opened: bool) -> tuple[int, list[_Factor]]:
        """Sign and factors of a product; a value that is none, or that is not opened, is its own only factor."""
        sign, factors = 1, []
        stack = [(i, opened)]
        while stack:
            k, opened = stack.pop()
            value = self._values[k]
            if opened and value.op == ca.OP_NEG:
                sign = -sign
                inner = [value.arguments[0]]
            elif opened and self._is_product(k):
                inner = [value.arguments[0]]
                if value.op == ca.OP_MUL:
                    inner.append(value.arguments[1])
                else:
                    factors.append(_Factor(None) if value.op == ca.OP_TWICE else _Factor(value.arguments[1], True))
            else:
                factors.append(_Factor(k))
                continue
            stack += [(a, self._opens(a, level)) for a in reversed(inner)]
        return sign, factors

    # Writing

    def rewrite(self) -> None:
        """Write every value that is needed."""
        plans: dict[int, list[_Term] | None] = {}
        needed = set(self._kept)
        for i in reversed(range(len(self._values))):
            if i not in needed:
                continue
            plans[i] = plan = self.plan(i)
            if plan is None:
                needed |= {*self._values[i].arguments}
            else:
                needed |= {f.place for term in plan for f in term.factors if f.place is not None}
        for i in sorted(needed):
            value, terms = self._values[i], plans[i]
            if terms is None:
                self._sx[i] = written(value, [self._sx[a] for a in value.arguments])
                depth = max((self._depth[a] for a in value.arguments), default=0) + latency(value.op)
                arrives = LATE if value.op == ca.OP_INPUT and value.group == self._state - 1 else 0
                self._depth[i] = 0 if self._level[i] < self._state else depth if value.arguments else arrives
            else:
                made = self._sum(terms)
                self._sx[i], self._depth[i] = made.sx, made.depth

    def result(self, i: int) -> ca.SX:
        """Value i, written."""
        return self._sx[i]

    def _sum(self, terms: Sequence[_Term]) -> _Ready:
        negated = None
        if all(term.sign < 0 for term in terms):
            early = [k for k, term in enumerate(terms) if any(self._is_early(f) for f in term.factors)]
            ready = [self._product(term, k) for k, term in enumerate(terms)]
            negated = early[0] if early else min(ready).order
        parts = [self._product(term, k, negate=k == negated) for k, term in enumerate(terms)]
        return self._together(parts, ca.OP_ADD)

    def _is_early(self, factor: _Factor) -> bool:
        return factor.place is None or self._level[factor.place] < self._state

    def _product(self, term: _Term, order: int, *, negate: bool = False) -> _Ready:
        """A term of a sum without its sign; with it, in the factor where it is cheapest, if `negate`."""
        parts = []
        for k, factor in enumerate(term.factors):
            if factor.place is None:
                parts.append(_Ready(0, 0, k, 1, ca.SX(2.0)))
            else:
                sx = self._reciprocal(factor.place) if factor.inverse else self._sx[factor.place]
                parts.append(_Ready(self._level[factor.place], self._depth[factor.place], k, 1, sx))
        if negate:
            first = min(parts, key=lambda part: (part.level, part.depth, part.order))
            first.sx = -first.sx
            first.depth += latency(ca.OP_NEG) if first.level == self._state else 0
        made = self._together(parts, ca.OP_MUL)
        return _Ready(made.level, made.depth, order, 1 if negate else term.sign, made.sx)

    def _reciprocal(self, i: int) -> ca.SX:
        if i not in self._inverse:
            self._inverse[i] = 1 / self._sx[i]
        return self._inverse[i]

    def _together(self, parts: Sequence[_Ready], op: int) -> _Ready:
        """All parts in one: what is known early first, then always the two that are there first."""
        join = _added if op == ca.OP_ADD else _multiplied
        ordered = sorted(parts, key=lambda part: (part.level, part.depth, part.order))
        early = [part for part in ordered if part.level < self._state]
        while len(early) > 1:
            early[:2] = [join(early[0], early[1], 0)]
        waiting = early + [part for part in ordered if part.level == self._state]
        heapq.heapify(waiting)
        while len(waiting) > 1:
            first, second = heapq.heappop(waiting), heapq.heappop(waiting)
            heapq.heappush(waiting, join(first, second, latency(op)))
        return waiting[0]


def _joined(a: _Ready, b: _Ready, cycles: int, sign: int, sx: ca.SX) -> _Ready:
    return _Ready(max(a.level, b.level), max(a.depth, b.depth) + cycles, min(a.order, b.order), sign, sx)


def _added(a: _Ready, b: _Ready, cycles: int) -> _Ready:
    first, second = sorted((a, b), key=lambda part: part.order)  # as it was written, as far as that goes
    if first.sign == second.sign:
        return _joined(a, b, cycles, first.sign, first.sx + second.sx)
    plus, minus = (first, second) if first.sign > 0 else (second, first)
    return _joined(a, b, cycles, 1, plus.sx - minus.sx)


def _multiplied(a: _Ready, b: _Ready, cycles: int) -> _Ready:
    return _joined(a, b, cycles, 1, a.sx * b.sx)


def associated(results: Sequence[ca.SX], known: Sequence[ca.SX], late: ca.SX | None = None) -> list[ca.SX]:
    """The results, dense, with their sums and products put together anew; equal but for rounding.

    known  columns of symbols by binding time, the earliest first: parameters, then what depends on time; all others
           depend on the state
    late   a column of symbols that depend on the state and arrive after all others
    """
    groups = [*known, ca.SX(0, 1) if late is None else late]
    with as_written():
        values, places = listed(stacked(results), groups)
        work = _Associated(values, places, len(groups))
        work.rewrite()
        return unstacked([work.result(i) for i in places], [item.shape for item in results])
