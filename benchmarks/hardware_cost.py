"""What sensors and motors that are not ideal cost: `python -m benchmarks.hardware_cost`.

Kernels are timed in turn in one process, and the best time of each counts: the paper's arm sampled every millisecond,
with steps of 0.1 ms, ideal and with everything of [sensor] and [actuator]; and the same two sampled at every step.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from springline.codegen.kernel import Kernel, KernelSpec, LoopSettings, kernel
from springline.model.hardware import ACTUATORS, SENSORS
from springline.model.structure import Structure
from springline.model.system import system_of

STEP, HOLD, DELAY = 1e-4, 10, 3
ALL = tuple(effect.name for effect in (*SENSORS, *ACTUATORS))
NUMBERS = {"position_noise": 1e-5, "velocity_noise": 1e-3, "position_resolution": 1e-5, "rate_limit": 1e7, "lag": 1e-4}


class Row(NamedTuple):
    """Steps of a sample, ns a step of a run, ideal and with everything, and what that is in ideal ones."""

    hold: int
    ideal: float
    everything: float
    ratio: float


def _loop(structure: Structure) -> tuple[Kernel, np.ndarray]:
    """A kernel with its numbers baked, and the one parameter that varies."""
    slots = system_of(structure).slots
    own = {"control.delta": 0.05, "control.a_max.0": 200.0, "control.a_max.1": 200.0}
    own |= {slot.key: NUMBERS[slot.key.split(".")[1]] for slot in slots if slot.key.split(".")[1] in NUMBERS}
    values = tuple(own.get(slot.key, slot.default) for slot in slots)
    return kernel(KernelSpec(structure, True, ("control.delta",), values)), np.array([[0.05]])


def measure(runs: int, steps: int, repeats: int) -> list[Row]:
    """A row for each way of sampling."""
    loops = [_loop(Structure()), _loop(Structure(effects=ALL, delay=DELAY))]
    rows = []
    for hold in (HOLD, 1):
        told = LoopSettings(steps, STEP, hold=hold)
        best = [float("inf")] * len(loops)
        for _ in range(repeats):
            for k, (loop, delta) in enumerate(loops):
                parameters = np.repeat(delta, runs, axis=0)
                begin = time.perf_counter()
                found = loop.run(parameters, told, numbers=range(runs))
                best[k] = min(best[k], time.perf_counter() - begin)
                assert not found.status.any(), "a run ended before its time"
        ideal, everything = (1e9 * seconds / (runs * steps) for seconds in best)
        rows.append(Row(hold, ideal, everything, everything / ideal))
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hardware_cost", description=__doc__)
    parser.add_argument("--runs", type=int, default=64)
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--repeats", type=int, default=15)
    chosen = parser.parse_args(arguments)
    print("sampled every    ideal       with everything")
    for row in measure(chosen.runs, chosen.steps, chosen.repeats):
        sampled = f"{row.hold * STEP * 1e3:g} ms"
        print(f"{sampled:13} {row.ideal:8.1f} ns {row.everything:8.1f} ns a step of a run, {row.ratio:.3f} times")


if __name__ == "__main__":
    main()
