"""What blocks of other shapes take: what codegen/kernel/paying.py chooses, and the choices beside it.

    python -m benchmarks.block_shapes [--kind NAME]

The benchmark's arm, or one of the kernels that `python -m benchmarks.every_kind --list` names with every parameter
tunable, with continuous and with sampled control: a batch in every span, with one and two groups of vectors and packs,
and a run by itself in every span, with joints in lanes and without. All kernels are called in this one process, in
turn; the best of many short samples counts, and the median of the ratios to the choice that were taken in one round.
"""

from __future__ import annotations

import argparse
import gc
import itertools
import statistics
import sys
import time
from dataclasses import dataclass, field, replace
from typing import get_args

from springline.benchmarks import every_kind, problem
from springline.benchmarks.contenders import ours
from springline.codegen.kernel import ONE_RUN, KernelOptions, Span, toolchain


@dataclass
class Candidate:
    """A kernel of some shape and its samples, ns per step and run."""

    shape: str
    run: problem.Runner
    batch: int
    samples: list[float] = field(default_factory=list)

    def sample(self, seconds: float) -> None:
        """One more sample of about so many seconds."""
        steps = max(20, round(seconds / (min(self.samples, default=100.0) * self.batch * 1e-9)))
        start = time.process_time()
        self.run(problem.deltas(self.batch), steps)
        self.samples.append((time.process_time() - start) * 1e9 / (steps * self.batch))


def candidates(kind: str, mode: problem.Control, one_run: bool) -> list[Candidate]:
    """The choice first, then every other."""
    batch = 1 if one_run else ours.BATCH
    chosen = ONE_RUN if one_run else KernelOptions()

    def build(options: KernelOptions) -> problem.Runner:
        if not kind:
            return ours.build(replace(ours.DEFAULT[mode], options=options))
        work = every_kind.kernel_of(dict(every_kind.kinds())[kind], mode == "sampled", options)
        return lambda deltas, steps: work.run(steps, len(deltas)).final_state

    found = [Candidate("the choice", build(chosen), batch)]
    if one_run:
        for span, paired in itertools.product(get_args(Span), (True, False)):
            options = replace(chosen, span=span, paired=paired)
            found.append(Candidate(f"{span}, {'joints in lanes' if paired else 'lanes alike'}", build(options), batch))
        return found
    for span, group, pack in itertools.product(get_args(Span), (1, 2), (1, 2)):
        options = replace(chosen, span=span, groups=group, packs=pack)
        found.append(Candidate(f"{span}, {group} x {pack}", build(options), batch))
    return found


def race(competitors: list[Candidate], rounds: int, seconds: float) -> None:
    """So many samples of each, in turn."""
    gc.collect()
    for number in range(rounds):
        for one in competitors if number % 2 else reversed(competitors):
            one.sample(seconds)


def table(title: str, competitors: list[Candidate]) -> list[str]:
    """Lines of at most 80 columns."""
    first = competitors[0].samples
    lines = [f"{title:34}{'ns, best':>10}{'ratio':>8}{'median':>8}"]
    for one in competitors:
        best, median = min(one.samples), statistics.median(a / b for a, b in zip(one.samples, first, strict=True))
        lines.append(f"  {one.shape:32}{best:>10.1f}{best / min(first):>8.3f}{median:>8.3f}")
    return lines


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.block_shapes", description=__doc__)
    parser.add_argument("--rounds", type=int, default=100, help="samples of each kernel (default 100)")
    parser.add_argument("--sample", type=float, default=0.003, help="seconds of a sample (default 0.003)")
    parser.add_argument("--kind", default="", choices=dict(every_kind.kinds()), help="not the benchmark's arm")
    chosen = parser.parse_args()
    width = toolchain.native_vector_width()
    sys.stdout.write(f"vectors of {width} doubles; groups of vectors x packs; ns per step and run\n")
    for mode in problem.MODES:
        for one_run in (False, True):
            competitors = candidates(chosen.kind, mode, one_run)
            race(competitors, chosen.rounds, chosen.sample)
            title = f"{mode}, one run" if one_run else mode
            sys.stdout.write("\n".join(table(title, competitors)) + "\n")


if __name__ == "__main__":
    main()
