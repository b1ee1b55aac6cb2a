"""`springline analyze`: what a design can do, before anything is run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from springline.runner.cli.options import Changes, NoCode, ScenarioName, expect_folder, refuse_results
from springline.runner.cli.overrides import overrides
from springline.runner.cli.terminal import complain, number, print_json, print_table, progress, say
from springline.runner.files import InputError, Problem

if TYPE_CHECKING:
    from springline.runner.analysis import Row


def analyze(
    scenario: ScenarioName,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for a report with figures.", show_default=False),
    ] = None,
    changes: Changes = None,
    ranges: Annotated[
        list[str] | None,
        typer.Option(
            "--range",
            metavar="KEY=LOW,HIGH",
            help="A number that may lie anywhere between two: plant.m3.scale=0.8,1.2. May be given again.",
            show_default=False,
        ),
    ] = None,
    confirm: Annotated[bool, typer.Option("--confirm", help="Find every boundary again by simulated runs.")] = False,
    damping: Annotated[
        float, typer.Option("--damping", help="Damping ratio of the springs' modes for which K_f is sought.")
    ] = 0.1,
    no_code: NoCode = False,
    force: Annotated[bool, typer.Option("--force", help="Replace files that were edited since.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the verdicts as JSON.")] = False,
) -> None:
    """Say whether a design can work, before it runs.

    Time scales, stability and its boundaries, margins, the proof's reach: from the linearised equations, a verdict
    each. With -o a report with figures. An unstable design is a result too, and the exit code is 0.

    Example: springline analyze paper/nominal --range plant.m3.scale=0.8,1.2
    """
    from springline.runner.analysis import analyze as examine
    from springline.runner.scenario import load_scenario

    loaded = load_scenario(scenario, overrides(changes, scenario))
    between = dict(_range(text, scenario) for text in ranges or ())
    if output is not None:
        expect_folder(output)
        refuse_results(output)
    with progress(f"analysing {scenario}", quiet=as_json) as report:
        found = examine(loaded, between, confirm=confirm, damping=damping, progress=report)
    written = None
    if output is not None:  # its figures take a second to load
        from springline.runner.analysis import write_report

        written = write_report(found, output, force=force)
    for note in (*loaded.notes, *loaded.warnings):
        complain(note)
    if as_json:
        rows = [row.plain() for row in found.rows]
        print_json("analyze", rows, {row.name: row.unit for row in found.rows}, found.status)
        return
    shown = ["name", "value", *(["runs"] if confirm else []), "ok", "verdict"]
    right = ("value", "runs")
    print_table(shown, [_cells(row, confirm) for row in found.rows], right=right)
    for note in found.notes:
        say(note)
    if written is not None:
        say(f"report: {written}")


_VERDICTS = {True: "yes", False: "no", None: "–"}


def _cells(row: Row, confirm: bool) -> list[str]:
    runs = [number(row.confirmed, row.unit)] if confirm else []
    return [row.name, number(row.value, row.unit), *runs, _VERDICTS[row.ok], row.text]


def _range(text: str, source: str) -> tuple[str, tuple[float, float]]:
    """KEY=LOW,HIGH as a key and two numbers. Raises InputError for what is not of that form."""
    key, equals, pair = (part.strip() for part in text.partition("="))
    where = f"range of {source}"
    try:
        low, high = map(float, pair.split(","))
    except ValueError:
        raise InputError(Problem(where, key, "expected --range KEY=LOW,HIGH with two numbers", text)) from None
    if not equals or not key:
        raise InputError(Problem(where, key, "expected --range KEY=LOW,HIGH", text))
    return key, (low, high)
