"""FMUs: what other tools find in them, that they compute our own loop to the last bit, and that they never crash.

Two clients that are not ours drive them: fmpy, and the container of fmu-manipulation-toolbox, which is an FMU itself.
"""

from __future__ import annotations

import ctypes
import importlib.util
import io
import itertools
import json
import math
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
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

    def names(self, causality: str) -> list[str]:
        return [
            v.name
            for v in self.description.modelVariables
            if v.causality == causality and v.type in ("Real", "Float64")
        ]


@pytest.fixture
def open_fmu(tmp_path: Path) -> Iterator[Callable[[Path], Client]]:
    clients: list[Client] = []

    def opened(path: Path) -> Client:
        clients.append(Client(path, tmp_path))
        return clients[-1]

    yield opened
    for client in clients:
        client.slave.freeInstance()


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
    settings = LoopSettings(steps=steps, step=STEP, hold=round(PERIOD / STEP), output_every=every, start_time=start)
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
        root = ET.fromstring(archive.read("modelDescription.xml"))  # noqa: S314 - our own
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
            for bound, outwards in ((variable.min, -math.inf), (variable.max, math.inf)):
                if bound is not None:  # the last number that is admissible
                    assert slot.bounds.holds(float(bound))
                    assert not slot.bounds.holds(math.nextafter(float(bound), outwards))
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


def test_another_number_is_another_token(
    shaken: Program, values_of: Values, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    binary = tmp_path / "library.so"
    binary.write_bytes(b"not built")
    monkeypatch.setattr(toolchain, "build_library", lambda *_, **__: binary)

    def token(overrides: dict[str, float], settings: Settings = SAMPLED) -> str:
        content = arm(shaken, values_of(shaken, overrides), "controller", 3, settings, "a")
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            found = re.search(rb'instantiationToken="([^"]+)"', archive.read("modelDescription.xml"))
            assert found is not None
            assert found[1] in archive.read("sources/fmu_token.h")
        return found[1].decode()

    first = token({})
    assert token({}) == first
    assert token({"control.k1": 4.0}) != first
    assert token({}, CONTINUOUS) != first


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
    assert len(declared(version)) == {2: 44, 3: 75}[version]
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
    guide = open_fmu(build("loop", version, CONTINUOUS if version == 2 else SAMPLED)).start()  # for its reference
    inputs, commands = controller.names("input"), plant.names("input")
    measured = [name for name in inputs if name in plant.references]
    reference = [name for name in inputs if name not in measured]
    assert len(measured) == len(reference) == 3 * shaken.system.n
    shown = [name for name in columns(shaken) if not name.startswith("q1d_")]
    sources = [controller if name in controller.names("output") else plant for name in shown]
    rows = []
    for k in range(round(DURATION / PERIOD) + 1):
        if k > 0:
            for client in (controller, plant, guide):
                client.step((k - 1) * PERIOD)
        controller.set(reference, guide.get(reference))
        controller.set(measured, plant.get(measured))
        plant.set(commands, controller.get(commands))
        rows.append([client.get([name])[0] for client, name in zip(sources, shown, strict=True)])
    expected = own_run(shaken, values_of(shaken), True)
    kept = [columns(shaken).index(name) for name in shown]
    np.testing.assert_array_equal(np.array(rows), expected[:, kept])


def test_sampled_controller_holds_between_samples(build: Build, open_fmu: Callable[[Path], Client]) -> None:
    client = open_fmu(build("controller", 3)).start()
    commands = ["U_lift", "U_rotation"]

    def command(q1: float) -> list[float]:
        client.set(["q1_lift", "q1d_lift"], [q1, 0.3])
        return client.get(commands)

    first = command(0.1)
    assert command(0.2) != first  # at a sample the command belongs to its inputs
    held = command(0.1)
    client.step(0.0, 0.4 * PERIOD)
    assert command(0.2) == held
    client.step(0.4 * PERIOD, 0.6 * PERIOD)
    sampled = command(0.2)
    assert sampled != held
    client.step(PERIOD, 1.5 * PERIOD)  # a sample on the way takes the inputs that are held
    assert command(0.7) == sampled
    client.set(["control.mu.0"], [20.0])
    assert command(0.7) == sampled
    client.step(2.5 * PERIOD, 0.5 * PERIOD)
    assert command(0.2) != sampled


def test_simulate_fmu_with_another_parameter(build: Build, shaken: Program, values_of: Values) -> None:
    fmpy = client_library("fmpy")
    names = columns(shaken)
    rows = fmpy.simulate_fmu(
        str(build("loop", 2, CONTINUOUS)),
        stop_time=DURATION,
        output_interval=EVERY * STEP,
        start_values={"control.delta": 0.02, "initial.q.0": 0.7},
        output=names,
    )
    expected = own_run(shaken, values_of(shaken, {"control.delta": 0.02, "initial.q.0": 0.7}), False)
    np.testing.assert_array_equal(np.column_stack([rows[name] for name in names]), expected)


def test_a_tunable_parameter_counts_from_where_it_is_set(build: Build, open_fmu: Callable[[Path], Client]) -> None:
    tuned, fresh = (open_fmu(build("loop", 3)) for _ in range(2))
    tuned.start()
    before = tuned.get(["U_lift"])
    tuned.set(["control.mu.0"], [20.0])
    fresh.set(["control.mu.0"], [20.0])
    fresh.start()
    assert tuned.get(["U_lift"]) == fresh.get(["U_lift"]) != before
    np.testing.assert_array_equal(driven(tuned, ["q1_lift"]), driven(fresh, ["q1_lift"]))


def test_start_time_and_uneven_communication_steps(
    build: Build, open_fmu: Callable[[Path], Client], shaken: Program, values_of: Values
) -> None:
    names, start = columns(shaken), 0.25
    client = open_fmu(build("loop", 2, CONTINUOUS)).start(start)
    expected = own_run(shaken, values_of(shaken), False, start=start)
    np.testing.assert_array_equal(driven(client, names, start), expected)

    uneven = open_fmu(build("loop", 2, CONTINUOUS)).start(start)
    times = start + DURATION * np.array([0.0, 0.1001, 0.33333, 0.5, 0.50001, 1.0])
    for time, after in itertools.pairwise(times):
        uneven.step(time, after - time)
    np.testing.assert_allclose(uneven.get(names[:8]), expected[-1, :8], rtol=0, atol=1e-7)  # RK4 at other steps
    assert uneven.get(["time"]) == [times[-1]]


def test_table_signals(open_fmu: Callable[[Path], Client], values_of: Values, tmp_path: Path) -> None:
    moved = program(Structure(base_motion=SignalShape("table", (1, 0, 1))))
    random = np.random.default_rng(474)
    table = Table(-0.05, 0.0625, True, random.normal(0.0, 0.1, (4, 2, 4)))
    values = values_of(moved)
    path = tmp_path / "table.fmu"
    ending = replace(SAMPLED, since=0.0, until=DURATION)
    content = fmu(
        moved.system.structure, values, ending, part="loop", version=3, identifier="table", name="table", tables=[table]
    )
    path.write_bytes(content)
    names = columns(moved)
    client = open_fmu(path).start()
    np.testing.assert_array_equal(driven(client, names), own_run(moved, values, True, tables=[table]))
    refused(client, lambda: client.step(DURATION), "the scenario's tables end at 0.29999999999999999 s")
    early = open_fmu(path)
    refused(early, lambda: early.start(-0.1), "the scenario's tables begin at 0 s")


@pytest.mark.parametrize("version", [2, 3])
def test_in_the_container_of_another_tool(
    build: Build,
    open_fmu: Callable[[Path], Client],
    shaken: Program,
    values_of: Values,
    tmp_path: Path,
    version: int,
) -> None:
    client_library("fmu_manipulation_toolbox")
    settings = CONTINUOUS if version == 2 else SAMPLED
    path = build("loop", version, settings)
    plan = {"name": "box.fmu", "fmu": [path.name], "auto_output": True, "step_size": EVERY * STEP}
    (tmp_path / "box.json").write_text(json.dumps(plan))
    (tmp_path / path.name).write_bytes(path.read_bytes())
    call = "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer; fmucontainer()"
    arguments = ["-fmu-directory", ".", "-container", "box.json", "-fmi", str(version)]
    subprocess.run([sys.executable, "-c", call, *arguments], check=True, cwd=tmp_path, capture_output=True)
    names = columns(shaken)
    rows = driven(open_fmu(tmp_path / "box.fmu").start(stop=DURATION), names)
    np.testing.assert_array_equal(rows, own_run(shaken, values_of(shaken), settings is SAMPLED))


@pytest.mark.parametrize("version", [2, 3])
def test_built_from_its_own_sources(
    build: Build,
    open_fmu: Callable[[Path], Client],
    shaken: Program,
    values_of: Values,
    tmp_path: Path,
    require_tool: Callable[..., str],
    version: int,
) -> None:
    require_tool("cmake")
    fmpy = client_library("fmpy")
    settings = CONTINUOUS if version == 2 else SAMPLED
    path = build("loop", version, settings)
    folder = tmp_path / path.stem  # where open_fmu looks before it unzips
    fmpy.extract(str(path), unzipdir=str(folder))
    (shipped,) = (folder / "binaries").rglob("*.*")
    before = shipped.read_bytes()
    shipped.unlink()
    client_library("fmpy.build").build_platform_binary(folder, configuration="Release")
    assert shipped.read_bytes() != before  # other flags, same results
    client = open_fmu(path).start()
    np.testing.assert_array_equal(
        driven(client, columns(shaken)), own_run(shaken, values_of(shaken), settings is SAMPLED)
    )


# --- life of an instance ---------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [2, 3])
def test_state_is_saved_restored_and_serialised(build: Build, open_fmu: Callable[[Path], Client], version: int) -> None:
    path = build("loop", version, CONTINUOUS if version == 2 else SAMPLED)
    client = open_fmu(path).start()
    outputs = client.names("output")
    client.step(0.0, 7 * STEP)  # between two samples
    state = client.slave.getFMUState()
    data = client.slave.serializeFMUState(state)

    def onwards(of: Client) -> list[list[float]]:
        rows = []
        for k in range(5):
            of.step((7 + 9 * k) * STEP, 9 * STEP)
            rows.append(of.get(outputs))
        return rows

    first = onwards(client)
    client.set(["control.delta"], [0.5])
    client.slave.setFMUState(state)
    assert client.get(["control.delta"]) == [0.05]
    assert onwards(client) == first
    other = open_fmu(path)  # another instance, never initialised
    foreign = other.slave.deserializeFMUState(data)
    other.slave.setFMUState(foreign)
    assert other.get(["time"]) == [7 * STEP]
    assert onwards(other) == first
    assert other.slave.serializeFMUState(foreign) == data
    spoilt = bytearray(data)
    spoilt[100] ^= 1
    for bad in (bytes(spoilt), data[:-1], b""):
        with pytest.raises(Exception, match=r"[Dd]e[sS]erialize"):
            other.slave.deserializeFMUState(bad)
    for instance, kept in ((client, state), (other, foreign)):
        instance.slave.freeFMUState(kept)


@pytest.mark.parametrize("version", [2, 3])
def test_instances_are_independent_and_reset(build: Build, open_fmu: Callable[[Path], Client], version: int) -> None:
    path = build("loop", version, CONTINUOUS if version == 2 else SAMPLED)
    alone = driven(open_fmu(path).start(), ["q1_lift", "U_lift"])
    one, other = open_fmu(path), open_fmu(path)
    other.set(["control.mu.0", "initial.q.0"], [30.0, 0.2])
    one.start(), other.start()
    rows = [one.get(["q1_lift", "U_lift"])]
    for k in range(round(DURATION / STEP) // EVERY):
        for client in (other, one):
            client.step(k * EVERY * STEP)
        rows.append(one.get(["q1_lift", "U_lift"]))
    np.testing.assert_array_equal(np.array(rows), alone)
    other.slave.reset()
    assert other.get(["control.mu.0", "initial.q.0", "time"]) == [12.0, 0.8, 0.0]
    np.testing.assert_array_equal(driven(other.start(), ["q1_lift", "U_lift"]), alone)


@pytest.mark.parametrize("version", [2, 3])
def test_ten_thousand_instances_leave_nothing_behind(
    build: Build, open_fmu: Callable[[Path], Client], version: int
) -> None:
    statm = Path("/proc/self/statm")
    if not statm.exists():
        pytest.skip("the resident set is read from /proc, which only Linux has")
    slave = open_fmu(build("controller", version)).slave
    if version == 2:
        make = (b"x", 1, slave.guid.encode(), None, ctypes.byref(slave.callbacks), 0, 0)
        instantiate, free = slave.dll.fmi2Instantiate, slave.dll.fmi2FreeInstance
        get, drop = slave.dll.fmi2GetFMUstate, slave.dll.fmi2FreeFMUstate
    else:
        make = (
            b"x",
            slave.guid.encode(),
            None,
            *[False] * 4,
            None,
            0,
            None,
            slave.logMessage,
            slave.intermediateUpdate,
        )
        instantiate, free = slave.dll.fmi3InstantiateCoSimulation, slave.dll.fmi3FreeInstance
        get, drop = slave.dll.fmi3GetFMUState, slave.dll.fmi3FreeFMUState
    instantiate.restype = ctypes.c_void_p

    def cycle() -> None:
        instance, state = ctypes.c_void_p(instantiate(*make)), ctypes.c_void_p()
        assert instance
        assert get(instance, ctypes.byref(state)) == 0 == drop(instance, ctypes.byref(state))
        free(instance)

    def resident() -> int:
        return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    for _ in range(500):
        cycle()
    before = resident()
    for _ in range(10_000):
        cycle()
    assert resident() - before < 200_000  # an instance has some 1,000 bytes: a leak would be 10 MB


# --- what goes wrong -------------------------------------------------------------------------------------


def refused(client: Client, action: Callable[[], object], text: str) -> None:
    """The action is an FMI error, and its message says `text`."""
    before = len(client.messages)
    with pytest.raises(Exception, match="fmi"):
        action()
    assert len(client.messages) == before + 1, client.messages
    assert text in client.messages[-1]


@pytest.mark.parametrize("version", [2, 3])
def test_wrong_values_are_refused_and_change_nothing(
    build: Build, open_fmu: Callable[[Path], Client], version: int
) -> None:
    client = open_fmu(build("controller", version)).start()
    inputs = client.names("input")
    client.set(inputs, [0.1] * len(inputs))
    before = client.get(list(client.names("output")))
    nan, inf = float("nan"), float("inf")
    for name, value, expected in (
        ("control.delta", -1.0, "control.delta is -1, expected a number >= 0"),
        ("control.alpha", 1.0, "expected a number in (0, 1)"),
        ("control.nu", 3.0, "expected a positive even integer"),
        ("control.mu.0", 0.0, "expected a number > 0"),
        ("control.k1", inf, "expected a number > 0"),
        ("control.U_max.0", -inf, "expected a number > 0 (inf means no limit)"),
        ("control.U_max.0", nan, "control.U_max.0 is"),
        ("q1_lift", nan, "q1_lift is"),
        ("q1d_rotation", inf, "q1d_rotation is inf, expected a finite number"),
        ("U_lift", 1.0, "U_lift is neither a parameter nor an input"),
        ("time", 1.0, "time is neither a parameter nor an input"),
    ):
        refused(client, lambda name=name, value=value: client.set([name], [value]), expected)
    assert client.get(client.names("output")) == before
    client.set(["control.U_max.0"], [inf])
    client.references["nobody"] = 9999
    client.references["flag"] = client.references["saturated_lift"]
    refused(client, lambda: client.get(["nobody"]), "there is no value reference 9999")
    refused(client, lambda: client.set(["nobody"], [0.0]), "there is no value reference 9999")
    refused(client, lambda: client.get(["flag"]), "saturated_lift is of another type")


@pytest.mark.parametrize("version", [2, 3])
def test_steps_that_cannot_be(build: Build, open_fmu: Callable[[Path], Client], version: int) -> None:
    client = open_fmu(build("plant", version))
    refused(client, lambda: client.step(0.0), "may not be called before initialization")
    client.start(stop=1.0)
    refused(client, lambda: client.set(["initial.q.0"], [0.1]), "initial.q.0 is fixed after initialization")
    for time, length, text in (
        (0.0, 0.0, "impossible"),
        (0.0, -PERIOD, "impossible"),
        (0.0, float("nan"), "impossible"),
        (0.0, 1e308, "stops at 1 s"),
        (0.5, PERIOD, "the instance is at 0 s"),
    ):
        refused(client, lambda time=time, length=length: client.step(time, length), text)
    client.step(0.0)
    client.set(["U_lift"], [1e300])
    refused(client, lambda: client.step(PERIOD), "the plant left the finite numbers")
    refused(client, lambda: client.step(PERIOD), "may not be called after an error")
    assert all(np.isfinite(client.get(client.names("output"))))
    client.slave.reset()
    client.start().step(0.0)


@pytest.mark.parametrize("version", [2, 3])
def test_null_pointers_and_foreign_tokens(build: Build, open_fmu: Callable[[Path], Client], version: int) -> None:
    """Called as C may call it: with nothing where something is expected. Errors, never a crash."""
    client = open_fmu(build("plant", version))
    dll = client.slave.dll
    nothing = [ctypes.c_void_p()] * 14
    for name in sorted(declared(version) - {"fmi2GetTypesPlatform", f"fmi{version}GetVersion"}):
        function = dll[name]
        if "Instantiate" in name:
            function.restype = ctypes.c_void_p
            assert function(*nothing) is None
        elif name.endswith("FreeInstance"):
            function(*nothing)
        else:
            assert function(*nothing) in (2, 3), name  # discard or error
    instance = ctypes.c_void_p(client.slave.component)
    reference = (ctypes.c_uint * 1)(0)
    get = dll[f"fmi{version}GetReal" if version == 2 else "fmi3GetFloat64"]
    size = ctypes.c_size_t(1)
    assert get(instance, None, size, None, size) == 3
    assert get(instance, reference, size, None, size) == 3
    assert get(instance, None, ctypes.c_size_t(0), None, ctypes.c_size_t(0)) == 0
    assert len(client.messages) == 2
    token = client.slave.guid
    client.slave.guid = "{another}"
    again = {"callbacks": client.slave.callbacks} if version == 2 else {"logMessage": client.slave.logMessage}
    with pytest.raises(Exception, match="instantiate"):
        client.slave.instantiate(**again)
    client.slave.guid, client.slave.component = token, instance.value
    assert "the token is {another}" in client.messages[-1]


def test_prefixed_functions_link_into_one_program(
    build: Build, tmp_path: Path, require_tool: Callable[..., str]
) -> None:
    """Two FMUs of two versions in one C program, as the standards' prefix rules have it."""
    compiler = toolchain.find_compiler().argv
    objects = []
    for part, version in (("controller", 2), ("plant", 3)):
        path = build(part, version)
        folder = tmp_path / path.stem
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
        objects.append(str(tmp_path / f"{path.stem}.o"))
        prefix = f"-DFMI{version}_FUNCTION_PREFIX={path.stem}_"
        source = str(folder / "sources" / "all.c")
        subprocess.run([*compiler, "-std=c99", "-O0", prefix, "-c", source, "-o", objects[-1]], check=True)
    main = tmp_path / "main.c"
    main.write_text(
        "#include <stdio.h>\n"
        "const char *controller_sampled_fmi2_fmi2GetVersion(void);\n"
        "const char *plant_sampled_fmi3_fmi3GetVersion(void);\n"
        "int main(void) {\n"
        '  printf("%s %s", controller_sampled_fmi2_fmi2GetVersion(), plant_sampled_fmi3_fmi3GetVersion());\n'
        "  return 0;\n}\n"
    )
    subprocess.run([*compiler, str(main), *objects, "-o", str(tmp_path / "both")], check=True)
    assert subprocess.run([tmp_path / "both"], check=True, capture_output=True, text=True).stdout == "2.0 3.0"


def test_unusable_arguments(shaken: Program, values_of: Values) -> None:
    values = values_of(shaken)
    with pytest.raises(ValueError, match="no C identifier"):
        arm(shaken, values, "plant", 3, SAMPLED, "two words")
    with pytest.raises(ValueError, match="1 tables given, the system has 0"):
        fmu(
            shaken.system.structure,
            values,
            SAMPLED,
            part="plant",
            version=3,
            identifier="a",
            name="a",
            tables=[Table(0.0, 1.0, False, np.zeros((1, 1, 4)))],
        )
