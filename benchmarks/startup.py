"""How long the command line takes to start: `python -m benchmarks.startup`.

Each command is a process of its own, as a shell starts it; all take turns, after a first round that does not count.
The floor is an interpreter that does nothing, and *ratio* is processor time over that of the floor, the best of both.
The aims are wall-clock times on an idle machine, and the best one is held against them; an aim that is missed is no
error.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from springline.benchmarks.processes import run_to_end

FLOOR = "python -c pass"
COMMANDS = (
    FLOOR,
    "springline --version",
    "springline --help",
    "springline run --help",
    "springline list scenarios",
    "springline list laws",
)
AIMS: Mapping[str, float] = {"springline --help": 0.15, "springline list laws": 0.3}
"""Wall-clock time, s, that a command is to stay under."""


@dataclass
class Samples:
    """Of one command: wall-clock time, and processor time of user and system, s."""

    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class Row:
    """A line of the table.

    wall_*, cpu_*  best and median, s
    ratio          best processor time over the floor's
    aim            wall-clock time that the best is to stay under, s; None where there is no aim
    """

    command: str
    wall_best: float
    wall_median: float
    cpu_best: float
    cpu_median: float
    ratio: float
    aim: float | None

    @property
    def verdict(self) -> str:
        """Whether the aim is "reached" or "missed"; nothing where there is none."""
        if self.aim is None:
            return ""
        return "reached" if self.wall_best < self.aim else "missed"


def words_of(command: str) -> list[str]:
    """What starts a command: this interpreter, or the program that is installed beside it."""
    name, *words = command.split()
    return [sys.executable if name == "python" else str(Path(sys.executable).with_name(name)), *words]


def measure(rounds: int, commands: Sequence[str] = COMMANDS) -> list[Row]:
    """So many samples of each command, the floor among them. Raises RuntimeError if one fails."""
    # Where byte code is not kept, each process would compile what it imports.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    found = {command: Samples() for command in commands}
    for command in found:
        run_to_end(words_of(command), environment)
    for number in range(rounds):
        # To and fro, so that none always comes after the same other.
        for command, samples in found.items() if number % 2 else reversed(found.items()):
            ended = run_to_end(words_of(command), environment)
            samples.wall.append(ended.wall)
            samples.cpu.append(ended.usage.ru_utime + ended.usage.ru_stime)
    floor = min(found[FLOOR].cpu)
    return [
        Row(
            command,
            min(samples.wall),
            statistics.median(samples.wall),
            min(samples.cpu),
            statistics.median(samples.cpu),
            min(samples.cpu) / floor,
            AIMS.get(command),
        )
        for command, samples in found.items()
    ]


def table(rows: Sequence[Row]) -> list[str]:
    """Lines of at most 80 columns; times in ms."""
    lines = [f"{'ms, best and median':28}{'wall clock':>12}{'processor':>12}{'ratio':>7}  aim"]
    for row in rows:
        wall, cpu = (
            f"{1e3 * best:>6.0f}{1e3 * median:>6.0f}"
            for best, median in ((row.wall_best, row.wall_median), (row.cpu_best, row.cpu_median))
        )
        aim = "" if row.aim is None else f"  {1e3 * row.aim:.0f}: {row.verdict}"
        lines.append(f"{row.command:28}{wall}{cpu}{row.ratio:>7.1f}{aim}")
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table, or with --json one object; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.startup", description=__doc__)
    parser.add_argument("--rounds", type=int, default=20, help="samples of each command (default 20)")
    parser.add_argument("--json", action="store_true")
    chosen = parser.parse_args(arguments)
    if chosen.rounds < 1:
        parser.error(f"--rounds: expected at least 1, got {chosen.rounds}")
    rows = measure(chosen.rounds)
    if chosen.json:
        print(json.dumps({"rounds": chosen.rounds, "rows": [vars(row) | {"verdict": row.verdict} for row in rows]}))
    else:
        print("\n".join(table(rows)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
