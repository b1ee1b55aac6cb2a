"""The face of the analysis: verdicts with their numbers, in words, confirmed by runs, and wrong use told at once."""

import html
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import springline as sl
from springline.runner.analysis import Analysis, equivalent_gain
from springline.runner.cli import app
from springline.runner.files import InputError

NAMES = (
    *("delta_critical", "period_max", "delay_max", "epsilon_ratio", "fast_damping"),
    *("k1_margin", "gain_margin", "phase_margin"),
)
SAMPLED = {"control.mode": "sampled", "control.period": 0.001}


@cache
def confirmed() -> Analysis:
    """The paper's arm, with runs."""
    return sl.analyze(sl.load_scenario("paper/nominal"), confirm=True)


@cache
def analysed(name: str = "paper/nominal", **overrides: Any) -> Analysis:
    changes = {key.replace("__", "."): value for key, value in overrides.items()}
    return sl.analyze(sl.load_scenario(name, changes))


def value(found: Analysis, name: str) -> float:
    number = found.row(name).value
    assert number is not None, found.row(name).text
    return number


def test_the_paper_s_arm() -> None:
    """E3, E11, E13 of docs/paper.md."""
    found = confirmed()
    assert found.status == "ok"
    assert 0.0255 < value(found, "delta_critical") < 0.028
    assert value(found, "period_max") == pytest.approx(0.002, rel=0.05)
    assert value(found, "fast_damping") == pytest.approx(9 / 1022, rel=0.1)
    assert "-50 ± " in found.row("fast_damping").text
    assert value(found, "epsilon_ratio") == pytest.approx(42 / 1020, rel=0.05)
    assert value(found, "k1_margin") == pytest.approx(3.0, abs=0.01)
    assert value(found, "floquet_exponent") < -5.0
    assert all(found.row(name).text for name in NAMES)
    assert {f"{name}_{joint}" for name in NAMES[5:] for joint in ("lift", "rotation")} <= {r.name for r in found.rows}
    assert "at sigma amplitude 0.1" in found.row("delta_critical").text
    assert "over 0.0001 … 0.5" in found.row("delta_critical").text


def test_a_delta_that_is_too_small_is_called_unstable() -> None:
    found = analysed(control__delta=0.02)
    assert found.status == "unstable"
    for name in ("delta_critical", "period_max", "delay_max", "gain_margin", "phase_margin", "fast_damping"):
        assert found.row(name).ok is False
        assert "unstable" in found.row(name).text
    assert found.row("delta_critical").value == pytest.approx(value(confirmed(), "delta_critical"))


def test_people_see_a_line_and_notebooks_a_table() -> None:
    found = analysed(control__delta=0.02)
    failed = [row.name for row in found.rows if row.ok is False]
    assert repr(found) == f"Analysis(unstable, {len(found.rows)} rows: no to {', '.join(failed)})"
    assert "delta_critical" in failed
    page = found._repr_html_()
    assert page.count("<tr>") == len(found.rows)
    assert f"<td>delta_critical</td><td>{found.row('delta_critical').value:.3g} m or rad</td><td>no</td>" in page
    assert all(html.escape(row.text) in page for row in found.rows)
    assert repr(found.scenario) == "Scenario('paper/nominal')"


def test_without_fast_control_no_delta_is_stable() -> None:
    row = analysed(control__fast=False).row("delta_critical")
    assert (row.value, row.ok) == (None, False)
    assert "unstable" in row.text


def test_a_sampled_control_is_judged_by_its_period_and_delay() -> None:
    found = analysed(**{key.replace(".", "__"): item for key, item in SAMPLED.items()})
    assert found.row("period_max").ok is True
    assert value(found, "delay_max") < 0.001
    assert value(found, "delta_critical") < 0.99 * value(confirmed(), "delta_critical")  # of the loop as it runs
    slow = {"control__mode": "sampled", "control__period": 0.0021, "simulation__duration": 4.2}
    late = analysed(**slow).row("period_max")
    assert late.ok is False
    assert late.text.startswith("unstable")


def test_a_law_whose_gain_has_no_bound_ends_in_a_limit_cycle() -> None:
    found = analysed(control__law="power")
    for name in ("delta_critical", "period_max", "delay_max"):
        assert found.row(name).value is None
        assert "no finite boundary" in found.row(name).text
    assert 1e-3 < value(found, "limit_cycle_amplitude") < 1e-2
    assert value(found, "limit_cycle_frequency") == pytest.approx(1020, rel=0.02)


@pytest.mark.parametrize(
    ("name", "overrides", "absent"),
    [
        ("controllers/computed_torque", {}, {"delta_critical", "k1_margin", "floquet_exponent"}),
        ("paper/nominal", {"drive__kind": "rigid"}, {"epsilon_ratio", "fast_damping", "delta_critical"}),
    ],
)
def test_what_does_not_apply_is_null_and_says_why(name: str, overrides: dict[str, Any], absent: set[str]) -> None:
    found = analysed(name, **overrides)
    for row in (found.row(key) for key in absent):
        assert row.value is None
        assert row.ok is None
        assert row.text


def test_three_links() -> None:
    found = analysed(mechanism__name="planar_arm", mechanism__n=3, control__controller="computed_torque")
    assert {f"gain_margin_joint{k}" for k in (1, 2, 3)} <= {row.name for row in found.rows}
    assert 0.0 < value(found, "epsilon_ratio") < 1.0


def test_a_range_is_searched_for_its_worst() -> None:
    scenario = sl.load_scenario("paper/nominal", {"control.delta": 0.03})
    row = sl.analyze(scenario, {"plant.m3.scale": (0.8, 1.2)}).row("delta_critical")
    assert row.ok is False  # stable with the arm as it is believed to be, but not with a light payload
    assert "worst at plant.m3.scale = 0.8" in row.text
    assert row.value == pytest.approx(value(confirmed(), "delta_critical"))


def test_runs_find_the_boundaries_of_the_paper_s_arm() -> None:
    found = confirmed()
    for name in ("delta_critical", "period_max", "delay_max"):
        row = found.row(name)
        assert row.confirmed == pytest.approx(row.value, rel=0.05)
        assert "Runs: " in row.text
    assert found.row("k1_margin").confirmed is None


@pytest.mark.parametrize(
    ("ranges", "told"),
    [
        ({"plant.m33.scale": (0.8, 1.2)}, "plant.m3.scale"),
        ({"plant.m3.scale": (1.2, 0.8)}, "LOW < HIGH"),
        ({"plant.m3.scale": (-0.8, 1.2)}, "> 0"),
        ({"control.delta": (0.05, float("inf"))}, "finite"),
    ],
)
def test_wrong_ranges_are_told(ranges: dict[str, tuple[float, float]], told: str) -> None:
    with pytest.raises(InputError, match=told):
        sl.analyze(sl.load_scenario("paper/nominal"), ranges)


@pytest.mark.parametrize("text", ["plant.m33=0.8,1.2", "plant.m3.scale=1", "plant.m3.scale", "plant.m3.scale=2,1"])
def test_wrong_use_is_exit_2_and_writes_nothing(text: str, tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["analyze", "paper/nominal", "--range", text, "-o", str(tmp_path / "out")])
    assert result.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_json() -> None:
    result = CliRunner().invoke(app, ["analyze", "paper/nominal", "--json"])
    assert result.exit_code == 0
    answer = json.loads(result.stdout)
    assert set(answer) == {"command", "version", "status", "rows", "units"}
    assert set(NAMES) <= {row["name"] for row in answer["rows"]}
    assert all(set(row) == {"name", "value", "unit", "ok", "text", "confirmed"} for row in answer["rows"])
    assert answer["units"]["delay_max"] == "s"


@pytest.mark.full
def test_the_report(tmp_path: Path) -> None:
    arguments = ["analyze", "paper/nominal", "-o", str(tmp_path / "out"), "--set", "simulation.duration=1.0"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    figures = {file.stem for file in (tmp_path / "out/figures").glob("*.png")}
    assert figures == {"spectrum", "reference", "channels", "laws", "tornado"}
    stored = json.loads((tmp_path / "out/analysis.json").read_text())
    assert {row["name"] for row in stored["rows"]} >= set(NAMES)
    assert "smallest stable" in (tmp_path / "out/report.md").read_text()
    again = CliRunner().invoke(app, ["run", "paper/nominal", "-o", str(tmp_path / "out")])
    assert again.exit_code == 2


def test_an_equivalent_gain_by_hand() -> None:
    """The describing function of |s|^(1/2) sgn s is 4/pi times the integral of sin^(3/2) over a quarter of a turn."""
    found = float(equivalent_gain(lambda s: np.sqrt(np.abs(s)) * np.sign(s), 0.01))
    assert found == pytest.approx(1.1128 / np.sqrt(0.01), rel=1e-3)


def test_rates_made_of_differences_leave_less_and_a_note_says_what_is_not_of_them() -> None:
    overrides = {**SAMPLED, "sensor.velocity": "differenced", "control.controller": "computed_torque"}
    found = analysed(**{key.replace(".", "__"): one for key, one in overrides.items()})
    assert value(found, "period_max") == pytest.approx(1.06e-3, rel=0.02)  # half of what measured rates have
    assert value(found, "delay_max") < 1e-4
    assert any("Rates are made of differences" in note for note in found.notes)


@pytest.mark.full
@pytest.mark.parametrize(
    "overrides",
    [
        {"mechanism.name": "planar_arm", "mechanism.n": 3},
        {**SAMPLED, "sensor.velocity": "differenced"},
        {**SAMPLED, "control.controller": "super_twisting"},
        {**SAMPLED, "control.observer": "extended_state", "actuator.delay": 2e-4, "actuator.lag": [1e-4, 1e-4]},
        {"drive.kind": "rigid"},
    ],
    ids=["three links", "differenced", "super twisting", "observer, delay and lag", "rigid"],
)
def test_runs_find_the_boundaries_of_other_loops(overrides: dict[str, Any]) -> None:
    found = sl.analyze(sl.load_scenario("paper/nominal", overrides), confirm=True)
    rows = [found.row(name) for name in ("delta_critical", "period_max", "delay_max")]
    known = [row for row in rows if row.value is not None]
    assert {"period_max", "delay_max"} <= {row.name for row in known}
    for row in known:
        assert row.confirmed == pytest.approx(row.value, rel=0.05), row.text


@pytest.mark.full
def test_a_wide_limit_cycle_is_said_to_be_another_and_why() -> None:
    found = sl.analyze(sl.load_scenario("paper/nominal", {"control.delta": 0.02}), confirm=True)
    row = found.row("limit_cycle_amplitude")
    assert row.confirmed == pytest.approx(row.value, rel=0.25)
    assert "Runs disagree by -" in row.text
    assert "a surface bends too" in row.text
    frequency = found.row("limit_cycle_frequency")
    assert frequency.confirmed == pytest.approx(frequency.value, rel=0.01)


def test_a_slim_margin_fails_and_says_so() -> None:
    found = analysed(control__mode="sampled", control__period=0.0018)
    row = found.row("phase_margin")
    assert found.status == "ok"
    assert row.ok is False
    assert row.text.startswith("slim, below 30 degrees")
    assert "a delay of this channel alone may be" in row.text
