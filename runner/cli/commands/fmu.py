"""`springline export fmu2` and `fmu3`: a scenario's controller, plant or closed loop for other simulators."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from springline.codegen.files import MANIFEST, read_manifest, write_tree
from springline.runner.cli.options import (
    TUNABLE,
    AsJson,
    Changes,
    Force,
    NoCode,
    ScenarioName,
    expect_folder,
    refuse_results,
    tunable_names,
)
from springline.runner.cli.overrides import overrides
from springline.runner.cli.terminal import complain, print_json, say
from springline.runner.files import InputError, Problem

if TYPE_CHECKING:
    from springline.codegen.export.fmu import Settings
    from springline.runner.scenario import Scenario

_KIND = "fmu"


class Part(StrEnum):
    """What of the scenario goes into the FMU."""

    controller = "controller"
    plant = "plant"
    loop = "loop"


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
    typer.Option(metavar=TUNABLE, help="Parameters that the FMU shows, comma-separated; the rest are constants."),
]


def _command(version: Literal[2, 3]) -> Callable[..., None]:
    """The command `springline export fmu2` or `fmu3`."""

    def command(
        scenario: ScenarioName,
        part: PartOption = Part.loop,
        output: Output = Path("fmu"),
        changes: Changes = None,
        no_code: NoCode = False,
        name: Name = None,
        tunable: Tunable = "all",
        force: Force = False,
        as_json: AsJson = False,
    ) -> None:
        from springline.codegen.export import LONGEST
        from springline.codegen.export.fmu import fmu
        from springline.runner.analysis import timing
        from springline.runner.scenario import kernel_tables, load_scenario

        expect_folder(output)
        refuse_results(output)
        others = _earlier(output, keep_edited=force)
        loaded = load_scenario(scenario, overrides(changes, scenario))
        stem = re.sub(r"\W", "_", Path(scenario).stem, flags=re.ASCII)
        begin = stem if stem[:1].isalpha() else f"scenario_{stem}"
        end = f"_{part}_fmi{version}"
        identifier = name or re.sub("_+", "_", begin[: LONGEST - len(end)] + end)
        sentences = timing(loaded)
        try:
            content = fmu(
                loaded.structure(),
                loaded.values(),
                _settings(loaded),
                part=part.value,
                version=version,
                identifier=identifier,
                name=f"springline {stem} {part}",
                tables=kernel_tables(loaded.tables()),
                tunable=tunable_names(tunable),
                timing=sentences,
            )
        except ValueError as error:  # the scenario's numbers are in their bounds, so this is --tunable or --name
            raise InputError(Problem(f"springline export fmu{version}", "", str(error))) from error
        path = f"{identifier}.fmu"
        entry = {"name": path, "fmi": f"{version}.0", "part": part.value, "scenario": stem}
        others.pop(path, None)
        kept = {name: (output / name).read_bytes() for name in others}
        manifest = {"kind": _KIND, "fmus": sorted([*others.values(), entry], key=lambda fmu: str(fmu["name"]))}
        written = write_tree(output, {**kept, path: content}, manifest, force=force).written
        done = "written" if path in written else "unchanged"
        for note in (*(loaded.notes if part is not Part.controller else ()), *loaded.warnings):
            complain(note)
        if as_json:
            print_json(f"export fmu{version}", [{"path": path, "change": done}], {})
        else:
            say(f"{output / path}: FMI {version}.0, {len(content) // 1024} KiB, {done}")

    command.__doc__ = f"""Write an FMU for Co-Simulation, FMI {version}.0.

    Example: springline export fmu{version} paper/nominal --part controller -o fmu"""
    return command


export_fmu2 = _command(2)
export_fmu3 = _command(3)


def _settings(scenario: Scenario) -> Settings:
    from springline.codegen.export.fmu import Settings

    simulation, control = scenario.document["simulation"], scenario.document["control"]
    ending = [table for table in scenario.tables() if table.ends == "error"]
    return Settings(
        duration=float(simulation["duration"]),
        step=scenario.step,
        period=float(control["period"]) if control["mode"] == "sampled" else 0.0,
        bound=scenario.bound,
        limits=scenario.limits,
        seed=scenario.seed,
        run=scenario.run_number,
        until=min((table.end for table in ending), default=math.inf),
    )


def _earlier(folder: Path, *, keep_edited: bool) -> dict[str, dict[str, str]]:
    """What the folder's manifest says of FMUs that are still there, by file name: those that are as they were written.

    One that was edited is in the way (write_tree says so), unless it is asked to be kept.
    Raises FolderConflict if the folder belongs to another command, InputError for a manifest that is not whole.
    """
    manifest = read_manifest(folder, _KIND)
    if manifest is None:
        return {}
    fmus = manifest.get("fmus")
    if not isinstance(fmus, list) or not all(
        isinstance(fmu, dict) and isinstance(fmu.get("name"), str) for fmu in fmus
    ):
        text = "does not say which FMUs it lists: remove it, or export into another folder"
        raise InputError(Problem(str(folder / MANIFEST), "fmus", text))
    written = {entry["path"]: entry["sha256"] for entry in manifest["files"]}

    def stays(name: str) -> bool:
        place = folder / name
        if not place.is_file():
            return False
        return keep_edited or hashlib.sha256(place.read_bytes()).hexdigest() == written.get(name)

    return {entry["name"]: entry for entry in fmus if stays(entry["name"])}
