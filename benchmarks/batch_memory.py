"""How much memory a sweep takes, by its number of runs: `python -m benchmarks.batch_memory`.

`springline batch` is run as a user runs it, a process for each size, with figures and without; beside it
`springline.runner.batch`, which returns its table, for at most 100,000 runs. What the system reports when the process
ends is its peak. The runs are a few steps long, for how long they are does not matter here.

Two things are held against these figures: the peak of the command grows by no more than 10 % from the fewest runs to
the most, and 100,000 runs stay under 300 MB. The exit code is 1 if one does not hold.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from springline.benchmarks.processes import run_to_end

# Only the standard library: what this process holds when it starts another counts to the other's peak.

SIZES = (10_000, 100_000, 1_000_000)
MOST_GROWTH = 1.10
MOST = 300.0  # MB
HELD_BY = 100_000  # runs

SWEEP = """
scenario = "paper/nominal"
samples = {runs}

[set]
simulation.duration = 4e-4

[vary]
control.delta = {{ uniform = [0.03, 0.05] }}
"""

COMMAND = "from springline.runner.cli.application import main; main()"

PYTHON = """
import sys
import numpy as np
from springline.runner import batch, load_scenario

scenario = load_scenario("paper/nominal", {"simulation.duration": 4e-4})
batch(scenario, {"control.delta": np.linspace(0.03, 0.05, int(sys.argv[1]))}, jobs=int(sys.argv[2]))
"""

WAYS: Mapping[str, Sequence[str]] = {"with figures": ["--plot"], "--no-plot": ["--no-plot"]}

_UNIT = 1 if sys.platform == "darwin" else 1024  # bytes, of ru_maxrss


class Peak(NamedTuple):
    """Peak memory of one process, MB (10^6 bytes)."""

    way: str
    runs: int
    peak_mb: float


def peak_mb(*words: str) -> float:
    """Peak resident memory of a Python process, MB. Raises RuntimeError if it fails."""
    usage = run_to_end([sys.executable, *words]).usage
    return usage.ru_maxrss * _UNIT / 1e6


def sweep_mb(runs: int, jobs: int, options: Sequence[str]) -> float:
    """Peak of `springline batch`."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "memory.toml")
        file.write_text(SWEEP.format(runs=runs), encoding="utf-8")
        command = ("batch", str(file), "-o", str(Path(folder, "dataset")), "--jobs", str(jobs), *options)
        return peak_mb("-c", COMMAND, *command)


def python_mb(runs: int, jobs: int) -> float:
    """Peak of a script that calls `batch`."""
    return peak_mb("-c", PYTHON, str(runs), str(jobs))


def measure(sizes: Sequence[int], jobs: int) -> list[Peak]:
    """The peak of each way and size. Raises RuntimeError where the figures may be those of this process."""
    empty = Peak("Python alone", 0, peak_mb("-c", ""))
    sweep_mb(64, jobs, ["--no-plot"])  # compiles the kernels, for a compiler would count too
    python_mb(64, jobs)
    peaks = [Peak(way, runs, sweep_mb(runs, jobs, options)) for way, options in WAYS.items() for runs in sizes]
    in_memory = max((runs for runs in sizes if runs <= HELD_BY), default=HELD_BY)
    peaks.append(Peak("batch() in Python", in_memory, python_mb(in_memory, jobs)))
    if empty.peak_mb > 0.5 * min(peak.peak_mb for peak in peaks):
        raise RuntimeError(f"a process begins with {empty.peak_mb:.0f} MB, for so large is the one that measures")
    return [empty, *peaks]


def growth(peaks: Sequence[Peak]) -> float:
    """How many times that of the fewest runs a sweep's peak is, at worst."""
    ratios = []
    for way in WAYS:
        found = [peak for peak in peaks if peak.way == way]
        fewest = min(found, key=lambda peak: peak.runs)
        ratios += [peak.peak_mb / fewest.peak_mb for peak in found]
    return max(ratios)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, or with --json one object; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.batch_memory", description=__doc__)
    parser.add_argument("--runs", type=int, nargs="+", default=SIZES, help="sizes of the sweeps")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="threads")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args(arguments)
    peaks = measure(chosen.runs, chosen.jobs)
    grown = growth(peaks)
    most = max(peak.peak_mb for peak in peaks if peak.runs <= HELD_BY)
    flat, small = grown <= MOST_GROWTH, most < MOST
    if chosen.json:
        facts = {"jobs": chosen.jobs, "growth": grown, "most_mb": most, "flat": flat, "small": small}
        print(json.dumps({**facts, "peaks": [peak._asdict() for peak in peaks]}, indent=2))
    else:
        print(f"peak memory, {chosen.jobs} threads")
        for peak in peaks:
            print(f"  {peak.way:<18}{peak.runs:>10,} runs{peak.peak_mb:>8.1f} MB")
        print(f"  largest over that of the fewest runs{grown:>7.3f}, at most {MOST_GROWTH:g}: {_holds(flat)}")
        print(f"  largest up to {HELD_BY:,} runs{most:>12.1f} MB, under {MOST:g} MB: {_holds(small)}")
    return 0 if flat and small else 1


def _holds(bar: bool) -> str:
    return "holds" if bar else "DOES NOT HOLD"


if __name__ == "__main__":
    sys.exit(main())
