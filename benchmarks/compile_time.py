"""What a user waits for before the first result: generation and compilation.

`python -m springline.benchmarks.compile_time` prints it for arms of seven joints on a base in six coordinates, each
with empty caches in a process of its own, because a process compiles only once; a bar that does not hold ends it with
1. With the TITLE of a contender it prints the seconds of that, cold or with what the caches hold. Imports are not
counted.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import casadi as ca

from springline.benchmarks import problem
from springline.benchmarks.contenders import CONTENDERS
from springline.codegen.export import bind
from springline.codegen.export.c import generate_files
from springline.codegen.files import write_tree
from springline.codegen.kernel.toolchain import find_compiler
from springline.model.base import COORDINATES
from springline.model.symbolic import operations as count
from springline.model.system import System
from springline.runner.run import simulate
from springline.runner.scenario import load_scenario


def compile_times(contender: problem.Contender) -> tuple[float, float]:
    """Seconds until a contender can run, with empty caches and again with what that left in them."""
    with tempfile.TemporaryDirectory(prefix="springline-bench-") as folder:
        caches = {
            "SPRINGLINE_CACHE": folder,
            "NUMBA_CACHE_DIR": folder,
            "JAX_COMPILATION_CACHE_DIR": folder,
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
            "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
        }
        command = [sys.executable, "-m", __spec__.name, contender.title]
        cold, cached = (
            float(subprocess.run(command, env=os.environ | caches, stdout=subprocess.PIPE, check=True).stdout)
            for _ in range(2)
        )
    return cold, cached


def measure(contender: problem.Contender) -> float:
    """Seconds of building and a first short call, less those of a second one."""
    for module in contender.modules:
        import_module(module)
    delta = problem.deltas(contender.batch)
    start = time.perf_counter()
    run = contender.build()
    run(delta, problem.QUANTUM)
    first = time.perf_counter()
    run(delta, problem.QUANTUM)
    return max(2 * first - start - time.perf_counter(), 0.0)


_MOVING = {item.key: [{"amplitude": 0.05, "omega": 5.0}] for item in COORDINATES}
_SHIP: dict[str, object] = {"base_motion": {"kind": "sine", **_MOVING}, "simulation.duration": 0.01}
ARMS: dict[str, dict[str, object]] = {
    "planar_arm, n = 7": {"mechanism.name": "planar_arm", "mechanism.n": 7, **_SHIP},
    "spatial arm, 7 joints": {"mechanism.name": f"{Path(__file__).with_name('spatial_arm.py')}:SpatialArm", **_SHIP},
}
"""Overrides of paper/nominal, by the name of a row."""
BARRED = "planar_arm, n = 7"
BAR = 10.0  # s, for generating and compiling the C of it


class Waiting(NamedTuple):
    """Seconds that an arm takes to become something, one after the other.

    operations  of an evaluation of the plant, without what depends on parameters alone
    derived     read, checked and its equations of motion derived
    generated   the files that `springline generate` writes, test vectors included
    exported    the typed interface and the model, compiled with -O2
    kernel      the loop of `springline run`, printed and compiled
    """

    operations: int
    derived: float
    generated: float
    exported: float
    kernel: float


def waiting(arm: str) -> Waiting:
    """Measured in a process of its own with empty caches."""
    with tempfile.TemporaryDirectory(prefix="springline-bench-") as folder:
        command = [sys.executable, "-m", __spec__.name, "--arm", arm]
        environment = os.environ | {"SPRINGLINE_CACHE": folder}
        done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, check=True)
    return Waiting(*json.loads(done.stdout))


def measure_arm(arm: str) -> Waiting:
    """As `waiting`, in this process."""
    times = [time.perf_counter()]
    scenario = load_scenario("paper/nominal", ARMS[arm])
    operations = operations_of_plant(scenario.system())
    times.append(time.perf_counter())
    files, manifest = generate_files(bind(scenario.structure(), scenario.values()))
    times.append(time.perf_counter())
    with tempfile.TemporaryDirectory(prefix="springline-bench-") as folder:
        write_tree(Path(folder), files, manifest)
        sources = [path for path in files if path.startswith("src/") and path.endswith(".c")]
        command = [*find_compiler().argv, "-std=c99", "-O2", "-ffp-contract=off", "-Iinclude", "-Isrc", "-c", *sources]
        subprocess.run(command, cwd=folder, check=True)
    times.append(time.perf_counter())
    simulate(scenario)
    first = time.perf_counter()
    simulate(scenario)
    times.append(2 * first - time.perf_counter())
    return Waiting(operations, *(after - before for before, after in pairwise(times)))


def operations_of_plant(system: System) -> int:
    """Arithmetic operations of one evaluation of the plant that do not depend on parameters alone."""
    plant = system.function("plant")
    symbols = [ca.SX.sym(plant.name_in(i), plant.size1_in(i)) for i in range(plant.n_in())]
    return count(plant(*symbols), ca.vertcat(*symbols), ca.vertcat(*symbols[:-1]))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what was asked for; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m springline.benchmarks.compile_time", description=__doc__)
    parser.add_argument("title", nargs="?", help="of a contender")
    parser.add_argument("--arm", choices=ARMS, help="one arm in this process, as JSON")
    chosen = parser.parse_args(arguments)
    if chosen.title:
        print(measure(next(contender for contender in CONTENDERS if contender.title == chosen.title)))
        return 0
    if chosen.arm:
        print(json.dumps(measure_arm(chosen.arm)))
        return 0
    print(f"{'s':<24}{''.join(f'{name:>12}' for name in Waiting._fields)}")
    found = {arm: waiting(arm) for arm in ARMS}
    for arm, row in found.items():
        print(f"{arm:<24}{row.operations:>12,}{''.join(f'{seconds:>12.1f}' for seconds in row[1:])}")
    seconds = found[BARRED].derived + found[BARRED].generated + found[BARRED].exported
    holds = seconds < BAR
    print(
        f"{BARRED}: generated and compiled in {seconds:.1f} s, under {BAR:g} s: {'holds' if holds else 'DOES NOT HOLD'}"
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
