"""How a claim is tested: by numbers and checks against thresholds that are stated, so that it may fail.

A claim's verdict follows from its checks alone: all met, it holds; some, partly; none, it fails.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from springline.runner.analysis import Proof
from springline.runner.paper.cases import CASES, JOINTS, Case
from springline.runner.paper.measured import Floats, Measured

Verdict = Literal["holds", "partly", "fails"]


@dataclass(frozen=True, slots=True)
class Number:
    """A number of a claim.

    label, value, unit  NaN where there is no such number
    printed             what the paper prints, if it does
    halved              the value with half the step, if that is known
    """

    label: str
    value: float
    unit: str = ""
    printed: float | None = None
    halved: float | None = None

    @property
    def change(self) -> float | None:
        """Change when the step is halved; None if it is not known, NaN if either value does not exist."""
        if self.halved is None:
            return None
        return 0.0 if self.halved == self.value else self.halved - self.value  # infinite bounds are equal too


@dataclass(frozen=True, slots=True)
class Check:
    """One condition of a claim with its threshold, whether it is met, and why not, where that is known."""

    text: str
    met: bool
    why: str = ""


@dataclass(frozen=True, slots=True)
class Finding:
    """What came of a claim.

    note    what to know of it besides, for people; "" for nothing
    stable  that every check comes out the same with half the step
    """

    number: int
    claim: str
    checks: tuple[Check, ...]
    numbers: tuple[Number, ...]
    note: str = ""
    stable: bool | None = None

    @property
    def verdict(self) -> Verdict:
        """What the checks add up to."""
        met = [check.met for check in self.checks]
        if all(met):
            return "holds"
        return "partly" if any(met) else "fails"


@dataclass(frozen=True, slots=True)
class Inherent:
    """What mechanism and surface say by themselves, which no choice of inputs changes (E5, E10).

    angles   angles of the rotating part all around, rad
    felt     H^-1 S of each joint per m/s^2 of heave at these angles, joints x angles
    at_rest  |sigma| at rest, of a joint and an array of its errors (m or rad);  printed  the same with delta = 0
    """

    angles: Floats
    felt: Floats
    at_rest: Callable[[str, Floats], Floats]
    printed: Callable[[str, Floats], Floats]

    def largest(self, joint: str) -> float:
        """Largest |H^-1 S| of a joint per m/s^2 of heave."""
        return float(np.max(np.abs(self.felt[JOINTS.index(joint)])))

    def surface_time(self, joint: str, start: float, end: float) -> float:
        """Time (s) that an error takes from `start` to `end` (0 < end < start, m or rad) on the printed surface."""
        errors = np.geomspace(end, start, 2001)
        return float(np.trapezoid(errors / self.printed(joint, errors), np.log(errors)))


@dataclass(frozen=True, slots=True)
class Evidence:
    """All that the claims look at, from runs of one step size.

    runs    scenario name -> run
    theory  scenario name -> what section 6 says of the run
    laws    law -> d sigma / dt it asks for, of an array of sigma
    inherent  what follows without any run
    linear  law -> run with a linear surface (Figure 5); empty unless the whole paper is repeated
    """

    runs: Mapping[str, Measured]
    theory: Mapping[str, Proof]
    laws: Mapping[str, Callable[[Floats], Floats]]
    inherent: Inherent
    linear: Mapping[str, Measured]

    def group(self, group: int) -> list[tuple[Case, Measured]]:
        """Cases of a group with their runs."""
        return [(case, self.runs[case.scenario]) for case in CASES if case.group == group]

    def law(self, law: str) -> Measured:
        """The run of group 2 with a law."""
        return self.runs[f"paper/group2_{law}"]

    def heave_for(self, law: str, joint: str, error: float) -> float:
        """The least heave acceleration, m/s^2, that holds a joint at rest with an error (m or rad) (E10).

        The law has to ask for what the heave does to the joint, at the angle where that is most.
        """
        asked = float(np.abs(self.laws[law](self.inherent.at_rest(joint, np.array([error]))))[0])
        return asked / self.inherent.largest(joint)


@dataclass(frozen=True, slots=True)
class Judgement:
    """What a claim comes to: its checks, its numbers, and what to know of it besides."""

    checks: Sequence[Check]
    numbers: Sequence[Number]
    note: str = ""


@dataclass(frozen=True, slots=True)
class Claim:
    """A claim of the paper and how it is tested; `groups` must have been run (none: the curves of Figures 4 and 5)."""

    number: int
    text: str
    groups: frozenset[int]
    judge: Callable[[Evidence], Judgement]

    def possible(self, evidence: Evidence) -> bool:
        """Whether the evidence holds all that this claim needs."""
        if not self.groups:
            return bool(evidence.linear)
        return all(case.scenario in evidence.runs for case in CASES if case.group in self.groups)


def judge(claims: Iterable[Claim], evidence: Evidence, halved: Evidence | None = None) -> list[Finding]:
    """Findings for every claim that the evidence allows, with the change of each number when the step is halved.

    halved  the same evidence from runs with half the step
    """
    findings = []
    for claim in claims:
        if not claim.possible(evidence):
            continue
        found = claim.judge(evidence)
        numbers, stable = found.numbers, None
        if halved is not None:
            again = claim.judge(halved)
            numbers = [replace(a, halved=b.value) for a, b in zip(numbers, again.numbers, strict=True)]
            stable = [c.met for c in found.checks] == [c.met for c in again.checks]
        plain = tuple(replace(check, met=bool(check.met)) for check in found.checks)  # NumPy's truth is not Python's
        findings.append(Finding(claim.number, claim.text, plain, tuple(numbers), found.note, stable))
    return findings
