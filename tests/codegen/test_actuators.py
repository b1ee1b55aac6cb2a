"""Commands that arrive late, slowly and behind a lag: the same everywhere, and what is off leaves no trace."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import structure_of, values_of
from fmi_client import Client, client_library
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.export.fmu import archive as fmu_module
from springline.codegen.files import write_tree
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, Runs, kernel
from springline.model.structure import Structure
from springline.model.system import System

pytestmark = pytest.mark.usefixtures("other_arms")

STEP, STEPS, HOLD = 1e-4, 300, 10
QUICK = ("-O0",)  # optimisation changes no bit: test_engines.py, test_fmu.py and test_export_c.py compare its levels
BOTH = ("rate_limit", "lag")


@pytest.fixture(autouse=True)
def _fmus_that_are_compiled_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu_module, "_FLAGS", (*fmu_module._FLAGS, *QUICK))


def numbers_of(structure: Structure, rate_limit: float = np.inf, lag: float = 0.0) -> np.ndarray:
    """The first joint has half the lag and half the rate of the second."""
    values = values_of(structure)
    for i, slot in enumerate(System(structure).slots):
        if slot.key.startswith("actuator."):
            _, name, joint = slot.key.split(".")
            values[i] = {"rate_limit": rate_limit, "lag": lag}[name] * (1.0 if joint == "0" else 2.0)
    return values


def run(structure: Structure, values: np.ndarray, every: int = 1, **options: Any) -> Runs:
    loop = kernel(KernelSpec(structure, True, options=KernelOptions(flags=QUICK, **options)))
    runs = loop.run(np.atleast_2d(values), LoopSettings(STEPS, STEP, hold=HOLD, output_every=every))
    assert not runs.status.any()
    return runs


def columns(structure: Structure, rows: np.ndarray, *quantities: str) -> np.ndarray:
    names = [entry.name for entry in System(structure).trajectory]
    wanted = [f"{quantity}_{joint.name}" for quantity in quantities for joint in System(structure).joints]
    return rows[..., [names.index(name) for name in wanted]]


def exported_rows(structure: Structure, values: np.ndarray, folder: Path) -> np.ndarray:
    """q1 and the command as main.c prints them."""
    write_tree(folder / "c", *generate_files(bind(structure, values)))
    source = folder / "c"
    warnings = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    files = [source / "src" / "springline.c", source / "main.c"]
    includes = [f"-I{source}/include", f"-I{source}/src"]
    subprocess.run(["cc", *QUICK, *warnings, "-ffp-contract=off", *includes, *files, "-o", folder / "main"], check=True)
    printed = subprocess.run([folder / "main", "1"], capture_output=True, text=True, check=False).stdout.splitlines()
    header, rows = printed[0].split(","), [[float(word) for word in line.split(",")] for line in printed[1:]]
    joints = [joint.name for joint in System(structure).joints]
    return np.array(rows)[:, [header.index(f"{quantity}_{joint}") for quantity in ("q1", "U") for joint in joints]]


def fmu_of(structure: Structure, values: np.ndarray, part: Any = "loop", version: Any = 3) -> bytes:
    told = Settings(duration=STEPS * STEP, step=STEP, period=HOLD * STEP)
    return fmu(structure, values, told, part=part, version=version, identifier="arm", name="arm")


@settings(max_examples=4, suppress_health_check=[HealthCheck.function_scoped_fixture], phases=[Phase.generate])
@given(
    mechanism=st.sampled_from(["transfer_manipulator", "one_link"]),
    integrator=st.sampled_from(["rk4", "midpoint", "dop853"]),
    effects=st.sampled_from([(), ("rate_limit",), ("lag",), BOTH]),
    delay=st.sampled_from([0, 1, 3, HOLD, 13]),
    version=st.sampled_from([2, 3]),
)
def test_what_becomes_of_commands_is_the_same_everywhere(
    mechanism: str,
    integrator: str,
    effects: tuple[str, ...],
    delay: int,
    version: int,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """Lanes, one lane, CasADi's C, the exported steps and FMUs: states, commands and what acts."""
    delay, folder = delay if effects or delay else 7, tmp_path_factory.mktemp("actuators")
    structure = structure_of(mechanism, integrator=integrator, effects=effects, delay=delay)
    values = numbers_of(structure, 2e4, 3e-4)
    rows = run(structure, values, width=4, groups=1).trajectory
    assert rows is not None
    for options in ({"width": 1, "groups": 1}, {"engine": "casadi"}):
        np.testing.assert_array_equal(run(structure, values, **options).trajectory, rows)
    expected = columns(structure, rows[0, ::100], "q1", "U_cmd")
    np.testing.assert_array_equal(exported_rows(structure, values, folder)[: len(expected)], expected)
    (folder / "arm.fmu").write_bytes(fmu_of(structure, values, version=version))
    client = Client(folder / "arm.fmu", folder).start()
    outputs = set(client.names("output"))
    names = [entry.name for entry in System(structure).trajectory]
    shown = [name for name in names if name in outputs and not name.startswith(("tip", "d_tip"))]
    assert {f"{name}_{joint.name}" for name in ("U", "U_cmd") for joint in System(structure).joints} <= set(shown)
    places, saved = [names.index(name) for name in shown], None
    for k in range(STEPS // HOLD):
        np.testing.assert_array_equal(client.get(shown), rows[0, HOLD * k, places], str(k))
        if k == 5:
            saved = client.slave.getFMUState()
        client.step(k * HOLD * STEP, HOLD * STEP)
    assert saved is not None
    client.slave.setFMUState(saved)  # what is on its way is part of it
    for k in range(5, 9):
        np.testing.assert_array_equal(client.get(shown), rows[0, HOLD * k, places], str(k))
        client.step(k * HOLD * STEP, HOLD * STEP)


@pytest.mark.parametrize("delay", [1, HOLD, 13])
def test_a_delayed_command_acts_so_many_steps_later(delay: int) -> None:
    structure = structure_of("transfer_manipulator", delay=delay)
    rows = run(structure, values_of(structure), width=4, groups=1).trajectory
    assert rows is not None
    acts, asked = columns(structure, rows[0], "U"), columns(structure, rows[0], "U_cmd")
    np.testing.assert_array_equal(acts[delay:], asked[:-delay])
    assert not acts[:delay].any() and np.ptp(asked) > 0.0
    held = asked[:-1].reshape(-1, HOLD, 2)
    np.testing.assert_array_equal(held, held[:, :1] + 0.0 * held)


def test_a_rate_limit_and_a_lag_act_one_behind_the_other() -> None:
    """By the formulas, step by step: the limit of a step's change, then the exact answer to a constant command."""
    structure = structure_of("transfer_manipulator", effects=BOTH)
    values = numbers_of(structure, 5e5, 3e-4)
    rows = run(structure, values, width=4, groups=1).trajectory
    assert rows is not None
    acts, asked = columns(structure, rows[0], "U"), columns(structure, rows[0], "U_cmd")
    most, decay = np.array([5e5, 1e6]) * STEP, np.exp(-STEP / np.array([3e-4, 6e-4]))
    last = force = np.zeros(2)
    limited = 0
    for k in range(STEPS):
        np.testing.assert_allclose(acts[k], force, rtol=1e-12, atol=1e-9)
        last = np.clip(asked[k], last - most, last + most)
        limited += int(np.any(last != asked[k]))
        force = last + (force - last) * decay
    assert 3 < limited < STEPS


def test_a_lag_is_exact_within_a_step() -> None:
    """A method of order 8 sees the force change within its step: with one ten times as long it gives the same."""
    structure = structure_of("one_link", drive="rigid", effects=("lag",), integrator="dop853")
    values = numbers_of(structure, lag=2e-2)
    loop = kernel(KernelSpec(structure, True, options=KernelOptions(flags=QUICK, width=4)))
    fine = loop.run(values[None], LoopSettings(100, 1e-3, hold=10, output_every=10)).trajectory
    coarse = loop.run(values[None], LoopSettings(10, 1e-2, hold=1, output_every=1)).trajectory
    assert fine is not None and coarse is not None
    np.testing.assert_allclose(coarse, fine, rtol=1e-5, atol=1e-6)


def test_what_limits_and_lags_nothing_leaves_every_bit() -> None:
    structure, ideal = structure_of("transfer_manipulator", effects=BOTH), structure_of("transfer_manipulator")
    idle, sound = run(structure, numbers_of(structure), width=4), run(ideal, values_of(ideal), width=4)
    assert idle.trajectory is not None and sound.trajectory is not None
    np.testing.assert_array_equal(idle.trajectory[..., : sound.trajectory.shape[-1]], sound.trajectory)
    np.testing.assert_array_equal(idle.metrics, sound.metrics)


def test_a_run_that_ends_does_not_disturb_its_neighbours() -> None:
    structure = structure_of("transfer_manipulator", effects=BOTH, delay=3)
    sound, wild = (numbers_of(structure, 5e5, 3e-4) for _ in range(2))
    names = [slot.key for slot in System(structure).slots]
    wild[names.index("plant.m3")] = 1e-9
    loop = kernel(KernelSpec(structure, True, options=KernelOptions(flags=QUICK, width=4, groups=1)))
    told = LoopSettings(STEPS, STEP, hold=HOLD, bound=50.0)
    alone, beside = loop.run(sound[None], told), loop.run(np.array([sound, wild, sound]), told)
    assert beside.status[1] != 0
    for k in (0, 2):
        np.testing.assert_array_equal(beside.final_state[k], alone.final_state[0])
        np.testing.assert_array_equal(beside.metrics[k], alone.metrics[0])


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("part", ["controller", "plant", "loop"])
def test_fmus_are_valid(part: str, version: int, tmp_path: Path) -> None:
    structure = structure_of("transfer_manipulator", effects=BOTH, delay=7)
    (tmp_path / "arm.fmu").write_bytes(fmu_of(structure, numbers_of(structure, 5e5, 3e-4), part, version))
    assert client_library("fmpy.validation").validate_fmu(str(tmp_path / "arm.fmu")) == []


@pytest.mark.parametrize("stride", [1, 5])
def test_a_plant_of_an_fmu_has_the_motors_of_the_loop(stride: int, tmp_path: Path) -> None:
    structure = structure_of("transfer_manipulator", effects=BOTH, delay=7)
    values = numbers_of(structure, 5e5, 3e-4)
    rows = run(structure, values, width=4).trajectory
    assert rows is not None
    names = [entry.name for entry in System(structure).trajectory]
    (tmp_path / "arm.fmu").write_bytes(fmu_of(structure, values, "plant"))
    client = Client(tmp_path / "arm.fmu", tmp_path).start()
    joints = [joint.name for joint in System(structure).joints]
    state = [f"{item.name}_{joint}" for item in System(structure).drive.state for joint in joints]
    for k in range(0, STEPS, stride):
        np.testing.assert_array_equal(client.get(state), rows[0, k, [names.index(name) for name in state]])
        asked = rows[0, k, [names.index(f"U_cmd_{joint}") for joint in joints]]
        client.set([f"U_{joint}" for joint in joints], asked)
        client.step(k * STEP, stride * STEP)


def test_an_export_has_what_motors_remember_and_checks_itself(tmp_path: Path) -> None:
    structure = structure_of("transfer_manipulator", effects=BOTH, delay=7)
    values = numbers_of(structure, 5e5, 3e-4)
    for real in ("double", "float"):
        folder = tmp_path / real
        export = bind(structure, values, tunable=["control", "actuator"], real=real)  # type: ignore[arg-type]
        write_tree(folder, *generate_files(export))
        header = (folder / "include" / "springline.h").read_text()
        for member in ("a_lift;", "U_last_rotation;", "line[7];", "line_at;"):
            assert member in header
        sources = [folder / "src" / "springline.c", folder / "src" / "springline_model.c", folder / "self_check.c"]
        warnings = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", *QUICK, "-ffp-contract=off"]
        includes = [f"-I{folder}/include", f"-I{folder}/src"]
        subprocess.run(["cc", *warnings, *includes, *sources, "-o", folder / "check"], check=True)
        done = subprocess.run([folder / "check", folder / "test_vectors.txt"], capture_output=True, check=False)
        assert done.returncode == 0, done.stdout


def test_what_is_off_is_in_no_printed_c() -> None:
    ideal = structure_of("transfer_manipulator")
    files, _ = generate_files(bind(ideal, values_of(ideal)))
    for name, content in files.items():
        for word in ("line_at", "U_last", "drive_motors", "U_cmd"):
            assert word not in content.decode(), f"{word} in {name}"


def test_motors_of_samples_are_refused_where_control_is_continuous() -> None:
    for structure in (structure_of("one_link", effects=("lag",)), structure_of("one_link", delay=1)):
        with pytest.raises(ValueError, match="sampled"):
            KernelSpec(structure, False)
        with pytest.raises(ValueError, match="expected a period"):
            fmu(structure, values_of(structure), Settings(1.0, STEP), part="loop", version=3, identifier="a", name="a")
