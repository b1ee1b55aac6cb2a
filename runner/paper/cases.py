"""What the paper publishes: its experiments (Table 2) and its results (Table 4).

Guo et al. 2023, J. Mar. Sci. Eng. 11(3) 474, doi 10.3390/jmse11030474.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

JOINTS = ("lift", "rotation")

UNIT: Mapping[str, str] = {"lift": "m", "rotation": "rad"}
"""Unit of a joint's coordinate."""

LAWS: Mapping[str, str] = {
    "variable_power_log": "variable power log",
    "double_power": "double power",
    "power": "power",
}
"""The paper's laws, the new one first: name in a scenario -> name in the paper."""

MEASURES: Mapping[str, str] = {
    "response_time": "response time",
    "settling_time": "settling time",
    "overshoot": "max overshoot",
    "steady_state_error": "steady-state error",
}
"""Column of the metrics -> heading of Table 4, in the table's order."""

Pair = tuple[float, float]
"""Lift and rotation."""


@dataclass(frozen=True, slots=True)
class Case:
    """One row of Table 4: its group, its name there, the scenario that repeats it, and the numbers printed.

    printed  measure -> (lift, rotation) in s, m or rad; empty where the paper prints no numbers
    """

    group: int
    name: str
    scenario: str
    printed: Mapping[str, Pair]


def _printed(response: Pair, settling: Pair, overshoot: Pair, steady_state: Pair) -> Mapping[str, Pair]:
    return dict(zip(MEASURES, (response, settling, overshoot, steady_state), strict=True))


# Group 1 prints 0.01 s for the lift's response under shake, groups 2 to 4 print 0.10 s for the same run (erratum E2).
_SHAKE = _printed((0.10, 0.16), (0.20, 0.21), (0.04, 0.0), (0.015, 0.001))

CASES: tuple[Case, ...] = (
    Case(1, "shake", "paper/group1_shake", _printed((0.01, 0.16), (0.20, 0.21), (0.04, 0.0), (0.015, 0.001))),
    Case(1, "pitch", "paper/group1_pitch", _printed((0.01, 0.16), (0.20, 0.21), (0.04, 0.0), (0.003, 0.003))),
    Case(1, "roll", "paper/group1_roll", _printed((0.01, 0.16), (0.20, 0.21), (0.03, 0.0), (0.0, 0.0))),
    Case(2, "variable power log", "paper/group2_variable_power_log", _SHAKE),
    Case(
        2, "double power", "paper/group2_double_power", _printed((0.14, 0.24), (0.63, 0.61), (0.21, 0.11), (0.18, 0.03))
    ),
    Case(2, "power", "paper/group2_power", _printed((0.19, 0.34), (0.76, 1.32), (0.22, 0.13), (0.16, 0.06))),
    Case(3, "no payload change", "paper/group3_nominal", _SHAKE),
    Case(
        3,
        "payload +20 %",
        "paper/group3_payload_plus",
        _printed((0.11, 0.16), (0.21, 0.21), (0.05, 0.0), (0.018, 0.003)),
    ),
    Case(
        3,
        "payload −20 %",
        "paper/group3_payload_minus",
        _printed((0.12, 0.16), (0.21, 0.21), (0.05, 0.0), (0.017, 0.002)),
    ),
    Case(4, "fast control on", "paper/group4_fast_on", _SHAKE),
    Case(4, "fast control off", "paper/group4_fast_off", {}),
)
"""Tables 2 and 4. "Payload 1" and "payload 2" are read as +20 % and -20 % (E6)."""

GROUPS = (1, 2, 3, 4)

INPUTS: Mapping[str, str] = {"law_limit": "paper", "motor_limit": "paper_motor_limit"}
"""Sets of what the paper does not publish (E5, E11): name -> folder of the packaged scenarios. A limit on the law's
acceleration, or on the motors' force."""


def under(inputs: str, scenario: str) -> str:
    """The scenario of a set of INPUTS that repeats the same case as one of "paper/"."""
    case = scenario.removeprefix("paper/")
    # What is printed is printed, whatever one thinks of the rest.
    return scenario if case == "as_printed" else f"{INPUTS[inputs]}/{case}"


GRADIENTS: Mapping[str, float] = {"variable_power_log": 0.56, "double_power": 3.11, "power": 3.11}
"""Slopes of the reaching laws near the origin that the paper prints with Figure 4."""

FLUTTER_SEEN = 1.0
"""Time in s after which the paper's run without fast control visibly flutters."""


def cases(groups: Iterable[int]) -> tuple[Case, ...]:
    """The cases of some groups, in Table 4's order. Raises ValueError for a group that the paper does not have."""
    wanted = set(groups)
    if unknown := wanted - set(GROUPS):
        raise ValueError(
            f"the paper has groups {', '.join(map(str, GROUPS))}, not {', '.join(map(str, sorted(unknown)))}"
        )
    return tuple(case for case in CASES if case.group in wanted)
