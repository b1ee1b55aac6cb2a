"""How a claim is tested: by numbers and checks against thresholds that are stated, so that it may fail.

A claim's verdict follows from its checks alone: all met, it holds; some, partly; none, it fails.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from springline.runner.analysis import Proof
from springline.runner.paper.cases import CASES, Case
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
    """What came of a claim. `stable` says that every check comes out the same with half the step."""

    number: int
    claim: str
    checks: tuple[Check, ...]
    numbers: tuple[Number, ...]
    stable: bool | None = None

    @property
    def verdict(self) -> Verdict:
        """What the checks add up to."""
        met = [check.met for check in self.checks]
        if all(met):
            return "holds"
        return "partly" if any(met) else "fails"


@dataclass(frozen=True, slots=True)
class Evidence:
    """All that the claims look at, from runs of one step size.

    runs    scenario name -> run
    theory  scenario name -> what section 6 says of the run
    laws    law -> d sigma / dt it asks for, of an array of sigma; empty unless the whole paper is repeated
    linear  law -> run with a linear surface (Figure 5); empty likewise
    """

    runs: Mapping[str, Measured]
    theory: Mapping[str, Proof]
    laws: Mapping[str, Callable[[Floats], Floats]]
    linear: Mapping[str, Measured]

    def group(self, group: int) -> list[tuple[Case, Measured]]:
        """Cases of a group with their runs."""
        return [(case, self.runs[case.scenario]) for case in CASES if case.group == group]

    def law(self, law: str) -> Measured:
        """The run of group 2 with a law."""
        return self.runs[f"paper/group2_{law}"]


Judgement = tuple[Sequence[Check], Sequence[Number]]


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
            return bool(evidence.laws and evidence.linear)
        return all(case.scenario in evidence.runs for case in CASES if case.group in self.groups)


def judge(claims: Iterable[Claim], evidence: Evidence, halved: Evidence | None = None) -> list[Finding]:
    """Findings for every claim that the evidence allows, with the change of each number when the step is halved.

    halved  the same evidence from runs with half the step
    """
    findings = []
    for claim in claims:
        if not claim.possible(evidence):
            continue
        checks, numbers = claim.judge(evidence)
        stable = None
        if halved is not None:
            again, finer = claim.judge(halved)
            numbers = [replace(a, halved=b.value) for a, b in zip(numbers, finer, strict=True)]
            stable = [c.met for c in checks] == [c.met for c in again]
        plain = tuple(replace(check, met=bool(check.met)) for check in checks)  # NumPy's truth is not Python's
        findings.append(Finding(claim.number, claim.text, plain, tuple(numbers), stable))
    return findings
