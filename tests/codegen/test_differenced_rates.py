"""Rates that a controller makes out of positions: as NumPy computes them, and with the same bits everywhere."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from arms import structure_of, values_of
from fmi_client import Client, client_library

from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.export.fmu import Settings, fmu
from springline.codegen.export.fmu import archive as fmu_module
from springline.codegen.files import write_tree
from springline.codegen.kernel import KernelOptions, KernelSpec, LoopSettings, kernel
from springline.model.structure import Structure
from springline.model.system import system_of

pytestmark = pytest.mark.usefixtures("other_arms")

STEP, STEPS, HOLD, SEED = 1e-4, 300, 10, 77
QUICK = ("-O0",)  # optimisation changes no bit: test_engines.py, test_fmu.py and test_export_c.py compare its levels
WARNINGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", *QUICK, "-ffp-contract=off"]


def elastic() -> Structure:
    return structure_of("transfer_manipulator", differenced=True, effects=("position_noise", "position_resolution"))


def rigid() -> Structure:
    own = {"controller": "super_twisting", "observer": "disturbance", "delay": 7}
    return structure_of("one_link", differenced=True, drive="rigid", **own)


@pytest.fixture(autouse=True)
def _fmus_that_are_compiled_quickly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu_module, "_FLAGS", (*fmu_module._FLAGS, *QUICK))


def numbers(structure: Structure, cutoff: float = 400.0, **sensor: float) -> np.ndarray:
    """Noise and steps of some micrometres, unless another is given; the second joint has twice of each."""
    values = values_of(structure)
    given = {"velocity_cutoff": cutoff, "position_noise": 2e-6, "position_resolution": 5e-6} | sensor
    for i, slot in enumerate(system_of(structure).slots):
        table, _, name = slot.key.partition(".")
        if table == "sensor":
            name, place = name.split(".")
            values[i] = given[name] * (1 + int(place))
    return values


def trajectory(structure: Structure, values: np.ndarray, hold: int = HOLD, number: int = 0, **options: Any) -> Any:
    """Rows of all steps by column."""
    loop = kernel(KernelSpec(structure, True, options=KernelOptions(flags=QUICK, **options)))
    runs = loop.run(values[None], LoopSettings(STEPS, STEP, hold=hold, output_every=1, seed=SEED), numbers=(number,))
    assert not runs.status.any() and runs.trajectory is not None
    names = [entry.name for entry in system_of(structure).trajectory]
    return dict(zip(names, runs.trajectory[0].T, strict=True))


def differenced(q: np.ndarray, cutoff: float, h: float) -> np.ndarray:
    """Of positions at samples: a difference behind a low-pass that sees it constant since the sample before."""
    kept, rates = np.exp(-cutoff * h), [0.0]
    for difference in np.diff(q):
        rates.append(kept * rates[-1] + (1 - kept) * (difference / h))
    return np.array(rates)


@pytest.mark.parametrize("cutoff", [400.0, np.inf])
def test_rates_are_filtered_differences_of_what_encoders_show(cutoff: float) -> None:
    structure = elastic()
    rows = trajectory(structure, numbers(structure, cutoff), width=4, groups=1)
    for place, joint in enumerate(("lift", "rotation"), start=1):
        for position in ("q1", "q2"):
            q = rows[f"{position}_measured_{joint}"][::HOLD]
            assert np.abs(q - rows[f"{position}_{joint}"][::HOLD]).max() > 1e-6  # noise is in what is differenced
            expected, found = differenced(q, place * cutoff, HOLD * STEP), rows[f"z_d{position}_diff_{joint}"]
            assert np.array_equal(np.diff(q) / (HOLD * STEP), expected[1:]) == np.isinf(cutoff)
            # A row at a sample shows the states that its command is computed from, and they are held between samples.
            np.testing.assert_allclose(found[HOLD::HOLD], expected[:-1], rtol=1e-13, atol=1e-16)
            np.testing.assert_array_equal(found[HOLD + 1 : -1 : HOLD], found[2 * HOLD :: HOLD])
            if np.isinf(cutoff):
                np.testing.assert_array_equal(found[HOLD::HOLD], expected[:-1])
            np.testing.assert_array_equal(rows[f"z_{position}_last_{joint}"][HOLD::HOLD], q[:-1])
    np.testing.assert_array_equal(rows["z_has_last"], [0.0, *[1.0] * STEPS])
    assert not any("dq1_measured" in name for name in rows)


def test_without_filter_and_with_short_periods_they_tend_to_the_true_rates() -> None:
    structure = structure_of("one_link", differenced=True, drive="rigid")
    ideal, gaps = structure_of("one_link", drive="rigid"), []
    for hold in (20, 10, 5):
        rows = trajectory(structure, numbers(structure, np.inf), hold)
        sampled = trajectory(ideal, values_of(ideal), hold)
        off = rows["z_dq1_diff_elbow"][3 * hold :: hold] - rows["dq1_elbow"][2 * hold : -1 : hold]
        apart = [rows[name][-1] - sampled[name][-1] for name in ("q1_elbow", "dq1_elbow")]
        gaps.append((np.abs(off).max(), np.abs(apart).max()))
    late, apart = np.array(gaps).T
    np.testing.assert_array_less(late[1:], 0.75 * late[:-1])  # by half a period: of first order
    np.testing.assert_array_less(apart[1:], 0.75 * apart[:-1])


def exported(structure: Structure, values: np.ndarray, folder: Path, **options: Any) -> Path:
    write_tree(folder, *generate_files(bind(structure, values, seed=SEED, period=HOLD * STEP, **options)))
    return folder


def built(folder: Path, *files: str) -> Path:
    includes, sources = [f"-I{folder}/include", f"-I{folder}/src"], [folder / file for file in files]
    subprocess.run(["cc", *WARNINGS, *includes, *sources, "-o", folder / "program"], check=True)
    return folder / "program"


def printed(program: Path, *arguments: str | Path, fine: bool = True) -> list[str]:
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0 or not fine, done.stdout
    return done.stdout.splitlines()


def packed(structure: Structure, values: np.ndarray, folder: Path, part: Any, version: Any = 3) -> Path:
    told = Settings(duration=STEPS * STEP, step=STEP, period=HOLD * STEP, seed=SEED)
    path = folder / f"{part}.fmu"
    path.write_bytes(fmu(structure, values, told, part=part, version=version, identifier="arm", name="arm"))
    return path


@pytest.mark.parametrize(("of", "version"), [(elastic, 3), (rigid, 2)])
def test_they_are_the_same_everywhere(of: Callable[[], Structure], version: int, tmp_path: Path) -> None:
    """Lanes, one lane, CasADi's C, the exported steps and FMUs, with their states saved and restored."""
    structure = of()
    values = numbers(structure)
    rows = trajectory(structure, values, width=4, groups=1)
    for options in ({"width": 1, "groups": 1}, {"engine": "casadi"}):
        alone = trajectory(structure, values, **options)
        for name, column in rows.items():
            np.testing.assert_array_equal(alone[name], column, name)
    folder = exported(structure, values, tmp_path / "c")
    printed(built(folder, "src/springline.c", "src/springline_model.c", "self_check.c"), folder / "test_vectors.txt")
    header, *lines = printed(built(folder, "src/springline.c", "main.c"), "1", fine=False)  # the first rows count
    found = np.array([[float(word) for word in line.split(",")] for line in lines])
    for name, column in zip(header.split(","), found.T, strict=True):
        if name.startswith("q1_") or (name.startswith("U_") and not structure.delay):  # main prints the command
            np.testing.assert_array_equal(column[: STEPS // 100 + 1], rows[name][::100], name)
    path = packed(structure, values, tmp_path, "loop", version)
    assert client_library("fmpy.validation").validate_fmu(str(path)) == []
    client = Client(path, tmp_path).start()
    known = {*client.names("output"), *client.names("local")}
    shown = [name for name in rows if name in known and "tip_" not in name]
    assert {name for name in shown if "_diff_" in name} and {name for name in shown if name.startswith("sigma_")}
    expected = np.array([rows[name] for name in shown]).T

    def go(first: int, last: int) -> None:
        for k in range(first, last, 5):  # half a sample
            np.testing.assert_array_equal(client.get(shown), expected[k], str(k))
            client.step(k * STEP, 5 * STEP)

    go(0, 105)
    saved = client.slave.serializeFMUState(client.slave.getFMUState())
    go(105, 200)
    client.slave.setFMUState(client.slave.deserializeFMUState(saved))
    go(105, STEPS)
    client.slave.freeInstance()


def test_the_exported_controller_is_told_of_positions_alone(tmp_path: Path) -> None:
    """It begins at rest, also after a reset; a cutoff may be set while it runs, and moves on what it has."""
    structure = structure_of("one_link", differenced=True)
    folder = exported(structure, numbers(structure), tmp_path, tunable=["sensor.velocity_cutoff"], prefix="arm")
    header = (folder / "include" / "arm.h").read_text()
    measurement = header[header.index("typedef struct arm_measurement") : header.index("} arm_measurement")]
    assert "q1_elbow" in measurement and "q2_elbow" in measurement and "dq" not in measurement
    assert "sensor_velocity_cutoff_elbow; /* rad/s;" in header
    (folder / "life.c").write_text(r"""
#include <stdio.h>
#include "arm.h"

static arm_controller controller;
static arm_reference reference;
static arm_measurement measurement;
static arm_command command;

static void sample(double q) {
  int status;
  measurement.q1_elbow = measurement.q2_elbow = q;
  status = arm_step(&controller, &reference, &measurement, &command, NULL);
  printf("%d %.17g %.17g\n", status, controller.z.z_dq1_diff_elbow, command.U_elbow);
}

int main(void) {
  arm_config config = arm_default_config;
  int status = arm_init(&controller, &config);
  sample(0.125);
  sample(0.25);
  config.parameters.sensor_velocity_cutoff_elbow = -1.0;
  status = 100 * status + 10 * arm_set_parameters(&controller, &config);
  config.parameters.sensor_velocity_cutoff_elbow = 1.0 / 0.0;
  status += arm_set_parameters(&controller, &config);
  sample(0.375);
  status += arm_reset(&controller);
  sample(0.125);
  printf("%d\n", status);
  return 0;
}
""")
    *samples, refused = printed(built(folder, "src/arm.c", "life.c"))
    assert refused == "40"
    status, rates, commands = np.array([[float(word) for word in line.split()] for line in samples]).T
    assert not status.any()
    np.testing.assert_allclose(rates, [0.0, (1 - np.exp(-0.4)) * 125.0, 125.0, 0.0], rtol=1e-14)
    assert commands[3] == commands[0]


def test_in_single_precision_it_checks_itself_too(tmp_path: Path) -> None:
    structure = elastic()
    folder = exported(structure, numbers(structure), tmp_path, real="float", tunable=["sensor", "control"])
    printed(built(folder, "src/springline.c", "src/springline_model.c", "self_check.c"), folder / "test_vectors.txt")


def test_the_controller_as_an_fmu_makes_out_rates(tmp_path: Path) -> None:
    structure = structure_of("one_link", differenced=True)
    client = Client(packed(structure, numbers(structure), tmp_path, "controller"), tmp_path).start()
    assert {name for name in client.names("input") if "q1_" in name or "q2_" in name} == {"q1_elbow", "q2_elbow"}
    q = [0.1, 0.1001, 0.1003, 0.1002]
    expected = differenced(np.array(q), 400.0, HOLD * STEP)
    for k, position in enumerate(q):
        client.set(["q1_elbow", "q2_elbow"], [position, position])
        client.step(k * HOLD * STEP, HOLD * STEP)
        np.testing.assert_allclose(client.get(["z_dq1_diff_elbow"]), expected[k], rtol=1e-12, atol=1e-16)
    client.slave.freeInstance()


def test_they_are_refused_where_control_is_continuous() -> None:
    with pytest.raises(ValueError, match="differenced rates are of samples"):
        KernelSpec(elastic(), False)
    structure = structure_of("one_link", differenced=True)
    with pytest.raises(ValueError, match="differenced rates go by samples: expected a period"):
        fmu(structure, values_of(structure), Settings(1.0, STEP), part="loop", version=3, identifier="a", name="a")
