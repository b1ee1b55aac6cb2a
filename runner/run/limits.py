"""What a trajectory takes of the memory, and a refusal before it starts where that is too much."""

from __future__ import annotations

from springline.codegen.memory import memory
from springline.runner.files import InputError, Problem
from springline.runner.run.columns import trajectory_schema
from springline.runner.run.settings import loop_settings
from springline.runner.scenario import Scenario

_MOST_ROWS = 10_000_000
_COPIES = 3  # of a trajectory in memory: the loop's rows, the table's columns, the file


def row_size(scenario: Scenario) -> int:
    """Bytes of the numbers in a trajectory row."""
    return 8 * len(trajectory_schema(scenario.system()))


def refuse_rows(scenario: Scenario, most: int, why: str) -> None:
    """Raise InputError if the trajectory has more rows than `most`; `why` says what sets this limit."""
    rows = loop_settings(scenario, trajectory=True).rows
    if rows > most:
        enough = -(-scenario.steps // max(most - 2, 1))  # the first row and the last come besides
        text = f"expected at least {enough} for {scenario.steps} steps: {rows} rows are more than {most}, {why}"
        raise InputError(Problem(scenario.source, "simulation.output_every", text, str(scenario.output_every)))


def refuse_large(scenario: Scenario) -> None:
    """Raise InputError if the trajectory, with the copies that become tables and files, would not fit into memory."""
    refuse_rows(scenario, _MOST_ROWS, "the most of a trajectory")
    there = memory()
    refuse_rows(
        scenario, there // (_COPIES * row_size(scenario)), f"all that {there / 1e9:.3g} GB of memory have room for"
    )
