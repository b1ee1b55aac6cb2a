"""A step of an explicit Runge-Kutta method as C: what is added to what after each stage.

The batch kernel, the exported plant step and the loop inside an FMU print these statements, each in its own way of
writing an element of a vector, so that they do the same operations in the same order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from springline.codegen.program.literals import Real, literal
from springline.model.integrators import Number, Tableau

Term = tuple[float, int]
"""A factor, and the stage whose slope it goes with."""


@dataclass(frozen=True, slots=True)
class Update:
    """What is done once the slope of a stage is known.

    next  its factor in the sum that becomes the next state, 0 if it does not enter
    at    the terms of the point where the next stage is evaluated, () after the last stage
    """

    next: float
    at: tuple[Term, ...]


def updates(tableau: Tableau) -> tuple[Update, ...]:
    """The Update of every stage."""
    rows = [*tableau.a[1:], ()]
    return tuple(Update(float(b), _terms(row)) for b, row in zip(tableau.b, rows, strict=True))


def _terms(factors: tuple[Number, ...]) -> tuple[Term, ...]:
    return tuple((float(factor), stage) for stage, factor in enumerate(factors) if factor)


def kept_slopes(tableau: Tableau) -> tuple[int, ...]:
    """The stages whose slopes are needed after more than their own update, ascending."""
    later = {stage for k, update in enumerate(updates(tableau)) for _, stage in update.at if stage < k}
    return tuple(sorted(later))


def first_in_sum(tableau: Tableau) -> int:
    """The first stage that enters the next state."""
    return next(k for k, factor in enumerate(tableau.b) if factor)


def statements(
    tableau: Tableau,
    stage: int,
    *,
    element: Callable[[str], str],
    slope: Callable[[int], str],
    gain: Callable[[float], str],
) -> Iterator[str]:
    """The C statements of a stage's update, for one element of the state.

    element  how an element of the vector x, next or at is written
    slope    how one of the slope of a stage is written
    gain     how a factor times the step is written
    """
    update = updates(tableau)[stage]
    if update.next:
        before = "x" if stage == first_in_sum(tableau) else "next"
        yield f"{element('next')} = {element(before)} + ({gain(update.next)} * {slope(stage)});"
    if update.at:
        terms = " + ".join(f"({gain(factor)} * {slope(k)})" for factor, k in update.at)
        yield f"{element('at')} = {element('x')} + {terms};"


def scalar_slopes(tableau: Tableau) -> tuple[str, ...]:
    """Names of the arrays that `scalar_stages` keeps slopes in."""
    kept = kept_slopes(tableau)
    once = () if len(kept) == tableau.stages else ("slope",)
    return (*once, *(f"slope_{k}" for k in kept))


def scalar_points(tableau: Tableau) -> tuple[str, ...]:
    """Names of the arrays that `scalar_stages` has states in: from `x` to `next`, by way of `at` if there is one."""
    return ("x", "at", "next") if tableau.stages > 1 else ("x", "next")


def scalar_stages(
    tableau: Tableau, real: Real, states: int, evaluate: Callable[[int, str, str], list[str]]
) -> Iterator[str]:
    """Lines of C that take the array x to the array next: `scalar_points` and `scalar_slopes` are what they work in.

    real      number type
    states    length of the arrays
    evaluate  (place among the nodes, where, into what) -> lines that evaluate the slope
    """
    kept = kept_slopes(tableau)

    def slope(k: int) -> str:
        return f"slope_{k}" if k in kept else "slope"

    for stage, when in enumerate(tableau.when):
        yield f"/* stage {stage + 1} of {tableau.stages} */"
        yield from evaluate(when, "at" if stage else "x", slope(stage))
        gains: dict[float, str] = {}
        lines = statements(
            tableau,
            stage,
            element=lambda name: f"{name}[i]",
            slope=lambda k: f"{slope(k)}[i]",
            gain=lambda factor: gains.setdefault(factor, f"gain_{len(gains)}"),  # noqa: B023 - used within the turn
        )
        body = list(lines)
        yield "{"
        for factor, name in gains.items():
            yield f"  const {'float' if real == 'float' else 'double'} {name} = {literal(factor, real)} * step;"
        yield f"  for (i = 0; i < {states}; i++) {{"
        yield from (f"    {line}" for line in body)
        yield "  }"
        yield "}"


def kernel_update(tableau: Tableau, states: str = "SL_NX") -> str:
    """What loop.c needs to know of the integrator, in C: its numbers, and kernel_update.

    states  how many of the states are integrated, in C
    """
    kept = kept_slopes(tableau)
    instants = [node for node in tableau.nodes if node < 1.0]
    places = [kept.index(stage) if stage in kept else -1 for stage in range(tableau.stages)]
    cases = "\n".join(
        f"    case {stage}: {{\n{_kernel_case(tableau, stage, states)}\n      break;\n    }}"
        for stage in range(tableau.stages)
    )
    return f"""/* The integrator: {tableau.title}, order {tableau.order}. */
enum {{ SL_STAGES = {tableau.stages}, SL_INSTANTS = {len(instants)}, SL_KEPT = {len(kept)} }};

static const double sl_node[SL_INSTANTS] = {{{", ".join(map(repr, instants))}}};
static const int sl_when[SL_STAGES] = {{{", ".join(map(str, tableau.when))}}}; /* the instant of each stage */
static const int sl_kept[SL_STAGES] = {{{", ".join(map(str, places))}}}; /* where its slope is kept, -1: nowhere */

/* After the slope of a stage: the next state as far as it is summed up, and where the next stage is evaluated. */
static inline void kernel_update(int stage, double h, const sl_group *x, sl_group *slope, sl_group (*kept)[SL_NX],
                                 sl_group *next, sl_group *at) {{
  int i, g;
  (void)kept;
  switch (stage) {{
{cases}
  }}
}}
"""


def _kernel_case(tableau: Tableau, stage: int, states: str) -> str:
    kept = kept_slopes(tableau)
    gains: dict[float, str] = {}

    def gain(factor: float) -> str:
        return gains.setdefault(factor, f"gain_{len(gains)}")

    def slope(k: int) -> str:
        return "slope[i][g]" if k == stage else f"kept[{kept.index(k)}][i][g]"

    lines = list(statements(tableau, stage, element=lambda name: f"{name}[i][g]", slope=slope, gain=gain))
    return "\n".join(
        [
            *(f"      const sl_v {name} = slv_set({literal(factor)} * h);" for factor, name in gains.items()),
            f"      for (i = 0; i < {states}; i++) {{",
            "        for (g = 0; g < SL_G; g++) {",
            *(f"          {line}" for line in lines),
            "        }",
            "      }",
        ]
    )
