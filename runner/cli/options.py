"""Arguments and options that several commands share, and what is checked of them."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import Annotated, Literal

import typer

from springline.codegen.files import TEMPORARY
from springline.runner.cli.completion import scenario_names, settings
from springline.runner.files import InputError, Problem

ScenarioName = Annotated[
    str, typer.Argument(help="A TOML file, or the name of a packaged scenario.", autocompletion=scenario_names)
]
Force = Annotated[bool, typer.Option("--force", help="Replace files that springline did not write.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print what was done to each file as JSON.")]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Override a key of the scenario, the value as in TOML: control.delta=0.02. May be given again.",
        show_default=False,
        autocompletion=settings,
    ),
]


def _refuse(context: typer.Context, refused: bool) -> bool:
    """Refuse code until the command ends: whoever calls commands from Python goes on as before."""
    if refused:
        from springline.runner.scenario import without_code

        context.with_resource(without_code())
    return refused


NoCode = Annotated[
    bool, typer.Option("--no-code", help="Refuse a scenario that names a Python file to run.", callback=_refuse)
]

TUNABLE = "NAMES|all|none"

_RESULTS = {
    "trajectory.parquet": "springline run",
    "trajectory.csv": "springline run",
    "sweep.json": "springline batch",
    "bench.json": "springline bench",
}
"""Files that tell whose results a folder holds; other folders of springline have a manifest that does."""


def tunable_names(text: str) -> list[str] | Literal["all", "none"]:
    """What --tunable names: parameters, comma-separated, or all or none of them."""
    match text:
        case "all" | "none":
            return text
    from springline.runner.scenario import canonical_key

    return [canonical_key(name.strip()) for name in text.split(",")]


def expect_folder(folder: Path, *, writable: bool = True) -> None:
    """Raise InputError unless `folder` is a folder, or could be made, and (if `writable`) written to."""
    for place in (folder, *folder.parents):
        try:
            mode = place.stat().st_mode
        except (FileNotFoundError, NotADirectoryError):
            if not place.is_symlink():
                continue  # to be made, or below a file: the folder above it tells
            problem = "is a link to something that does not exist"
        except (OSError, ValueError) as error:  # links in a circle, too long, not allowed, a NUL
            problem = f"cannot be a folder ({getattr(error, 'strerror', None) or error})"
        else:
            longest = os.pathconf(place, "PC_NAME_MAX")
            if not stat.S_ISDIR(mode):
                problem = "is a file where a folder was expected"
            elif any(len(os.fsencode(part)) > longest for part in folder.relative_to(place).parts):
                problem = f"would hold a name longer than {longest} bytes"
            elif writable and not os.access(place, os.W_OK | os.X_OK):
                problem = "cannot be written to"
            else:
                return
        raise InputError(Problem(str(place), "", f"{problem}; choose another with -o"))
    raise InputError(Problem(str(folder), "", "is in no folder: the current one is gone"))


def refuse_occupied(folder: Path, *, force: bool) -> None:
    """Raise InputError if `folder` cannot be one, or holds something and `force` does not say that this is meant."""
    expect_folder(folder)
    if not force and _holds_something(folder):
        text = "is not empty: choose another folder with -o, or replace its results with --force"
        raise InputError(Problem(str(folder), "", text))


def refuse_results(folder: Path) -> None:
    """Raise InputError if `folder` holds results of a command that puts no manifest beside them."""
    for name, command in _RESULTS.items():
        if (folder / name).exists():
            text = f"holds the results of {command} ({name}): choose another folder with -o"
            raise InputError(Problem(str(folder), "", text))


def _holds_something(folder: Path) -> bool:
    return folder.is_dir() and any(not item.name.startswith(TEMPORARY) for item in folder.iterdir())
