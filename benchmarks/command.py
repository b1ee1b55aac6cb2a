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
    before: Annotated[
        Path | None,
        typer.Option(metavar="CHECKOUT", help="A checkout from before a change, whose kernels are timed beside ours."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print rows and aims as JSON.")] = False,
) -> None:
    """Time springline and its alternatives on this machine.

    Evaluations, agreement, compile times, and which of springline's aims are reached. Exit code 1 if a contender's
    result differs from springline's by more than its tolerance.

    Example: springline bench --quick --only springline,numpy
    """
    from springline.benchmarks.aims import judge
    from springline.benchmarks.contenders import CONTENDERS
    from springline.benchmarks.harness import QUICK, UNITS, Effort, measure
    from springline.benchmarks.report import (
        AIM_COLUMNS,
        COLUMNS,
        OUTPUTS,
        aim_table,
        files,
        machine_lines,
        plain,
        table,
    )
    from springline.runner.files import write_folder

    expect_folder(output)
    chosen = _chosen(only, CONTENDERS) + _before(before)
    with progress("measuring", quiet=as_json) as report:
        result = measure(QUICK if quick else Effort(), chosen, report)
    write_folder(output, files(result), replaces=OUTPUTS)
    if as_json:
        rows, aims = ([plain(one) for one in found] for found in (result.rows, judge(result)))
        print_json("bench", rows, UNITS, "ok" if result.agreed else "failed", aims=aims)
    else:
        for line in machine_lines(result):
            say(line)
        print_table(COLUMNS, table(result.rows), right=COLUMNS[2:])
        print_table(AIM_COLUMNS, aim_table(judge(result)), right=AIM_COLUMNS[1:3])
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


def _before(checkout: Path | None) -> list[Contender]:
    """The kernels of another checkout, if one is named."""
    from springline.benchmarks.against import contenders, interpreter_of

    if checkout is None:
        return []
    try:
        return list(contenders(interpreter_of(checkout)))
    except ValueError as error:
        raise InputError(Problem("--before", "", str(error), str(checkout))) from error
