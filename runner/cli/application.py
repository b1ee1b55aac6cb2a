"""The command `springline`: its commands are registered here, and here their failures become exit codes.

0    done; a run that diverged is a result too
1    failed: no compiler, no space, a check that does not hold
2    the user's input is wrong, and nothing was written
130  Ctrl-C
"""

from __future__ import annotations

import os
import re
import sys
import traceback
from importlib.metadata import entry_points
from pathlib import Path
from typing import Annotated, Any, TextIO

import typer
from typer.core import TyperGroup

from springline.codegen.export import targets
from springline.codegen.files import FolderConflict
from springline.codegen.kernel import ToolchainError
from springline.runner.cli.commands import analyze, batch, doctor, fmu, generate, listing, reproduce, run, target
from springline.runner.cli.terminal import complain, say
from springline.runner.files import InputError

_TRACEBACK = "SPRINGLINE_TRACEBACK"


class Commands(TyperGroup):
    """The group of all commands. What a command raises for the user to read is one message, never a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command; raises typer.Exit with the code of the failure."""
        try:
            return super().invoke(ctx)
        except (InputError, FolderConflict) as error:
            complain(f"Error: {error}")
            raise typer.Exit(2) from error
        except BrokenPipeError:  # whoever read stdout has had enough; typer ends quietly
            raise
        except (ToolchainError, OSError) as error:
            complain(f"Error: {error}")
            raise typer.Exit(1) from error
        except MemoryError as error:
            complain("Error: there is not enough memory for this")
            raise typer.Exit(1) from error
        except KeyboardInterrupt as error:
            complain("stopped")
            raise typer.Exit(130) from error
        except Exception as error:
            if isinstance(error, typer.Abort) or hasattr(error, "exit_code"):  # typer's own, told by typer
                raise
            if os.environ.get(_TRACEBACK):
                raise
            place = traceback.extract_tb(error.__traceback__)[-1]
            complain(
                f"Error: a fault of springline itself: {type(error).__name__}: {error} ({Path(place.filename).name}, "
                f"line {place.lineno}). Please report it; {_TRACEBACK}=1 shows how it came to that."
            )
            raise typer.Exit(1) from error


app = typer.Typer(
    name="springline",
    cls=Commands,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

export = typer.Typer(no_args_is_help=True, help="Export a scenario's controller and plant for other programs.")

app.command("run")(run.run)
app.command("batch")(batch.batch)
app.command("replay")(batch.replay)
app.command("generate")(generate.generate)
export.command("c")(generate.export_c)
export.command("fmu2")(fmu.export_fmu2)
export.command("fmu3")(fmu.export_fmu3)
for name, found in targets().items():
    export.command(name)(target.target_command(name, found))
app.add_typer(export, name="export")
app.command("analyze")(analyze.analyze)
app.command("reproduce")(reproduce.reproduce)
for entry in sorted(entry_points(group="springline.commands"), key=lambda entry: entry.name):
    app.command(entry.name)(entry.load())
app.command("list")(listing.list_)
app.command("doctor")(doctor.doctor)


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
