"""What no arm can be is told before a run, wherever it starts."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from springline.runner import load_scenario
from springline.runner.files import InputError

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
