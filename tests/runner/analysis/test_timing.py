"""What an export says of sample periods and delays: the analysis' own numbers, of the scenario that it is made of."""

from __future__ import annotations

import math
import re

import pytest

import springline as sl
from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.runner.analysis import delay_max, linear_loop, period_max, timing
from springline.runner.scenario import Scenario

SAMPLED = {"control.mode": "sampled", "control.period": 0.001}


def told(sentences: tuple[str, ...], what: str) -> float:
    """The number, s, in the sentence that begins so."""
    sentence = next(sentence for sentence in sentences if sentence.startswith(f"Largest {what}"))
    found = re.search(r"about ([0-9.]+) ms", sentence)
    assert found, sentence
    return float(found[1]) / 1e3


def is_rounded_down(value: float, exact: float | None) -> bool:
    assert exact is not None
    return exact * 0.9 < value <= exact and f"{value:.2g}" == f"{value:.6g}"


def slower() -> Scenario:
    """Another arm, with springs of a quarter of the stiffness."""
    return sl.load_scenario("paper/nominal", {**SAMPLED, "drive.k_s2": 5e5, "drive.k_s3": 5e3})


@pytest.mark.parametrize("sampled", [False, True])
def test_the_numbers_are_those_of_the_analysis(sampled: bool) -> None:
    scenario = sl.load_scenario("paper/nominal", SAMPLED if sampled else {})
    loop, sentences = linear_loop(scenario, scenario.sigma_amplitude), timing(scenario)
    assert is_rounded_down(told(sentences, "sample period"), period_max(loop)[0].value)
    assert is_rounded_down(told(sentences, "delay of the command"), delay_max(loop)[0].value)
    assert "amplitude 0.1;" in sentences[-1]
    held = next(sentence for sentence in sentences if "period of 1 ms" in sentence)
    assert told((held,), "delay") == pytest.approx(0.00054)  # PAPER.md E11: 0.5 ms survive, 0.6 do not


def test_readme_and_header_of_another_arm_have_its_own() -> None:
    scenario = slower()
    sentences = timing(scenario)
    assert sentences[:2] != timing(sl.load_scenario("paper/nominal", SAMPLED))[:2]
    files, _ = generate_files(bind(scenario.structure(), scenario.values(), timing=sentences))
    for path in ("README.md", "include/springline.h"):
        text = " ".join(files[path].decode().replace("\n *", " ").split())
        assert all(sentence in text for sentence in sentences), path


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("paper/group4_fast_off", {}, "none; the continuous loop is unstable."),
        ("paper/group2_power", {}, "the law's gain grows without bound as sigma goes to zero"),
        ("controllers/computed_torque", {}, "limits left out. They are boundaries"),
        ("paper/nominal", {"drive.kind": "rigid"}, "Largest sample period"),
    ],
)
def test_what_has_no_number_says_why(name: str, changes: dict[str, object], said: str) -> None:
    sentences = timing(sl.load_scenario(name, changes))
    assert said in " ".join(sentences)
    assert not any(math.isnan(float(number)) for text in sentences for number in re.findall(r"about (\S+) ms", text))


def test_rates_made_of_differences_can_be_exported() -> None:
    assert timing(sl.load_scenario("paper/nominal", {**SAMPLED, "sensor.velocity": "differenced"}))
