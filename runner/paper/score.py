"""How close a reproduction comes to Table 4: how many of its numbers lie within 10 %, 30 % and a factor of two."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from springline.runner.paper.cases import JOINTS, MEASURES, Case
from springline.runner.paper.measured import Measured

BANDS: Mapping[str, tuple[float, float]] = {
    "within 10 %": (0.9, 1.1),
    "within 30 %": (0.7, 1.3),
    "within a factor of 2": (0.5, 2.0),
}
"""What a number may be, over the printed one; each band holds the one before it."""

FARTHER = "farther"
"""Of a number in no band, or one that does not exist."""

_PRINTED_STEP: Mapping[str, float] = {
    "response_time": 0.01,
    "settling_time": 0.01,
    "overshoot": 0.01,
    "steady_state_error": 0.001,
}
"""Last digit that Table 4 prints. A printed 0 is met by what rounds to it: nothing is within a share of zero."""


@dataclass(frozen=True, slots=True)
class Score:
    """How many of some numbers of Table 4 were met.

    total   how many are printed
    within  band -> how many lie in it, in the order of BANDS
    """

    total: int
    within: Mapping[str, int]


def closeness(measure: str, printed: float, ours: float) -> str:
    """The narrowest band of BANDS in which a number lies, or FARTHER; in SI units."""
    if math.isnan(ours):
        return FARTHER
    if printed == 0.0:
        return next(iter(BANDS)) if abs(ours) < _PRINTED_STEP[measure] / 2 else FARTHER
    # What the quotient of two decimal fractions loses is no matter of closeness.
    ratio = round(ours / printed, 12)
    return next((band for band, (low, high) in BANDS.items() if low <= ratio <= high), FARTHER)


def score(cases: Iterable[Case], runs: Mapping[str, Measured], measures: Iterable[str], joints: Iterable[str]) -> Score:
    """How many of the numbers that Table 4 prints for these cases, measures and joints were met."""
    chosen = [(measure, JOINTS.index(joint)) for measure in measures for joint in joints]
    found = [
        closeness(measure, case.printed[measure][i], runs[case.scenario].metric(measure, JOINTS[i]))
        for case in cases
        if case.printed
        for measure, i in chosen
    ]
    bands = list(BANDS)
    within = {band: sum(one in bands[: k + 1] for one in found) for k, band in enumerate(bands)}
    return Score(len(found), within)


def columns() -> list[tuple[str, str]]:
    """Measure and joint of each column of Table 4, in its order."""
    return [(measure, joint) for measure in MEASURES for joint in JOINTS]
