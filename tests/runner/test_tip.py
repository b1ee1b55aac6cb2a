"""The tip in runs: columns that follow from the others, of rows alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springline.codegen.kernel import lanes
from springline.codegen.program import program
from springline.model.mechanisms import MECHANISMS
from springline.model.quantities import TIP, TIP_RATE
from springline.model.structure import SignalShape, Structure
from springline.runner import load_scenario, simulate
from springline.runner.files import units
from springline.runner.run import run_figures

SEA = {
    "simulation.duration": 0.5,
    "simulation.output_every": 1,
    "base_motion": {
        "kind": "sine",
        "shake": [{"amplitude": 0.3, "omega": 3.0}],
        "pitch": [{"amplitude": 0.2, "omega": 2.0, "phase": 0.4}],
        "roll": [{"amplitude": 0.4, "omega": 5.0}],
    },
}
NAMES = [quantity.name for quantity in (*TIP, *TIP_RATE)]


@pytest.mark.parametrize(
    "mode", [{}, {"control.mode": "sampled", "control.period": 1e-3}], ids=["continuous", "sampled"]
)
def test_its_columns_follow_from_joints_and_base(mode: dict[str, Any]) -> None:
    result = simulate(load_scenario("paper/nominal", SEA | mode))
    table = result.trajectory
    assert simulate(load_scenario("paper/nominal", SEA | mode), engine="casadi").trajectory == table
    assert table.column_names[-12:] == NAMES
    assert [units(table)[name] for name in NAMES] == ["m"] * 6 + ["m/s"] * 6
    lift, theta, shake, pitch, roll = (
        table[name].to_numpy() for name in ("q1_lift", "q1_rotation", "y_r1", "theta_1z", "theta_1x")
    )
    x, y = 0.5 + 1.48 * np.cos(theta), lift + 1.48 * np.sin(theta)
    up, across = y * np.cos(roll), y * np.sin(roll)
    expected = [x, y, 0 * y, x * np.cos(pitch) - up * np.sin(pitch), shake + x * np.sin(pitch) + up * np.cos(pitch)]
    for name, values in zip(NAMES, [*expected, across], strict=False):
        np.testing.assert_allclose(table[name], values, rtol=0, atol=1e-14)
    for place, rate in zip(NAMES[:6], NAMES[6:], strict=True):
        differences = np.gradient(table[place].to_numpy(), table["t"].to_numpy(), edge_order=2)
        np.testing.assert_allclose(table[rate].to_numpy()[5:-5], differences[5:-5], atol=2e-3)


def test_it_follows_a_base_from_a_record_too(tmp_path: Path) -> None:
    t = np.linspace(0, 1, 101)
    rows = "\n".join(f"{float(s)!r},{float(0.2 * np.sin(3 * s))!r}" for s in t)
    (tmp_path / "sea.csv").write_text(f"t,heave\n{rows}")
    path = tmp_path / "a.toml"
    path.write_text(
        "[base_motion]\nkind = 'table'\npath = 'sea.csv'\ncolumns = { t = 't', shake = 'heave' }\n"
        "[simulation]\nduration = 0.3\n"
    )
    table = simulate(load_scenario(path)).trajectory
    difference = table["tip_y_inertial"].to_numpy() - table["tip_y_ship"].to_numpy()
    np.testing.assert_allclose(difference, table["y_r1"], rtol=0, atol=1e-15)
    rates = table["d_tip_y_inertial"].to_numpy() - table["d_tip_y_ship"].to_numpy()
    np.testing.assert_allclose(rates, 0.6 * np.cos(3 * table["t"].to_numpy()), atol=1e-5)


def test_rows_alone_compute_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that a batch evaluates in its steps has as many operations as without a tip."""
    structure = Structure(base_motion=SignalShape("sine", (1, 1, 1)))
    with_tip = lanes.emit(program(structure), {})
    arm = MECHANISMS[structure.mechanism]
    bare = type("Bare", (type(arm),), {"name": "bare", "tip": lambda self, q, p: None})
    monkeypatch.setitem(MECHANISMS, "bare", bare())
    without = lanes.emit(program(replace(structure, mechanism="bare")), {})
    per_step = ("closed", "control", "error", "plant", "uniform", "varying", "signals", "start")
    assert {name: with_tip.counts[name] for name in per_step} == {name: without.counts[name] for name in per_step}
    assert with_tip.counts["tip"] > 0 and "tip" not in without.counts
    for size in ("uniform", "varying"):
        assert with_tip.sizes[size] == without.sizes[size]


def test_a_run_shows_it_in_a_figure() -> None:
    scenario = load_scenario("paper/nominal", SEA)
    figure = run_figures(scenario, simulate(scenario))["tip"]
    assert [axes.get_ylabel() for axes in figure.axes] == ["tip x [m]", "tip y [m]", "tip z [m]"]
    assert [line.get_label() for line in figure.axes[0].lines] == ["from the earth", "from the ship"]
