"""Both sets of what the paper does not publish: the same cases, and how close each comes to Table 4."""

from __future__ import annotations

import math

import pytest
from typer.testing import CliRunner

from springline.runner.cli import app
from springline.runner.paper import INPUTS
from springline.runner.paper.cases import CASES, JOINTS, MEASURES, cases, under
from springline.runner.paper.runs import study
from springline.runner.paper.score import score
from springline.runner.scenario import load_scenario


def test_both_sets_have_every_case_and_differ_in_inputs_alone() -> None:
    assert under("motor_limit", "paper/as_printed") == "paper/as_printed"
    open_keys = {"a_max", "U_max", "delta"}
    for name in ["paper/nominal", *(case.scenario for case in CASES)]:
        one, other = (load_scenario(under(inputs, name)) for inputs in INPUTS)
        assert one.structure().law == other.structure().law
        for table in ("plant", "reference", "initial"):
            assert one.document[table] == other.document[table], (name, table)
        for table, given in (("mechanism", {"J"}), ("simulation", {"response_band", "settling_band"})):
            changed = {key for key, value in one.document[table].items() if other.document[table][key] != value}
            assert changed == given, name
        control, others = one.document["control"], other.document["control"]
        assert {key for key in control if control[key] != others[key]} == open_keys
        assert all(map(math.isinf, others["a_max"]))


@pytest.mark.parametrize("inputs", INPUTS)
def test_a_set_is_one_set(inputs: str) -> None:
    """The same limits, boundary layer, inertia, bands and heave in all of its scenarios."""
    every = [load_scenario(under(inputs, case.scenario)).document for case in CASES]
    nominal = load_scenario(under(inputs, "paper/nominal")).document
    for key in ("a_max", "U_max", "delta"):
        assert {str(one["control"][key]) for one in every} == {str(nominal["control"][key])}
    for table in ("mechanism", "simulation"):
        assert {str(one[table]) for one in every} == {str(nominal[table])}
    heaves = {str(one["base_motion"]["heave"]) for one in every if one["base_motion"].get("heave")}
    assert len(heaves) == 1


def test_14_numbers_of_group_2_lie_within_30_percent_where_the_motors_are_limited() -> None:
    found = study([2], whole=False, inputs="motor_limit")
    met = score(cases([2]), found.evidence.runs, list(MEASURES), list(JOINTS))
    assert met.total == 24
    assert met.within["within 30 %"] == 14


def test_an_unknown_set_is_refused_before_anything_is_written(tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("none") / "report"
    done = CliRunner().invoke(app, ["reproduce", "--inputs", "motor_limits", "-o", str(folder)])
    assert done.exit_code == 2
    assert "motor_limit" in done.output
    assert not folder.exists()
