"""`springline generate` and `springline export c`: the C of a scenario, ready to be compiled elsewhere."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from springline.codegen.manifest import MANIFEST, Stale, check_tree, summary, write_tree
from springline.runner.commands.run import refuse_files
from springline.runner.errors import InputError, Problem
from springline.runner.terminal import print_json, say

DEFAULT = "paper/nominal"


class Real(StrEnum):
    """The C type of every number."""

    double = "double"
    float = "float"


Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the C files.")]
Check = Annotated[bool, typer.Option("--check", help="Write nothing; exit 1 and say why if DIR is stale.")]
Tunable = Annotated[
    str,
    typer.Option(
        metavar="NAMES|all|none",
        help=(
            "Parameters that stay variables of the C, comma-separated: control.k1,control.mu; the rest are constants."
        ),
    ),
]
Prefix = Annotated[str, typer.Option(metavar="NAME", help="What every C symbol begins with.")]
RealType = Annotated[Real, typer.Option(help="C type of every number.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that springline did not write.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print what was done to each file as JSON.")]


def generate(
    scenario: Annotated[str, typer.Argument(help="A TOML file, or the name of a packaged scenario.")] = DEFAULT,
    output: Output = Path("generated"),
    check: Check = False,
    tunable: Tunable = "none",
    prefix: Prefix = "springline",
    real: RealType = Real.double,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Generate C for a scenario: controller, plant and the functions of the model, its parameters as constants."""
    _generate("generate", scenario, output, check, tunable, prefix, real, force, as_json)


def export_c(
    scenario: Annotated[str, typer.Argument(help="A TOML file, or the name of a packaged scenario.")],
    output: Output = Path("generated"),
    check: Check = False,
    tunable: Tunable = "none",
    prefix: Prefix = "springline",
    real: RealType = Real.double,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """The same files as `springline generate SCENARIO`."""
    _generate("export c", scenario, output, check, tunable, prefix, real, force, as_json)


def _generate(
    command: str,
    scenario: str,
    output: Path,
    check: bool,
    tunable: str,
    prefix: str,
    real: Real,
    force: bool,
    as_json: bool,
) -> None:
    from springline.codegen.api import generate_files
    from springline.runner.scenario import load_scenario

    refuse_files(output)
    loaded = load_scenario(scenario)
    names: Any = tunable if tunable in {"all", "none"} else [name.strip() for name in tunable.split(",")]
    try:
        files, manifest = generate_files(
            loaded.structure(), loaded.values(), tunable=names, prefix=prefix, real=real.value
        )
    except ValueError as error:  # the scenario's numbers are in their bounds, so this is --tunable or --prefix
        raise InputError(Problem(f"springline {command}", "", str(error))) from error
    if check:
        _report_check(command, output, check_tree(output, files, manifest), as_json)
        return
    changes = write_tree(output, files, manifest, force=force)
    if as_json:
        done = {**dict.fromkeys(changes.written, "written"), **dict.fromkeys(changes.removed, "removed")}
        paths = sorted({*files, MANIFEST, *changes.removed})
        print_json(command, [{"path": path, "change": done.get(path, "unchanged")} for path in paths], {})
        return
    for path in changes.written:
        say(f"  wrote   {path}")
    for path in changes.removed:
        say(f"  removed {path}")
    say(f"{output} is up to date: {len(files) + 1} files, {len(changes.written)} written")


def _report_check(command: str, output: Path, stale: list[Stale], as_json: bool) -> None:
    if as_json:
        print_json(command, [entry._asdict() for entry in stale], {}, "stale" if stale else "ok")
    else:
        say(summary(output, stale))
    if stale:
        raise typer.Exit(1)
