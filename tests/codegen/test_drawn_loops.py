"""Properties of any loop: structures are drawn rarely, for each is a kernel of its own, and numbers often."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawn import Loop, columns, loops, numbers_of
from fmi_client import Client
from hypothesis import Phase, given, settings
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


@contextmanager
def known(loop: Loop) -> Iterator[None]:
    """With the controller that is drawn; FMUs are compiled quickly."""
    with pytest.MonkeyPatch.context() as patched:
        for name, controller in loop.brought.items():
            patched.setitem(CONTROLLERS, name, controller)
        patched.setattr(fmu_module, "_FLAGS", (*fmu_module._FLAGS, *QUICK))
        yield


def run(structure: Structure, sampled: bool, values: np.ndarray, hold: int, every: int = 1, **options: Any) -> Runs:
    loop = kernel(KernelSpec(structure, sampled, options=KernelOptions(flags=QUICK, **options)))
    told = LoopSettings(STEPS, STEP, bound=1e4, hold=hold, output_every=every, seed=SEED)
    return loop.run(values, told, numbers=range(len(values)))


def same(found: Runs, expected: Runs) -> None:
    for name in ("status", "quantity", "final_state", "metrics", "trajectory"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), name)


def exported_rows(structure: Structure, values: np.ndarray, hold: int, folder: Path) -> tuple[list[str], np.ndarray]:
    """What main.c prints, until the arm is where its numbers are none."""
    write_tree(folder / "c", *generate_files(bind(structure, values, seed=SEED, period=hold * STEP)))
    source = folder / "c"
    warnings = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror"]
    files = [source / "src" / "springline.c", source / "main.c"]
    includes = [f"-I{source}/include", f"-I{source}/src"]
    subprocess.run(["cc", *QUICK, *warnings, "-ffp-contract=off", *includes, *files, "-o", folder / "main"], check=True)
    printed = subprocess.run([folder / "main", "1"], capture_output=True, text=True, check=False).stdout.splitlines()
    return printed[0].split(","), np.array([[float(word) for word in line.split(",")] for line in printed[1:]])


def expect_same_everywhere(loop: Loop, hold: int, version: int, folder: Path) -> None:
    """Lanes, a lane alone, CasADi's C, the exported steps and an FMU; and no command beyond U_max."""
    structure = loop.structure
    values = np.array([numbers_of(structure, loop.seed + k) for k in range(RUNS)])
    names = columns(structure)
    n = System(structure).n
    keys = [slot.key for slot in System(structure).slots]
    most = values[:, [keys.index(f"control.U_max.{i}") for i in range(n)]]
    for sampled in (True, False):
        if not sampled and (structure.effects or structure.delay):
            continue
        together = run(structure, sampled, values, hold, width=4, groups=1)
        same(run(structure, sampled, values, hold, engine="casadi"), together)
        same(run(structure, sampled, values, hold, width=1, groups=1), together)
        command = "U_cmd" if f"U_cmd_{System(structure).joints[0].name}" in names else "U"
        asked = [names.index(f"{command}_{joint.name}") for joint in System(structure).joints]
        acts = [names.index(f"U_{joint.name}") for joint in System(structure).joints]
        for k in range(RUNS):
            if together.status[k] == 0:
                assert (np.abs(together.trajectory[k][:, asked]) <= most[k]).all()
                assert (np.abs(together.trajectory[k][:, acts]) <= most[k] * (1 + 1e-12)).all()
        sound = [k for k in range(RUNS) if together.status[k] == 0]
        print(structure, "sound", len(sound), {int(s) for s in together.status})
        if not sound:
            continue
        first = sound[0]
        alone = run(structure, sampled, values[first : first + 1], hold, width=2, groups=1)
        if alone.status[0]:
            continue
        rows = alone.trajectory[0]
        period = hold * STEP if sampled else 0.0
        told = Settings(duration=STEPS * STEP, step=STEP, period=period, seed=SEED, bound=1e4)
        name = f"arm{int(sampled)}"
        content = fmu(structure, values[first], told, part="loop", version=version, identifier=name, name=name)
        (folder / f"{name}.fmu").write_bytes(content)
        client = Client(folder / f"{name}.fmu", folder).start()
        outputs = set(client.names("output"))
        shown = [name for name in names if name in outputs and not name.startswith(("tip", "d_tip"))]
        places = [names.index(name) for name in shown]
        for k in range(0, STEPS, hold):
            np.testing.assert_array_equal(client.get(shown), rows[k, places], str(k))
            client.step(k * STEP, hold * STEP)
        client.slave.freeInstance()
        if sampled:
            own = hold if System(structure).memory else 10
            header, printed = exported_rows(structure, values[first], own, folder)
            every = 100
            expected = rows if own == hold else run(structure, True, values[first : first + 1], own, width=2, groups=1).trajectory[0]
            expected = expected[::every]
            at = [names.index(f"U_cmd{n[1:]}" if n.startswith("U_") and command == "U_cmd" else n) for n in header]
            np.testing.assert_array_equal(printed[: len(expected), 1:], expected[:, at[1:]])


@settings(max_examples=int(__import__("os").environ.get("N", "4")), derandomize=False, phases=[Phase.generate])
@given(loop=loops(), hold=st.sampled_from([10, 5, 20]), version=st.sampled_from([3, 2]))
def test_any_loop_is_the_same_everywhere(
    loop: Loop, hold: int, version: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    with known(loop):
        expect_same_everywhere(loop, hold, version, tmp_path_factory.mktemp("loop"))
