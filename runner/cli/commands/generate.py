"""`springline generate` and `springline export c`: the C of a scenario, ready to be compiled elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path, PurePosixPath
from typing import Annotated, Any

import typer

from springline.codegen.files import MANIFEST, Stale, check_tree, read_manifest, summary, write_tree
from springline.runner.cli.options import (
    TUNABLE,
    AsJson,
    Changes,
    Force,
    NoCode,
    ScenarioName,
    expect_folder,
    overrides,
    refuse_results,
    tunable_names,
)
from springline.runner.cli.terminal import print_json, say
from springline.runner.files import InputError, Problem

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
        metavar=TUNABLE,
        help=(
            "Parameters that stay variables of the C, comma-separated: control.k1,control.mu; the rest are constants."
        ),
    ),
]
Prefix = Annotated[str, typer.Option(metavar="NAME", help="What every C symbol begins with.")]
RealType = Annotated[Real, typer.Option(help="C type of every number.")]


def _command(name: str, description: str, default: Any = ...) -> Callable[..., None]:
    """The command `springline NAME`; `default` is the scenario when none is given, and `...` if one has to be."""

    def command(
        scenario: ScenarioName = default,
        output: Output = Path("generated"),
        changes: Changes = None,
        no_code: NoCode = False,
        check: Check = False,
        tunable: Tunable = "none",
        prefix: Prefix = "springline",
        real: RealType = Real.double,
        force: Force = False,
        as_json: AsJson = False,
    ) -> None:
        from springline.codegen.export import bind
        from springline.codegen.export.c import Overflow, generate_files
        from springline.runner.scenario import load_scenario

        expect_folder(output, writable=not check)
        loaded = load_scenario(scenario, overrides(changes, scenario))
        names = tunable_names(tunable)
        try:
            period = max(loaded.control_every, 1) * loaded.step
            export = bind(
                loaded.structure(), loaded.values(), tunable=names, prefix=prefix, real=real.value, period=period
            )
            files, manifest = generate_files(export)
        except Overflow as error:
            raise InputError(Problem(scenario, error.key, str(error), repr(error.value))) from error
        except ValueError as error:  # the scenario's numbers are in their bounds: --tunable, --prefix or --real
            raise InputError(Problem(f"springline {name}", "", str(error))) from error
        if not check:
            refuse_results(output)
        if check:
            stale = check_tree(output, files, manifest)
            _report_check(name, output, stale, len(files), as_json)
            if stale and not as_json:
                _report_options(output, manifest, files)
            if stale:
                raise typer.Exit(1)
        else:
            _write(name, output, files, manifest, force, as_json)
            if not as_json:
                say(export.system.arm.told)

    command.__doc__ = description
    return command


generate = _command(
    "generate",
    """Generate the C of a scenario: controller, plant and model.

    Its parameters are constants, but for those that --tunable names.""",
    DEFAULT,
)
export_c = _command("export c", "The same files as `springline generate SCENARIO`.")


def _write(
    name: str, output: Path, files: dict[str, bytes], manifest: dict[str, Any], force: bool, as_json: bool
) -> None:
    changes = write_tree(output, files, manifest, force=force)
    if as_json:
        done = {**dict.fromkeys(changes.written, "written"), **dict.fromkeys(changes.removed, "removed")}
        paths = sorted({*files, MANIFEST, *changes.removed})
        print_json(name, [{"path": path, "change": done.get(path, "unchanged")} for path in paths], {})
        return
    for path in changes.written:
        say(f"  wrote   {path}")
    for path in changes.removed:
        say(f"  removed {path}")
    say(f"{output} is up to date: {len(files) + 1} files, {len(changes.written)} written")


def _report_check(name: str, output: Path, stale: list[Stale], files: int, as_json: bool) -> None:
    if as_json:
        print_json(name, [entry._asdict() for entry in stale], {}, "stale" if stale else "ok")
    elif len(stale) == files + 1 and all(entry.kind == "missing" for entry in stale):
        say(f"{output} holds no generated files: the same command without --check writes them")
    else:
        say(summary(output, stale))


def _report_options(output: Path, manifest: Mapping[str, Any], files: Mapping[str, bytes]) -> None:
    """Say which options a stale folder was made with, where they are not those of this command."""
    there = read_manifest(output, None)
    if there is None:
        return
    made = _options(there, [entry["path"] for entry in there["files"]])
    asked = _options(manifest, list(files))
    other = [f"{option} {value}" for option, value in made.items() if value != asked[option]]
    if other:
        say(f"it was made with {' '.join(other)}: check it with the same")


def _options(manifest: Mapping[str, Any], paths: list[str]) -> dict[str, str]:
    """The options that an export was made with, as its manifest and files tell."""
    entries = manifest.get("parameters")
    entries = [entry for entry in entries if isinstance(entry, dict)] if isinstance(entries, list) else []
    free = [str(entry.get("name")) for entry in entries if entry.get("binding") == "run"]
    headers = [PurePosixPath(path).stem for path in paths if path.startswith("include/")]
    return {
        "--tunable": "none" if not free else "all" if len(free) == len(entries) else ",".join(free),
        "--prefix": headers[0] if headers else "?",
        "--real": "float" if "src/sl_mathf.h" in paths else "double",
    }
