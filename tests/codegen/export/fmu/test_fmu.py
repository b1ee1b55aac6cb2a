"""FMUs: what other tools find in them, that they compute our own loop to the last bit, and that they never crash.

Two clients that are not ours drive them: fmpy, and the container of fmu-manipulation-toolbox, which is an FMU itself.
"""

from __future__ import annotations

import ctypes
import html
import io
import json
import os
import re
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from importlib import resources
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmi_client import (
    CONTINUOUS,
    DURATION,
    EVERY,
    PERIOD,
    SAMPLED,
    STEP,
    TIMING,
    Build,
    Open,
    Values,
    arm,
    client_library,
    columns,
    driven,
    own_run,
    refused,
)
from numpy.typing import NDArray

from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.export.fmu.units import base_exponents
from springline.codegen.kernel import toolchain
from springline.codegen.program import Program, SignalTable, program
from springline.model.structure import SignalShape, Structure

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
    assert html.escape(TIMING) in page
    icon, licence = {
        2: ("model.png", "documentation/license.txt"),
        3: ("terminalsAndIcons/icon.png", "documentation/licenses/license.txt"),
    }[version]
    assert {icon, licence, "sources/all.c", "sources/buildDescription.xml"} <= names
    assert any(name.startswith("binaries/") for name in names)
    experiment = root.find("DefaultExperiment")
    assert experiment is not None
    assert (experiment.get("stopTime"), experiment.get("stepSize")) == (repr(DURATION), repr(STEP))
    shown = re.findall(r"<td><code>([^<]*)</code></td>", page)
    tag = "ScalarVariable" if version == 2 else "*"
    described = [v.get("name") for v in root.findall(f"ModelVariables/{tag}")]
    assert sorted(shown) == sorted(name for name in described if name != "time")
    assert not re.search(r"/(?:home|root|tmp|usr)/", page)


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
    open_fmu: Open,
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
    build: Build, open_fmu: Open, shaken: Program, values_of: Values, version: int
) -> None:
    controller, plant = (open_fmu(build(part, version)).start() for part in ("controller", "plant"))
    guide = open_fmu(build("loop", version, CONTINUOUS if version == 2 else SAMPLED)).start()  # for its reference
    inputs = controller.names("input")
    commands = [name for name in plant.names("input") if name.startswith("U_")]  # all else stays at zero
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


@pytest.mark.parametrize("version", [2, 3])
def test_the_proposed_step_is_stable_where_values_are_exchanged_after_it(
    build: Build, open_fmu: Open, shaken: Program, values_of: Values, version: int
) -> None:
    """A master that steps first and then exchanges is a step late, which the proposed step size has to allow for."""

    def late(step: float) -> NDArray[np.float64]:
        controller, plant = (open_fmu(build(part, version)).start() for part in ("controller", "plant"))
        guide = open_fmu(build("loop", version, CONTINUOUS if version == 2 else SAMPLED)).start()
        inputs = controller.names("input")
        commands = [name for name in plant.names("input") if name.startswith("U_")]  # all else stays at zero
        sources = [plant if name in plant.references else guide for name in inputs]
        for k in range(round(DURATION / step)):
            given = controller.get(commands)  # belongs to the inputs of one step ago
            controller.set(inputs, [source.get([name])[0] for source, name in zip(sources, inputs, strict=True)])
            plant.set(commands, given if k > 0 else controller.get(commands))
            for client in (controller, plant, guide):
                client.step(k * step, step)
        return np.array(plant.get(columns(shaken)[:2]))

    description = open_fmu(build("controller", version)).description
    proposed = float(description.defaultExperiment.stepSize)
    on_time = own_run(shaken, values_of(shaken), True)[-1, :2]
    for step in (proposed, 5e-4):  # the latter is what docs/fmu.md allows for this arm
        np.testing.assert_allclose(late(step), on_time, rtol=0, atol=1e-3)
    with pytest.raises(Exception, match="fmi"):
        late(1e-3)  # what it forbids


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


def test_table_signals(open_fmu: Open, values_of: Values, tmp_path: Path) -> None:
    moved = program(Structure(base_motion=SignalShape("table", (1, 0, 1))))
    random = np.random.default_rng(474)
    table = SignalTable(-0.05, 0.0625, True, random.normal(0.0, 0.1, (4, 2, 4)))
    values = values_of(moved)
    path = tmp_path / "table.fmu"
    ending = replace(SAMPLED, until=DURATION)
    content = fmu(
        moved.system.structure, values, ending, part="loop", version=3, identifier="table", name="table", tables=[table]
    )
    path.write_bytes(content)
    names = columns(moved)
    client = open_fmu(path).start()
    np.testing.assert_array_equal(driven(client, names), own_run(moved, values, True, tables=[table]))
    refused(client, lambda: client.step(DURATION), "the scenario's tables end at 0.29999999999999999 s")


@pytest.mark.parametrize("version", [2, 3])
def test_in_the_container_of_another_tool(
    build: Build,
    open_fmu: Open,
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
    open_fmu: Open,
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
def test_instances_are_independent_and_reset(build: Build, open_fmu: Open, version: int) -> None:
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
def test_ten_thousand_instances_leave_nothing_behind(build: Build, open_fmu: Open, version: int) -> None:
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


@pytest.mark.parametrize("version", [2, 3])
def test_wrong_values_are_refused_and_change_nothing(build: Build, open_fmu: Open, version: int) -> None:
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
        ("control.U_max.0", -inf, "expected a number > 0 (1e+300 or more means no limit)"),
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
def test_steps_that_cannot_be(build: Build, open_fmu: Open, version: int) -> None:
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


@pytest.mark.parametrize(("settings", "version"), [(SAMPLED, 2), (CONTINUOUS, 3)])
@pytest.mark.parametrize("part", ["controller", "loop"])
def test_a_law_that_overflows_before_a_max_is_an_error(
    build: Build, open_fmu: Open, part: str, settings: Settings, version: int
) -> None:
    client = open_fmu(build(part, version, settings))
    client.set(["control.k1"], [1e308])

    def begin() -> None:
        client.start()
        if part == "controller":
            client.set(["q1d_lift", "q1d_rotation"], [1.0, 1.0])
            client.get(["U_lift"])

    refused(client, begin, "the law left the finite numbers")


@pytest.mark.parametrize("version", [2, 3])
def test_null_pointers_and_foreign_tokens(build: Build, open_fmu: Open, version: int) -> None:
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
            tables=[SignalTable(0.0, 1.0, False, np.zeros((1, 1, 4)))],
        )
