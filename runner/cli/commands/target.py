"""`springline export <target>`: the command of a folder of codegen/export/ that needs no options of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from springline.codegen.files import write_tree
from springline.runner.cli.options import (
    AsJson,
    Changes,
    Force,
    NoCode,
    ScenarioName,
    expect_folder,
    overrides,
    refuse_results,
)
from springline.runner.cli.terminal import print_json, say

Output = Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the files.")]


def target_command(target: str, description: str) -> Callable[..., None]:
    """The command of a target: all parameters are bound, the folder is of the target's own kind."""

    def command(
        scenario: ScenarioName,
        output: Output = Path(target),
        changes: Changes = None,
        no_code: NoCode = False,
        force: Force = False,
        as_json: AsJson = False,
    ) -> None:
        from springline.codegen.export import bind, target_files
        from springline.runner.scenario import load_scenario

        expect_folder(output)
        refuse_results(output)
        loaded = load_scenario(scenario, overrides(changes, scenario))
        export = bind(loaded.structure(), loaded.values(), period=max(loaded.control_every, 1) * loaded.step)
        files = target_files(target, export)
        done = write_tree(output, files, {"kind": target, "hash": export.sha256}, force=force)
        if as_json:
            change = {**dict.fromkeys(done.written, "written"), **dict.fromkeys(done.removed, "removed")}
            paths = sorted({*files, *done.removed})
            print_json(f"export {target}", [{"path": p, "change": change.get(p, "unchanged")} for p in paths], {})
        else:
            say(f"{output}: {len(files) + 1} files, {len(done.written)} written")

    command.__doc__ = description
    return command
