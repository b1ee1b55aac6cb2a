"""Forces, friction, limits and tip wherever the loop is printed: engines, exported C and FMUs have the same bits."""

from __future__ import annotations

import ctypes
import io
import subprocess
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from fmi_client import Client, Values, client_library, refused

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.export.fmu import archive as fmu_module
from springline.codegen.files import write_tree
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, kernel
from springline.codegen.program import Program, program
from springline.model.drive import FRICTION
from springline.model.quantities import TIP, TIP_RATE
from springline.model.structure import SignalShape, Structure

STEP, STEPS, HOLD = 1e-4, 400, 10
QUICK = ("-O0",)  # optimisation changes no bit: test_engines.py, test_fmu.py and test_export_c.py compare its levels
ALL = tuple(item.name for item in FRICTION)
TIP_NAMES = [item.name for item in (*TIP, *TIP_RATE)]
SIZES = {
    "plant.spring_damping.0": 120.0, "plant.spring_damping.1": 1.5, "plant.link_viscous.0": 8.0,
    "plant.link_viscous.1": 0.4, "plant.link_coulomb.0": 20.0, "plant.link_coulomb.1": 2.0,
    "plant.motor_viscous.0": 3.0, "plant.motor_viscous.1": 0.02, "plant.motor_coulomb.0": 5.0,
    "plant.motor_coulomb.1": 0.05, "disturbance.lift.offset": -60.0, "disturbance.lift.terms.0.amplitude": 25.0,
    "disturbance.lift.terms.0.omega": 40.0, "disturbance.rotation.offset": 9.0,
}  # fmt: skip


@pytest.fixture(autouse=True)
def _fmus_that_are_compiled_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu_module, "_FLAGS", (*fmu_module._FLAGS, *QUICK))


@pytest.fixture(scope="module")
def loaded() -> Program:
    """The paper's arm with all friction, disturbed, on a base that moves in all ways."""
    shape = SignalShape("sine", (1, 1, 1))
    return program(Structure(base_motion=shape, friction=ALL, disturbance=SignalShape("sine", (1, 0))))


def rows_of(of: Program, values: np.ndarray, sampled: bool, every: int = HOLD, **options: Any) -> np.ndarray:
    loop = kernel(KernelSpec(of.system.structure, sampled, options=KernelOptions(flags=QUICK, **options)))
    runs = loop.run(values[None], LoopSettings(STEPS, STEP, hold=HOLD, output_every=every))
    assert runs.status[0] == 0 and runs.trajectory is not None
    return runs.trajectory[0]


def made(of: Program, values: np.ndarray, part: Any, folder: Path, **settings: Any) -> Client:
    """An instance of an FMU of this arm."""
    given = Settings(**({"duration": STEPS * STEP, "step": STEP} | settings))
    content = fmu(of.system.structure, values, given, part=part, version=3, identifier="arm", name="arm")
    path = folder / f"{part}{len(list(folder.iterdir()))}.fmu"
    path.write_bytes(content)
    return Client(path, folder)


def driven(client: Client, names: list[str]) -> np.ndarray:
    client.start()
    rows = [client.get(names)]
    for k in range(STEPS // HOLD):
        client.step(k * HOLD * STEP, HOLD * STEP)
        rows.append(client.get(names))
    return np.array(rows)


@pytest.mark.parametrize("sampled", [True, False], ids=["sampled", "continuous"])
def test_engines_and_fmus_have_the_same_bits(sampled: bool, loaded: Program, values_of: Values, tmp_path: Path) -> None:
    """Of every column that both show, force and tip among them."""
    values = values_of(loaded, SIZES)
    rows = rows_of(loaded, values, sampled, engine="casadi")
    for width, groups in ((1, 1), (4, 2), (8, 1)):
        np.testing.assert_array_equal(rows_of(loaded, values, sampled, width=width, groups=groups), rows)
    names = [entry.name for entry in loaded.system.trajectory[1:]]
    assert names[-14:] == ["disturbance_lift", "disturbance_rotation", *TIP_NAMES]
    client = made(loaded, values, "loop", tmp_path, period=HOLD * STEP if sampled else 0.0)
    np.testing.assert_array_equal(driven(client, names), rows[:, 1:])


def test_the_exported_plant_step_has_the_bits_of_the_loop(loaded: Program, values_of: Values, tmp_path: Path) -> None:
    """main.c steps the exported controller and plant under the exported signals; the self check replays vectors."""
    values = values_of(loaded, SIZES)
    write_tree(tmp_path / "c", *generate_files(bind(loaded.system.structure, values)))
    includes = [f"-I{tmp_path}/c/include", f"-I{tmp_path}/c/src"]
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", *QUICK, "-ffp-contract=off"]
    source = tmp_path / "c" / "src" / "springline.c"
    subprocess.run(["cc", *flags, *includes, source, tmp_path / "c" / "main.c", "-o", tmp_path / "main"], check=True)
    printed = subprocess.run([tmp_path / "main", "1"], capture_output=True, text=True, check=True).stdout.splitlines()
    header = printed[0].split(",")
    shown = np.array([[float(word) for word in line.split(",")] for line in printed[1:]])
    names = [entry.name for entry in loaded.system.trajectory]
    wanted = ["q1_lift", "q1_rotation", "U_lift", "U_rotation"]
    rows = rows_of(loaded, values, True, every=100)
    places = ([header.index(name) for name in wanted], [names.index(name) for name in wanted])
    np.testing.assert_array_equal(shown[: len(rows), places[0]], rows[:, places[1]])
    check = [source, tmp_path / "c" / "src" / "springline_model.c", tmp_path / "c" / "self_check.c"]
    subprocess.run(["cc", *flags, *includes, *check, "-o", tmp_path / "check"], check=True)
    subprocess.run([tmp_path / "check", tmp_path / "c" / "test_vectors.txt"], capture_output=True, check=True)


def test_the_loop_is_what_casadi_computes(loaded: Program, values_of: Values) -> None:
    """RK4 with CasADi's virtual machine, sampled: to rounding, as its elementary functions are the host's."""
    values, system = values_of(loaded, SIZES), loaded.system
    signals, plant, control = (system.function(name) for name in ("signals", "loop_plant", "loop_control"))
    x = system.function("start")(0.0, np.zeros(0), values)
    for k in range(50):
        w = [signals((k + c) * STEP, np.zeros(0), values) for c in (0.0, 0.5, 1.0)]
        u = control(w[0], x, values)[0] if k % HOLD == 0 else u  # noqa: F821 - of the sample before
        k1 = plant(w[0], x, u, values)
        k2 = plant(w[1], x + STEP / 2 * k1, u, values)
        k3 = plant(w[1], x + STEP / 2 * k2, u, values)
        x = x + STEP / 6 * (k1 + 2 * k2 + 2 * k3 + plant(w[2], x + STEP * k3, u, values))
    rows = rows_of(loaded, values, True, every=50, width=4)
    np.testing.assert_allclose(rows[1, 1:9], np.array(x)[:, 0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("part", ["loop", "plant"])
def test_forces_are_inputs_of_an_fmu_whose_scenario_has_none(part: Any, values_of: Values, tmp_path: Path) -> None:
    """A force that the importer holds is one that a scenario has; at zero it is none."""
    bare = program(Structure())
    names = [entry.name for entry in bare.system.trajectory[1:9]]
    forces = ["disturbance_lift", "disturbance_rotation"]
    client = made(bare, values_of(bare), part, tmp_path)
    assert set(forces) <= set(client.names("input")) and not set(forces) & set(client.names("output"))
    free = driven(client, names)
    pushed = made(bare, values_of(bare), part, tmp_path)
    pushed.slave.enterInitializationMode()
    pushed.set(forces, [-60.0, 9.0])
    pushed.slave.exitInitializationMode()
    rows = [pushed.get(names)]
    for k in range(STEPS // HOLD):
        pushed.step(k * HOLD * STEP, HOLD * STEP)
        rows.append(pushed.get(names))
    held = program(Structure(disturbance=SignalShape("sine", (0, 0))))
    offsets = {"disturbance.lift.offset": -60.0, "disturbance.rotation.offset": 9.0}
    if part == "loop":
        np.testing.assert_array_equal(free, rows_of(bare, values_of(bare), False)[:, 1:9])
        np.testing.assert_array_equal(rows, rows_of(held, values_of(held, offsets), False)[:, 1:9])
    else:
        own = made(held, values_of(held, offsets), part, tmp_path)
        assert set(forces) <= set(own.names("output"))
        np.testing.assert_array_equal(rows, driven(own, names))
    assert np.abs(np.array(rows) - free).max() > 1e-3


def test_the_tip_seen_from_earth_follows_a_base_that_the_importer_moves(values_of: Values, tmp_path: Path) -> None:
    """At once, and so its description says."""
    bare = program(Structure())
    client = made(bare, values_of(bare), "plant", tmp_path).start()
    before = dict(zip(TIP_NAMES, client.get(TIP_NAMES), strict=True))
    client.set(["y_r1", "d_y_r1"], [0.25, -2.0])
    after = dict(zip(TIP_NAMES, client.get(TIP_NAMES), strict=True))
    assert after["tip_y_inertial"] == before["tip_y_inertial"] + 0.25
    assert after["d_tip_y_inertial"] == before["d_tip_y_inertial"] - 2.0
    assert after["tip_y_ship"] == before["tip_y_ship"]
    structure = bare.system.structure
    content = fmu(structure, values_of(bare), Settings(1.0, STEP), part="plant", version=3, identifier="a", name="a")
    page = ET.fromstring(zipfile.ZipFile(io.BytesIO(content)).read("modelDescription.xml"))  # noqa: S314 - our own
    names = {v.get("valueReference"): v.get("name") for v in page.find("ModelVariables") or ()}
    depends = {
        names[output.get("valueReference")]: {names[k] for k in (output.get("dependencies") or "").split()}
        for output in page.iter("Output")
    }
    assert {"y_r1", "d_y_r1"} <= depends["d_tip_y_inertial"] and "disturbance_lift" not in depends["d_tip_y_inertial"]
    assert depends["tip_y_ship"] == depends["q1_lift"] == set()
    path = tmp_path / "valid.fmu"
    path.write_bytes(content)
    assert client_library("fmpy.validation").validate_fmu(str(path)) == []


def test_an_fmu_refuses_a_step_beyond_a_joints_limits(values_of: Values, tmp_path: Path) -> None:
    """Where a run of the scenario would end with out_of_limits; the last state stays."""
    bare = program(Structure())
    infinity = float("inf")
    limits = ((-infinity, 0.79), (-infinity, infinity))
    values = values_of(bare)
    loop = kernel(KernelSpec(bare.system.structure, options=KernelOptions(flags=QUICK)))
    ended = loop.run(values_of(bare, {"initial.q.0": 0.7})[None], LoopSettings(5000, STEP, limits=limits))
    at = round(float(ended.end_time[0]) / STEP)
    assert 10 < at < 5000 and ended.quantity[0] == 0
    values = values_of(bare, {"initial.q.0": 0.7})
    client = made(bare, values, "loop", tmp_path, limits=limits).start()
    for k in range(at):
        client.step(k * STEP, STEP)
    refused(client, lambda: client.step(at * STEP, STEP), "a joint would leave its limits (mechanism.limits)")
    assert client.get(["q1_lift"]) == [ended.final_state[0, 0]]


def test_a_plant_without_a_base_is_at_rest_and_undisturbed(loaded: Program, values_of: Values, tmp_path: Path) -> None:
    """base = NULL: as a base of zeros, forces among them."""
    write_tree(tmp_path / "c", *generate_files(bind(loaded.system.structure, values_of(loaded, SIZES))))
    (tmp_path / "both.c").write_text(
        '#include "springline.h"\n#include <string.h>\n'
        "int both(double *next) {\n"
        "  springline_controller c; springline_state a, b; springline_command u = {50.0, -3.0};\n"
        "  springline_base zero[SPRINGLINE_BASE_NODES];\n"
        "  memset(zero, 0, sizeof zero);\n"
        "  if (springline_init(&c, &springline_default_config) || springline_start(&c, &a)) return -1;\n"
        "  b = a;\n"
        "  if (springline_plant_step(&c, &a, &u, NULL, 1e-4)) return -1;\n"
        "  if (springline_plant_step(&c, &b, &u, zero, 1e-4)) return -1;\n"
        "  next[0] = a.dq1_lift; next[1] = b.dq1_lift;\n"
        "  zero[0].disturbance_lift = zero[1].disturbance_lift = zero[2].disturbance_lift = 100.0;\n"
        "  if (springline_plant_step(&c, &b, &u, zero, 1e-4)) return -1;\n"
        "  if (springline_plant_step(&c, &a, &u, NULL, 1e-4)) return -1;\n"
        "  next[2] = a.dq1_lift; next[3] = b.dq1_lift;\n"
        "  return 0;\n}\n"
    )
    sources = [tmp_path / "both.c", tmp_path / "c" / "src" / "springline.c"]
    library = tmp_path / "both.so"
    includes = [f"-I{tmp_path}/c/include", f"-I{tmp_path}/c/src"]
    subprocess.run(["cc", "-std=c99", "-shared", "-fPIC", *QUICK, *includes, *sources, "-o", library], check=True)
    values = (ctypes.c_double * 4)()
    assert ctypes.CDLL(str(library)).both(values) == 0
    assert values[0] == values[1] and values[3] > values[2]
