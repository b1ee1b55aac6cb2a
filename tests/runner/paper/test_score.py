"""The score counts what lies in a band, and nothing else."""

from __future__ import annotations

import math

import pytest

from springline.runner.paper.cases import JOINTS, MEASURES, cases
from springline.runner.paper.measured import Measured
from springline.runner.paper.score import BANDS, FARTHER, closeness, score

CLOSE, NEAR, FACTOR = BANDS


@pytest.mark.parametrize(
    ("measure", "printed", "ours", "band"),
    [
        ("settling_time", 0.20, 0.18, CLOSE),
        ("settling_time", 0.20, 0.2201, NEAR),
        ("settling_time", 0.20, 0.139, FACTOR),
        ("settling_time", 0.20, 0.1, FACTOR),
        ("settling_time", 0.20, 0.4, FACTOR),
        ("settling_time", 0.20, 0.401, FARTHER),
        ("settling_time", 0.20, math.nan, FARTHER),
        ("overshoot", 0.0, 0.0049, CLOSE),
        ("overshoot", 0.0, 0.0051, FARTHER),
        ("steady_state_error", 0.0, 0.0004, CLOSE),
        ("steady_state_error", 0.0, 0.0006, FARTHER),
    ],
)
def test_a_number_is_as_close_as_its_narrowest_band(measure: str, printed: float, ours: float, band: str) -> None:
    assert closeness(measure, printed, ours) == band


def runs(factor: float) -> dict[str, Measured]:
    """Runs of group 2 whose numbers are the printed ones times a factor."""
    return {
        case.scenario: Measured(
            {}, {f"{m}_{joint}": factor * case.printed[m][i] for m in MEASURES for i, joint in enumerate(JOINTS)}
        )
        for case in cases([2])
    }


@pytest.mark.parametrize(("factor", "within"), [(1.05, (24, 24, 24)), (1.2, (1, 24, 24)), (1.9, (1, 1, 24))])
def test_bands_hold_those_before_them(factor: float, within: tuple[int, ...]) -> None:
    """One of the 24 numbers is a printed 0, which any multiple of it meets."""
    met = score(cases([2]), runs(factor), MEASURES, JOINTS)
    assert met.total == 24
    assert tuple(met.within.values()) == within


def test_a_part_is_counted_alone() -> None:
    met = score(cases([2]), runs(1.0), ["settling_time"], ["rotation"])
    assert (met.total, met.within[CLOSE]) == (3, 3)


def test_cases_without_printed_numbers_do_not_count() -> None:
    only = [case for case in cases([4]) if not case.printed]
    assert score(only, {}, MEASURES, JOINTS).total == 0
