"""Properties of any loop: structures are drawn rarely, for each is a kernel of its own, and numbers often."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drawn import Loop, columns, loops, numbers_of
from fmi_client import Client
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.export.fmu import archive as fmu_module
from springline.codegen.files import write_tree
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, Runs, kernel
from springline.model.control import CONTROLLERS
from springline.model.structure import Structure
from springline.model.system import System

STEP, STEPS, RUNS = 1e-4, 300, 6
QUICK = ("-O0",)  # optimisation changes no bit: test_engines.py, test_fmu.py and test_export_c.py compare its levels
SEED = 20261128
ROW = 100  # steps between two lines of main.c
USUAL = 10  # steps of its sample period where the controller remembers nothing

# The first example is always the simplest, so that it takes a second one to see anything drawn.
FEW = settings(max_examples=2, derandomize=True, phases=[Phase.generate], suppress_health_check=list(HealthCheck))
MANY = settings(FEW, max_examples=40, derandomize=False)


@contextmanager
def known(loop: Loop) -> Iterator[Structure]:
    """Its structure, with the controller that is drawn; FMUs are compiled quickly."""
    with pytest.MonkeyPatch.context() as patched:
        for name, controller in loop.brought.items():
            patched.setitem(CONTROLLERS, name, controller)
        patched.setattr(fmu_module, "_FLAGS", (*fmu_module._FLAGS, *QUICK))
        yield loop.structure


def run(
    structure: Structure,
    sampled: bool,
    values: np.ndarray,
    hold: int,
    every: int = 1,
    told: LoopSettings | None = None,
    **options: int | str,
) -> Runs:
    loop = kernel(KernelSpec(structure, sampled, options=KernelOptions(flags=QUICK, **options)))  # type: ignore[arg-type]
    told = told or LoopSettings(STEPS, STEP, bound=1e4, hold=hold, output_every=every, seed=SEED)
    return loop.run(values, told, numbers=range(len(values)))


def same(found: Runs, expected: Runs) -> None:
    for name in ("status", "quantity", "final_state", "metrics", "trajectory"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), name)


def exported_rows(structure: Structure, values: np.ndarray, hold: int, folder: Path) -> tuple[list[str], np.ndarray]:
    """What main.c prints; it goes on for a second, in which an arm may end."""
    write_tree(folder / "c", *generate_files(bind(structure, values, seed=SEED, period=hold * STEP)))
    source = folder / "c"
    warnings = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    files = [source / "src" / "springline.c", source / "main.c"]
    includes = [f"-I{source}/include", f"-I{source}/src"]
    subprocess.run(["cc", *QUICK, *warnings, "-ffp-contract=off", *includes, *files, "-o", folder / "main"], check=True)
    printed = subprocess.run([folder / "main", "1"], capture_output=True, text=True, check=False).stdout.splitlines()
    return printed[0].split(","), np.array([[float(word) for word in line.split(",")] for line in printed[1:]])


def expect_limited(structure: Structure, runs: Runs, values: np.ndarray) -> None:
    """No command is beyond U_max, and nothing that acts; motors round."""
    names, joints = columns(structure), System(structure).joints
    keys = [slot.key for slot in System(structure).slots]
    for i, joint in enumerate(joints):
        most = values[:, keys.index(f"control.U_max.{i}")]
        commands = {"U": 1e-12, "U_cmd": 0.0} if f"U_cmd_{joint.name}" in names else {"U": 0.0}
        for name, rounding in commands.items():
            for k in np.flatnonzero(runs.status == 0):
                asked = np.abs(runs.trajectory[k][:, names.index(f"{name}_{joint.name}")])
                assert asked.max() <= most[k] * (1 + rounding), name


def expect_fmu(
    structure: Structure,
    values: np.ndarray,
    rows: np.ndarray,
    settings: Settings,
    folder: Path,
    version: int,
    stride: int,
) -> None:
    content = fmu(structure, values, settings, part="loop", version=version, identifier="arm", name="arm")  # type: ignore[arg-type]
    file = folder / f"arm{settings.hold}.fmu"
    file.write_bytes(content)
    client, names = Client(file, folder).start(), columns(structure)
    outputs = set(client.names("output"))
    shown = [name for name in names if name in outputs and not name.startswith(("tip", "d_tip"))]
    for k in range(0, STEPS, stride):
        np.testing.assert_array_equal(client.get(shown), rows[k, [names.index(name) for name in shown]], str(k))
        client.step(k * STEP, stride * STEP)
    client.slave.freeInstance()


def expect_same_everywhere(loop: Loop, hold: int, version: int, folder: Path) -> None:
    with known(loop) as structure:
        values = np.array([numbers_of(structure, loop.seed + k) for k in range(RUNS)])
        for sampled in (True, False):
            if not sampled and (structure.effects or structure.delay or structure.differenced):
                continue
            together = run(structure, sampled, values, hold, width=4, groups=1)
            same(run(structure, sampled, values, hold, engine="casadi"), together)
            same(run(structure, sampled, values, hold, width=1, groups=1), together)
            expect_limited(structure, together, values)
            sound = np.flatnonzero(together.status == 0)
            if not sound.size:
                continue  # all of them ended, and alike
            own = values[sound[0]]
            alone = run(structure, sampled, own[None], hold, width=1, groups=1)  # as run 0, for noise
            if alone.status[0]:
                continue
            told = Settings(STEPS * STEP, STEP, hold * STEP if sampled else 0.0, bound=1e4, seed=SEED)
            expect_fmu(structure, own, alone.trajectory[0], told, folder, version, hold)
            if sampled:
                period = hold if System(structure).memory else USUAL
                expected = run(structure, True, own[None], period, ROW, width=1, groups=1).trajectory[0]
                names = columns(structure)
                asked = "U_cmd_" if any(name.startswith("U_cmd_") for name in names) else "U_"
                header, printed = exported_rows(structure, own, period, folder)
                places = [names.index(name.replace("U_", asked)) for name in header[1:]]
                np.testing.assert_array_equal(printed[: len(expected), 1:], expected[:, places])


@FEW
@given(loop=loops(), hold=st.sampled_from([10, 5, 20]), version=st.sampled_from([3, 2]))
def test_any_loop_is_the_same_everywhere(
    loop: Loop, hold: int, version: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Lanes, a lane alone, CasADi's C, the exported steps and an FMU; and no command beyond U_max."""
    expect_same_everywhere(loop, hold, version, tmp_path_factory.mktemp("loop"))


@pytest.mark.full
@MANY
@given(loop=loops(), hold=st.sampled_from([10, 5, 20]), version=st.sampled_from([3, 2]))
def test_many_loops_are_the_same_everywhere(
    loop: Loop, hold: int, version: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    expect_same_everywhere(loop, hold, version, tmp_path_factory.mktemp("loop"))


@settings(FEW, max_examples=4)
@given(loop=loops())
def test_the_loop_commands_what_the_exported_controller_does_at_what_is_measured(loop: Loop) -> None:
    """CasADi's virtual machine does the operations of either, which takes no compiler."""
    with known(loop) as structure:
        system, values, rng = System(structure), numbers_of(structure, loop.seed), np.random.default_rng(loop.seed)
        n, moving = system.n, system.base.b.numel()
        for _ in range(200):
            given_d = np.zeros(system.d.numel())
            w = np.array(system.function("signals")(rng.uniform(0, 3), given_d, values)).ravel()
            x = rng.normal(size=system.x.numel()) / 2
            z = [rng.normal(size=system.z.numel())] if system.memory else []
            noise = [rng.normal(size=system.noise.numel())] if system.noise.numel() else []
            fed = np.split(w[3 * n : 3 * n + 3 * moving], 3) if system.measured_base else []
            y = np.array(system.function("measure")(x, *noise, values)).ravel()
            h = [1e-3] if structure.differenced else []
            there = system.function("loop_control")(w, x, *z, *noise, *h, values)[0]
            here = system.function("control")(*np.split(w[: 3 * n], 3), *fed, y, *z, *h, values)[0]
            np.testing.assert_array_equal(np.array(there), np.array(here))


@FEW
@given(loop=loops())
def test_hardware_of_no_amplitude_leaves_every_bit(loop: Loop) -> None:
    """Effects are there, and zero or without limit: what an ideal loop has is the same."""
    with known(loop) as drawn:
        structure = replace(drawn, delay=0)
        ideal = replace(structure, effects=())
        values, keys = numbers_of(structure, loop.seed), [slot.key for slot in System(structure).slots]
        hardware = np.array([key.split(".")[0] in ("sensor", "actuator") and "cutoff" not in key for key in keys])
        absent = {slot.key: slot.default for slot in System(structure).slots}
        values[hardware] = [absent[key] for key in np.array(keys)[hardware]]
        silent, sound = (
            run(which, True, numbers[None], 10, width=1, groups=1)
            for which, numbers in ((structure, values), (ideal, values[~hardware]))
        )
        shared = [columns(structure).index(name) for name in columns(ideal)]
        np.testing.assert_array_equal(silent.trajectory[..., shared], sound.trajectory)
        np.testing.assert_array_equal(silent.metrics, sound.metrics)


def expect_convergence(loop: Loop) -> None:
    """The error of sampling at period T is of first order in T, at one step of a method that errs by far less."""
    with known(loop) as drawn:
        structure = replace(drawn, integrator="rk4")
        values = numbers_of(structure, loop.seed)[None]
        steps, step, periods = 640, 5e-5, np.array([4, 8, 16, 32])

        def end(hold: int) -> np.ndarray | None:
            told = LoopSettings(steps, step, bound=1e4, hold=max(hold, 1), output_every=0)
            runs = run(structure, hold > 0, values, hold, told=told, width=1, groups=1)
            return None if runs.status[0] else runs.final_state[0]

        true = end(0)
        found = [end(int(hold)) for hold in periods]
        if true is None or any(state is None for state in found):
            return  # an arm that ends does so whatever samples it
        errors = np.array([np.max(np.abs(state - true) / (1e-3 + np.abs(true))) for state in found])
        order = np.polyfit(np.log(periods), np.log(errors), 1)[0]
        assert errors[0] < 1e-6 or (order > 0.7 and errors[0] < errors[-1] / 3), (order, errors)


# Formulas with jumps have no order: what is drawn of a controller itself is left out here.
SMOOTH = loops(
    controllers=("super_twisting", "computed_torque", "nonsingular_terminal", "terminal_sliding"), hardware=False
)


@FEW
@given(loop=SMOOTH)
def test_sampled_control_tends_to_continuous_control(loop: Loop) -> None:
    expect_convergence(loop)


@pytest.mark.full
@MANY
@given(loop=SMOOTH)
def test_sampled_control_of_many_loops_tends_to_continuous_control(loop: Loop) -> None:
    expect_convergence(loop)
