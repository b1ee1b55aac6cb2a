"""Tables of the documentation that are printed from the declarations in springline.model.

    python -m runner.report.docs_tables [--write]

Prints the columns of a trajectory, on a base that moves in every way, the metrics of a run of the packaged arm, and the
keys of sensors; --write (`make docs-tables`) puts them into docs/scenarios.md, between the comments that name them. The
text around them is written by hand.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from springline.model.base import COORDINATES
from springline.model.hardware import SENSORS
from springline.model.metrics import METRICS
from springline.model.parameters import Joint, Parameter
from springline.model.quantities import Quantity
from springline.model.structure import SignalShape, Structure
from springline.model.system import System
from springline.runner.report.docs_pages import asked_to_write, put

SCENARIOS_PAGE = Path(__file__).parents[2] / "docs" / "scenarios.md"


def table(quantities: Iterable[Quantity], joints: Sequence[Joint]) -> str:
    """Name, unit and meaning of what these quantities hold, in Markdown; one row for all joints."""
    rows = ["| column | unit | meaning |", "|---|---|---|"]
    for quantity in quantities:
        found = quantity.entries(joints)
        if quantity.per == "joint":
            units = ", ".join(dict.fromkeys(entry.unit for entry in found))
            shown = [(f"{quantity.name}_<joint>", units, quantity.meaning)]
        else:
            shown = [(entry.name, entry.unit, entry.meaning) for entry in found]
        rows += [f"| `{name}` | {cell(unit)} | {cell(meaning)} |" for name, unit, meaning in shown]
    return "\n".join(rows) + "\n"


def keys(parameters: Iterable[Parameter], joints: Sequence[Joint]) -> str:
    """Name, meaning and unit of what each joint has one of, in Markdown."""
    rows = ["| key | what | unit |", "|---|---|---|"]
    for item in parameters:
        units = ", ".join(dict.fromkeys(item.unit_of(joint) for joint in joints))
        rows.append(f"| `{item.name}` | {cell(item.meaning)} | {cell(units)} |")
    return "\n".join(rows) + "\n"


def cell(text: str) -> str:
    """Plain text as it stands in a cell of a table in Markdown."""
    return text.replace("|", r"\|").replace("^2", "²")


def tables() -> dict[str, str]:
    """The tables by name."""
    system = System(Structure(base_motion=SignalShape("sine", (1,) * len(COORDINATES))))
    return {
        "sensors": keys([item for effect in SENSORS for item in effect.parameters], system.joints),
        "trajectory": table(system.columns, system.joints),
        "metrics": table(METRICS, system.joints),
    }


def written(page: str) -> str:
    """The page with its tables as they should be. Raises ValueError if it has no place for one."""
    for name, text in tables().items():
        page = put(page, name, text)
    return page


def main() -> int:
    """Command line; the exit code is 2 where there is no page to write."""
    if asked_to_write(__doc__, "the tables", SCENARIOS_PAGE):
        SCENARIOS_PAGE.write_text(written(SCENARIOS_PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    else:
        sys.stdout.write("\n".join(tables().values()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
