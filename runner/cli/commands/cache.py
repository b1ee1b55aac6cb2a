"""`springline cache`: the compiled kernels that springline keeps, and how to be rid of them."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from springline.runner.cli.amounts import size_text
from springline.runner.cli.terminal import print_json, say


class Action(StrEnum):
    """What to do with the cache."""

    show = "show"
    clear = "clear"


def cache(
    action: Annotated[Action, typer.Argument(help="What to do.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False,
) -> None:
    """Show the compiled kernels, or remove them.

    A kernel is compiled once and then kept. Removing them is safe while springline runs elsewhere: a kernel that is
    needed again is compiled again.

    Example: springline cache show
    """
    from springline.codegen.kernel import toolchain

    folder = toolchain.cache_root()
    found = toolchain.clear_cache() if action is Action.clear else toolchain.cached()
    if as_json:
        row = {"folder": str(folder), "kernels": found.libraries, "bytes": found.bytes, "busy": found.busy}
        print_json("cache", [row], {"bytes": "B"})
        return
    kernels = f"{found.libraries} kernel{'' if found.libraries == 1 else 's'}, {size_text(found.bytes)}"
    if action is Action.show:
        say(f"{folder}: {kernels}")
        return
    say(f"{folder}: removed {kernels}")
    if found.busy:
        say(f"{found.busy} being compiled at this moment: left there")
