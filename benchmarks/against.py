"""How fast the batch kernel is against that of another checkout: `python -m benchmarks.against OTHER_CHECKOUT`.

The benchmark's arm with continuous and with sampled control, 32 runs at a time in the default build, and a run by
itself. Each checkout prints and compiles its own kernels; all are called in this one process, in turn, so that whatever
slows the machine down slows both. Times are of the processor, per step and run, less what a call without a step takes:
samples are short, for many short ones tell more than a few long ones.

The exit code is 1 if a kernel of this checkout takes more than `--threshold` times as long as the other's, by the best
samples and by the median of neighbouring ones too: noise seldom fools both. Where libraries and stack come to lie in
memory moves a ratio by 1 or 2 % from process to process, so call it several times before you believe 3 %.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from springline.benchmarks import problem

WORK = ("continuous", "sampled", "continuous, one run", "sampled, one run")
"""Variants of springline's own contenders; every version has them."""

_CALLS = 50
_ROOT = "import pathlib, springline.codegen as c; print(pathlib.Path(c.__file__).parents[2])"


@contextmanager
def packages_of(checkout: Path) -> Iterator[None]:
    """Within, `import springline` means the checkout's; what was imported before is there again afterwards.

    Raises CalledProcessError if the checkout's interpreter cannot import it.
    """
    command = [str(checkout / ".venv" / "bin" / "python"), "-B", "-c", _ROOT]
    root = subprocess.run(command, check=True, cwd=checkout, capture_output=True, text=True).stdout.strip()

    def taken() -> dict[str, object]:
        names = [name for name in sys.modules if name.partition(".")[0] == "springline"]
        return {name: sys.modules.pop(name) for name in names}

    before = taken()
    sys.path.insert(0, root)
    try:
        yield
    finally:
        sys.path.remove(root)
        taken()
        sys.modules.update(before)  # type: ignore[arg-type]


def runners() -> dict[str, tuple[problem.Runner, int]]:
    """The kernel and the batch of each of WORK, by the springline that is imported now."""
    contenders = importlib.import_module("springline.benchmarks.contenders.ours").CONTENDERS
    found = {contender.variant: contender for contender in contenders}
    return {name: (found[name].build(), found[name].batch) for name in WORK}


@dataclass
class Race:
    """A kernel of each checkout and their samples, ns per step and run: this one's first."""

    runs: tuple[problem.Runner, problem.Runner]
    batch: int
    steps: int = problem.QUANTUM
    calls: list[float] = field(default_factory=lambda: [0.0, 0.0])
    samples: tuple[list[float], list[float]] = field(default_factory=lambda: ([], []))

    def _spent(self, which: int, steps: int) -> float:
        delta = problem.deltas(self.batch)
        start = time.process_time()
        self.runs[which](delta, steps)
        return time.process_time() - start

    def prepare(self, sample: float) -> None:
        """Let a sample take about so many seconds, and see how long a call without a step takes."""
        self.calls = [min(self._spent(which, 0) for _ in range(_CALLS)) for which in (0, 1)]
        spent = min(self._spent(which, problem.QUANTUM) for which in (0, 1, 0, 1))
        self.steps = min(problem.STEPS, max(1, round(sample / spent)) * problem.QUANTUM)

    def sample(self, first: int) -> None:
        """One more sample of each; `first` goes first."""
        for which in (first, 1 - first):
            spent = self._spent(which, self.steps) - self.calls[which]
            self.samples[which].append(spent * 1e9 / (self.steps * self.batch))

    @property
    def best(self) -> tuple[float, float]:
        """The best sample of each, ns."""
        return min(self.samples[0]), min(self.samples[1])

    @property
    def ratios(self) -> tuple[float, float]:
        """This checkout's time over the other's: by the best samples, and the median of those taken in one round."""
        this, other = self.best
        return this / other, statistics.median(a / b for a, b in zip(*self.samples, strict=True))


def race(checkout: Path, rounds: int, sample: float) -> dict[str, Race]:
    """Time the kernels of both checkouts, `rounds` samples of `sample` s each.

    Raises CalledProcessError if the other cannot be imported, ToolchainError without a C compiler.
    """
    here = runners()
    with packages_of(checkout):
        there = runners()
    races = {name: Race((here[name][0], there[name][0]), here[name][1]) for name in WORK}
    for one in races.values():
        one.prepare(sample)
    gc.collect()
    gc.disable()
    try:
        for number in range(rounds):
            for one in races.values():
                one.sample(number % 2)
    finally:
        gc.enable()
    return races


def table(races: dict[str, Race]) -> list[str]:
    """Lines of at most 80 columns."""
    lines = [f"{'ns per step and run, best':28}{'this':>8}{'other':>8}{'ratio':>8}{'median ratio':>14}"]
    for name, one in races.items():
        (this, other), (best, median) = one.best, one.ratios
        lines.append(f"{name:28}{this:>8.1f}{other:>8.1f}{best:>8.3f}{median:>14.3f}")
    return lines


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.against", description=__doc__)
    parser.add_argument("other", type=Path, help="a checkout that `make install EXTRAS=dev,bench` was run in")
    parser.add_argument("--threshold", type=float, default=1.03, help="largest ratio that is no failure (default 1.03)")
    parser.add_argument("--rounds", type=int, default=1000, help="samples of each kernel (default 1000)")
    parser.add_argument("--sample", type=float, default=0.0015, help="seconds of a sample (default 0.0015)")
    chosen = parser.parse_args()
    checkout = chosen.other.absolute()
    if not (checkout / ".venv" / "bin" / "python").exists():
        parser.error(f"there is no {checkout}/.venv/bin/python: run `make install` in the other checkout")
    if chosen.rounds < 1 or not chosen.sample > 0.0 or not chosen.threshold > 0.0:
        parser.error("--rounds, --sample and --threshold are to be positive")
    try:
        races = race(checkout, chosen.rounds, chosen.sample)
    except subprocess.CalledProcessError as error:
        last = error.stderr.strip().splitlines()[-1:]
        parser.error(f"{checkout} has no springline to import ({''.join(last)}): run `make install` there")
    sys.stdout.write("\n".join(table(races)) + "\n")
    return int(any(min(one.ratios) > chosen.threshold for one in races.values()))


if __name__ == "__main__":
    sys.exit(main())
