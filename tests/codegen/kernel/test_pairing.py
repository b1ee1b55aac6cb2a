"""Joints in lanes: whatever lies side by side, each lane does what it would do by itself."""

import math
import operator
import struct
from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from springline.codegen.elementary import Op, procedure
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, kernel
from springline.codegen.kernel.block import Block
from springline.codegen.kernel.pairing import paired
from springline.codegen.program import program
from springline.model.structure import SignalShape, Structure

Lanes = tuple[float, float]
OPERATIONS: dict[Op, Callable[..., float]] = {
    Op.ADD: operator.add,
    Op.SUB: operator.sub,
    Op.MUL: operator.mul,
    Op.NEG: operator.neg,
    Op.SQRT: lambda a: math.sqrt(a) if a >= 0 else math.nan,
    Op.LT: operator.lt,
    Op.IF: lambda mask, a: a if mask else 0.0,
}


def computed(block: Block) -> dict[str, Lanes]:
    """What a block stores, lane by lane; inputs are as long as their names say."""
    lanes: list[Lanes] = []
    for node in block.nodes:
        if node.op is Op.INPUT:
            lanes.append((float(node.text), float(node.text)))
        elif node.op is Op.REAL_CONSTANT:
            lanes.append((float(node.number), float(node.number if node.second is None else node.second)))
        elif node.op in (Op.PAIR, Op.PAIR_MASKS):
            a, b = node.arguments
            lanes.append((lanes[a][int(node.number) % 2], lanes[b][int(node.number) // 2]))
        else:
            operands = [lanes[a] for a in node.arguments]
            lanes.append(tuple(OPERATIONS[node.op](*(each[k] for each in operands)) for k in (0, 1)))  # type: ignore[arg-type]
    return {text: lanes[place] for text, place in block.stores}


def counts(block: Block) -> Counter[Op]:
    return Counter(node.op for node in block.nodes)


@given(st.data(), st.integers(2, 40))
@settings(max_examples=100, deadline=None)
def test_every_result_is_in_both_lanes_with_the_same_bits(data: st.DataObject, count: int) -> None:
    block = Block()
    numbers = [block.load("0.75"), block.load("-1.5"), block.constant(0.5), block.constant(-0.0)]
    masks = [block.add(Op.LT, numbers[0], numbers[1])]
    for _ in range(count):
        op = data.draw(st.sampled_from(list(OPERATIONS)))
        arity = 1 if op in (Op.NEG, Op.SQRT, Op.IF) else 2
        given = [data.draw(st.sampled_from(masks))] if op is Op.IF else []
        given += [data.draw(st.sampled_from(numbers)) for _ in range(arity)]
        (masks if op is Op.LT else numbers).append(block.add(op, *given))
    block.stores = [(f"next[{k}][@]", place) for k, place in enumerate(numbers[-4:])]
    wanted, found = computed(block), computed(paired(block, 2))
    for text, lanes in wanted.items():
        bits = [struct.pack("d", lane) for lane in (lanes[0], *found[text])]
        assert len(set(bits)) == 1 or all(math.isnan(lane) for lane in (lanes[0], *found[text])), text


def chains(joints: int) -> Block:
    block = Block()
    for k in range(joints):
        value = block.multiply(block.load(f"x[{k}][@]"), block.constant(2.0 + k))
        block.stores.append((f"next[{k}][@]", block.elementary(procedure("exp"), [value])[0]))
    return block


def test_joints_that_do_the_same_take_half_the_operations() -> None:
    before, after = counts(chains(2)), counts(paired(chains(2), 2))
    assert before[Op.MUL] == 2 * after[Op.MUL] > 10
    assert before[Op.ADD] == 2 * after[Op.ADD] > 5
    assert after[Op.PAIR] == 3, "two inputs brought together, and each result into both lanes"
    assert any(node.second == 3.0 for node in paired(chains(2), 2).nodes if node.op is Op.REAL_CONSTANT)


def test_a_third_joint_goes_by_itself() -> None:
    """Beside it lies at most what it has twice itself."""
    two, three = counts(paired(chains(2), 2)), counts(paired(chains(3), 3))
    assert two[Op.MUL] < three[Op.MUL] <= two[Op.MUL] + counts(chains(1))[Op.MUL]


def test_nothing_is_a_block_too() -> None:
    assert not paired(Block(), 1).nodes


def test_what_costs_more_to_bring_together_than_it_saves_is_left() -> None:
    block = Block()
    x = [block.load(f"x[{k}][@]") for k in range(4)]
    block.stores = [(f"next[{k}][@]", block.sum(x[k], x[k + 2])) for k in (0, 1)]
    assert counts(paired(block, 2)) == counts(block)


def test_one_that_follows_from_the_other_is_not_beside_it() -> None:
    block = Block()
    first = block.multiply(block.load("x[0][@]"), block.constant(3.0))
    block.stores = [("next[0][@]", first), ("next[1][@]", block.multiply(first, block.constant(5.0)))]
    assert counts(paired(block, 2))[Op.MUL] == 2


def planar(joints: int) -> Structure:
    return Structure(mechanism="planar_arm", size=joints, reference=SignalShape("sine", (1,) * joints))


@pytest.mark.parametrize("structure", [planar(1), planar(3)], ids=["one joint", "three joints"])
@pytest.mark.parametrize("sampled", [False, True], ids=["continuous", "sampled"])
def test_runs_alone_have_the_bits_of_runs_together(structure: Structure, sampled: bool) -> None:
    slots = program(structure).system.slots
    values = np.tile([slot.default for slot in slots], (3, 1))
    start = [k for k, slot in enumerate(slots) if slot.key.startswith("initial.q.")]
    values[:, start] = np.linspace(0.2, 0.7, 3 * len(start)).reshape(3, -1)
    steps = LoopSettings(steps=30, step=2e-4, output_every=7, hold=3)

    def simulated(options: KernelOptions) -> Sequence[bytes]:
        runs = kernel(KernelSpec(structure, sampled, None, (), options)).run(values, steps)
        assert runs.trajectory is not None and np.isfinite(runs.trajectory).all()
        names = ("trajectory", "final_state", "metrics", "status", "end_time")
        return [getattr(runs, name).tobytes() for name in names]

    together = simulated(KernelOptions(engine="casadi", flags=("-O0",)))
    assert simulated(KernelOptions(alone=True, paired=True, flags=("-O0",))) == together
