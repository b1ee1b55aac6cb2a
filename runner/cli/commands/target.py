"""`springline export <target>`, and `c` is one: files made of a scenario, which a manifest keeps in order."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

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
    from springline.codegen.export import Export, Target
    from springline.codegen.files import Stale

Tree = Callable[["Export"], tuple[dict[str, bytes], dict[str, Any]]]
"""Files of an Export by path, and what the manifest says beside their list."""


class Real(StrEnum):
    """The C type of every number."""

    double = "double"
    float = "float"


Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the files.")]
Check = Annotated[bool, typer.Option("--check", help="Write nothing; exit 1 and say why if DIR is stale.")]
Tunable = Annotated[
    str,
    typer.Option(
        metavar=TUNABLE,
        help="Parameters that stay variables, comma-separated: control.k1,control.mu; the rest are constants.",
    ),
]
Prefix = Annotated[str, typer.Option(metavar="NAME", help="What every C symbol begins with.")]
RealType = Annotated[Real, typer.Option(help="C type of every number.")]

OPTIONAL = ("prefix", "real")
"""Options that a target has only if it says so."""


def tree_command(
    name: str,
    description: str,
    tree: Tree,
    *,
    folder: str,
    options: Collection[str] = OPTIONAL,
    default: Any = ...,
) -> Callable[..., None]:
    """The command `springline NAME`, which writes the files of a scenario, or checks them.

    folder   where to, unless -o says otherwise;  default  the scenario when none is given, and `...` if one has to be
    options  those of OPTIONAL that it has
    """

    def command(
        scenario: ScenarioName = default,
        output: Output = Path(folder),
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
        from springline.codegen.export.c import Overflow
        from springline.codegen.files import check_tree
        from springline.runner.analysis import timing
        from springline.runner.scenario import load_scenario

        expect_folder(output, writable=not check)
        loaded = load_scenario(scenario, overrides(changes, scenario))
        for warning in loaded.warnings:
            complain(warning)
        names = tunable_names(tunable)
        sentences = timing(loaded)
        try:
            period = max(loaded.control_every, 1) * loaded.step
            export = bind(
                loaded.structure(),
                loaded.values(),
                tunable=names,
                prefix=prefix,
                real=real.value,
                period=period,
                seed=loaded.seed,
                run=loaded.run_number,
                timing=sentences,
            )
            files, manifest = tree(export)
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
                _report_options(output, manifest)
            if stale:
                raise typer.Exit(1)
        else:
            _write(name, output, files, manifest, force, as_json)
            if not as_json:
                say(export.system.arm.told)

    command.__doc__ = description
    signature = inspect.signature(command, eval_str=True)
    taken = [item for key, item in signature.parameters.items() if key not in OPTIONAL or key in options]
    vars(command)["__signature__"] = signature.replace(parameters=taken)
    return command


def target_command(name: str, target: Target) -> Callable[..., None]:
    """The command `springline export NAME` of a folder of codegen/export/ that has none of its own."""

    def tree(export: Export) -> tuple[dict[str, bytes], dict[str, Any]]:
        from springline.codegen.export import made_with, target_files

        return target_files(name, export), {"kind": name, "hash": export.sha256, "options": made_with(export)}

    description = f"{target.title}\n\nExample: springline export {name} paper/nominal"
    return tree_command(f"export {name}", description, tree, folder=name, options=target.options)


def _write(
    name: str, output: Path, files: dict[str, bytes], manifest: dict[str, Any], force: bool, as_json: bool
) -> None:
    from springline.codegen.files import MANIFEST, write_tree

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
    from springline.codegen.files import summary

    if as_json:
        print_json(name, [entry._asdict() for entry in stale], {}, "stale" if stale else "ok")
    elif len(stale) == files + 1 and all(entry.kind == "missing" for entry in stale):
        say(f"{output} holds no generated files: the same command without --check writes them")
    else:
        say(summary(output, stale))


def _report_options(output: Path, manifest: Mapping[str, Any]) -> None:
    """Say which options a stale folder was made with, where they are not those of this command."""
    from springline.codegen.files import read_manifest

    there = read_manifest(output, manifest.get("kind"))
    made = there.get("options") if there else None
    if not isinstance(made, dict):
        return
    other = [
        f"--{option} {made.get(option)}" for option, asked in manifest["options"].items() if made.get(option) != asked
    ]
    if other:
        say(f"it was made with {' '.join(other)}: check it with the same")
