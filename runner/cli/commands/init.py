"""`springline init`: commented files to start from."""

from __future__ import annotations

import os
import shlex
from enum import StrEnum
from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from springline.runner.cli.options import Force, expect_folder
from springline.runner.cli.terminal import say


class Kind(StrEnum):
    """What to start with."""

    scenario = "scenario"
    arm = "arm"
    controller = "controller"
    sweep = "sweep"
    notebook = "notebook"


# What is written for each, the template that it is, and the command that comes next.
_STARTS: dict[Kind, tuple[dict[str, str], str]] = {
    Kind.scenario: ({"scenario.toml": "scenario.toml"}, "springline run {scenario}"),
    Kind.arm: ({"arm.py": "arm.py.txt", "scenario.toml": "arm.toml"}, "springline analyze {scenario}"),
    Kind.controller: (
        {"controller.py": "controller.py.txt", "scenario.toml": "controller.toml"},
        "springline run {scenario}",
    ),
    Kind.sweep: ({"sweep.toml": "sweep.toml", "scenario.toml": "scenario.toml"}, "springline batch {sweep}"),
    Kind.notebook: ({"notebook.ipynb": "notebook.ipynb"}, "jupyter lab {notebook}"),
}


def init(
    kind: Annotated[Kind, typer.Argument(help="What to start with.")] = Kind.scenario,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the files.")] = Path(),
    force: Force = False,
) -> None:
    """Write commented files to start from.

    A scenario with the keys that one changes first; an arm or a controller of your own, with a scenario that runs it;
    a sweep with its scenario; or a notebook that goes through all of it in Python. Nothing is written if one of the
    files is there.

    Example: springline init controller -o my_controller
    """
    from springline.codegen.files import FolderConflict
    from springline.runner.files import write_folder

    expect_folder(output)
    names, following = _STARTS[kind]
    templates = resources.files("springline.runner.cli") / "templates"
    files = {name: (templates / template).read_bytes() for name, template in names.items()}
    there = [name for name in files if os.path.lexists(output / name) and not (force and (output / name).is_file())]
    if there:
        raise FolderConflict(output, dict.fromkeys(there, "is there already"), force_helps=not force)
    write_folder(output, files)
    for name in files:
        say(f"  wrote   {output / name}")
    places = {Path(name).stem: shlex.quote(str(output / name)) for name in files}
    say(f"next: {following.format_map(places)}")
