"""Damping and friction in scenarios and sweeps: presence is structure, size is a number."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from springline.runner import batch, load_scenario, simulate
from springline.runner.cli import app
from springline.runner.files import InputError
from springline.runner.sweep import Plan, load_sweep

SHORT = {"simulation.duration": 0.05}


def test_presence_is_structure_and_size_a_number() -> None:
    bare = load_scenario("paper/nominal", SHORT)
    assert bare.structure().friction == ()
    assert not [slot.key for slot in bare.system().slots if "viscous" in slot.key or "coulomb" in slot.key]
    damped = bare.with_overrides({"drive.link_viscous": 5.0, "plant.motor_coulomb.1": 0.1})
    assert damped.structure().friction == ("link_viscous", "motor_coulomb")
    assert damped.value_of("plant.link_viscous.1") == damped.value_of("drive.link_viscous.1") == 5.0
    assert damped.value_of("plant.motor_coulomb.1") == 0.1
    assert damped.value_of("drive.motor_coulomb.1") == 0.0
    assert damped.value_of("plant.coulomb_velocity.0") == 0.01
    scaled = damped.with_overrides({"plant.link_viscous": {"scale": 2.0}})
    assert scaled.value_of("plant.link_viscous.0") == 10.0
    assert damped.with_overrides({"drive.link_viscous": 0.0, "plant.motor_coulomb": 0.0}).structure().friction == ()
    assert simulate(bare).trajectory != simulate(damped).trajectory


def test_friction_slows_an_arm_that_nothing_drives() -> None:
    """From 0.3 m/s, no gravity, motors held to nothing: Coulomb stops it, viscous friction lets it creep on."""
    free = {"mechanism.g": 0.0, "control.U_max": 1e-12, "initial.q": [0.0, 0.0], "initial.dq": [0.3, 0.0],
            "simulation.duration": 2.0, "drive.kind": "rigid"}  # fmt: skip
    ends = {}
    for name, change in {
        "none": {},
        "viscous": {"drive.link_viscous": [52.0, 0.0]},
        "coulomb": {"drive.motor_coulomb": [15.6, 0.0]},
    }.items():
        table = simulate(load_scenario("paper/nominal", free | change)).trajectory
        ends[name] = table["dq1_lift"].to_numpy()[-1] / 0.3
    assert ends["none"] > 0.8
    assert 0.05 < ends["viscous"] < 0.3  # about exp(-1 / s * 2 s) of it
    assert abs(ends["coulomb"]) < 0.01  # it stops after 1 s, but for what the rotation still pulls


@pytest.mark.parametrize(
    ("changes", "place", "text"),
    [
        ({"drive.link_viscous": -1.0}, "drive.link_viscous", "expected a number >= 0 [N s/m]"),
        ({"drive.coulomb_velocity": [0.01, 0.0]}, "drive.coulomb_velocity.1", "expected a number > 0 [rad/s]"),
        ({"plant.spring_damping": "much"}, "plant.spring_damping", "expected a number >= 0 [N s/m]"),
        ({"drive.link_viscos": 1.0}, "drive.link_viscos", "unknown key"),
        ({"drive.kind": "rigid", "drive.spring_damping": 1.0}, "drive.spring_damping", "only goes with kind"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(changes: dict[str, object], place: str, text: str) -> None:
    with pytest.raises(InputError) as error:
        load_scenario("paper/nominal", changes)
    assert place in str(error.value) and text in str(error.value)


def test_one_joint_of_the_plant_follows_the_controller_until_it_is_told_otherwise() -> None:
    bare = load_scenario("paper/nominal", SHORT)
    changed = bare.with_overrides({"plant.link_viscous.1": 2.0, "drive.link_viscous": [4.0, 5.0]})
    assert changed.document["plant"]["link_viscous"] == [4.0, 2.0]
    scaled = bare.with_overrides({"drive.link_viscous": [4.0, 5.0], "plant.link_viscous.scale.0": 2.0})
    assert [scaled.value_of(f"plant.link_viscous.{i}") for i in range(2)] == [8.0, 5.0]


def sweep_of(folder: Path, vary: str, method: str = 'method = "random"\nsamples = 8') -> Path:
    path = folder / "sweep.toml"
    path.write_text(
        f'scenario = "paper/nominal"\n{method}\nseed = 2\n[set]\nsimulation.duration = 0.02\n[vary]\n{vary}\n'
    )
    return path


def test_a_sweep_that_switches_friction_on_and_off_groups_by_it(tmp_path: Path) -> None:
    for base in ("", "drive.link_viscous = 7.0"):
        vary = "drive.link_viscous = { values = [0.0, 5.0] }\ncontrol.delta = { uniform = [0.04, 0.08] }"
        path = sweep_of(tmp_path, vary)
        path.write_text(path.read_text().replace("[vary]", f"{base}\n[vary]"))
        plan = Plan(load_sweep(path))
        assert [group.scenario.structure().friction for group in plan.groups] == [(), ("link_viscous",)]
        assert "plant.link_viscous.0" not in plan.groups[1].work.parameters, "a constant of its group"


@pytest.mark.parametrize("axis", ["{ uniform = [0.5, 5.0] }", "{ values = [1.0, 5.0] }", "{ uniform = [0.0, 5.0] }"])
def test_a_size_that_varies_is_a_number_of_one_kernel(axis: str, tmp_path: Path) -> None:
    """Also where the scenario that is varied has none."""
    plan = Plan(load_sweep(sweep_of(tmp_path, f"drive.link_viscous.0 = {axis}")))
    [group] = plan.groups
    assert group.scenario.structure().friction == ("link_viscous",)
    assert "plant.link_viscous.0" in group.work.parameters


def test_replayed_runs_have_the_bits_of_their_sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a range whose end is zero too, where a run by itself has no friction at all; resumed as it stands."""
    monkeypatch.chdir(tmp_path)
    vary = """drive.link_viscous = { uniform = [0.0, 5.0], points = 3 }
drive.motor_coulomb.1 = { tie = "drive.link_viscous", factor = 0.01 }"""
    sweep_of(tmp_path, vary, 'method = "grid"')
    for command in ("batch sweep.toml -o data --no-plot", "batch sweep.toml -o data --no-plot --resume",
                    "replay data 0 --no-plot", "replay data 2 --no-plot"):  # fmt: skip
        done = CliRunner().invoke(app, command.split(), prog_name="springline")
        assert done.exit_code == 0, done.output
        assert "bit for bit" in done.output or "replay" not in command


def test_a_batch_of_arrays_may_cross_zero() -> None:
    scenario = load_scenario("paper/nominal", SHORT)
    sizes = np.array([0.0, 3.0, 8.0])
    table = batch(scenario, {"plant.link_coulomb.0": sizes}, jobs=1).to_pylist()
    for size, row in zip(sizes, table, strict=True):
        alone = simulate(scenario.with_overrides({"plant.link_coulomb.0": float(size)})).metrics.to_pylist()[0]
        assert {name: row[name] for name in alone} == alone
    with pytest.raises(InputError, match=r"plant\.link_coulomb\.0: run 1: expected a number >= 0"):
        batch(scenario, {"plant.link_coulomb.0": [1.0, -3.0]})
