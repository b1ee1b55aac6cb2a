"""What is not proved of the elementary functions is measured, and the page says what was seen."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from springline.benchmarks.math_dense import CASES, Case, measure

DOCUMENT = Path(__file__).parents[2] / "docs" / "math.md"


def documented() -> dict[tuple[str, str], float]:
    block = DOCUMENT.read_text().split("<!-- dense: begin -->")[1].split("<!-- dense: end -->")[0]
    rows = re.findall(r"^\| (\w+) \| (.+?) \| ([\d.]+) \| `", block, re.MULTILINE)
    return {(function, where): float(error) for function, where, error in rows}


def test_few_arguments_are_no_worse_than_the_many_of_the_page() -> None:
    known = documented()
    assert set(known) == {(case.function, case.range) for case in CASES}
    for case, error, where in measure(100_000):
        assert case.low <= where <= case.high or case.high <= where <= case.low
        assert 0.4 < error <= known[case.function, case.range] + 0.005, case
        assert known[case.function, case.range] <= (1.6 if case.function in ("log", "log1p", "pow_m1_3") else 2.0)


def test_a_wrong_function_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = Case("log", "logl(x) * (1 + 0x1p-50L)", 0.5, 2.0, "1/2 .. 2")
    monkeypatch.setattr("springline.benchmarks.math_dense.CASES", (wrong,))
    [(_, error, _)] = measure(1000)
    assert error > 3
