"""FMUs: what other tools find in them, that they compute what our own loop does to the last bit, and that they never crash.

Two clients that are not ours drive them: fmpy, and the container of fmu-manipulation-toolbox, which is an FMU itself.
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import math
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator, Sequence
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from numpy.typing import NDArray

from springline.codegen import toolchain
from springline.codegen.fmu import Settings, fmu
from springline.codegen.fmu_units import base_exponents
from springline.codegen.kernel import KernelOptions, LoopSettings, Table, kernel
from springline.codegen.program import Program, program
from springline.codegen.scalar import literal
from springline.model.base import COORDINATES
from springline.model.system import SignalShape, Structure

STEP, PERIOD, DURATION = 1e-4, 1e-3, 0.3
SAMPLED = Settings(duration=DURATION, step=STEP, period=PERIOD)
CONTINUOUS = Settings(duration=DURATION, step=STEP)
EVERY = 10  # steps per communication step

Values = Callable[..., NDArray[np.float64]]
Build = Callable[..., Path]


def client_library(module: str) -> Any:
    """A client that the tests need; without it they are skipped, in CI they fail."""
    if importlib.util.find_spec(module) is not None:
        return importlib.import_module(module)
    reason = f"{module} is not installed: pip install 'springline[fmu,dev]'"
    if os.environ.get("CI") == "true":
        pytest.fail(reason)
    pytest.skip(reason)


@pytest.fixture(scope="session")
def build(
    tmp_path_factory: pytest.TempPathFactory, shaken: Program, values_of: Values
) -> Callable[[str, int, Settings], Path]:
    """build(part, version, settings): the FMU file of the shaken arm."""
    folder = tmp_path_factory.mktemp("fmu")

    def built(part: str, version: int, settings: Settings = SAMPLED) -> Path:
        kind = "sampled" if settings.period else "continuous"
        path = folder / f"{part}_{kind}_fmi{version}.fmu"
        if not path.exists():
            path.write_bytes(arm(shaken, values_of(shaken), part, version, settings, path.stem))
        return path

    return built


def arm(of: Program, values: NDArray[np.float64], part: Any, version: Any, settings: Settings, name: str) -> bytes:
    return fmu(of.system.structure, values, settings, part=part, version=version, identifier=name, name=name)


class Client:
    """An FMU instance in fmpy: variables by name, messages kept."""

    def __init__(self, path: Path, folder: Path) -> None:
        fmpy = client_library("fmpy")
        self.description = fmpy.read_model_description(str(path))
        self.two = self.description.fmiVersion == "2.0"
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.messages: list[str] = []
        unzipped = folder / path.stem
        if not unzipped.exists():
            fmpy.extract(str(path), unzipdir=str(unzipped))
        module = importlib.import_module("fmpy.fmi2" if self.two else "fmpy.fmi3")
        self.slave = (module.FMU2Slave if self.two else module.FMU3Slave)(
            guid=self.description.guid,
            unzipDirectory=str(unzipped),
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="under test",
        )
        if self.two:
            callbacks = module.fmi2CallbackFunctions()
            callbacks.logger = module.fmi2CallbackLoggerTYPE(
                lambda _e, _n, _s, _c, message: self.messages.append(message.decode())
            )
            self.slave.instantiate(callbacks=callbacks)
        else:
            self.slave.instantiate(logMessage=lambda _e, _s, _c, message: self.messages.append(message.decode()))

    def start(self, time: float = 0.0, stop: float | None = None) -> Client:
        if self.two:
            self.slave.setupExperiment(startTime=time, stopTime=stop)
            self.slave.enterInitializationMode()
        else:
            self.slave.enterInitializationMode(startTime=time, stopTime=stop)
        self.slave.exitInitializationMode()
        return self

    def get(self, names: Sequence[str]) -> list[float]:
        read = self.slave.getReal if self.two else self.slave.getFloat64
        return list(read([self.references[name] for name in names]))

    def set(self, names: Sequence[str], values: Sequence[float]) -> None:
        write = self.slave.setReal if self.two else self.slave.setFloat64
        write([self.references[name] for name in names], list(values))

    def step(self, time: float, length: float = PERIOD) -> None:
        self.slave.doStep(currentCommunicationPoint=time, communicationStepSize=length)

    def save(self) -> Any:
        return self.slave.getFMUState() if not self.two else self.slave.getFMUState()

    def names(self, causality: str) -> list[str]:
        return [
            v.name for v in self.description.modelVariables if v.causality == causality and v.type in ("Real", "Float64")
        ]


@pytest.fixture
def open_fmu(tmp_path: Path) -> Iterator[Callable[[Path], Client]]:
    clients: list[Client] = []

    def opened(path: Path) -> Client:
        clients.append(Client(path, tmp_path))
        return clients[-1]

    yield opened
    for client in clients:
        client.slave.fmi2FreeInstance(client.slave.component) if client.two else client.slave.fmi3FreeInstance(
            client.slave.component
        )


def columns(of: Program) -> list[str]:
    """Names of a trajectory's columns after t, in the order of loop.c."""
    joints = [joint.name for joint in of.system.joints]
    quantities = ("q1", "dq1", "q2", "dq2", "q1d", "e", "sigma", "U")
    return [*(f"{q}_{joint}" for q in quantities for joint in joints), *(c.symbol for c in COORDINATES)]


def own_run(
    of: Program,
    values: NDArray[np.float64],
    sampled: bool,
    *,
    steps: int = round(DURATION / STEP),
    every: int = EVERY,
    start: float = 0.0,
    tables: Sequence[Table] = (),
) -> NDArray[np.float64]:
    """Our own loop's rows, without t."""
    loop = kernel(of.system.structure, sampled, KernelOptions(width=1, groups=1))
    settings = LoopSettings(
        steps=steps, step=STEP, hold=round(PERIOD / STEP), output_every=every, start_time=start
    )
    trajectory = loop.run(values[None, :], settings, tables).trajectory
    assert trajectory is not None
    return trajectory[0, :, 1:]


def driven(client: Client, names: Sequence[str], start: float = 0.0) -> NDArray[np.float64]:
    """The same rows from an FMU."""
    rows = [client.get(names)]
    for k in range(round(DURATION / STEP) // EVERY):
        client.step(start + k * EVERY * STEP, EVERY * STEP)
        rows.append(client.get(names))
    return np.array(rows)


# --- what is in the file ---------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("part", ["controller", "plant", "loop"])
def test_fmpy_finds_nothing_to_complain_about(build: Build, part: str, version: int) -> None:
    validation = client_library("fmpy.validation")
    assert validation.validate_fmu(str(build(part, version))) == []


@pytest.mark.parametrize("version", [2, 3])
def test_contents(build: Build, version: int) -> None:
    path = build("plant", version)
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        assert {entry.date_time for entry in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        root = ET.fromstring(archive.read("modelDescription.xml"))
        page = archive.read("documentation/index.html").decode()
    icon, licence = {
        2: ("model.png", "documentation/license.txt"),
        3: ("terminalsAndIcons/icon.png", "documentation/licenses/license.txt"),
    }[version]
    assert {icon, licence, "sources/all.c", "sources/buildDescription.xml"} <= names
    assert any(name.startswith("binaries/") for name in names)
    experiment = root.find("DefaultExperiment")
    assert experiment is not None
    assert (experiment.get("stopTime"), experiment.get("stepSize")) == (repr(DURATION), repr(PERIOD))
    shown = re.findall(r"<td><code>([^<]*)</code></td>", page)
    tag = "ScalarVariable" if version == 2 else "*"
    described = [v.get("name") for v in root.findall(f"ModelVariables/{tag}")]
    assert sorted(shown) == sorted(name for name in described if name != "time")
    assert not re.search(r"/(?:home|root|tmp|usr)/", page)


def test_parameters_have_units_starts_and_ranges(build: Build, shaken: Program, values_of: Values) -> None:
    fmpy = client_library("fmpy")
    values = dict(zip((slot.key for slot in shaken.system.slots), values_of(shaken), strict=True))
    seen = set()
    for part in ("controller", "plant", "loop"):
        description = fmpy.read_model_description(str(build(part, 3)))
        for variable in description.modelVariables:
            if variable.causality != "parameter":
                continue
            slot = next(slot for slot in shaken.system.slots if slot.key == variable.name)
            seen.add((part, slot.key))
            assert variable.unit == slot.unit
            assert float(variable.start) == values[slot.key]
            for bound, inside in ((variable.min, slot.bounds.low), (variable.max, slot.bounds.high)):
                assert bound is None or slot.bounds.holds(float(bound)) and abs(float(bound) - inside) < 1e-300 + 2e-16
            assert variable.variability == ("fixed" if slot.key.startswith("initial.") else "tunable")
    assert ("controller", "control.delta") in seen and ("controller", "plant.m3") not in seen
    assert ("plant", "plant.m3") in seen and ("plant", "control.delta") not in seen
    assert {key for part, key in seen if part == "loop"} >= {key for part, key in seen}


def test_units_are_products_of_base_units() -> None:
    assert base_exponents("N m s/rad") == {"kg": 1, "m": 2, "s": -1, "rad": -1}
    assert base_exponents("1/s") == {"s": -1}
    assert base_exponents("kg m^2") == {"kg": 1, "m": 2}
    assert base_exponents("1") == {}
    assert base_exponents("m or rad") is None
    assert base_exponents("SI") is None


def test_same_bytes_twice(shaken: Program, values_of: Values, build: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    path = build("controller", 3)
    monkeypatch.setenv("SPRINGLINE_CACHE", str(path.parent / "another cache"))  # compiled anew
    again = arm(shaken, values_of(shaken), "controller", 3, SAMPLED, path.stem)
    assert again == path.read_bytes()


def test_another_number_is_another_token(shaken: Program, values_of: Values, build: Build) -> None:
    fmpy = client_library("fmpy")
    path = build("controller", 3)
    other = path.with_name("other.fmu")
    other.write_bytes(
        arm(shaken, values_of(shaken, {"control.k1": 4.0}), "controller", 3, SAMPLED, path.stem)
    )
    tokens = {fmpy.read_model_description(str(p)).instantiationToken for p in (path, other)}
    assert len(tokens) == 2


def declared(version: int) -> set[str]:
    """Every function that the standard's header declares."""
    header = resources.files("springline.codegen") / "runtime" / "fmu" / f"fmi{version}Functions.h"
    return set(re.findall(rf"FMI{version}_Export +fmi{version}\w+TYPE +(\w+);", header.read_text()))


@pytest.mark.parametrize("version", [2, 3])
def test_exactly_the_functions_of_the_standard_are_exported(
    build: Build, version: int, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    nm = require_tool("nm")
    path = build("loop", version, CONTINUOUS if version == 2 else SAMPLED)
    with zipfile.ZipFile(path) as archive:
        binary = next(name for name in archive.namelist() if name.startswith("binaries/"))
        archive.extract(binary, tmp_path)
    listing = subprocess.run(
        [nm, "-D", "--defined-only", str(tmp_path / binary)], check=True, capture_output=True, text=True
    ).stdout
    exported = {line.split()[-1] for line in listing.splitlines() if not line.split()[-1].startswith("_")}
    assert len(declared(version)) == {2: 44, 3: 82}[version]
    assert exported == declared(version)


# --- the same numbers ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("version", "settings"), [(2, CONTINUOUS), (3, SAMPLED)])
def test_loop_is_our_own_run(
    build: Build,
    open_fmu: Callable[[Path], Client],
    shaken: Program,
    values_of: Values,
    version: int,
    settings: Settings,
) -> None:
    names = columns(shaken)
    client = open_fmu(build("loop", version, settings)).start()
    expected = own_run(shaken, values_of(shaken), settings is SAMPLED)
    np.testing.assert_array_equal(driven(client, names), expected)


@pytest.mark.parametrize("version", [2, 3])
def test_controller_and_plant_are_the_sampled_run(
    build: Build, open_fmu: Callable[[Path], Client], shaken: Program, values_of: Values, version: int
) -> None:
    controller, plant = (open_fmu(build(part, version)).start() for part in ("controller", "plant"))
    measured = [name for name in controller.names("input") if name in plant.names("output")]
    reference = [name for name in controller.names("input") if name not in measured]
    commands = plant.names("input")
    signals = shaken.system.function("signals")
    values = values_of(shaken)
    names = [name for name in columns(shaken) if not name.startswith("q1d_")]
    rows = []
    for k in range(round(DURATION / PERIOD) + 1):
        if k > 0:
            for client in (controller, plant):
                client.step((k - 1) * PERIOD)
        controller.set(reference, reference_at(k * PERIOD))
        controller.set(measured, plant.get(measured))
        plant.set(commands, controller.get(commands))
        rows.append([(controller if name in controller.names("output") else plant).get([name])[0] for name in names])
    assert signals is not None and len(reference) == 3 * shaken.system.n
    expected = own_run(shaken, values, True)
    kept = [columns(shaken).index(name) for name in names]
    np.testing.assert_array_equal(np.array(rows), expected[:, kept])
