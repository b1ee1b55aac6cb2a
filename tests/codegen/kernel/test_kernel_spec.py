"""KernelSpec: one kernel, and the key of every cache of kernels."""

import pickle
from dataclasses import replace
from typing import Any

import pytest

from springline.codegen.kernel import KernelOptions, KernelSpec, kernel, print_kernel
from springline.codegen.program import program
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

STRUCTURE = Structure()
KEYS = [slot.key for slot in System(STRUCTURE).slots]
BAKED = tuple(slot.default for slot in System(STRUCTURE).slots)
SPEC = KernelSpec(STRUCTURE, False, ("control.delta",), BAKED)


def baked_with(**values: float) -> tuple[float, ...]:
    return tuple(values.get(key.replace(".", "_"), value) for key, value in zip(KEYS, BAKED, strict=True))


def test_equal_specs_are_one_kernel() -> None:
    other = KernelSpec(Structure(), False, ("control.delta",), BAKED)
    assert other == SPEC
    assert kernel(other) is kernel(SPEC)


def test_what_a_tunable_slot_would_have_been_and_the_order_of_keys_do_not_matter() -> None:
    pair = ("plant.m3", "control.delta")
    assert replace(SPEC, baked=baked_with(control_delta=0.5)) == SPEC
    assert replace(SPEC, tunable=pair) == replace(SPEC, tunable=pair[::-1])
    assert replace(SPEC, tunable=pair).tunable == tuple(key for key in KEYS if key in pair)


@pytest.mark.parametrize("change", [
    {"structure": Structure(law="power")},
    {"sampled": True},
    {"tunable": ("control.delta", "plant.m3")},
    {"tunable": None, "baked": ()},
    {"baked": baked_with(plant_m3=41.0)},
    {"options": KernelOptions(width=4)},
])  # fmt: skip
def test_all_else_is_another_kernel(change: dict[str, Any]) -> None:
    assert replace(SPEC, **change) != SPEC


def test_zeros_of_both_signs_are_two_kernels() -> None:
    """As numbers they are equal, but the run that starts at rest would be given the other one's kernel."""
    plus, minus = (replace(SPEC, baked=baked_with(initial_dq_0=zero)) for zero in (0.0, -0.0))
    assert plus.baked == minus.baked
    assert plus != minus
    texts = [dict(print_kernel(program(STRUCTURE), spec).files)["kernel.h"] for spec in (plus, minus)]
    assert texts[0] != texts[1]
    assert kernel(plus) is not kernel(minus)


def test_a_spec_travels_to_another_process() -> None:
    sent = pickle.loads(pickle.dumps(SPEC))  # noqa: S301 # our own bytes
    assert sent == SPEC
    assert sent.constants == {key: value for key, value in zip(KEYS, BAKED, strict=True) if key != "control.delta"}


@pytest.mark.parametrize(("change", "message"), [
    ({"tunable": None}, f"baked has {len(BAKED)} values, expected none"),
    ({"baked": BAKED[1:]}, f"baked has {len(BAKED) - 1} values, expected {len(BAKED)}"),
    ({"baked": ()}, f"baked has 0 values, expected {len(BAKED)}"),
    ({"baked": baked_with(plant_m3=float("nan"))}, r"baked plant\.m3 is nan"),
    ({"tunable": ("control.dleta",)}, r"no parameter 'control\.dleta' .* nearest name is 'control\.delta'"),
    ({"options": KernelOptions(engine="casadi")}, "the casadi engine bakes no parameter"),
])  # fmt: skip
def test_what_does_not_fit_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(SPEC, **change)


@pytest.mark.parametrize(("options", "message"), [
    ({"engine": "numba"}, "engine is 'numba', expected one of lanes, casadi"),
    ({"width": 3}, "width is 3, expected a power of two"),
    ({"alone": True, "width": 8}, "width is 8, expected 2 or 4 for a run alone"),
    ({"alone": True, "groups": 2}, "groups is 2, expected 1 for a run alone"),
    ({"paired": True}, "paired is True, expected alone to be, too"),
    ({"width": 0}, "width is 0, expected a whole number from 1"),
    ({"groups": 1.5}, r"groups is 1\.5, expected a whole number"),
    ({"packs": -1}, "packs is -1, expected a whole number from 1"),
])  # fmt: skip
def test_options_that_no_kernel_can_have_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        KernelOptions(**options)


def test_a_program_of_another_structure_is_refused() -> None:
    other = program(Structure(base_motion=SignalShape("sine", (1, 0, 0))))
    with pytest.raises(ValueError, match="the program is of Structure"):
        print_kernel(other, SPEC)
