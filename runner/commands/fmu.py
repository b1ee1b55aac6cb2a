"""`springline export fmu2` and `fmu3`: a scenario's controller, plant or closed loop for other simulators."""

from __future__ import annotations

import hashlib
import json
import math
import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from springline.codegen.manifest import MANIFEST, write_tree
from springline.runner.commands.run import refuse_files
from springline.runner.errors import InputError, Problem
from springline.runner.terminal import print_json, say


class Part(StrEnum):
    """What of the scenario goes into the FMU."""

    controller = "controller"
    plant = "plant"
    loop = "loop"


ScenarioName = Annotated[str, typer.Argument(help="A TOML file, or the name of a packaged scenario.")]
PartOption = Annotated[
    Part, typer.Option("--part", help="The control law, the arm, or both of them with the scenario's reference.")
]
Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the .fmu file.")]
Name = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Model identifier and file name; made of scenario and part if not given."),
]
Tunable = Annotated[
    str,
    typer.Option(
        metavar="NAMES|all|none", help="Parameters that the FMU shows, comma-separated; the rest are constants."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace files that springline did not write.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print what was written as JSON.")]


def export_fmu2(
    scenario: ScenarioName,
    part: PartOption,
    output: Output = Path("fmu"),
    name: Name = None,
    tunable: Tunable = "all",
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write an FMU for Co-Simulation, FMI 2.0."""
    _export(2, scenario, part, output, name, tunable, force, as_json)


def export_fmu3(
    scenario: ScenarioName,
    part: PartOption,
    output: Output = Path("fmu"),
    name: Name = None,
    tunable: Tunable = "all",
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Write an FMU for Co-Simulation, FMI 3.0."""
    _export(3, scenario, part, output, name, tunable, force, as_json)


def _export(
    version: Any,
    scenario: str,
    part: Part,
    output: Path,
    name: str | None,
    tunable: str,
    force: bool,
    as_json: bool,
) -> None:
    from springline.codegen.fmu import Settings, fmu
    from springline.runner.scenario import load_scenario
    from springline.runner.simulate import kernel_tables

    command = f"export fmu{version}"
    refuse_files(output)
    others = _earlier(command, output, keep_edited=force)
    loaded = load_scenario(scenario)
    stem = re.sub(r"\W", "_", Path(scenario).stem, flags=re.ASCII)
    identifier = name or f"{stem if stem[:1].isalpha() else f'scenario_{stem}'}_{part}_fmi{version}"
    names: Any = tunable if tunable in {"all", "none"} else [key.strip() for key in tunable.split(",")]
    document = loaded.document
    ending = [table for table in loaded.tables() if table.ends == "error"]
    sampled = document["control"]["mode"] == "sampled"
    settings = Settings(
        duration=float(document["simulation"]["duration"]),
        step=loaded.step,
        period=float(document["control"]["period"]) if sampled else 0.0,
        bound=loaded.bound,
        since=max((table.t0 for table in ending), default=-math.inf),
        until=min((table.end for table in ending), default=math.inf),
    )
    try:
        content = fmu(
            loaded.structure(),
            loaded.values(),
            settings,
            part=part.value,
            version=version,
            identifier=identifier,
            name=f"springline {stem} {part}",
            tables=kernel_tables(loaded.tables()),
            tunable=names,
        )
    except ValueError as error:  # the scenario's numbers are in their bounds, so this is --tunable or --name
        raise InputError(Problem(f"springline {command}", "", str(error))) from error
    path = f"{identifier}.fmu"
    entry = {"name": path, "fmi": f"{version}.0", "part": part.value, "scenario": stem}
    others.pop(path, None)
    kept = {name: (output / name).read_bytes() for name in others}
    manifest = {"fmus": sorted([*others.values(), entry], key=lambda fmu: str(fmu["name"]))}
    changes = write_tree(output, {**kept, path: content}, manifest, force=force)
    done = "written" if path in changes.written else "unchanged"
    if as_json:
        print_json(command, [{"path": path, "change": done}], {})
    else:
        say(f"{output / path}: FMI {version}.0, {len(content) // 1024} KiB, {done}")


def _earlier(command: str, folder: Path, *, keep_edited: bool) -> dict[str, dict[str, str]]:
    """What the folder's manifest says of FMUs that are still there, by file name: those that are as they were written.

    One that was edited is in the way (write_tree says so), unless it is asked to be kept.
    Raises InputError if the folder belongs to an export of another kind.
    """
    try:
        manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return {}
    except ValueError:  # no manifest of ours: write_tree says so
        return {}
    if not isinstance(manifest, dict) or "fmus" not in manifest:
        text = f"{folder} holds something else than FMUs (its {MANIFEST} says so): choose another folder with -o"
        raise InputError(Problem(f"springline {command}", "", text))
    written = {entry["path"]: entry["sha256"] for entry in manifest["files"]}

    def stays(name: str) -> bool:
        place = folder / name
        if not place.is_file():
            return False
        return keep_edited or hashlib.sha256(place.read_bytes()).hexdigest() == written.get(name)

    return {entry["name"]: entry for entry in manifest["fmus"] if stays(entry["name"])}
