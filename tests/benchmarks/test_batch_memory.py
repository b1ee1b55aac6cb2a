"""The command that measures the memory of sweeps, on sweeps that are too small to tell anything."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from springline.benchmarks import batch_memory
from springline.benchmarks.batch_memory import Peak, growth, peak_mb


def measured(*options: str) -> str:
    """What the command prints; in a process of its own, for this one is larger than what it would measure."""
    words = [sys.executable, "-m", "springline.benchmarks.batch_memory", "--runs", "64", "--jobs", "1"]
    return subprocess.run([*words, *options], capture_output=True, text=True, check=True).stdout


def test_the_command_prints_peaks_and_whether_they_hold() -> None:
    answer = json.loads(measured("--json"))
    found = {(peak["way"], peak["runs"]): peak["peak_mb"] for peak in answer["peaks"]}
    assert len(found) == len(answer["peaks"]) == 4
    assert 1.0 < found.pop(("Python alone", 0)) < 30.0
    assert all(50.0 < peak < 300.0 for peak in found.values())
    # Matplotlib is about 40 MB: the peaks are those of the processes that were started.
    assert found["with figures", 64] > 1.1 * found["--no-plot", 64]
    assert answer["growth"] == 1.0
    assert answer["most_mb"] == max(found.values())
    assert answer["flat"] is answer["small"] is True


def test_every_size_is_measured_in_every_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """The kernels are compiled before; a table in memory is for the largest size that the bar is held against."""
    started: list[tuple[int, bool | None]] = []

    def peak(*words: str) -> float:
        if "batch" in words:  # springline batch FILE ...
            (samples,) = re.findall(r"samples = (\d+)", Path(words[words.index("batch") + 1]).read_text())
            started.append((int(samples), "--plot" in words))
        elif words[1] == "":
            return 1.0
        else:
            started.append((int(words[-2]), None))
        return 100.0 + 10.0 * len(started)

    monkeypatch.setattr(batch_memory, "peak_mb", peak)
    peaks = batch_memory.measure([64, 128, 1_000_000], 1)
    assert started[:2] == [(64, False), (64, None)]
    assert started[2:] == [(64, True), (128, True), (1_000_000, True), (64, False), (128, False), (1_000_000, False),
                           (128, None)]  # fmt: skip
    first, second = batch_memory.WAYS
    assert [peak[:2] for peak in peaks[1:]] == [
        *((way, runs) for way in (first, second) for runs in (64, 128, 1_000_000)), ("batch() in Python", 128)
    ]  # fmt: skip
    assert [peak.peak_mb for peak in peaks] == [1.0, *(100.0 + 10.0 * k for k in range(3, 10))]


def test_growth_is_that_of_the_way_that_grows_most() -> None:
    first, second = batch_memory.WAYS
    peaks = [Peak(first, 10, 100.0), Peak(first, 1000, 104.0), Peak(second, 1000, 90.0), Peak(second, 10, 80.0)]
    assert growth([*peaks, Peak("another", 10, 900.0)]) == 90.0 / 80.0


def test_bars_that_do_not_hold_are_told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = batch_memory.WAYS
    peaks = [Peak(first, 10, 301.0), Peak(first, 1_000_000, 340.0), Peak(second, 10, 100.0)]
    monkeypatch.setattr(batch_memory, "measure", lambda sizes, jobs: peaks)
    assert batch_memory.main(["--runs", "10"]) == 1
    assert capsys.readouterr().out.count("DOES NOT HOLD") == 2
    peaks[:2] = [Peak(first, 10, 200.0), Peak(first, 1_000_000, 220.0)]
    assert batch_memory.main(["--runs", "10"]) == 0
    said = capsys.readouterr().out
    assert said.count("holds") == 2
    assert "1,000,000 runs   220.0 MB" in said


def test_a_process_that_fails_has_no_peak() -> None:
    with pytest.raises(RuntimeError, match=r"exit code 3 of -c(.|\n)*no space"):
        peak_mb("-c", "print('no space'); raise SystemExit(3)")


def test_figures_that_may_be_those_of_the_process_that_measures_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch_memory, "peak_mb", lambda *words: 200.0)
    with pytest.raises(RuntimeError, match="begins with 200 MB, for so large is the one that measures"):
        batch_memory.measure([64], 1)
