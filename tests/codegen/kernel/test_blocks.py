"""Blocks: whatever they cover and in whatever order they stand, the same bits."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from springline.codegen.elementary import Op, procedure
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, Runs, kernel, print_kernel
from springline.codegen.kernel.block import Block
from springline.codegen.kernel.paying import Span, what_pays
from springline.codegen.kernel.schedule import scheduled
from springline.codegen.program import program
from springline.model.structure import SignalShape, Structure

SETTINGS = LoopSettings(steps=30, step=2e-4, output_every=7, hold=3)


def simulated(structure: Structure, values: np.ndarray, sampled: bool, options: KernelOptions) -> Runs:
    spec = KernelSpec(structure, sampled, None, (), options)
    return kernel(spec).run(values, SETTINGS)


def table(structure: Structure, runs: int = 5) -> np.ndarray:
    """Default values, with a start and a sine of the reference that differ from run to run."""
    slots = program(structure).system.slots
    values = np.tile([slot.default for slot in slots], (runs, 1))
    for k, slot in enumerate(slots):
        if slot.key.startswith(("initial.q.", "reference.")):
            values[:, k] = np.linspace(0.2, 0.7, runs)
    return values


STRUCTURES = {
    "rk4": Structure(base_motion=SignalShape("sine", (1, 0, 1))),
    "dopri5": Structure(integrator="dopri5"),
    "euler, rigid": Structure(integrator="euler", drive="rigid"),
    "midpoint, double power": Structure(integrator="midpoint", law="double_power"),
}


@pytest.mark.parametrize("sampled", [False, True], ids=["continuous", "sampled"])
@pytest.mark.parametrize("name", STRUCTURES)
def test_what_a_block_covers_changes_no_bit(name: str, sampled: bool) -> None:
    structure = STRUCTURES[name]
    values = table(structure)
    wanted = simulated(structure, values, sampled, KernelOptions(engine="casadi", flags=("-O1",)))
    assert wanted.trajectory is not None and np.isfinite(wanted.trajectory).all()
    for k, span in enumerate(get_args(Span)):
        options = KernelOptions(width=(4, 2, 1)[k], groups=1 + k % 2, packs=2 - k % 2, span=span, flags=("-O1",))
        found = simulated(structure, values, sampled, options)
        for what in ("trajectory", "final_state", "metrics", "status", "end_time"):
            assert getattr(found, what).tobytes() == getattr(wanted, what).tobytes(), (span, what)


def operations(block: Block, order: Sequence[int]) -> int:
    """Check an order: every operation once, none before its operands. Returns how many values are alive at most."""
    same: list[int] = []
    for i, node in enumerate(block.nodes):
        leaf = node.op in (Op.INPUT, Op.REAL_CONSTANT, Op.BITS_CONSTANT)
        same.append(-1 if leaf else same[node.arguments[0]] if node.op in (Op.REAL, Op.BITS) else i)
    wanted, stack = set[int](), [same[i] for i in (*(k for _, k in block.stores), *block.fine)]
    while stack:
        i = stack.pop()
        if i >= 0 and i not in wanted:
            wanted.add(i)
            stack += [same[a] for a in block.nodes[i].arguments]
    assert sorted(order) == sorted(wanted)
    last = {a: k for k, i in enumerate(order) for a in {same[a] for a in block.nodes[i].arguments} if a >= 0}
    place = {i: k for k, i in enumerate(order)}
    assert all(place[a] < k for a, k in last.items() if a in place)
    for k, i in enumerate(order):
        assert all(place[a] < k for a in {same[a] for a in block.nodes[i].arguments} if a >= 0)
    return max((sum(place[a] <= k < last[a] for a in last) for k in range(len(order))), default=0)


@given(st.data(), st.integers(2, 40), st.integers(1, 8))
@settings(max_examples=60, deadline=None)
def test_an_order_has_every_operation_once_behind_its_operands(data: st.DataObject, count: int, most: int) -> None:
    block = Block()
    places = [block.load("x[0][@]"), block.load("x[1][@]"), block.constant(0.5)]
    for _ in range(count):
        op = data.draw(st.sampled_from([Op.ADD, Op.MUL, Op.DIV, Op.SUB, Op.NEG, Op.SQRT]))
        arguments = [data.draw(st.sampled_from(places)) for _ in range(1 if op in (Op.NEG, Op.SQRT) else 2)]
        places.append(block.add(op, *arguments))
    if data.draw(st.booleans()):
        places += block.elementary(procedure("exp"), [places[-1]])
    block.stores = [(f"next[{k}][@]", place) for k, place in enumerate(places[-3:])]
    order = scheduled(block, most)
    assert operations(block, order.places) <= order.alive


def test_few_values_alive_where_few_are_wanted() -> None:
    """Independent chains one after the other need two or three registers, side by side as many as there are chains."""
    block = Block()
    for k in range(30):
        value = block.load(f"x[{k}][@]")
        for factor in (3.0, 5.0, 7.0):
            value = block.multiply(value, block.constant(factor + k))
        block.stores.append((f"next[{k}][@]", value))
    wide, narrow = scheduled(block, 100), scheduled(block, 4)
    assert wide.alive > 2 * narrow.alive
    assert narrow.alive <= 7


def test_equal_operations_are_one() -> None:
    block = Block()
    a, b = block.load("x[0][@]"), block.load("x[1][@]")
    assert block.sum(a, b) == block.sum(b, a)
    assert block.add(Op.SUB, a, b) != block.add(Op.SUB, b, a)
    assert block.constant(0.0) != block.constant(-0.0)
    first, second = block.elementary(procedure("sin"), [a]), block.elementary(procedure("sin"), [a])
    assert first == second and len(block.fine) == 1
    block.name(first[0], "sine"), block.name(a, "sine")
    assert block.labels == {first[0]: "sine"}, "a name is of one value"


def test_equal_stages_are_one_function() -> None:
    """The two middle stages of rk4 differ in their factors alone, which are not in the text."""
    structure = STRUCTURES["rk4"]
    options = KernelOptions(width=2, span="stage", flags=("-O0",))
    text = dict(print_kernel(program(structure), KernelSpec(structure, options=options)).files)["kernel.h"]
    assert re.findall(r"int kernel_(\w+)\(SL_BLOCK", text) == ["closed_0", "later_1", "later_3"]
    [rows] = re.findall(r"sl_blocks\[SL_BLOCKS\] = \{(.*)\};", text)
    assert rows.count("kernel_later_1") == 2


@pytest.mark.parametrize("width", [1, 2, 4, 8, 16])
@pytest.mark.parametrize("sampled", [False, True])
def test_large_steps_are_evaluations(width: int, sampled: bool) -> None:
    """A step of many operations is no block, or compilers take minutes for it."""
    small, large = what_pays(width, sampled, 500, 2000), what_pays(width, sampled, 500, 30_000)
    wide, largest = what_pays(width, sampled, 1500, 3000), what_pays(width, sampled, 5000, 30_000)
    assert large.span == largest.span == "evaluation"
    assert small.span == "step" or (width in (2, 4) and not sampled)
    assert wide.groups == largest.groups == 1, "large evaluations fill a processor one vector at a time"
    for shape in (small, large, wide, largest):
        assert shape.groups * shape.alive <= (28 if width >= 8 else 12), "about the registers that there are"


def test_times_of_a_step_have_what_is_read_there() -> None:
    """With sampled control nothing reads the reference inside a step; a run of its own has no signals of its own."""
    structure = Structure(base_motion=SignalShape("sine", (1, 0, 1)))
    keys = [slot.key for slot in program(structure).system.slots]

    def stored(sampled: bool, tunable: tuple[str, ...] | None) -> dict[int, int]:
        baked = () if tunable is None else tuple(slot.default for slot in program(structure).system.slots)
        spec = KernelSpec(structure, sampled, tunable, baked, KernelOptions(width=4, groups=1))
        source = dict(print_kernel(program(structure), spec).files)["kernel.h"]
        assert ("kernel_times(" in source) == ("#define SL_BLOCKED_TIMES 1" in source)
        return {instant: len(set(re.findall(rf"varying\[{instant}\]\[(\d+)\]\[g\] =", source))) for instant in (0, 1)}

    continuous, sampled = stored(False, None), stored(True, None)
    assert continuous[0] == continuous[1] == sampled[1] > 2 * sampled[0] > 0
    assert stored(False, ("control.delta",)) == {0: 0, 1: 0}
    heave = tuple(key for key in keys if key.startswith("base_motion.heave"))
    inside, end = stored(True, heave).values()
    assert 0 < inside < end, "rows show the heave itself"


def test_signals_of_many_terms_are_no_block() -> None:
    structure = Structure(base_motion=SignalShape("sine", (60, 0, 60)))
    spec = KernelSpec(structure, False, None, (), KernelOptions(width=4, groups=1))
    assert "#define SL_BLOCKED_TIMES 0" in dict(print_kernel(program(structure), spec).files)["kernel.h"]


def test_an_unknown_span_is_refused() -> None:
    with pytest.raises(ValueError, match=r"span is 'run', expected one of evaluation, stage, step"):
        replace(KernelOptions(), span="run")  # type: ignore[arg-type]
