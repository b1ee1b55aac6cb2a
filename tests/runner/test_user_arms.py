"""What no arm can be is told before a run, wherever it starts."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from springline.runner import batch, load_scenario
from springline.runner.cli import app
from springline.runner.files import InputError
from springline.runner.sweep import Plan, load_sweep

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_mechanism"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"kg m^2", 1.16', '"kg m^2", -1.16', ["link 'column': inertia: expected a number >= 0, got -1.16"]),
        ('"kg m^2", 2.73', '"kg m^2", 12.73', ["link 'upper arm': inertia: no body has a principal moment above"]),
        ('"kg", 56.5', '"kg", -3.0', ["link 'upper arm': mass: expected a number >= 0, got -3"]),
        ("43.0 * 105**2", "0.0", ["stiffness, k1: expected as default a number > 0, got 0.0"]),
        ("0.0013 * 105**2", "-1.0", ["motor_inertia, I1: expected as default a number > 0, got -1.0"]),
    ],
)
def test_a_slip_is_told_where_the_arm_starts_on_its_reference(
    tmp_path: Path, old: str, new: str, told: list[str]
) -> None:
    shutil.copytree(EXAMPLE, tmp_path / "arm")
    file = tmp_path / "arm" / "manutec_r3.py"
    text = file.read_text("utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), "utf-8")
    with pytest.raises(InputError) as caught:
        load_scenario(tmp_path / "arm" / "deck.toml")
    message = str(caught.value)
    assert "mechanism.name: manutec_r3.py:ManutecR3" in message and all(part in message for part in told), message


def test_so_is_a_number_of_the_scenario() -> None:
    for key in ("drive.k1", "plant.k1", "drive.I2"):
        with pytest.raises(InputError, match=rf"{key}: expected a number > 0"):
            load_scenario(EXAMPLE / "deck.toml", {key: 0.0})
    with pytest.raises(InputError, match="link 'upper arm': mass: expected a number >= 0, got -3"):
        load_scenario(EXAMPLE / "deck.toml", {"plant.m2": -3.0})


# Many runs


SWEEP = """
scenario = "deck.toml"
samples = 600
[set]
simulation.duration = 0.01
[vary]
{vary}
"""


@pytest.fixture
def arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(EXAMPLE, tmp_path / "arm")
    monkeypatch.chdir(tmp_path / "arm")
    return tmp_path / "arm"


def springline(*arguments: str) -> Any:
    return CliRunner().invoke(app, list(arguments), prog_name="springline")


@pytest.mark.parametrize(
    ("vary", "told"),
    [
        ("plant.m2 = { values = [20.0, -3.0, 30.0] }", ["vary.plant.m2: run ", "plant.m2 = -3: ", "'upper arm': mass"]),
        ("plant.m2 = { normal = [56.5, 30.0] }", ["vary.plant.m2: run ", "plant.m2 = -", "'upper arm': mass"]),
        ("mechanism.m2 = { values = [20.0, -3.0] }", ["vary.mechanism.m2: run ", "'upper arm': mass: expected"]),
        ("plant.m2.scale = { values = [1.0, 2.0] }\nplant.Ixx2 = { uniform = [1.0, 40.0] }",
         ["vary: run ", "plant.m2.scale = ", "plant.Ixx2 = ", "'upper arm': inertia: no body has a principal moment"]),
        ("plant.load = { values = [0.0, -30.0] }\ncontrol.law = { each = [\"power\", \"double_power\"] }",
         ["vary.plant.load: run "]),
        ("plant.k1 = { uniform = [-1.0, 3.0] }", ["vary.plant.k1: expected a number > 0", "got -1.0"]),
    ],
)  # fmt: skip
def test_a_sweep_looks_at_every_run_before_it_starts_one(arm: Path, vary: str, told: list[str]) -> None:
    """Whatever it was asked for, and nothing is written."""
    (arm / "s.toml").write_text(SWEEP.format(vary=vary))
    for option in ((), ("--dry-run",), ("--resume",)):
        refused = springline("batch", "s.toml", "-o", "data", *option)
        assert refused.exit_code == 2 and all(part in refused.stderr for part in told), refused.output
        assert not (arm / "data").exists()


def test_the_run_that_is_named_is_the_one(arm: Path) -> None:
    (arm / "s.toml").write_text(SWEEP.format(vary="plant.m2 = { normal = [56.5, 20.0] }"))
    plan = Plan(load_sweep(arm / "s.toml"), chunk=600)
    drawn = plan.columns(plan.chunk(0))["plant.m2"]
    first = int(np.argmax(drawn < 0))
    assert drawn[first] < 0 and first > 0
    with pytest.raises(InputError, match=rf"run {first}: plant.m2 = {drawn[first]:.6g}: .* \(leave such values out"):
        plan.expect_plausible()
    with pytest.raises(InputError, match="mass: expected a number >= 0"):
        plan.scenario_of(first)
    assert plan.scenario_of(first - 1).value_of("plant.m2") == drawn[first - 1]


def test_a_sweep_that_was_begun_is_refused_once_its_numbers_are_no_arms(arm: Path) -> None:
    (arm / "s.toml").write_text(SWEEP.format(vary="plant.load = { values = [1.0, 5.0] }").replace("600", "8"))
    assert springline("batch", "s.toml", "-o", "data", "--no-plot").exit_code == 0
    before = {path.name: path.read_bytes() for path in (arm / "data").iterdir() if path.suffix == ".parquet"}
    (arm / "s.toml").write_text(SWEEP.format(vary="plant.m2 = { values = [1.0, -5.0] }").replace("600", "8"))
    refused = springline("batch", "s.toml", "-o", "data", "--resume")
    assert refused.exit_code == 2 and "plant.m2 = -5: mechanism manutec_r3: link 'upper arm'" in refused.stderr
    assert before == {path.name: path.read_bytes() for path in (arm / "data").iterdir() if path.suffix == ".parquet"}


def test_a_batch_of_arrays_does_so_too() -> None:
    scenario = load_scenario(EXAMPLE / "deck.toml", {"simulation.duration": 0.01})
    masses = np.full(5000, 50.0)
    masses[4500] = -3.0
    with pytest.raises(InputError, match=r"plant\.m2: run 4500: plant\.m2 = -3: .*'upper arm': mass"):
        batch(scenario, {"plant.m2": masses})
    planar = load_scenario("paper/nominal", {"mechanism.name": "planar_arm", "mechanism.n": 2})
    flat = {"plant.inertia": np.array([1.0, 0.0, 0.0]), "plant.com": np.array([0.0, 1.0, 0.0])}
    with pytest.raises(InputError, match=r"run 2: plant\.inertia = 0, plant\.com = 0: the mass matrix at the start"):
        batch(planar, flat)
    assert batch(planar, flat | {"plant.com": np.array([0.5, 1.0, 0.5])}).num_rows == 3
