"""Expressions derived in several threads: the switch of one never shows in the other's."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from threading import Event

import casadi as ca

from springline.model.structure import SignalShape, Structure
from springline.model.symbolic import as_written, derivation, derived_property
from springline.model.system import System, system_of


def _instructions(function: ca.Function) -> list[object]:
    return [
        (function.instruction_id(k), tuple(function.instruction_input(k)), tuple(function.instruction_output(k)))
        for k in range(function.n_instructions())
    ]


def _derived(structure: Structure) -> dict[str, list[object]]:
    """All Functions of a system of its own: nothing of it is known yet."""
    return {name: _instructions(function) for name, function in System(structure).functions.items()}


def test_systems_derived_side_by_side_are_those_derived_alone() -> None:
    structures = [Structure(), Structure(base_motion=SignalShape("sine", (1, 1, 1))), Structure(drive="rigid")]
    alone = [_derived(structure) for structure in structures]
    ended = Event()

    def switching() -> None:
        while not ended.is_set():
            with as_written():
                time.sleep(1e-3)
            time.sleep(1e-4)

    with ThreadPoolExecutor(4) as threads:
        switches = threads.submit(switching)
        try:
            together = list(threads.map(_derived, structures))
        finally:
            ended.set()
        switches.result()
    assert together == alone


def test_what_is_derived_is_derived_once() -> None:
    class Slow:
        count = 0

        @derived_property
        def value(self) -> int:
            time.sleep(0.05)
            Slow.count += 1
            return Slow.count

    slow = Slow()
    with ThreadPoolExecutor(4) as threads:
        assert set(threads.map(lambda _: slow.value, range(4))) == {1}
    structure = Structure(drive="rigid", start="reference", base_motion=SignalShape("sine", (4, 0, 4)))
    with ThreadPoolExecutor(4) as threads:
        assert len({id(each) for each in threads.map(lambda _: system_of(structure), range(4))}) == 1


def test_one_thread_derives_at_a_time() -> None:
    inside = 0

    @derivation
    def derive(_: int) -> int:
        nonlocal inside
        inside += 1
        time.sleep(0.01)
        seen = inside
        inside -= 1
        return seen

    with ThreadPoolExecutor(4) as threads:
        assert set(threads.map(derive, range(8))) == {1}
    derive(0)


def test_a_derivation_may_contain_another() -> None:
    @derivation
    def inner() -> bool:
        return bool(ca.GlobalOptions.getSimplificationOnTheFly())

    @derivation
    def outer() -> tuple[bool, bool]:
        with as_written():
            literal = inner()
        return literal, inner()

    assert outer() == (False, True)
