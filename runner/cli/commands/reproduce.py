"""`springline reproduce`: the paper again, number by number."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from springline.runner.cli.options import Changes, NoCode, expect_folder, refuse_results
from springline.runner.cli.overrides import overrides
from springline.runner.cli.terminal import number, print_json, print_table, progress, say
from springline.runner.files import InputError, unknown


def reproduce(
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the report.")] = Path(
        "reproduction"
    ),
    group: Annotated[
        list[int] | None,
        typer.Option("--group", metavar="N", help="A group of Table 2 alone. May be given again.", show_default="all"),
    ] = None,
    inputs: Annotated[
        str,
        typer.Option(
            "--inputs",
            metavar="NAME",
            help="What the paper does not publish: law_limit or motor_limit, where it limits.",
        ),
    ] = "law_limit",
    changes: Changes = None,
    no_code: NoCode = False,
    force: Annotated[
        bool, typer.Option("--force", help="Replace files that were edited since, and a report that has more.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print Table 4 as JSON.")] = False,
) -> None:
    """Repeat the reference paper, number by number.

    Its runs, tables, figures and claims, in one report. A claim that fails is a result too, and the exit code is 0.

    Example: springline reproduce --group 1 -o reproduction
    """
    from springline.runner.paper import GROUPS, INPUTS
    from springline.runner.paper import reproduce as repeat

    known = [str(item) for item in GROUPS]
    wrong = [str(item) for item in group or [] if str(item) not in known]
    if wrong:
        raise InputError(*(unknown("springline reproduce", "--group", "group", item, known) for item in wrong))
    if inputs not in INPUTS:
        raise InputError(unknown("springline reproduce", "--inputs", "set of inputs", inputs, list(INPUTS)))
    expect_folder(output)
    refuse_results(output)
    changed = overrides(changes, "the paper's scenarios")
    with progress("reproducing the paper", quiet=as_json) as report:
        done = repeat(output, group, inputs=inputs, overrides=changed, force=force, progress=report)
    if as_json:
        print_json("reproduce", done.table, {})
        return
    rows = [
        [
            f"{row['group']} {row['case']}",
            row["joint"],
            row["measure"].replace("_", " "),
            number(row["printed"], row["unit"]),
            number(row["value"], row["unit"]),
        ]
        for row in done.table
    ]
    print_table(["run", "joint", "measure", "paper", "here"], rows, right=("paper", "here"))
    print_table(["", "claim", "verdict"], [[str(f.number), f.claim, f.verdict] for f in done.findings])
    if done.changes.removed:
        say(f"removed: {len(done.changes.removed)} files of the earlier reproduction")
    say(f"report: {done.report}")
