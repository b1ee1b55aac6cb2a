"""`springline run`: one scenario simulated, its tables and report in a folder."""

from __future__ import annotations

import os
import shutil
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from springline.runner.cli.completion import scenario_names
from springline.runner.cli.options import Changes, NoCode, refuse_occupied
from springline.runner.cli.overrides import overrides
from springline.runner.cli.terminal import complain, number, print_json, print_table, progress, say
from springline.runner.files import InputError, Problem

if TYPE_CHECKING:
    from springline.model.parameters import Joint
    from springline.runner.run import Result
    from springline.runner.scenario import Scenario

OUTPUTS = (
    "scenario.toml",
    "report.html",
    *(f"{table}.{form}" for table in ("trajectory", "metrics") for form in ("parquet", "csv", "units.json")),
    "figures/*.png",
    "figures/*.svg",
)
"""What a run leaves in its folder, as glob patterns."""


_TEXT_SIZE = 2.5  # a number as text, by the size of a double


class Engine(StrEnum):
    """Which C computes a run; the results are the same to the last bit."""

    lanes = "lanes"
    casadi = "casadi"


class Format(StrEnum):
    """How tables are stored."""

    parquet = "parquet"
    csv = "csv"


def run(
    scenario: Annotated[
        str,
        typer.Argument(help="A TOML file, or a packaged scenario: paper/group1_shake.", autocompletion=scenario_names),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="DIR", show_default="results/SCENARIO", help="Folder for the results."),
    ] = None,
    changes: Changes = None,
    no_code: NoCode = False,
    engine: Annotated[Engine, typer.Option(help="The engine.")] = Engine.lanes,
    form: Annotated[Format, typer.Option("--format", help="Format of the tables.")] = Format.parquet,
    with_hash: Annotated[
        bool,
        typer.Option("--hash", help="Print a SHA-256 of the trajectory's bits last: equal bits, equal hash."),
    ] = False,
    plot: Annotated[bool, typer.Option("--plot/--no-plot", help="Draw figures.")] = True,
    force: Annotated[bool, typer.Option("--force", help="Replace results that DIR holds.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the metrics as JSON.")] = False,
) -> None:
    """Simulate one scenario; write tables, figures, a report.

    report.html, trajectory, metrics, figures and the resolved scenario go into one folder. A run that diverges is a
    result: it is reported with the quantity and the time, and the exit code is 0.

    Example: springline run paper/group1_shake --set control.delta=0.03 -o shake
    """
    from springline.runner.files import table_files, units, write_folder
    from springline.runner.run import report_files, simulate, trajectory_hash
    from springline.runner.scenario import load_scenario, packaged_scenarios

    loaded = load_scenario(scenario, overrides(changes, scenario))
    packaged = scenario in packaged_scenarios()
    folder = output or Path("results", scenario if packaged else Path(scenario).stem)
    refuse_occupied(folder, force=force)
    _refuse_own_inputs(folder, scenario, loaded)
    _refuse_too_large(folder, loaded, form)
    with progress(f"simulating {scenario}", quiet=as_json) as report:
        result = simulate(loaded, engine=engine.value, progress=report)
    files = {"scenario.toml": loaded.to_toml(folder).encode()}
    with progress("drawing figures", quiet=as_json or not plot) as report:
        files |= report_files(loaded, result, plot=plot, progress=report)
    files |= table_files("trajectory", result.trajectory, form.value)
    files |= table_files("metrics", result.metrics, form.value)
    write_folder(folder, files, replaces=OUTPUTS)
    for note in (*loaded.notes, *loaded.warnings):
        complain(note)
    sha256 = {"sha256": trajectory_hash(result.trajectory)} if with_hash else {}
    if as_json:
        print_json("run", result.metrics.to_pylist(), units(result.metrics), result.status, **sha256)
        return
    print_metrics(result, loaded.system().joints)
    say(f"results: {folder}")
    say(result.message)
    for name, value in sha256.items():
        say(f"{name} {value}")


def _refuse_own_inputs(folder: Path, source: str, scenario: Scenario) -> None:
    """Raise InputError if writing the results would replace the scenario file or a table that it reads."""
    tables = (scenario.document[name].get("path") for name in ("reference", "base_motion", "disturbance"))
    inputs = {Path(name).resolve() for name in (source, *tables) if name is not None}
    lost = sorted(str(path) for pattern in OUTPUTS for path in folder.glob(pattern) if path.resolve() in inputs)
    if lost:
        raise InputError(
            Problem(
                lost[0],
                "",
                "is what the run reads, and its results would take its place: choose another folder with -o",
            )
        )


def _refuse_too_large(folder: Path, scenario: Scenario, form: Format) -> None:
    """Raise InputError if the trajectory does not fit memory or the disk of `folder`; all else is small."""
    from springline.runner.run import refuse_large, refuse_rows, row_size

    refuse_large(scenario)
    place = next(place for place in (folder, *Path(os.path.realpath(folder)).parents) if place.exists())
    free = shutil.disk_usage(place).free
    row = row_size(scenario) if form is Format.parquet else round(_TEXT_SIZE * row_size(scenario))
    refuse_rows(scenario, free // row, f"all that {free / 1e9:.3g} GB of free disk space at {place} have room for")


def print_metrics(result: Result, joints: tuple[Joint, ...]) -> None:
    """The metrics of one run on stdout, one row a metric and one column a joint."""
    from springline.codegen.kernel import METRICS
    from springline.runner.files import units

    unit, values = units(result.metrics), result.metrics.to_pylist()[0]
    rows = []
    for metric in METRICS:
        columns = [f"{metric}_{joint.name}" for joint in joints]
        rows.append(
            [
                metric.replace("_tv", " total variation").replace("_", " "),
                *(number(values[column], unit[column]) for column in columns),
            ]
        )
    names = [joint.name for joint in joints]
    print_table(["metric", *names], rows, right=names)
