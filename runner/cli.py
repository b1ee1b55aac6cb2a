"""The command `springline`: its commands are registered here, and here their failures become exit codes.

0    done; a run that diverged is a result too
1    failed: no compiler, no space, a check that does not hold
2    the user's input is wrong, and nothing was written
130  Ctrl-C
"""

from __future__ import annotations

from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from springline.codegen.manifest import FolderConflict
from springline.codegen.toolchain import ToolchainError
from springline.runner.commands import batch, bench, doctor, fmu, generate, listing, reproduce, run
from springline.runner.errors import InputError
from springline.runner.terminal import complain, say, version


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
        except KeyboardInterrupt as error:
            complain("stopped")
            raise typer.Exit(130) from error


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
app.add_typer(export, name="export")
app.command("reproduce")(reproduce.reproduce)
app.command("bench")(bench.bench)
app.command("list")(listing.list_)
app.command("doctor")(doctor.doctor)


def _show_version(wanted: bool) -> None:
    if wanted:
        say(f"springline {version()}")
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
    app(prog_name="springline")
