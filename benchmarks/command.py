"""`springline bench`: the closed loop side by side with what one would use instead."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from springline.runner.cli import expect_folder, print_json, print_table, progress, say
from springline.runner.files import InputError, Problem

if TYPE_CHECKING:
    from collections.abc import Sequence

    from springline.benchmarks.problem import Contender


def bench(
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for bench.json and the bar chart.")
    ] = Path("results/bench"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Fewer and shorter samples, and no compile times: for a first look.")
    ] = False,
    only: Annotated[
        str, typer.Option(metavar="NAMES", help="Only contenders whose name contains one of these, comma-separated.")
    ] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON.")] = False,
) -> None:
    """Time springline and its alternatives on this machine.

    Evaluations, agreement, compile times. Exit code 1 if a contender's result differs from springline's by more than
    its tolerance.
    """
    from springline.benchmarks.contenders import CONTENDERS
    from springline.benchmarks.harness import QUICK, UNITS, Effort, measure
    from springline.benchmarks.report import COLUMNS, OUTPUTS, files, machine_lines, plain, table
    from springline.runner.files import write_folder

    expect_folder(output)
    chosen = _chosen(only, CONTENDERS)
    with progress("measuring", quiet=as_json) as report:
        result = measure(QUICK if quick else Effort(), chosen, report)
    write_folder(output, files(result), replaces=OUTPUTS)
    if as_json:
        print_json("bench", [plain(row) for row in result.rows], UNITS, "ok" if result.agreed else "failed")
    else:
        print_table(COLUMNS, table(result.rows), right=COLUMNS[2:])
        for line in machine_lines(result):
            say(line)
        say(f"results: {output}")
    if not result.agreed:
        raise typer.Exit(1)


def _chosen(only: str, contenders: Sequence[Contender]) -> list[Contender]:
    """Contenders whose name contains one of the comma-separated words, and springline's defaults, their measure."""
    from springline.benchmarks.contenders.ours import is_default

    words = [word.strip().lower() for word in only.split(",") if word.strip()] or [""]
    # Some names contain a comma themselves: what can be asked for is what stands between commas.
    known = tuple(dict.fromkeys(word for contender in contenders for word in contender.name.split(", ")))
    wrong = [word for word in words if not any(word in name.lower() for name in known)]
    if wrong:
        text = "expected a contender's name, or a part of it"
        raise InputError(*(Problem("--only", "", text, repr(word), word, known) for word in wrong))
    return [
        contender
        for contender in contenders
        if is_default(contender) or any(word in contender.name.lower() for word in words)
    ]
