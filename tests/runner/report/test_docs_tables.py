"""The tables in docs/scenarios.md are printed from the declarations, and are those that stand there."""

from __future__ import annotations

from pathlib import Path

import pytest

from springline.model.hardware import SENSORS
from springline.model.parameters import Joint
from springline.model.quantities import Quantity
from springline.model.system import System
from springline.runner.report import put
from springline.runner.report.docs_tables import table, tables, written

ROOT = Path(__file__).parents[3]


def test_the_page_has_the_tables_that_the_command_writes() -> None:
    page = (ROOT / "docs" / "scenarios.md").read_text(encoding="utf-8")
    assert written(page) == page, "stale: run `make docs-tables`"


def test_every_column_and_every_metric_has_its_row() -> None:
    system, printed = System(), tables()
    for name, found in (("trajectory", system.trajectory), ("metrics", system.metrics)):
        rows = printed[name].splitlines()[2:]
        for entry in found:
            own = entry.name if entry.joint is None else entry.name.removesuffix(entry.joint.name) + "<joint>"
            (row,) = (row for row in rows if row.startswith(f"| `{own}` |"))
            assert entry.unit.replace("^2", "²") in row


def test_every_effect_of_a_sensor_has_its_row() -> None:
    rows = tables()["sensors"].splitlines()[2:]
    names = [item.name for effect in SENSORS for item in effect.parameters]
    assert [row.split("`")[1] for row in rows] == names
    assert rows[names.index("velocity_noise")].endswith("| m/s, rad/s |")


def test_a_quantity_of_the_joints_is_one_row_with_their_units() -> None:
    joints = (Joint("a", "m", "N"), Joint("b", "rad", "N m"), Joint("c", "rad", "N m"))
    quantity = Quantity("x", "x", "{q}/s^2", "largest |x|")
    assert table([quantity], joints).splitlines()[2:] == [r"| `x_<joint>` | m/s², rad/s² | largest \|x\| |"]


def test_a_table_is_put_where_its_comments_stand_and_nowhere_else() -> None:
    page = "a\n<!-- one: begin -->\nold\n<!-- one: end -->\nb\n"
    assert put(page, "one", "new\n") == page.replace("old", "new")
    for wrong in ("a\n", "<!-- one: begin -->\n", "<!-- one: end -->\n<!-- one: begin -->\n"):
        with pytest.raises(ValueError, match="no place for the table 'one'"):
            put(wrong, "one", "new\n")
