"""The metrics in a kernel: what is folded at every sample and what becomes of it at the end, printed as C.

What depends on a run's first sample and on thresholds alone is computed once. A metric of what the system does not have
is not gathered at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import reduce

import casadi as ca

from springline.codegen.program import MASKS, POWERS, Binding, ValueGraph, literal, print_operation
from springline.model.metrics import (
    FIRST,
    METRICS,
    NOW,
    OUTSIDE,
    PARTS,
    RUN,
    SETTINGS,
    Fold,
    Kind,
    Metric,
    Part,
    symbols,
)
from springline.model.quantities import SIGMA, E, U
from springline.model.symbolic import as_written
from springline.model.system import System

_BEGIN: Mapping[Kind, float] = {
    "largest": -math.inf,
    "smallest": math.inf,
    "integral": 0.0,
    "mean": 0.0,
    "variation": 0.0,
    "first": math.inf,
    "last": 0.0,
}
"""What a fold of no sample is."""

_WITHIN: Mapping[Part, str] = {"run": "run", "second half": "half", "last quarter": "quarter"}
"""Part of a run -> what sl_instant calls it; where "settled" begins is another time in each lane."""


BANDS = tuple(symbols(SETTINGS))
"""What the metrics of a run take for settled, in the order in which the loop is given it."""


def _band(name: str) -> str:
    """What C calls one of BANDS."""
    return f"SL_{name.upper()}"


class _Statements:
    """The body of a C function that computes nodes of a graph, on vectors ("slv") or on numbers ("sl").

    load   (name of an input, index) -> C
    given  nodes that are there as numbers -> C
    """

    def __init__(
        self, graph: ValueGraph, library: str, load: Callable[[str, int], str], given: Mapping[int, str] | None = None
    ) -> None:
        self.graph, self.library, self.load = graph, library, load
        self.lines: list[str] = []
        self._given = given or {}
        self._computed: set[int] = set()

    def add(self, line: str) -> None:
        """A line of one's own."""
        self.lines.append(f"  {line}")

    def number(self, i: int) -> str:
        """C of a node as a number; what it takes is computed before."""
        self._compute(i)
        node = self.graph.nodes[i]
        if i in self._given:
            return self._given[i]
        if node.binding is Binding.CONSTANT:
            return self._constant(node.value)
        if node.op is None:
            return self.load(*node.source)
        return f"{self.library}_true(a{i})" if node.op in MASKS else f"a{i}"

    def truth(self, i: int) -> str:
        """C of a node as a truth value."""
        if self.graph.nodes[i].op in MASKS and i not in self._given:
            self._compute(i)
            return f"a{i}"
        return f"({self.number(i)} != {self._constant(0.0)})"

    def _constant(self, value: float) -> str:
        return f"slv_set({literal(value)})" if self.library == "slv" else literal(value)

    def _compute(self, i: int) -> None:
        node = self.graph.nodes[i]
        if node.op is None or i in self._computed or i in self._given:
            return
        power = self.graph.nodes[node.arguments[-1]]
        text = print_operation(
            node.op,
            node.arguments,
            library=self.library,
            value=self.number,
            truth=self.truth,
            constant=self._constant,
            exponent=power.value if node.op in POWERS and power.binding is Binding.CONSTANT else None,
            call=lambda name, operands: f"{self.library}_{name}({', '.join(operands)})",
            origin=node.origin,
        )
        vector, mask = ("sl_v", "sl_m") if self.library == "slv" else ("double", "int")
        self._computed.add(i)
        self.add(f"const {mask if node.op in MASKS else vector} a{i} = {text};")


class _Printer:
    """The metrics of a system as C: those that it has, and of their folds each once."""

    def __init__(self, system: System) -> None:
        state = {quantity.name: f"x[{k} * SL_NJ + i][g]" for k, quantity in enumerate(system.drive.state)}
        own = {E.name: "e[i][g]", U.name: "u[i][g]"} | ({SIGMA.name: "sigma[i][g]"} if system.sliding else {})
        self.sources = own | state
        self.used: set[str] = set()
        self.results: dict[Fold, ca.SX] = {}
        self.users: dict[Fold, str] = {}
        self.values: list[tuple[Metric, ca.SX, ca.SX] | None] = [self._value(metric) for metric in METRICS]
        self.folds = list(self.results)
        self.begins = [k for k, fold in enumerate(self.folds) if fold.kind == "integral" and fold.part != "run"]

    def _value(self, metric: Metric) -> tuple[Metric, ca.SX, ca.SX] | None:
        """Its value, and whether there is one; None where the system lacks what it is made of."""
        parts = [PARTS[part] for part in dict.fromkeys(fold.part for fold in metric.folds)]
        needed = [*metric.folds, *(fold for folds, _ in parts for fold in folds)]
        results = {fold: self.results.get(fold, ca.SX.sym("fold")) for fold in needed}
        mine = [results[fold] for fold in metric.folds]
        with as_written():
            value = ca.SX(metric.value(*mine))
            conditions = [metric.exists(*mine), *(holds(*map(results.__getitem__, folds)) for folds, holds in parts)]
            exists = reduce(ca.logic_and, [c for c in map(ca.SX, conditions) if not c.is_one()] or [ca.SX(1)])
        seen = ca.vertcat(value, exists, *(fold.of for fold in needed))
        used = {name for at in (NOW, FIRST) for name, symbol in symbols(at).items() if ca.depends_on(seen, symbol)}
        if not used <= set(self.sources):
            return None
        self.used |= used
        for fold, result in results.items():
            self.results.setdefault(fold, result)
            self.users.setdefault(fold, metric.name)
        return metric, value, exists

    # -- graphs ---------------------------------------------------------------------------------------------------

    def _sampled(self, graph: ValueGraph, now: str, first: Binding) -> tuple[list[int], int]:
        """What the folds are of in sample `now`, and whether it is outside the settling band."""
        given = [list(symbols(group).values()) for group in (NOW, FIRST, SETTINGS)]
        wanted = [fold.of for fold in self.folds]
        function = ca.Function("sample", [ca.vertcat(*each) for each in given], [ca.vertcat(*wanted, OUTSIDE)])
        bindings = ((now, first if now == "first" else Binding.STATE), ("first", first), ("settings", first))
        inputs = [
            [graph.leaf(name, k, binding) for k in range(len(each))]
            for (name, binding), each in zip(bindings, given, strict=True)
        ]
        ((*found, outside),) = graph.add(f"sample {now}", function, inputs)
        return found, outside

    def _load(self, places: Mapping[str, str]) -> Callable[[str, int], str]:
        """How an input is read: `places` has a pattern for each."""
        members = {name: list(symbols(NOW)) for name in ("now", "first", "before", "last")}
        members |= {"settings": [_band(name) for name in BANDS], "run": list(symbols(RUN))}
        members["fold"] = [str(k) for k in range(len(self.folds))]
        return lambda name, k: places[name].format(members[name][k])

    # -- C --------------------------------------------------------------------------------------------------------

    def text(self) -> str:
        """Types and functions."""
        sources = {name: source for name, source in self.sources.items() if name in self.used}
        graph = ValueGraph()
        now, outside = self._sampled(graph, "now", Binding.RUN)
        before, _ = self._sampled(graph, "before", Binding.RUN)
        wanted = [*now, outside, *before]
        inside = graph.needed(wanted, Binding.STATE)
        early = sorted({i for k in inside for i in graph.nodes[k].arguments} | set(wanted))
        staged = [i for i in early if graph.nodes[i].op is not None and graph.nodes[i].binding is Binding.RUN]
        once = {i: f"m->once[{k}]" for k, i in enumerate(staged)}

        places = {"now": "at.{}", "first": "m->first.{}", "before": "m->last.{}", "settings": "bands[{}][g]"}
        start = _Statements(graph, "slv", self._load(places))
        for name in sources:
            start.add(f"m->first.{name} = m->last.{name} = at.{name};")
        for i, place in once.items():
            start.add(f"{place} = {start.number(i)};")
        for k, fold in enumerate(self.folds):
            start.add(f"m->fold[{k}] = slv_set({literal(_BEGIN[fold.kind])}); /* {self.users[fold]} */")
        sample = _Statements(graph, "slv", self._load(places), once)
        for k, fold in enumerate(self.folds):
            self._gather(sample, k, fold, now[k], before[k], outside)
        for name in sources:  # compilers copy the structure as a whole in pieces of 8 bytes
            sample.add(f"m->last.{name} = at.{name};")

        members = "".join(f"  sl_v {name};\n" for name in sources)
        taken = "".join(f"\n    .{name} = {source}," for name, source in sources.items())
        gathered = [
            (once, "once", "of the first sample and the job"),
            (self.folds, "fold", "what is gathered, in the order of the metrics"),
            (self.begins, "begin", "of an integral over a part of the run, the sample that it began with"),
        ]
        kept = "".join(f"  sl_v {name}[{len(of)}]; /* {meaning} */\n" for of, name, meaning in gathered if of)
        started, sampled, finished = map("\n".join, (start.lines, sample.lines, self._finish()))
        return f"""/* ---- metrics: see METRICS in model/metrics.py ---- */

enum {{ SL_METRICS_PER_JOINT = {len(METRICS)} }};

/* What metrics take for settled: SETTINGS in model/metrics.py. */
enum sl_band {{ {", ".join(map(_band, BANDS))}, SL_NBANDS }};

/* What metrics are made of, of one joint on one group of lanes. */
typedef struct {{
{members}}} sl_sample;

typedef struct {{
  sl_sample first, last;
{kept}}} sl_metrics;

static inline sl_sample kernel_sample(const sl_group *x, const sl_group *u, const sl_group *e, const sl_group *sigma,
                                      int i, int g) {{
  return (sl_sample){{{taken}
  }};
}}

static inline void kernel_metrics_start(sl_metrics *m, sl_sample at, const sl_group *bands, int g) {{
{started}
}}

static inline void kernel_metrics_sample(sl_metrics *m, sl_instant now, sl_sample at) {{
{sampled}
}}

/* Metrics of a lane, with its own bands[SL_NBANDS], into out[SL_METRICS_PER_JOINT]; NaN where there is none. */
static inline void kernel_metrics_finish(const sl_metrics *m, int lane, sl_span run, const double *bands,
                                         double *out) {{
{finished}
}}
"""

    def _gather(self, into: _Statements, k: int, fold: Fold, now: int, before: int, outside: int) -> None:
        """One sample more in fold k."""
        place = f"m->fold[{k}]"
        if fold.kind in ("first", "last"):
            into.add(f"{place} = sl_{fold.kind}({place}, {into.truth(now)}, slv_set(now.time));")
            return
        x = into.number(now)
        begin = f"m->begin[{self.begins.index(k)}]" if k in self.begins else ""
        if fold.kind == "variation":
            more = f"sl_variation({place}, {x}, {into.number(before)})"
        else:
            more = f"sl_{'sum' if fold.kind in ('integral', 'mean') else fold.kind}({place}, {x})"
        if fold.part == "settled":
            alone = f"slv_set({literal(0.0)})" if fold.kind == "variation" else x
            into.add(f"{place} = slv_select({into.truth(outside)}, {alone}, {more});")
            if begin:
                into.add(f"if (!now.run_goes_on) {begin} = {x};")
                into.add(f"{begin} = slv_select({into.truth(outside)}, {x}, {begin});")
            return
        within = _WITHIN[fold.part]
        if fold.part == "run":
            into.add(f"{place} = {more};")
            return
        into.add(f"if (now.{within}{'_goes_on' if fold.kind == 'variation' else ''}) {place} = {more};")
        if begin:
            into.add(f"if (now.{within} && !now.{within}_goes_on) {begin} = {x};")

    def _finish(self) -> list[str]:
        graph = ValueGraph()
        first, _ = self._sampled(graph, "first", Binding.STATE)
        last, _ = self._sampled(graph, "last", Binding.STATE)
        present = [found for found in self.values if found is not None]
        known = [list(symbols(group).values()) for group in (FIRST, SETTINGS, RUN)]
        given = [*known, list(self.results.values())]
        wanted = [each for _, value, exists in present for each in (value, exists)]
        function = ca.Function("finish", [ca.vertcat(*each) for each in given], [ca.vertcat(*wanted)])
        inputs = [
            [graph.leaf(name, k, Binding.STATE) for k in range(len(each))]
            for name, each in zip(("first", "settings", "run", "fold"), given, strict=True)
        ]
        (nodes,) = graph.add("finish", function, inputs)
        places = {"first": "slv_get(m->first.{}, lane)", "last": "slv_get(m->last.{}, lane)"}
        places |= {"settings": "bands[{}]", "run": "run.{}", "fold": "fold{}"}
        body = _Statements(graph, "sl", self._load(places))
        for k, fold in enumerate(self.folds):
            text = f"slv_get(m->fold[{k}], lane)"
            if fold.kind in ("integral", "mean"):
                begin = (
                    body.number(first[k]) if fold.part == "run" else f"slv_get(m->begin[{self.begins.index(k)}], lane)"
                )
                more = ", run.duration" if fold.kind == "mean" else ""
                text = f"sl_{fold.kind}({text}, {begin}, {body.number(last[k])}, run.step{more})"
            body.add(f"const double fold{k} = {text}; /* {self.users[fold]} */")
        pairs = iter(zip(nodes[::2], nodes[1::2], strict=True))
        for k, found in enumerate(self.values):
            text = "SL_NAN"
            if found is not None:
                value, exists = next(pairs)
                text = body.number(value)
                if graph.nodes[exists].binding is not Binding.CONSTANT:
                    text = f"{body.truth(exists)} ? {text} : SL_NAN"
            body.add(f"out[{k}] = {text}; /* {METRICS[k].name} */")
        return body.lines


def print_metrics(system: System) -> str:
    """C of the metrics of a system, the same for every width of lanes. Raises UnprintableOperation."""
    return _Printer(system).text()
