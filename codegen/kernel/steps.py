"""The steps of a loop as blocks: which values go into which, and the C functions they become.

A step is evaluations of the slopes at the stages of the integrator, and the sums that lead from one to the next. With
control in continuous time an evaluation is control and plant; with sampled control the first stage of a step takes the
sample, or holds the last, and all others are the plant alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from springline.codegen.kernel.block import Block, Expansion
from springline.codegen.kernel.block_c import Constants, statements
from springline.codegen.kernel.loop_values import LoopValues
from springline.codegen.kernel.pairing import paired
from springline.codegen.kernel.paying import MOST, Shape
from springline.codegen.kernel.schedule import scheduled
from springline.codegen.program import Binding, kept_slopes, literal, updates

_SHOWN = ("u", "e", "sigma", "wished", "a_law")

_SENSORS = ", const sl_group *restrict noise, sl_group *restrict measured"

_ACTUATORS = ", sl_group (*restrict acting)[SL_NJ]"

PREAMBLE = """\
/* A block takes the packs through a part of a step, in the common case; it returns 0 where a lane meets a rare one, and
 * what it has written is then to be computed again by the complete functions. `times` and `gains` are those of its
 * first stage. A block stands by itself: inlined into the loop it would share its registers, and spill them. */
#define SL_BLOCK_FUNCTION static __attribute__((noinline, unused))
#define SL_BLOCK_ARGUMENTS \\
  const sl_time *times, const sl_v *restrict gains, double period, const sl_group *restrict p, \\
      const sl_group *restrict r, const sl_group *restrict x, const sl_group *restrict from, sl_group *restrict next, \\
      sl_group *restrict at, sl_group (*restrict kept)[SL_NX], sl_group *restrict slope, sl_group *restrict u, \\
      sl_group *restrict e, sl_group *restrict sigma, sl_group *restrict wished, sl_group *restrict a_law@SENSORS

typedef struct {
  int (*compute)(SL_BLOCK_ARGUMENTS);
  int instant, gain; /* the first it needs */
} sl_block;
"""

_TIMES_ARGUMENTS = (
    "const double *time, const double (*data)[SL_ND + 1], const sl_time *times,\n"
    "    const sl_group *restrict p, const sl_group *restrict r, sl_group *const *varying"
)


@dataclass(frozen=True, slots=True)
class Steps:
    """The printed blocks, how they are shaped, and operations per run of each."""

    text: str
    shape: Shape
    counts: dict[str, int]


def print_steps(values: LoopValues, sampled: bool, shape: Callable[[int, int], Shape]) -> Steps:
    """Print the blocks of a step.

    shape  is asked with the operations of the first evaluation and of all evaluations of a step
    """
    builder = _Builder(values, sampled)
    tableau = values.program.system.tableau
    every = list(range(tableau.stages))
    operations = first = len(builder.evaluation(0, builder.variants[0]).nodes)
    if len(every) > 1:
        operations += len(every[1:]) * len(builder.evaluation(1, "later").nodes)
    chosen = shape(first, operations)
    spans = [every] if chosen.span == "step" else [[stage] for stage in every]
    functions: dict[object, str] = {}  # equal stages are one function
    counts: dict[str, int] = {}
    gains: list[float] = []

    def function(stages: Sequence[int], variant: str, gain: int) -> str:
        factors: dict[float, int] = {}
        if chosen.span == "evaluation" or variant == "take":
            block = builder.evaluation(stages[0], variant)
        else:
            block = builder.stages(stages, variant, factors)
        gains.extend(list(factors)[len(gains) - gain :])
        if block.content not in functions:
            functions[block.content] = f"{variant}_{stages[0]}"
            define(functions[block.content], block)
        return f"{{kernel_{functions[block.content]}, {tableau.when[stages[0]]}, {gain}}}"

    def begin(name: str, arguments: str, block: Block) -> tuple[Block, Sequence[int]]:
        if chosen.paired:
            block = paired(block, builder.n)
        order = scheduled(block, chosen.alive)
        counts[name] = len(order.places)
        text.append(f"/* {counts[name]} operations a run, {order.alive} values at once */")
        text.append(f"SL_BLOCK_FUNCTION int kernel_{name}({arguments}) {{")
        return block, order.places

    def define(name: str, block: Block) -> None:
        block, order = begin(name, "SL_BLOCK_ARGUMENTS", block)
        groups = [str(g) for g in range(chosen.groups)]
        masks = [f"ok_{g}" if chosen.groups > 1 else "ok" for g in groups]
        text.extend(f"  sl_m {mask} = slv_yes();" for mask in masks)
        text.extend(statements(block, order, groups, constants, "  "))
        text.append(f"  return slv_all({' & '.join(masks)});\n}}\n")

    def define_times(block: Block) -> None:
        block, order = begin("times", _TIMES_ARGUMENTS, block)
        text.extend(["  sl_m ok = slv_yes();", "  int g;", "  for (g = 0; g < SL_G; g++) {"])
        text.extend(statements(block, order, ["g"], constants, "    "))
        text.append("  }\n  return slv_all(ok);\n}\n")

    text: list[str] = []
    constants = Constants()
    times = builder.times()
    blocked_times = 0 < len(times.nodes) <= MOST
    if blocked_times:
        define_times(times)
    later = "later" if sampled or chosen.span != "evaluation" else "closed"  # one function for all stages is short
    rows, held = [], ""
    for stages in spans:
        gain = len(gains)
        rows.append(function(stages, builder.variants[0] if stages[0] == 0 else later, gain))
        if stages[0] == 0 and sampled:
            held = function(stages, "held", gain)
    taken = function([0], "take", len(gains)) if builder.actuated else ""
    fused = int(chosen.span != "evaluation")
    text = [
        "/* ---- a step, block by block ---- */\n",
        "#define SL_BLOCKED 1",
        PREAMBLE.replace("@SENSORS", (_SENSORS if builder.measured else "") + (_ACTUATORS if builder.actuated else "")),
        *constants.text(chosen.groups),
        *text,
        f"#define SL_BLOCKED_TIMES {int(blocked_times)} /* whether kernel_times has what varies at a step's times */",
        f"#define SL_FUSED {fused} /* whether blocks sum up the next state, too */",
        f"enum {{ SL_BLOCKS = {len(spans)}, SL_PER_BLOCK = {len(spans[0])}, SL_GAINS = {len(gains)} }};",
        f"static const double sl_gain[SL_GAINS + 1] = {{{', '.join(map(literal, [*gains, 0.0]))}}};",
        f"static const sl_block sl_blocks[SL_BLOCKS] = {{{', '.join(rows)}}};",
        *([f"static const sl_block sl_take = {taken};"] if taken else []),
        *(
            [f"static const sl_block sl_held = {held};", "#define SL_HELD sl_held"]
            if sampled
            else ["#define SL_HELD sl_blocks[0]"]
        ),
    ]
    return Steps("\n".join(text), chosen, counts)


class _Builder:
    """Makes the blocks of a loop. Variants of the first stage: closed, or sample and held; of others: later.

    Where motors are not driven by the command as it is, the sample is taken by a block of its own, take.
    """

    def __init__(self, values: LoopValues, sampled: bool) -> None:
        self.values, self.sampled = values, sampled
        self.variants = ("sample", "held") if sampled else ("closed",)
        program = values.program
        self.tableau = program.system.tableau
        self.n, self.plant, self.memory = program.system.n, program.size("x"), program.size("z")
        self.actuated = bool(program.size("commanded"))
        self.measured = program.size("measured")
        self.integrated = self.plant + (0 if sampled else self.memory)

    def evaluation(self, stage: int, variant: str) -> Block:
        """The slopes of one stage, into `slope`, at what `from` points to."""
        block = Block()
        at = "x" if variant == "take" else "from"
        where = [block.load(f"{at}[{k}][@]") for k in range(self.integrated)]
        slopes = _Stages(self, block, stage).slopes(stage, variant, where)
        block.stores += [(f"slope[{k}][@]", place) for k, place in enumerate(slopes)]
        return block

    def times(self) -> Block:
        """What varies from run to run at the times of a step that come after its beginning; its end is the last."""
        block, values = Block(), self.values
        slots, last = values.slots[Binding.VARYING], sum(node < 1 for node in self.tableau.nodes)
        inner = [i for binding, i in values.given(values.wanted["plant"], Binding.STATE) if binding is Binding.VARYING]

        def load(i: int, instant: int) -> str:
            node = values.graph.nodes[i]
            source, k = node.source
            if source == "t":
                return f"slv_set(time[{instant}])"
            return f"slv_set(data[{instant}][{k}])" if source == "d" else _given(values, i, instant)

        for instant in range(last):
            wanted = inner if self.sampled and instant < last - 1 else list(slots)  # a sample is taken at the beginning
            places = Expansion(block, values, load, Binding.VARYING).values(wanted, {}, instant)
            block.stores += [
                (f"varying[{instant}][{slots[i]}][@]", place) for i, place in zip(wanted, places, strict=True)
            ]
        return block

    def stages(self, stages: Sequence[int], variant: str, factors: dict[float, int]) -> Block:
        """Stages with their sums; `factors` gets what the step is multiplied by, in the order of `gains`."""
        block, every = Block(), updates(self.tableau)
        kept, states = kept_slopes(self.tableau), range(self.integrated)
        part = _Stages(self, block, stages[0])
        x = [block.load(f"x[{k}][@]") for k in states]
        at = x if stages[0] == 0 else [block.load(f"from[{k}][@]") for k in states]
        entered = [stage for stage, update in enumerate(every) if update.next]
        total = [block.load(f"next[{k}][@]") for k in states] if stages[0] > entered[0] else x
        slopes: dict[int, Sequence[int]] = {}

        def slope(stage: int, k: int) -> int:
            return slopes[stage][k] if stage in slopes else block.load(f"kept[{kept.index(stage)}][{k}][@]")

        def product(factor: float, stage: int, k: int) -> int:
            return block.multiply(block.load(f"gains[{factors.setdefault(factor, len(factors))}]"), slope(stage, k))

        for stage in stages:
            slopes[stage] = part.slopes(stage, variant if stage == 0 else "later", at)
            update = every[stage]
            if update.next:
                total = [block.sum(total[k], product(update.next, stage, k)) for k in states]
            if update.at:
                at = list(x)
                for factor, other in update.at:
                    at = [block.sum(at[k], product(factor, other, k)) for k in states]
        for stage in stages:
            if any(stage == other for update in every[stages[-1] + 1 :] for _, other in update.at):
                block.stores += [(f"kept[{kept.index(stage)}][{k}][@]", slopes[stage][k]) for k in states]
        if stages[-1] >= entered[0]:
            block.stores += [(f"next[{k}][@]", total[k]) for k in states]
        if every[stages[-1]].at:
            block.stores += [(f"at[{k}][@]", at[k]) for k in states]
        return block


class _Stages:
    """Evaluations within a block whose first stage is `first`."""

    def __init__(self, builder: _Builder, block: Block, first: int) -> None:
        self.builder, self.block, self.values = builder, block, builder.values
        self.instant = builder.tableau.when[first]
        self.expansion = Expansion(block, self.values, self._load)
        n = builder.n
        self.command: Sequence[int] = (
            [block.load(f"u[{k}][@]") for k in range(n)] if builder.sampled and not builder.actuated else []
        )

    def slopes(self, stage: int, variant: str, at: Sequence[int]) -> Sequence[int]:
        """Slopes of a stage; what the first one shows is stored."""
        builder, block, wanted = self.builder, self.block, self.values.wanted
        n, plant, memory = builder.n, builder.plant, builder.memory
        where = {("x", k): at[k] for k in range(plant)} | {("z", k): at[plant + k] for k in range(len(at) - plant)}
        instant = builder.tableau.when[stage] - self.instant
        if variant == "later" and not builder.sampled:
            return self.expansion.values(wanted["closed"][: len(at)], where, instant)
        if variant == "closed":
            places = self.expansion.values(wanted["closed"], where, instant)
            self._show(_SHOWN, places[len(at) :])
            return places[: len(at)]
        if variant == "take" or (variant == "sample" and not builder.actuated):  # else it has been taken before
            places = self.expansion.values(wanted["control"], where, instant)
            self._show(_SHOWN, places[: 5 * n])
            self.command = places[:n]
            shown, ahead = places[5 * n : 5 * n + builder.measured], places[5 * n + builder.measured :]
            block.stores += [(f"measured[{k}][@]", place) for k, place in enumerate(shown)]
            block.stores += [(f"next[{plant + k}][@]", place) for k, place in enumerate(ahead)]
            if variant == "take":
                return []
        elif variant == "held":
            self._show(("e", "sigma"), self.expansion.values(wanted["error"], where, instant))
            held = [(f"next[{plant + k}][@]", block.load(f"x[{plant + k}][@]")) for k in range(memory)]
            block.stores += held
        if builder.actuated:
            self.command = [block.load(f"acting[{instant}][{k}][@]") for k in range(n)]
        command = {("u", k): self.command[k] for k in range(n)}
        return self.expansion.values(wanted["plant"], where | command, instant)

    def _show(self, names: Sequence[str], places: Sequence[int]) -> None:
        n = self.builder.n
        self.block.stores += [(f"{name}[{k}][@]", places[i * n + k]) for i, name in enumerate(names) for k in range(n)]

    def _load(self, i: int, instant: int) -> str:
        """C expression of what a block is given."""
        source, k = self.values.graph.nodes[i].source
        if source == "z":  # with sampled control: held over the step
            return f"x[{self.builder.plant + k}][@]"
        if source == "noise":
            return f"noise[{k}][@]"
        return "slv_set(period)" if source == "h" else _given(self.values, i, instant)


def _given(values: LoopValues, i: int, instant: int) -> str:
    """C expression of a parameter, or of a value of an earlier binding time."""
    node, slots = values.graph.nodes[i], values.slots
    source, k = node.source
    if source == "p":
        return f"p[{k}][@]"
    if node.binding is Binding.RUN:
        return f"r[{slots[Binding.RUN][i]}][@]"
    if node.binding is Binding.UNIFORM:
        return f"slv_set(times[{instant}].uniform[{slots[Binding.UNIFORM][i]} * SL_W])"
    return f"times[{instant}].varying[{slots[Binding.VARYING][i]}][@]"
