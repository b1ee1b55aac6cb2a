"""Whether kernels of any kind are slower than another checkout's: laws, tableaus, tables, controller states, joints.

    python -m benchmarks.every_kind OTHER_CHECKOUT

Every parameter is tunable; a batch of 32 equal runs, continuous and sampled control. Each checkout prints and compiles
its own kernels, which are called in this one process in turn, on the processor's time inside the compiled loop. The
exit code is 1 if a kernel takes more than `--threshold` times as long as the other's, by the best samples and by the
median of neighbouring ones too.
"""

from __future__ import annotations

import argparse
import importlib
import statistics
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from springline.benchmarks.against import Clock, interpreter_of, packages_of

RUNS = 32
STEP = 1e-4


@dataclass(frozen=True, slots=True)
class Work:
    """A kernel of some kind, and what it is run with."""

    kernel: Any
    values: Any
    settings: Any
    tables: tuple[Any, ...]

    def run(self, steps: int, runs: int = RUNS) -> Any:
        """Simulate so many steps."""
        return self.kernel.run(np.tile(self.values, (runs, 1)), self.settings(steps, STEP, hold=10), self.tables)


@dataclass(frozen=True, slots=True)
class Timed:
    """Work and its clock."""

    work: Work
    clock: Clock

    def sample(self, steps: int) -> float:
        """Time of a step of a run, ns."""
        self.clock.spent = 0.0
        self.work.run(steps)
        return self.clock.spent * 1e9 / (steps * RUNS)


def _module(name: str) -> Any:
    return importlib.import_module(f"springline.{name}")


def _remembering() -> Any:
    """A controller with two states a joint."""
    control, quantities = _module("model.control"), _module("model.quantities")

    class Remembering(control.Controller):  # type: ignore[misc,name-defined] # a checkout's own
        """PD about the reference with the integrals of the error and of that."""

        states = (
            quantities.Quantity("xi", "xi", "{q} s", "integral of the error", per="joint"),
            quantities.Quantity("zeta", "zeta", "{q} s^2", "integral of xi", per="joint"),
        )

        def control(self, r: Any, y: Any, z: Any, model: Any, p: Any) -> Any:
            error = r.q - y.q1
            terms = model(y.q1, y.dq1)
            wished = r.ddq + 20 * (r.dq - y.dq1) + 100 * error + 50 * z.xi + z.zeta
            return control.Control(terms.H @ wished + terms.c + terms.G, error, {"xi": error, "zeta": z.xi})

    return Remembering()


def kinds() -> Iterator[tuple[str, dict[str, Any]]]:
    """What the structures differ in, by the fields' names."""
    shape = _module("model.structure").SignalShape
    moving = {"base_motion": shape("sine", (1, 0, 1))}
    for law in _module("model.control").LAWS:
        yield f"law {law}", {**moving, "law": law}
    for integrator in _module("model.integrators").INTEGRATORS:
        if integrator != "rk4":  # all others have it
            yield f"tableau {integrator}", {**moving, "integrator": integrator}
    yield "rigid drive", {**moving, "drive": "rigid"}
    yield "base by a table", {"base_motion": shape("table", (1, 0, 1))}
    yield "controller states", {**moving, "controller": "remembering"}
    for n in (1, 3, 7):
        sines = shape("sine", (1,) * n)
        yield f"planar_arm, n = {n}", {**moving, "mechanism": "planar_arm", "size": n, "reference": sines}


def kernel_of(fields: Mapping[str, Any], sampled: bool, options: Any = None) -> Work:
    """The kernel of a structure, every parameter tunable, at the parameters' default values."""
    kernels, program = _module("codegen.kernel"), _module("codegen.program")
    _module("model.control").CONTROLLERS.setdefault("remembering", _remembering())
    structure = _module("model.structure").Structure(**fields)
    system = program.program(structure).system
    tables = tuple(
        program.SignalTable(0.0, 0.1, True, np.ones((40, len(each.channels), 4)) * [0.0, 0.1, 0.2, 0.3])
        for each in system.tables
    )
    spec = kernels.KernelSpec(structure, sampled, options=options or kernels.KernelOptions())
    defaults = [slot.default for slot in system.slots]
    return Work(kernels.kernel(spec), defaults, kernels.LoopSettings, tables)


def timed(interpreter: Path) -> dict[str, Timed]:
    """The kernels of all kinds, printed and compiled by the springline of an interpreter."""
    found: dict[str, Timed] = {}
    with packages_of(interpreter):
        toolchain, clocks = _module("codegen.kernel").toolchain, list[Clock]()
        load = toolchain.load

        def clocked(library: Path) -> Clock:
            clocks.append(Clock(load(library)))
            return clocks[-1]

        toolchain.load = clocked
        for label, fields in kinds():
            for mode in ("continuous", "sampled"):
                work = kernel_of(fields, mode == "sampled")
                found[f"{label}, {mode}"] = Timed(work, clocks[-1])
    return found


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.every_kind", description=__doc__)
    parser.add_argument("other", type=Path, nargs="?", help="a checkout with its own `make install EXTRAS=dev,bench`")
    parser.add_argument("--list", action="store_true", help="print the kinds and end")
    parser.add_argument("--threshold", type=float, default=1.03, help="largest ratio that is no failure (default 1.03)")
    parser.add_argument("--rounds", type=int, default=100, help="samples of each kernel (default 100)")
    parser.add_argument("--sample", type=float, default=0.0015, help="seconds of a sample (default 0.0015)")
    chosen = parser.parse_args()
    if chosen.list:
        sys.stdout.write("".join(f"{label}\n" for label, _ in kinds()))
        return 0
    if chosen.other is None:
        parser.error("which other checkout?")
    try:
        there = timed(interpreter_of(chosen.other))
    except ValueError as error:
        parser.error(str(error))
    here, worst = timed(Path(sys.executable)), 0.0
    sys.stdout.write(f"{'ns per step and run, best':38}{'this':>9}{'other':>9}{'ratio':>8}{'median':>8}\n")
    for name, one in here.items():
        pair = (one, there[name])
        assert set(one.work.run(200).status) == {0}, f"{name}: a run that ends early tells nothing"
        steps = max(1, round(chosen.sample / (min(each.sample(200) for each in pair) * RUNS * 1e-9)))
        samples: tuple[list[float], list[float]] = ([], [])
        for number in range(chosen.rounds):
            for which in (number % 2, 1 - number % 2):
                samples[which].append(pair[which].sample(steps))
        this, other = map(min, samples)
        median = statistics.median(a / b for a, b in zip(*samples, strict=True))
        sys.stdout.write(f"{name:38}{this:>9.1f}{other:>9.1f}{this / other:>8.3f}{median:>8.3f}\n")
        sys.stdout.flush()
        worst = max(worst, min(this / other, median))
    return int(worst > chosen.threshold)


if __name__ == "__main__":
    sys.exit(main())
