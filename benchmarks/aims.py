"""What springline aims at: ratios of two lines of the benchmark, by instruction set, and whether they are reached."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from springline.benchmarks import against
from springline.benchmarks.contenders import ours
from springline.benchmarks.harness import Report, Row

Line = tuple[str, str]
"""Contender and variant."""

COLUMNS = ("x86-64-v4", "x86-64-v3")
"""Instruction sets that have aims of their own; their vectors are those of AVX-512 and of AVX2."""


@dataclass(frozen=True, slots=True)
class Aim:
    """One ratio: how many times as long an evaluation takes in one line as in another.

    wanted  one for each of COLUMNS, or one for every machine
    most    whether it is the most that is wanted, not the least
    cores   processor cores that have to be free, or the ratio says nothing of springline
    how     what has to be asked for, or a line is not there
    """

    name: str
    longer: Line
    shorter: Line
    wanted: tuple[float, float] | float
    most: bool = False
    cores: int = 1
    how: str = ""

    def on(self, instruction_set: str) -> float:
        """What is wanted on a machine; NaN for nothing."""
        if isinstance(self.wanted, tuple):
            return dict(zip(COLUMNS, self.wanted, strict=True)).get(instruction_set, math.nan)
        return self.wanted


def _aims() -> Iterable[Aim]:
    def default(mode: str) -> Line:
        return ours.NAME, mode

    for name, wanted in (
        ("CasADi C", (25.0, 10.0)),
        ("Numba", (20.0, 8.0)),
        ("NumPy", (16.0, 14.0)),
        ("JAX", (33.0, 13.0)),
        ("handwritten C", (17.0, 7.0)),
    ):
        yield Aim(f"continuous: {name}", (name, "continuous"), default("continuous"), wanted)
    yield Aim("sampled: CasADi C", ("CasADi C", "sampled"), default("sampled"), (21.0, 8.5))
    for mode, wanted in (("continuous", (1.65, 1.25)), ("sampled", (1.65, 1.35))):
        yield Aim(f"{mode}: {against.NAME}", (against.NAME, mode), default(mode), wanted, how="--before CHECKOUT")
    for mode in ("continuous", "sampled"):
        alone = f"{mode}, one run"
        yield Aim(f"{alone}: handwritten C", ("handwritten C", alone), (ours.NAME, alone), (2.2, 1.9))
    for mode in ("continuous", "sampled"):
        free = f"{mode}, all tunable"
        yield Aim(f"{free}, over baked", (ours.NAME, free), default(mode), (1.25, 1.2), most=True)
    for mode in ("continuous", "sampled"):
        yield Aim(f"{mode}: one thread over two", default(mode), (ours.NAME, f"{mode}, 2 threads"), 1.9, cores=2)
    for effects in ours.REAL:
        yield Aim(
            f"{ours.HELD}: {effects}, over ideal",
            (ours.NAME, f"{ours.HELD}, {effects}"),
            (ours.NAME, ours.HELD),
            1.25,
            most=True,
        )
    yield Aim(
        "plant of seven links over that of the paper's arm",
        (ours.NAME, ours.SEVEN),
        (ours.NAME, ours.PLANT),
        10.0,
        most=True,
    )


AIMS = tuple(_aims())
"""All of them. How much longer others take, then what may be lost by tuning and real hardware, won by threads, taken by
long arms."""

_FREE = 0.95  # of the cores that an aim needs: threads that only calculate get no less where nothing else runs


@dataclass(frozen=True, slots=True)
class Judgement:
    """What became of an aim.

    wanted    the ratio, `bound` says whether at least or at most; NaN where the machine has no such aim
    measured  the ratio, NaN where a line is missing
    verdict   "reached", "missed", or why it is neither
    """

    aim: str
    bound: str
    wanted: float
    measured: float
    verdict: str


def judge(report: Report, aims: Sequence[Aim] = AIMS) -> list[Judgement]:
    """What a report says of each aim."""
    rows = {(row.contender, row.variant): row for row in report.rows}
    return [_judged(aim, rows, report.machine) for aim in aims]


def _judged(aim: Aim, rows: dict[Line, Row], machine: dict[str, Any]) -> Judgement:
    wanted = aim.on(machine["instruction_set"])
    longer, shorter = (rows.get(line) for line in (aim.longer, aim.shorter))
    measured = longer.ns_per_eval / shorter.ns_per_eval if longer and shorter else math.nan
    reached = measured <= wanted if aim.most else measured >= wanted
    free = machine["free_cores"]
    if math.isnan(measured):
        notes = [row.note for row in (longer, shorter) if row and row.note]
        verdict = f"not measured: {(notes or [aim.how or 'not among the contenders'])[0]}"
    elif math.isnan(wanted):
        verdict = f"no aim for {machine['instruction_set']}"
    elif not reached and aim.cores > 1 and (free is None or free < _FREE * aim.cores):
        verdict = f"not judged: {'–' if free is None else format(free, '.2f')} cores were free"
    else:
        verdict = "reached" if reached else "missed"
    return Judgement(aim.name, "at most" if aim.most else "at least", wanted, measured, verdict)
