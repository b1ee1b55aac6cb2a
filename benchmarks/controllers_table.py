"""The tables of docs/controllers.md: how well each controller holds the arm on a ship, alone and with help.

    python -m benchmarks.controllers_table [--write]

Prints it; --write (`make docs-controllers`) puts it into the page, between the comments that name it. It takes minutes,
for every row is a structure, and so a kernel, of its own.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from springline.model.control import CONTROLLERS
from springline.runner.report import asked_to_write, put
from springline.runner.run import Result, simulate
from springline.runner.scenario import Scenario, load_scenario

PAGE = Path(__file__).parent.parent / "docs" / "controllers.md"
NAME = "on the ship"

SHIPS: Mapping[str, Mapping[str, object]] = {
    "paper/group1_shake": {},
    "ship/vessel_10hz": {"simulation.duration": 20.0},
}
HELP: Mapping[str, Mapping[str, object]] = {
    "alone": {},
    "disturbance": {"control.observer": "disturbance"},
    "disturbance, spring": {"control.observer": "disturbance", "control.disturbance.input": "spring"},
    "extended_state": {"control.observer": "extended_state"},
    "extended_state, spring": {"control.observer": "extended_state", "control.extended_state.input": "spring"},
    "feedforward": {"control.feedforward": "base"},
}
TURNING = ("paper/group1_pitch", "paper/group1_roll")
"""Ships of the short table, with the true payload: base motions of the paper that turn."""

PAYLOADS = (1.0, 1.2, 0.8)
"""Factors on the plant's m3 and J; the controller keeps its own."""

TRANSIENT = 1.0
"""s from the start that do not count."""


def errors(scenario: Scenario, result: Result) -> tuple[float, float, float]:
    """Root mean square after the transient: of e by joint, and of the tip's distance in m from where it should be.

    That is where the tip would be in inertial axes, on the base as it moves, if q1 were the reference.
    """
    table = result.trajectory
    t = table["t"].to_numpy()
    late = t >= TRANSIENT
    system = scenario.system()
    joints = [joint.name for joint in system.joints]
    lift, rotation = (np.sqrt(np.mean(table[f"e_{joint}"].to_numpy()[late] ** 2)) for joint in joints)
    names = [entry.name for entry in system.base_motion[0].entries(system.joints)]
    base = np.array([table[name].to_numpy()[late] for name in names])
    wished = np.zeros((system.x.numel(), base.shape[1]))
    wished[: system.n] = [table[f"q1d_{joint}"].to_numpy()[late] for joint in joints]
    tip = system.function("tip").map(base.shape[1])
    values = np.repeat(scenario.values()[:, None], base.shape[1], axis=1)
    there = np.array(tip(base, np.zeros_like(base), wished, values))[3:6]  # behind the tip as seen from the ship
    seen = np.array([table[f"tip_{axis}_inertial"].to_numpy()[late] for axis in "xyz"])
    return float(lift), float(rotation), float(np.sqrt(np.mean(np.sum((seen - there) ** 2, axis=0))))


def cell(ship: str, changes: Mapping[str, object]) -> str:
    """Errors in mm, mrad and mm, or why there are none."""
    scenario = load_scenario(ship, changes)
    result = simulate(scenario)
    if result.status != "ok":
        return result.status
    return " / ".join(f"{1e3 * value:#.2g}".rstrip(".") for value in errors(scenario, result))


def rows() -> Iterator[str]:
    """The table in Markdown, line by line."""
    payloads = [f"payload {factor - 1:+.0%}" if factor != 1.0 else "true payload" for factor in PAYLOADS]
    for ship, shown in SHIPS.items():
        yield f"| `{ship}` | help | {' | '.join(payloads)} |"
        yield "|---" * (2 + len(payloads)) + "|"
        for controller in CONTROLLERS:
            for name, help_ in HELP.items():
                changes = {**shown, "control.controller": controller, **help_}
                cells = [
                    cell(ship, changes | {"plant.m3.scale": factor, "plant.J.scale": factor}) for factor in PAYLOADS
                ]
                yield f"| {controller} | {name} | {' | '.join(cells)} |"
        yield ""
    yield f"| true payload | help | {' | '.join(f'`{ship}`' for ship in TURNING)} |"
    yield "|---" * (2 + len(TURNING)) + "|"
    for controller in CONTROLLERS:
        for name in ("alone", "disturbance", "feedforward"):
            changes = {"control.controller": controller, **HELP[name]}
            yield f"| {controller} | {name} | {' | '.join(cell(ship, changes) for ship in TURNING)} |"
    yield ""


def main() -> int:
    """Command line; the exit code is 2 where there is no page to write."""
    write = asked_to_write(__doc__, "the table", PAGE)
    table = ""
    for row in rows():
        table += f"{row}\n"
        sys.stdout.write(f"{row}\n")
        sys.stdout.flush()
    if write:
        PAGE.write_text(put(PAGE.read_text(encoding="utf-8"), NAME, table), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
