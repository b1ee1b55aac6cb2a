"""The report of a run: it says what is true, all of it is in the file, and nothing of the machine."""

from __future__ import annotations

import html
import re
from typing import Any

import pytest

from springline.runner.run import Result, report_files, simulate, trajectory_hash
from springline.runner.scenario import Scenario, load_scenario

Run = tuple[Scenario, Result]


def simulated(name: str, changes: dict[str, Any]) -> Run:
    scenario = load_scenario(name, changes)
    return scenario, simulate(scenario)


def words(run: Run) -> str:
    """The text of a report without figures, marks and line breaks."""
    page = report_files(*run, plot=False)["report.html"].decode()
    body = page.partition("<main>")[2]
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", body)).split())


@pytest.fixture(scope="module")
def calm() -> Run:
    return simulated("paper/nominal", {"simulation.duration": 0.5})


def test_a_report_holds_everything_and_fetches_nothing(calm: Run) -> None:
    files = report_files(*calm)
    page = files["report.html"].decode()
    assert len(page) < 3_000_000
    figures = [name for name in files if name.endswith(".svg")]
    assert page.count("<figure>") == page.count("<svg viewBox=") == len(figures) > 5
    assert not [source for source in re.findall(r'(?:src|href)="([^"#]*)"', page) if source]
    assert not re.search(r"https?://|<script|<link|@import|url\((?!#)", page)
    assert "prefers-color-scheme: dark" in page and "@media print" in page


def test_the_same_run_gives_the_same_page(calm: Run) -> None:
    assert report_files(*calm) == report_files(*calm)


def test_a_report_says_what_was_run(calm: Run) -> None:
    said = words(calm)
    for text in (
        "transfer_manipulator : lift (m), rotation (rad)",
        "variable power log law, with fast control, continuous",
        "base motion at rest",
        "lift sin(3.142 t) m; rotation 1 + sin(1.571 t) rad",
        "no U_max, a_max = 200 m/s² / 200 rad/s²",
        "0.5 s in 5000 steps of 0.1 ms, rk4",
        f"SHA-256 of their bits {trajectory_hash(calm[1].trajectory)}",
    ):
        assert text in said, text


def test_numbers_have_units_and_stand_right(calm: Run) -> None:
    page = report_files(*calm, plot=False)["report.html"].decode()
    metrics = calm[1].metrics.to_pylist()[0]
    assert f'<td class="number short" data-of="lift">{metrics["settling_time_lift"]:.4g} s</td>' in page
    assert f'<td class="number short" data-of="rotation">{metrics["U_max_rotation"]:.4g} N · m</td>' in page
    assert (
        f'<td class="number short" data-of="rotation">{1e6 * metrics["steady_state_error_rotation"]:.4g} µrad</td>'
        in page
    )


def test_a_calm_run_is_called_settled_and_calm(calm: Run) -> None:
    said = words(calm)
    at = calm[1].metrics["settling_time_lift"][0].as_py()
    assert f"lift: error settled It is within 40 mm (5 % of its initial error) from {at:.4g} s on." in said
    assert said.count(" calm In the second half") == 2
    assert "not settled" not in said and "chatters" not in said.partition("Provenance")[0]
    assert "a_max at its limit The limit of 200 m/s² is reached in" in said


def test_a_run_that_stopped_is_not_called_anything_else() -> None:
    said = words(simulated("paper/nominal", {"control.fast": False}))
    assert "Stopped: dq2_rotation left its bound (|dq2_rotation| ≤ 1e+06)" in said
    assert "the run out of bounds" in said
    assert said.count("not settled What it would have come to is not known") == 2
    assert " calm " not in said and "is within" not in said


def test_a_run_that_chatters_and_one_that_does_not_settle() -> None:
    chattering = words(simulated("paper/nominal", {"control.delta": 0.01, "simulation.duration": 1.0}))
    assert "lift: command chatters In the second half it varies by" in chattering
    short = words(simulated("paper/nominal", {"simulation.duration": 0.2}))
    assert "lift: error not settled It is outside of 40 mm" in short


def test_hardware_limits_and_starts_are_told() -> None:
    """What a scenario has stands there, and is not mentioned where it does not."""
    changes = {
        "simulation.duration": 0.1,
        "control.mode": "sampled",
        "control.period": 1e-3,
        "control.U_max": [2000.0, 2500.0],
        "sensor.position_noise": 2e-5,
        "actuator.delay": 2e-4,
        "mechanism.limits": [[-1.5, 1.2], [-1.0, 3.0]],
        "plant.m3": 48.0,
    }
    run = simulated("controllers/super_twisting", changes)
    said = words(run)
    for text in (
        "sampled every 1 ms",
        "position noise 20 µm / 20 µrad",
        "delay 0.2 ms",
        "U_max = 2000 N / 2500 N · m",
        "other than the controller believes m3 = 48.0",
        "limits of its joints lift −1.5 m to 1.2 m, rotation −1 rad to 3 rad",
        "seed and run of the sensors' noise 0, 0",
        "heave ",
    ):
        assert text in said, text
    assert "a_max" not in said.partition("Provenance")[0]
    commanded = run[1].trajectory["U_cmd_rotation"].to_pylist()
    share = 100 * sum(abs(value) >= 2500.0 * (1 - 1e-9) for value in commanded) / len(commanded)
    assert share and f"The limit of 2500 N · m is reached in {share:.2g} % of the rows." in said
    rigid = words(simulated("paper/nominal", {"simulation.duration": 0.01, "drive.kind": "rigid"}))
    assert "drive rigid" in rigid and "spring" not in rigid.partition("Provenance")[0].replace("springline", "")


def test_no_path_is_told(tmp_path: Any) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("[simulation]\nduration = 0.01\n", encoding="utf-8")
    page = report_files(*simulated(str(file), {}), plot=False)["report.html"].decode()
    assert "A run of mine.toml" in page and str(tmp_path) not in page
