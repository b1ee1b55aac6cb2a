"""The command that measures what a sweep costs beyond its kernel, on a sweep that is too small to tell anything."""

import json
import math

import pytest

from springline.benchmarks.batch_throughput import MILLION, RUN, Times, best, main

TINY = ["--runs", "64", "--duration", "4e-4", "--threads", "2", "--repeats", "2"]


def test_the_command_prints_rates_and_their_ratios(capsys: pytest.CaptureFixture[str]) -> None:
    main([*TINY, "--json"])
    found = json.loads(capsys.readouterr().out)
    assert (found["runs"], found["duration"], found["threads"]) == (64, 4e-4, 2)
    assert all(math.isfinite(value) and value > 0.0 for value in found.values())
    kernel, batch, single = (found[f"{way}_runs_per_s"] for way in ("kernel", "batch", "single"))
    assert batch < kernel  # four steps a run: drawing and storing take far longer than simulating
    assert found["batch_over_kernel"] == pytest.approx(batch / kernel)
    assert found["threads_over_one"] == pytest.approx(batch / single)
    assert found["million_4s_runs_s"] == pytest.approx(MILLION / batch * RUN / 4e-4)


def test_the_table_has_a_line_for_each(capsys: pytest.CaptureFixture[str]) -> None:
    main(TINY)
    head, *lines = capsys.readouterr().out.splitlines()
    assert head == "64 runs of 0.0004 s, best of 2"
    assert len(lines) == 7
    assert sum(line.endswith(" runs/s") for line in lines) == 3


def test_the_best_of_several_is_taken_of_each_clock() -> None:
    assert best([Times(2.0, 3.0), Times(1.0, 4.0)]) == Times(1.0, 3.0)
