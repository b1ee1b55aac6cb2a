"""The command `springline`: its commands are registered here, and here their failures become exit codes.

0    done; a run that diverged is a result too
1    failed: no compiler, no space, a check that does not hold
2    the user's input is wrong, and nothing was written
130  Ctrl-C
"""

from __future__ import annotations

import importlib
import os
import re
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO, cast

import typer

from springline.runner.cli.groups import Function, LazyGroup, Sources, example_epilog
from springline.runner.cli.shell_words import prepare
from springline.runner.cli.terminal import complain, say

if TYPE_CHECKING:
    from springline.codegen.export import Target

_COMMANDS = "springline.runner.cli.commands"
_PLUGINS = "springline.commands"
_PLACES = {
    "init": "init.init",
    "run": "run.run",
    "batch": "batch.batch",
    "replay": "batch.replay",
    "generate": "generate.generate",
    "export": "",
    "analyze": "analyze.analyze",
    "reproduce": "reproduce.reproduce",
    "list": "listing.list_",
    "doctor": "doctor.doctor",
    "cache": "cache.cache",
}
"""The commands in the order of the help, and where in the folder commands/ each is; `export` is a group."""

_TRACEBACK = "SPRINGLINE_TRACEBACK"


def _command(place: str) -> Callable[[], Function]:
    """What imports a command, "module.function" of the folder commands/."""
    module, _, function = place.rpartition(".")
    return lambda: cast("Function", getattr(importlib.import_module(f"{_COMMANDS}.{module}"), function))


class Exports(LazyGroup):
    """The group `springline export`: a command for each target."""

    def sources(self) -> Sources:
        """The targets that have a command of their own, then those that need none."""
        from springline.codegen.export import targets

        def of(name: str, target: Target) -> Callable[[], Function]:
            def command() -> Function:
                from springline.runner.cli.commands.target import target_command

                return target_command(name, target)

            return command

        own = {"c": _command("generate.export_c"), **{f"fmu{n}": _command(f"fmu.export_fmu{n}") for n in (2, 3)}}
        return {**own, **{name: of(name, target) for name, target in targets().items()}}


class Commands(LazyGroup):
    """The group of all commands. What a command raises for the user to read is one message, never a traceback."""

    def sources(self) -> Sources:
        """The commands of this package."""
        return {name: None if name == "export" else _command(place) for name, place in _PLACES.items()}

    def more(self) -> Sources:
        """Those that other packages bring."""
        from importlib.metadata import entry_points

        return {entry.name: entry.load for entry in sorted(entry_points(group=_PLUGINS), key=lambda each: each.name)}

    def invoke(self, ctx: Any) -> Any:
        """Run the command; raises typer.Exit with the code of the failure."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError:  # whoever read stdout has had enough; typer ends quietly
            raise
        except KeyboardInterrupt as error:
            complain("stopped")
            raise typer.Exit(130) from error
        except Exception as error:
            code = _told(error)
            if code is None:
                raise
            raise typer.Exit(code) from error


def _told(error: Exception) -> int | None:
    """Tell the user what a command has raised; the exit code, or None for what is to be raised again."""
    from springline.codegen.files import FolderConflict
    from springline.codegen.kernel import ToolchainError
    from springline.runner.files import InputError

    match error:
        case InputError() | FolderConflict():
            complain(f"Error: {error}")
            return 2
        case ToolchainError() | OSError():
            complain(f"Error: {error}")
        case MemoryError():
            complain("Error: there is not enough memory for this")
        case _:
            if isinstance(error, typer.Abort) or hasattr(error, "exit_code"):  # typer's own, told by typer
                return None
            if os.environ.get(_TRACEBACK):
                return None
            place = traceback.extract_tb(error.__traceback__)[-1]
            complain(
                f"Error: a fault of springline itself: {type(error).__name__}: {error} ({Path(place.filename).name}, "
                f"line {place.lineno}). Please report it; {_TRACEBACK}=1 shows how it came to that."
            )
    return 1


app = typer.Typer(
    name="springline",
    cls=Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=example_epilog("springline run paper/nominal"),
)

app.add_typer(
    typer.Typer(
        cls=Exports,
        no_args_is_help=True,
        help="Export a scenario's controller and plant for other programs.",
        epilog=example_epilog("springline export c paper/nominal -o generated"),
    ),
    name="export",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from springline.runner.version import __version__

        say(f"springline {__version__}")
        raise typer.Exit


@app.callback()
def springline(
    _: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """From the symbolic model of a series-elastic manipulator on a moving base to C, runs, figures and tables."""


def main() -> None:
    """Entry point of the `springline` command."""
    _open_streams()
    if prepare(os.environ) and not os.environ.get(_TRACEBACK):
        _close(sys.stderr)  # it is the line that somebody types in
    _expect_working_directory()
    _mend_environment()
    code: Any = 0
    try:
        try:
            app(prog_name="springline")
        except SystemExit as end:
            code = end.code
        sys.stdout.flush()
    except OSError as error:  # a full disk, or nobody reads any more
        _close(sys.stdout)
        if not code and not isinstance(error, BrokenPipeError):
            complain(f"Error: cannot write to the standard output: {error}")
        code = code or 1
    try:
        sys.stderr.flush()
    except OSError:
        _close(sys.stderr)
    sys.exit(code)


def _close(stream: TextIO) -> None:
    """Let what a stream holds go nowhere: Python tries again at its end, and would make an exit code of it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _expect_working_directory() -> None:
    """Exit with a message where the working directory was deleted: no path could be told from there."""
    try:
        os.getcwd()
    except OSError as error:
        complain(f"Error: the working directory cannot be used ({error.strerror}): change to one that exists")
        sys.exit(1)


def _mend_environment() -> None:
    """Take out of the environment what libraries would stumble over."""
    for name in ("COLUMNS", "LINES"):  # Rich takes for a number whatever has digits, "²" too
        if not re.fullmatch("[0-9]{1,4}", os.environ.get(name, "0")):
            del os.environ[name]
    os.environ["MPLBACKEND"] = "Agg"  # all figures go into files, whatever windows a user's own plots have


def _open_streams() -> None:
    """Make the standard streams ones that anything can be written to.

    Where one was closed, the next file that is opened would take its place, and whoever prints would write into it.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, mode, encoding="utf-8", closefd=False))
        elif mode == "w":
            getattr(sys, name).reconfigure(errors="backslashreplace")  # a locale that lacks a character
