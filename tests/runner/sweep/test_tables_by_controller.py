"""Sweeps over controllers and observers: what stands in [control.<name>] counts in the runs that have it."""

from __future__ import annotations

from pathlib import Path

import pytest
from pyarrow import parquet
from typer.testing import CliRunner

from springline.runner.cli import app
from springline.runner.files import InputError
from springline.runner.scenario import load_scenario
from springline.runner.sweep import Dataset, Plan, load_sweep, place, stored_plan

SHORT = 'scenario = "paper/group1_shake"\nmethod = "grid"\n[set]\ndrive.kind = "rigid"\nsimulation.duration = 0.02\n'
RIVALS = 'control.controller = { values = ["terminal_sliding", "computed_torque", "super_twisting"] }\n'


def written(folder: Path, text: str, drive: str = "rigid") -> Path:
    file = folder / "rivals.toml"
    file.write_text(SHORT.replace("rigid", drive) + text)
    return file


def planned(folder: Path, text: str, drive: str = "rigid") -> Plan:
    return Plan(load_sweep(written(folder, text, drive)))


def command(*words: object) -> str:
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, done.output
    return str(done.output)


def test_values_apply_where_the_run_s_controller_is_that_one(tmp_path: Path) -> None:
    text = f"control.super_twisting.slope = 20.0\n[vary]\n{RIVALS}plant.m3.scale = {{ values = [1.0, 1.2] }}\n"
    plan = planned(tmp_path, text)
    for run, has in enumerate([False, False, False, False, True, True]):
        scenario = plan.scenario_of(run)
        assert ("super_twisting" in scenario.document["control"]) == has
        assert "computed_torque" not in scenario.document["control"] or not has
    assert plan.scenario_of(5).value_of("control.super_twisting.slope.1") == 20.0
    assert '"set"' not in str(planned(tmp_path, f"[vary]\n{RIVALS}").sweep.as_json())


def test_keys_that_vary_are_null_where_they_are_of_another_controller(tmp_path: Path) -> None:
    """In the table, whose runs come out the same by themselves, from what the dataset says of them."""
    text = f"""control.computed_torque.k_d = 50.0
[vary]
{RIVALS}control.super_twisting.slope = {{ uniform = [10.0, 20.0], points = 3 }}
control.super_twisting.root_gain.0 = {{ tie = "control.super_twisting.slope", factor = 1.2 }}
control.computed_torque.k_p.1 = {{ values = [700.0, 800.0] }}
"""
    out = tmp_path / "out"
    command("batch", written(tmp_path, text), "-o", out, "--jobs", 1, "--no-plot")
    table = parquet.read_table(sorted(out.glob("part-*.parquet")))
    rows = table.to_pylist()
    assert len(rows) == 18
    for row in rows:
        own = row["control.controller"] == "super_twisting"
        assert (row["control.super_twisting.slope"] is not None) == own
        assert (row["control.super_twisting.root_gain.0"] is not None) == own
        assert (row["control.computed_torque.k_p.1"] is not None) == (row["control.controller"] == "computed_torque")
    plan = stored_plan(Dataset(place(str(out))))
    last = plan.scenario_of(17)
    assert last.value_of("control.super_twisting.slope.0") == 20.0
    assert last.value_of("control.super_twisting.root_gain.0") == 24.0
    assert plan.scenario_of(6).value_of("control.computed_torque.k_d.0") == 50.0
    for run in (0, 7, 17):
        command("replay", out, run, "-o", tmp_path / f"again{run}", "--no-plot")
    resolved = load_scenario(tmp_path / "again7" / "scenario.toml")
    assert resolved.control_tables == {"computed_torque"}
    command("batch", written(tmp_path, text), "-o", out, "--resume", "--jobs", 1, "--no-plot")


def test_figures_leave_out_what_a_run_does_not_have(tmp_path: Path) -> None:
    for axes in (
        "control.super_twisting.slope = { values = [10.0, 20.0] }\n",
        "control.super_twisting.slope = { values = [10.0, 20.0] }\nplant.m3.scale = { values = [1.0, 1.2] }\n",
    ):
        out = tmp_path / str(len(axes))
        text = f"[vary]\ncontrol.controller = {{ values = ['computed_torque', 'super_twisting'] }}\n{axes}"
        command("batch", written(tmp_path, text), "-o", out, "--jobs", 1)
        assert list(out.glob("*.svg"))


def test_what_an_observer_is_driven_by_may_vary_among_runs_without_one(tmp_path: Path) -> None:
    text = """control.extended_state.bandwidth = 25.0
[vary]
control.observer = { values = ["none", "disturbance", "extended_state"] }
control.disturbance.input = { values = ["command", "spring"] }
"""
    plan = planned(tmp_path, text, "elastic")
    inputs = [plan.scenario_of(run).structure().observer_input for run in range(6)]
    assert inputs == ["command", "command", "command", "spring", "command", "command"]
    assert [group.constants["control.disturbance.input"] for group in plan.groups] == [
        None, None, "command", "spring", None, None
    ]  # fmt: skip
    assert plan.scenario_of(4).value_of("control.extended_state.bandwidth.0") == 25.0


def test_of_the_scenario_s_own_controller_too(tmp_path: Path) -> None:
    text = 'control.controller = "super_twisting"\ncontrol.super_twisting.slope = 20.0\n[vary]\n'
    text += 'control.controller = { values = ["super_twisting", "computed_torque"] }\n'
    text += "control.super_twisting.layer = { values = [0.1, 0.2] }\n"
    plan = planned(tmp_path, text)
    assert plan.sweep.held == {}
    assert [plan.scenario_of(run).document["control"].get("super_twisting", {}).get("layer") for run in range(4)] == [
        0.1, 0.2, None, None
    ]  # fmt: skip
    assert plan.scenario_of(1).value_of("control.super_twisting.slope.0") == 20.0


OWN = """
from springline.model import Control, Controller, Parameter
class Servo(Controller):
    parameters = (Parameter("stiffness", "1/s^2", 900.0, "of the loop"),)
    def control(self, r, y, z, model, p):
        arm, e = model(y.q1, y.dq1), r.q - y.q1
        return Control(arm.H @ (r.ddq + 60 * (r.dq - y.dq1) + p.stiffness * e) + arm.c + arm.G, e)
"""


def test_of_a_controller_of_a_user_s_file(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN)
    text = "control.servo.stiffness = 700.0\n[vary]\n"
    text += 'control.controller = { values = ["computed_torque", "own.py:Servo"] }\n'
    file, out = written(tmp_path, text + "plant.m3.scale = { values = [1.0, 1.1] }\n"), tmp_path / "out"
    command("batch", file, "-o", out, "--jobs", 1, "--no-plot", "--set", "control.servo.stiffness=800")
    plan = stored_plan(Dataset(place(str(out))), [tmp_path / "own.py"])
    assert plan.scenario_of(3).value_of("control.servo.stiffness") == 800.0
    command("replay", out, 3, "-o", tmp_path / "again", "--no-plot", "--code", tmp_path / "own.py")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"control.super_twisting.slop = 20.0\n[vary]\n{RIVALS}", "set.control.super_twisting.slop: unknown key"),
        (f"control.super_twisting.slope = -20.0\n[vary]\n{RIVALS}", "set.control.super_twisting.slope"),
        (f"control.nonsingular_terminal.gain = 20.0\n[vary]\n{RIVALS}", "control.nonsingular_terminal"),
        (f"[vary]\n{RIVALS}control.super_twisting.slop = {{ values = [20.0] }}\n", "vary.control.super_twisting.slop"),
        (f"[vary]\n{RIVALS}control.super_twisting.slop = {{ uniform = [1, 2], points = 3 }}\n", "twisting.slope"),
        (f"[vary]\n{RIVALS}control.nonsingular_terminal.gain = {{ values = [20.0] }}\n", "nonsingular_terminal"),
    ],
)  # fmt: skip
def test_wrong_use_is_told(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        planned(tmp_path, text)
    assert message in str(error.value), str(error.value)


def test_gains_that_no_theorem_covers_are_named_for_the_runs_that_have_them(tmp_path: Path) -> None:
    text = f"control.super_twisting.integral_gain = 90.0\n[vary]\n{RIVALS}"
    done = CliRunner().invoke(app, ["batch", str(written(tmp_path, text)), "--dry-run"])
    assert "control.super_twisting.integral_gain.0 is 90" in done.stderr
