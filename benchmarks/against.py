"""How fast the batch kernel is against that of another checkout.

    python -m benchmarks.against OTHER_CHECKOUT

The benchmark's arm with continuous and with sampled control, 32 runs at a time in the default build, and a run by
itself. Each checkout prints and compiles its own kernels; all are called in this one process, in turn, so that whatever
slows the machine down slows both. Times are of the processor inside the compiled loop, per step and run. Samples are
short, for many short ones tell more than a few long ones.

The exit code is 1 if a kernel of this checkout takes more than `--threshold` times as long as the other's, by the best
samples and by the median of neighbouring ones too: noise seldom fools both. Where libraries and stack come to lie in
memory moves a ratio by 1 or 2 % from process to process, so call it several times before you believe 3 %.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import importlib
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from springline.benchmarks import problem
from springline.benchmarks.contenders import ours

WORK = ("continuous", "sampled", "continuous, one run", "sampled, one run")
"""Variants of springline's own contenders; every version has them."""

NAME = "springline before"
"""What the kernels of another checkout are called among the contenders."""

_ROOT = "import pathlib, springline.codegen as c; print(pathlib.Path(c.__file__).parents[2])"


def _root_of(interpreter: Path) -> str:
    command = [str(interpreter), "-IB", "-c", _ROOT]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


@contextmanager
def packages_of(interpreter: Path) -> Iterator[None]:
    """Within, `import springline` means the interpreter's; what was imported before is there again afterwards.

    Raises CalledProcessError if it cannot import it.
    """
    root = _root_of(interpreter)

    def taken() -> dict[str, object]:
        names = [name for name in sys.modules if name.partition(".")[0] == "springline"]
        return {name: sys.modules.pop(name) for name in names}

    before, path = taken(), sys.path
    sys.path = [root, *(place for place in path if not (Path(place) / "springline").is_dir())]
    try:
        yield
    finally:
        sys.path = path
        taken()
        sys.modules.update(before)  # type: ignore[arg-type] # modules, put back as they were found


class Clock:
    """Stands for a loaded library and its loop, which it times: `spent` is the processor's time inside, s."""

    restype = None  # of the loop, as ctypes calls it

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        self.spent = 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._library, name)

    @property
    def springline_simulate(self) -> Clock:
        """The loop's entry point."""
        return self

    def __call__(self, job: Any) -> None:
        start = time.process_time()
        self._library.springline_simulate(job)
        self.spent += time.process_time() - start


@dataclass(frozen=True, slots=True)
class Timed:
    """A kernel, how many runs it is given at a time, and its clock."""

    run: problem.Runner
    batch: int
    clock: Clock

    def sample(self, steps: int) -> float:
        """Time of a step of a run, ns."""
        self.clock.spent = 0.0
        self.run(problem.deltas(self.batch), steps)
        return self.clock.spent * 1e9 / (steps * self.batch)


def interpreter_of(checkout: Path) -> Path:
    """The Python of a checkout's own environment. Raises ValueError if there is none that has springline."""
    interpreter = checkout.absolute() / ".venv" / "bin" / "python"
    if not interpreter.exists():
        raise ValueError(f"there is no {interpreter}: run `make install` in the other checkout")
    try:
        _root_of(interpreter)
    except subprocess.CalledProcessError as error:
        last = "".join(error.stderr.strip().splitlines()[-1:])
        raise ValueError(f"{interpreter} cannot import springline ({last}): run `make install` there") from error
    return interpreter


def contenders(interpreter: Path) -> tuple[problem.Contender, ...]:
    """The default kernels of another springline, for the benchmark; results need not have the same bits."""

    def build(mode: problem.Control) -> problem.Runner:
        return kernels(interpreter, (mode,))[mode].run

    return tuple(problem.Contender(NAME, mode, mode, partial(build, mode), batch=ours.BATCH) for mode in problem.MODES)


def kernels(interpreter: Path, variants: Collection[str] = WORK) -> dict[str, Timed]:
    """The kernels of these variants, printed and compiled by the springline of an interpreter.

    Raises CalledProcessError if its springline cannot be imported, ToolchainError without a C compiler.
    """
    found = {}
    with packages_of(interpreter):
        theirs = importlib.import_module("springline.benchmarks.contenders.ours")
        toolchain = theirs.toolchain  # from where it lies in that checkout
        load: Callable[[Path], ctypes.CDLL] = toolchain.load
        clocks: list[Clock] = []

        def clocked(library: Path) -> Clock:
            clocks.append(Clock(load(library)))
            return clocks[-1]

        toolchain.load = clocked
        for contender in theirs.CONTENDERS:
            if contender.variant in variants:
                run = contender.build()
                found[contender.variant] = Timed(run, contender.batch, clocks[-1])
    return found


@dataclass
class Race:
    """A kernel of each checkout and their samples, ns per step and run: this one's first."""

    kernels: tuple[Timed, Timed]
    steps: int = problem.QUANTUM
    samples: tuple[list[float], list[float]] = field(default_factory=lambda: ([], []))

    def prepare(self, sample: float) -> None:
        """Let a sample take about so many seconds."""
        spent = min(one.sample(self.steps) * one.batch for one in self.kernels) * 1e-9
        self.steps = min(problem.STEPS, max(1, round(sample / spent)))

    def sample(self, first: int) -> None:
        """One more sample of each; `first` goes first."""
        for which in (first, 1 - first):
            self.samples[which].append(self.kernels[which].sample(self.steps))

    @property
    def best(self) -> tuple[float, float]:
        """The best sample of each, ns."""
        return min(self.samples[0]), min(self.samples[1])

    @property
    def ratios(self) -> tuple[float, float]:
        """This checkout's time over the other's: by the best samples, and the median of those taken in one round."""
        this, other = self.best
        return this / other, statistics.median(a / b for a, b in zip(*self.samples, strict=True))


def race(other: Path, rounds: int, sample: float) -> dict[str, Race]:
    """Time the kernels of this interpreter and another: `rounds` samples of `sample` s each. Raises as `kernels`."""
    here, there = kernels(Path(sys.executable)), kernels(other)
    races = {name: Race((here[name], there[name])) for name in WORK}
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
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("other", type=Path, help="a checkout that `make install EXTRAS=dev,bench` was run in")
    parser.add_argument("--threshold", type=float, default=1.03, help="largest ratio that is no failure (default 1.03)")
    parser.add_argument("--rounds", type=int, default=1000, help="samples of each kernel (default 1000)")
    parser.add_argument("--sample", type=float, default=0.0015, help="seconds of a sample (default 0.0015)")
    chosen = parser.parse_args()
    try:
        interpreter = interpreter_of(chosen.other)
    except ValueError as error:
        parser.error(str(error))
    if chosen.rounds < 1 or not chosen.sample > 0.0 or not chosen.threshold > 0.0:
        parser.error("--rounds, --sample and --threshold are to be positive")
    races = race(interpreter, chosen.rounds, chosen.sample)
    sys.stdout.write("\n".join(table(races)) + "\n")
    return int(any(min(one.ratios) > chosen.threshold for one in races.values()))


if __name__ == "__main__":
    sys.exit(main())
