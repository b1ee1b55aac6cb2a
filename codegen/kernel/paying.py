"""What is printed as one block, and how many vectors go side by side: what pays, by instruction set and size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Span = Literal["evaluation", "stage", "step"]
"""What a block covers: an evaluation of the slopes, a stage with its update, or a whole step."""


@dataclass(frozen=True, slots=True)
class Shape:
    """How the steps of a kernel are printed; none of it changes a bit.

    span    what a block covers
    groups  vectors that each statement is printed for, side by side
    packs   packs of groups that go through time in turn, block by block
    alive   values of a group from which on the order saves registers
    paired  whether operations that joints have in common lie in the lanes of one vector, where a run is alone
    """

    span: Span
    groups: int
    packs: int
    alive: int
    paired: bool = False


# By lanes of a vector, each without and with sampled control; benchmarks/block_shapes.py measures what others take.
#
# A whole step gives the processor most to do at once, but is long: with 256 bits a step with control in every stage
# does not fit into what a processor keeps decoded (seen: Zen 3), and one evaluation that all stages share is faster.
# Two vectors side by side fill the processor where one evaluation is small; where it is large it has enough to do by
# itself, and a second vector only costs registers and room.
_SMALL: dict[int, tuple[Shape, Shape]] = {
    8: (Shape("step", 1, 2, 28), Shape("step", 2, 2, 14)),
    2: (Shape("evaluation", 2, 1, 6), Shape("step", 1, 2, 12)),
    1: (Shape("step", 1, 1, 12, True), Shape("step", 1, 1, 12, True)),
}
# Many stages of small evaluations: as one block, compilers take more than their share of time.
_LONG: dict[int, tuple[Shape, Shape]] = {
    8: (Shape("evaluation", 2, 1, 14), Shape("evaluation", 2, 2, 14)),
    2: (Shape("evaluation", 2, 1, 6), Shape("evaluation", 2, 2, 6)),
    1: (Shape("evaluation", 1, 1, 12, True), Shape("evaluation", 1, 1, 12, True)),
}
# Few stages of large evaluations.
_WIDE: dict[int, tuple[Shape, Shape]] = {
    8: (Shape("step", 1, 2, 28), Shape("step", 1, 2, 28)),
    2: (Shape("evaluation", 1, 2, 12), Shape("evaluation", 1, 2, 12)),
    1: (Shape("step", 1, 1, 12, True), Shape("step", 1, 1, 12, True)),
}
_LONG_AND_WIDE: dict[int, tuple[Shape, Shape]] = {
    8: (Shape("evaluation", 1, 2, 28), Shape("evaluation", 1, 1, 28)),
    2: (Shape("evaluation", 1, 2, 12), Shape("evaluation", 1, 2, 12)),
    1: (Shape("evaluation", 1, 1, 12, True), Shape("evaluation", 1, 1, 12, True)),
}
MOST = 4000
"""Operations of a step, or of the signals of its times, beyond which a block of them is long."""
_WIDEST = 1000
"""Operations of an evaluation, beyond which it is large: the paper's arm has 600, three joints 1,300."""


def what_pays(width: int, sampled: bool, evaluation: int, step: int) -> Shape:
    """The Shape of a kernel.

    width       lanes of a vector
    evaluation  primitives of the first evaluation of a step, with the control
    step        of all evaluations of a step
    """
    small, long = (_WIDE, _LONG_AND_WIDE) if evaluation > _WIDEST else (_SMALL, _LONG)
    table = long if step > MOST else small
    return table[max(lanes for lanes in table if lanes <= width)][sampled]
