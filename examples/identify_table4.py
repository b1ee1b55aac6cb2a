"""What the paper does not publish, found from what it does: inputs of group 2 that come closest to its Table 4.

    python identify_table4.py                       two seeds
    python identify_table4.py --generations 2 --population 8 --seeds 1 --state state
    python identify_table4.py --jobs 2 --state state    go on where the state files in that folder end
    python identify_table4.py --heave 0.64 --state calm     no more heave than some ship makes

The paper states no limit on its motors, no boundary layer, no inertia, no sea, and not when an error counts as small
(docs/paper.md, E5 and E11). Here the law has no limit and the motors have one; differential evolution looks for ONE set
of inputs with which all three laws under shake give as many of group 2's 24 numbers as possible. Each generation is
three calls of batch(), which takes bands as it takes parameters. A heave that no ship makes is worth less than one that
some ship does (E14).
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

from springline.runner import batch, load_scenario
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]

LAWS = ("variable_power_log", "double_power", "power")
JOINTS = ("lift", "rotation")
MEASURES = ("response_time", "settling_time", "overshoot", "steady_state_error")
PRINTED = np.array([
    [[0.10, 0.16], [0.20, 0.21], [0.04, 0.0], [0.015, 0.001]],
    [[0.14, 0.24], [0.63, 0.61], [0.21, 0.11], [0.18, 0.03]],
    [[0.19, 0.34], [0.76, 1.32], [0.22, 0.13], [0.16, 0.06]],
])  # fmt: skip
"""Group 2 of Table 4: laws x measures x joints; s, m, rad."""

CLOSE = 0.3
"""A number within this share of the printed one is met."""
SMALL = 0.005
"""A printed 0 is met by what rounds to it: m or rad."""
CALM = 0.64
"""m/s^2 rms, the largest heave of an 83 m vessel in waves of 5 m (E14); more of it costs CALM_PRICE numbers each."""
CALM_PRICE = 0.25

# Key -> least, greatest, and whether its logarithm is searched. Heave enters as accelerations, m/s^2.
INPUTS: Mapping[str, tuple[float, float, bool]] = {
    "control.U_max.0": (600.0, 6000.0, True),
    "control.U_max.1": (300.0, 8000.0, True),
    "control.delta": (0.02, 0.5, True),
    "mechanism.J": (3.0, 20.0, True),
    "heave.0": (0.0, 7.0, False),
    "base_motion.shake.0.omega": (0.5, 8.0, True),
    "base_motion.shake.0.phase": (-np.pi, np.pi, False),
    "heave.1": (0.0, 4.0, False),
    "base_motion.shake.1.omega": (8.0, 45.0, True),
    "base_motion.shake.1.phase": (-np.pi, np.pi, False),
    "simulation.response_band": (0.05, 0.5, True),
    "simulation.settling_band": (0.02, 0.5, True),
}

COARSE = 2e-4
"""s, step of the search where nothing else is said. Twice as large, RK4 damps the springs where the inertia is small: a
search may find inputs then whose motion is the step's."""
FINE = 1e-4
"""s, step with which what is found is run."""


def scenarios(step: float) -> list[Scenario]:
    """Group 2 with motors that have a limit and laws that have none."""
    return [
        load_scenario(
            f"paper/group2_{law}",
            {
                "control.a_max": float("inf"),
                "control.U_max": [2000.0, 2000.0],
                "simulation.step": step,
                "simulation.output_every": 10,
            },
        )
        for law in LAWS
    ]


def columns_of(unit: Floats, most: float) -> dict[str, Floats]:
    """Points of the unit cube, inputs x runs, as the columns of a batch; heave of at most `most` m/s^2 rms."""
    columns = {}
    for x, (key, (low, high, logarithmic)) in zip(unit, INPUTS.items(), strict=True):
        columns[key] = low * (high / low) ** x if logarithmic else low + (high - low) * x
    rms = np.sqrt((columns["heave.0"] ** 2 + columns["heave.1"] ** 2) / 2.0)
    share = np.minimum(1.0, most / np.maximum(rms, 1e-12))
    for term in ("0", "1"):
        columns[f"base_motion.shake.{term}.amplitude"] = (
            share * columns.pop(f"heave.{term}") / columns[f"base_motion.shake.{term}.omega"] ** 2
        )
    return columns


def metrics(laws: Sequence[Scenario], columns: Mapping[str, Floats], jobs: int | None) -> Floats:
    """Table 4's group 2 of each run: runs x laws x measures x joints; NaN where there is no such number."""
    found = []
    for scenario in laws:
        table = batch(scenario, columns, jobs=jobs)
        found.append([[table[f"{m}_{joint}"].to_numpy() for joint in JOINTS] for m in MEASURES])
    return np.moveaxis(np.array(found, dtype=np.float64), -1, 0)


def misses(found: Floats) -> Floats:
    """How far each number is from the printed one: 1 at the edge of what counts as met, NaN for none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = found / PRINTED
        distance = np.where(ratio < 1.0, (1.0 - ratio) / CLOSE, (ratio - 1.0) / CLOSE)
        return np.where(PRINTED == 0.0, np.abs(found) / SMALL, distance)


def met(found: Floats) -> NDArray[np.bool_]:
    """Which numbers are met."""
    return misses(found) <= 1.0


def heave(columns: Mapping[str, Floats]) -> Floats:
    """Root mean square of the heave's acceleration, m/s^2."""
    each = [
        columns[f"base_motion.shake.{term}.amplitude"] * columns[f"base_motion.shake.{term}.omega"] ** 2
        for term in ("0", "1")
    ]
    return np.sqrt(sum(a**2 for a in each) / 2.0)


def cost(found: Floats, columns: Mapping[str, Floats]) -> Floats:
    """What is minimised: a number that is missed costs 1 to 1.6, one that is met up to 0.1: so there is a slope."""
    distance = misses(found)
    inside = 0.1 * distance
    outside = 1.0 + 0.3 * np.minimum(np.log(np.maximum(distance, 1.0)), 2.0)
    each = np.where(distance <= 1.0, inside, np.where(np.isnan(distance), 1.6, outside))
    return each.sum(axis=(1, 2, 3)) + CALM_PRICE * np.maximum(heave(columns) - CALM, 0.0)


class Journal:
    """What every generation cost, in a file: a search that is begun again takes from it what it has computed before.

    A seeded search asks the same questions in the same order, so it goes on as if it had never been stopped.
    """

    def __init__(self, path: Path, most: float, step: float) -> None:
        self.path, self.most, self.step = path, most, step
        self.entries = json.loads(path.read_text()) if path.exists() else []
        self.next = 0

    def answer(self, unit: Floats) -> Floats | None:
        """The costs of these points, if this is where the journal has them. Ends the program for other points."""
        if self.next == len(self.entries):
            return None
        entry = self.entries[self.next]
        if entry["points"] != self._digest(unit):
            raise SystemExit(f"{self.path} is of another search: give --state another folder")
        self.next += 1
        return np.array(entry["costs"])

    def add(self, unit: Floats, costs: Floats) -> None:
        """Write down what points cost; the file is the old one or the new one, whatever happens."""
        self.entries.append({"points": self._digest(unit), "costs": [float(x) for x in costs]})
        self.next += 1
        temporary = self.path.with_suffix(".new")
        temporary.write_text(json.dumps(self.entries))
        os.replace(temporary, self.path)

    def _digest(self, unit: Floats) -> str:
        return sha256(np.append(np.ascontiguousarray(unit, "<f8"), [self.most, self.step]).tobytes()).hexdigest()


def search(seed: int, generations: int, population: int, journal: Journal, jobs: int | None) -> Floats:
    """The best point of the unit cube that a seed finds."""
    laws = scenarios(journal.step)

    def costs(unit: Floats) -> Floats:
        known = journal.answer(unit)
        if known is None:
            columns = columns_of(unit, journal.most)
            known = cost(metrics(laws, columns, jobs), columns)
            journal.add(unit, known)
            print(f"seed {seed}, generation {journal.next - 1}: {known.min():.3f}", flush=True)
        return known

    rng = np.random.default_rng(seed)
    found = differential_evolution(
        costs,
        [(0.0, 1.0)] * len(INPUTS),
        maxiter=generations,
        init=rng.random((population, len(INPUTS))),
        mutation=(0.4, 0.9),
        recombination=0.8,
        rng=rng,
        tol=0.0,
        atol=0.0,
        polish=False,
        updating="deferred",
        vectorized=True,
    )
    return np.asarray(found.x)


def report(best: Mapping[int, Floats], most: float, jobs: int | None) -> None:
    """Print what the seeds found, run with the fine step, and how far they lie apart."""
    unit = np.array(list(best.values())).T
    columns = columns_of(unit, most)
    found = metrics(scenarios(FINE), columns, jobs)
    total = cost(found, columns)
    for i, seed in enumerate(best):
        print(f"seed {seed}: cost {total[i]:.3f}, {met(found[i]).sum()} of 24 within 30 %")
    if len(best) > 1:
        print("spread of the seeds, as a share of the range searched:")
        for key, x in zip(INPUTS, unit, strict=True):
            print(f"  {key}: {np.ptp(x):.2f}")
    i = int(np.argmin(total))
    print(f"best, step {FINE:g} s, heave of {heave(columns)[i]:.2f} m/s^2 rms:")
    for key, values in columns.items():
        print(f"  {key} = {float(values[i])!r}")
    for law, printed, ours in zip(LAWS, PRINTED, found[i], strict=True):
        for measure, wanted, got in zip(MEASURES, printed, ours, strict=True):
            print(f"  {law} {measure}: {got[0]:.4g}/{got[1]:.4g} (printed {wanted[0]:g}/{wanted[1]:g})")


def main() -> None:
    """Search with every seed, then compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--generations", type=int, default=300)
    parser.add_argument("--population", type=int, default=64)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--heave", type=float, default=np.inf, help="at most so much, m/s^2 rms")
    parser.add_argument("--step", type=float, default=COARSE, help="of the search, s")
    parser.add_argument("--state", type=Path, default=Path("identify_state"), help="folder of the state files")
    given = parser.parse_args()
    given.state.mkdir(parents=True, exist_ok=True)
    best = {
        seed: search(
            seed,
            given.generations,
            given.population,
            Journal(given.state / f"seed{seed}.json", given.heave, given.step),
            given.jobs,
        )
        for seed in given.seeds
    }
    report(best, given.heave, given.jobs)


if __name__ == "__main__":
    main()
