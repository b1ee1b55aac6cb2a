"""Packaged controllers with observers have the same bits in every engine, exported C and FMUs."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import structure_of, values_of
from fmi_client import Client, check_restored

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.files import write_tree
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, Runs, kernel
from springline.model.structure import SignalShape, Structure
from springline.model.system import System

STEP, STEPS, HOLD = 1e-4, 400, 10

CASES: list[dict[str, Any]] = [
    {"controller": "super_twisting", "observer": "extended_state", "observer_input": "spring"},
    {"controller": "nonsingular_terminal", "observer": "disturbance", "drive": "rigid"},
    {"controller": "computed_torque", "observer": "disturbance", "feedforward": "base"},
]
cases = pytest.mark.parametrize("chosen", CASES, ids=lambda chosen: str(chosen["controller"]))


def case(chosen: dict[str, Any]) -> tuple[Structure, np.ndarray]:
    structure = structure_of("transfer_manipulator", **chosen)
    start = {"initial.q.0": 0.01, "initial.q.1": 0.99, "initial.dq.0": 3.0, "initial.dq.1": 1.5}
    return structure, values_of(structure, {"control.U_max.0": 700.0, "control.U_max.1": 400.0} | start)


def run(structure: Structure, sampled: bool, values: np.ndarray, every: int, **options: Any) -> Runs:
    loop = kernel(KernelSpec(structure, sampled, options=KernelOptions(**options)))
    return loop.run(np.atleast_2d(values), LoopSettings(STEPS, STEP, hold=HOLD, output_every=every))


@cases
@pytest.mark.parametrize("sampled", [True, False])
def test_engines_have_the_same_bits(chosen: dict[str, Any], sampled: bool) -> None:
    structure, values = case(chosen)
    many = np.array([values] * 5)
    many[:, [slot.key for slot in System(structure).slots].index("initial.q.0")] = 0.02 * np.arange(5)
    reference = run(structure, sampled, many, 3, engine="casadi")
    assert (reference.status == 0).all()
    at = [entry.name for entry in System(structure).trajectory]
    commands = np.abs(reference.trajectory[:, :, [at.index("U_lift"), at.index("U_rotation")]])
    assert 0.01 < np.mean(commands == [700.0, 400.0]) < 0.99  # limited now and then
    runs = run(structure, sampled, many, 3, width=4)
    np.testing.assert_array_equal(runs.trajectory, reference.trajectory)
    np.testing.assert_array_equal(runs.metrics, reference.metrics)


@cases
def test_exported_c_checks_itself_and_runs_as_the_loop(chosen: dict[str, Any], tmp_path: Path) -> None:
    structure, values = case(chosen)
    files = generate_files(bind(structure, values, prefix="arm", tunable=["control"], period=HOLD * STEP))
    write_tree(tmp_path, *files)
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O1", "-ffp-contract=off"]
    flags += [f"-I{tmp_path}/include", f"-I{tmp_path}/src"]

    def built(*sources: str) -> Path:
        program = tmp_path / sources[-1].removesuffix(".c")
        subprocess.run(["cc", *flags, *(tmp_path / source for source in sources), "-o", program], check=True)
        return program

    check = built("src/arm.c", "src/arm_model.c", "self_check.c")
    done = subprocess.run([check, tmp_path / "test_vectors.txt"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    main = built("src/arm.c", "main.c")
    printed = subprocess.run([main, "1"], capture_output=True, text=True, check=True).stdout.splitlines()
    header, rows = printed[0].split(","), np.array([[float(word) for word in line.split(",")] for line in printed[1:]])
    names = [entry.name for entry in System(structure).trajectory]
    own = run(structure, True, values, 100).trajectory[0][:, [names.index(name) for name in header]]
    np.testing.assert_array_equal(rows[: len(own), 1:], own[:, 1:])


@cases
def test_the_loop_in_an_fmu_is_the_loop(chosen: dict[str, Any], tmp_path: Path) -> None:
    structure, values = case(chosen)
    settings = Settings(duration=STEPS * STEP, step=STEP, period=HOLD * STEP)
    content = fmu(structure, values, settings, part="loop", version=3, identifier="observed", name="observed")
    (tmp_path / "loop.fmu").write_bytes(content)
    client = Client(tmp_path / "loop.fmu", tmp_path).start()
    names = [entry.name for entry in System(structure).trajectory][1:]
    rows = [client.get(names)]
    for k in range(0, STEPS, 5):
        client.step(k * STEP, 5 * STEP)
        rows.append(client.get(names))
    np.testing.assert_array_equal(rows, run(structure, True, values, 5).trajectory[0][:, 1:])
    client.slave.freeInstance()


@pytest.mark.parametrize("version", [2, 3])
def test_a_saved_state_of_an_fmu_carries_controller_and_observer(version: Any, tmp_path: Path) -> None:
    structure, values = case(CASES[0])
    settings = Settings(duration=STEPS * STEP, step=STEP, period=HOLD * STEP)
    content = fmu(structure, values, settings, part="loop", version=version, identifier="kept", name="kept")
    (tmp_path / "kept.fmu").write_bytes(content)
    names = ["z_nu_lift", "z_nu_rotation", "z_v_hat_lift", "z_d_hat_lift", "z_d_hat_rotation", "U_lift", "q1_rotation"]
    check_restored(tmp_path / "kept.fmu", tmp_path, names, HOLD * STEP / 2, 7, 60)  # saved between two samples


def test_an_importer_s_base_reaches_the_controller(tmp_path: Path) -> None:
    """A loop whose base the importer moves computes the command of the exported control at that motion."""
    structure, values = case({"controller": "computed_torque", "feedforward": "base", "base_motion": SignalShape()})
    values[[slot.key.startswith("control.U_max") for slot in System(structure).slots]] = 1e6
    settings = Settings(duration=STEPS * STEP, step=STEP, period=0.0)
    content = fmu(structure, values, settings, part="loop", version=2, identifier="fed", name="fed")
    (tmp_path / "fed.fmu").write_bytes(content)
    client = Client(tmp_path / "fed.fmu", tmp_path).start()
    (still,) = client.get(["U_lift"])
    client.set(["dd_y_r1"], [2.0])
    pushed, told = client.get(["U_lift", "measured_dd_y_r1"])
    assert told == 2.0
    system = System(structure)
    w = np.array(system.function("signals")(0.0, [], values)).ravel()
    x = np.array(system.function("start")(0.0, [], values)).ravel()
    wished = system.function("control")(*np.split(w[:6], 3), np.zeros(3), np.zeros(3), [2.0, 0.0, 0.0], x, values)[0]
    assert pushed == pytest.approx(float(wished[0]), rel=1e-12)
    assert abs(pushed - still) > 10.0
    client.slave.freeInstance()
