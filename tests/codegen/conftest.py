"""The paper's nominal numbers under a shake, for tests of the generated code that do without scenario files."""

import functools
import math
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from fmi_client import SAMPLED, Client, Values, arm
from numpy.typing import NDArray

from springline.codegen.export.fmu import Settings
from springline.codegen.program import Program, program
from springline.model.structure import SignalShape, Structure

NOMINAL = {
    "reference.lift.terms.0.amplitude": 1.0,
    "reference.lift.terms.0.omega": math.pi,
    "reference.rotation.offset": 1.0,
    "reference.rotation.terms.0.amplitude": 1.0,
    "reference.rotation.terms.0.omega": 0.5 * math.pi,
    "initial.q.0": 0.8,
    "initial.q.1": 0.5,
    "base_motion.heave.0.amplitude": 0.1,
    "base_motion.heave.0.omega": 10.0,
    "base_motion.pitch.0.amplitude": 0.05,
    "base_motion.pitch.0.omega": 3.0,
    "base_motion.roll.0.amplitude": 0.1,
    "base_motion.roll.0.omega": 2.0,
    "base_motion.roll.0.phase": 0.5,
}


@pytest.fixture(scope="session")
def structure() -> Structure:
    """The paper's arm with its own law, a base that shakes, pitches and rolls."""
    return Structure(base_motion=SignalShape("sine", (1, 1, 1)))


@pytest.fixture(scope="session")
def shaken(structure: Structure) -> Program:
    return program(structure)


@pytest.fixture(scope="session")
def values_of() -> Callable[..., NDArray[np.float64]]:
    """values_of(program, {key: value}): all slots, nominal but for the overrides."""

    def values(of: Program, overrides: dict[str, float] | None = None) -> NDArray[np.float64]:
        wanted = {**NOMINAL, **(overrides or {})}
        return np.array([wanted.get(slot.key, slot.default) for slot in of.system.slots])

    return values


@pytest.fixture(scope="session")
def build(
    once: Callable[[str, Callable[[Path], object]], Path], shaken: Program, values_of: Values
) -> Callable[[str, int, Settings], Path]:
    """build(part, version, settings): the FMU file of the shaken arm."""

    def built(part: str, version: int, settings: Settings = SAMPLED) -> Path:
        kind = "sampled" if settings.period else "continuous"
        name = f"{part}_{kind}_fmi{version}"
        content = functools.partial(arm, shaken, values_of(shaken), part, version, settings, name)
        return once(f"fmu/{name}.fmu", lambda path: path.write_bytes(content()))

    return built


@pytest.fixture
def open_fmu(tmp_path: Path) -> Iterator[Callable[[Path], Client]]:
    clients: list[Client] = []

    def opened(path: Path) -> Client:
        clients.append(Client(path, tmp_path))
        return clients[-1]

    yield opened
    for client in clients:
        client.slave.freeInstance()
