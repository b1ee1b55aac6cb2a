"""[disturbance]: forces on the links in scenarios, runs, sweeps and records."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springline.runner import batch, load_scenario, simulate
from springline.runner.files import InputError, units

SHORT = {"simulation.duration": 0.2}
SINE = {
    "disturbance": {
        "kind": "sine",
        "lift": {"offset": -40.0, "terms": [{"amplitude": 15.0, "omega": 20.0, "phase": 0.5}]},
    }
}


def test_its_columns_are_there_where_it_is_on() -> None:
    bare = load_scenario("paper/nominal", SHORT)
    result = simulate(bare.with_overrides(SINE))
    table = result.trajectory
    added = ["disturbance_lift", "disturbance_rotation"]
    at = table.column_names.index("theta_1x") + 1
    assert table.column_names[at : at + 2] == added
    assert [name for name in table.column_names if name not in added] == [e.name for e in bare.system().trajectory]
    assert [units(table)[name] for name in added] == ["N", "N m"]
    t = table["t"].to_numpy()
    np.testing.assert_allclose(table["disturbance_lift"], -40.0 + 15.0 * np.sin(20.0 * t + 0.5), rtol=1e-14)
    assert not table["disturbance_rotation"].to_numpy().any()
    assert bare.with_overrides(SINE).with_overrides({"disturbance.kind": "none"}) == bare


@pytest.mark.parametrize("drive", ["elastic", "rigid"])
def test_a_force_that_carries_the_weight_lets_a_free_arm_rest(drive: str) -> None:
    """Positive acts along +q1: (m2 + m3) g holds the lift, m3 g L3 cos(theta) the rotation; motors without weight."""
    weight = {"kind": "sine", "lift": {"offset": 50.0 * 9.8}, "rotation": {"offset": 40.0 * 9.8 * 0.74 * np.cos(0.5)}}
    free = {"disturbance": weight, "control.U_max": 1e-9, "drive.kind": drive, "initial.q": [0.8, 0.5]}
    table = simulate(load_scenario("paper/nominal", SHORT | free)).trajectory
    np.testing.assert_allclose(table["q1_lift"].to_numpy(), 0.8, atol=1e-9)
    np.testing.assert_allclose(table["q1_rotation"].to_numpy(), 0.5, atol=1e-9)
    fallen = simulate(load_scenario("paper/nominal", SHORT | free).with_overrides({"disturbance.kind": "none"}))
    assert fallen.trajectory["q1_lift"].to_numpy()[-1] < 0.7


def test_it_follows_a_record(tmp_path: Path) -> None:
    t = np.linspace(0.0, 1.0, 101)
    lines = "\n".join(f"{time!r},{float(30 * np.sin(4 * time))!r}" for time in t.tolist())
    (tmp_path / "gusts.csv").write_text("time,torque\n" + lines)
    path = tmp_path / "windy.toml"
    path.write_text(
        "[disturbance]\nkind = 'table'\npath = 'gusts.csv'\ncolumns = { t = 'time', rotation = 'torque' }\nt0 = 0.3\n"
        "ends = 'error'\n[simulation]\nduration = 0.2\n"
    )
    scenario = load_scenario(path)
    assert scenario.structure().disturbance.terms == (0, 1)
    for engine in ("lanes", "casadi"):
        table = simulate(scenario, engine=engine).trajectory  # type: ignore[arg-type]
        expected = 30 * np.sin(4 * (table["t"].to_numpy() + 0.3))
        np.testing.assert_allclose(table["disturbance_rotation"], expected, atol=1e-6)
        assert not table["disturbance_lift"].to_numpy().any()
    path.write_text(path.read_text().replace("rotation =", "roll ="))
    with pytest.raises(InputError, match=r"disturbance\.columns\.roll: unknown key"):
        load_scenario(path)


def test_its_numbers_vary_from_run_to_run() -> None:
    scenario = load_scenario("paper/nominal", SHORT | SINE)
    sizes = np.array([-80.0, 0.0, 25.0])
    table = batch(scenario, {"disturbance.lift.offset": sizes}, jobs=1).to_pylist()
    for size, row in zip(sizes, table, strict=True):
        alone = simulate(scenario.with_overrides({"disturbance.lift.offset": float(size)})).metrics.to_pylist()[0]
        assert {name: row[name] for name in alone} == alone
    assert len({row["iae_lift"] for row in table}) == 3


@pytest.mark.parametrize(
    ("table", "place", "text"),
    [
        ({"kind": "wind"}, "disturbance.kind", "unknown kind"),
        ({"kind": "sine", "lif": {"offset": 1.0}}, "disturbance.lif", "did you mean 'lift'"),
        ({"kind": "sine", "lift": {"offset": "big"}}, "disturbance.lift.offset", "expected a finite number [N]"),
        ({"kind": "none", "lift": {"offset": 1.0}}, "disturbance.lift", "only goes with kind = 'sine'"),
        ({"kind": "sine", "lift": {"terms": [{"amplitude": 1.0}]}}, "disturbance.lift.terms.0.omega", "is missing"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(table: dict[str, Any], place: str, text: str) -> None:
    with pytest.raises(InputError) as error:
        load_scenario("paper/nominal", {"disturbance": table})
    assert place in str(error.value) and text in str(error.value)
