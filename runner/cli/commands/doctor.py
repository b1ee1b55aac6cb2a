"""`springline doctor`: does this machine have what springline needs?"""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed_version
from typing import Annotated

import typer

from springline.codegen.kernel import Check, ToolchainError, checks
from springline.runner.cli.terminal import print_json, print_table, say
from springline.runner.version import __version__

PACKAGES = ("casadi", "matplotlib", "numpy", "pyarrow", "pydantic", "scipy", "typer")
_DURATION = 0.05  # s: long enough for every state to have moved


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Print the checks as JSON.")] = False,
) -> None:
    """Check compiler, cache, packages and both engines.

    The engines must compute the same bits on this machine.
    """
    rows = [*checks(), *map(_package, PACKAGES)]
    if all(row.ok for row in rows):
        rows.append(_engines())
    fine = all(row.ok for row in rows)
    if as_json:
        print_json("doctor", [row._asdict() for row in rows], {}, "ok" if fine else "failed")
    else:
        say(f"springline {__version__}")
        print_table(["check", "found", ""], [[row.name, row.value, "ok" if row.ok else "FAILS"] for row in rows])
    if not fine:
        raise typer.Exit(1)


def _package(name: str) -> Check:
    try:
        return Check(name, installed_version(name), True)
    except PackageNotFoundError:
        return Check(name, f"is not installed: pip install {name}", False)


def _engines() -> Check:
    """A short run of the default scenario, compiled by both engines."""
    from springline.runner.run import simulate
    from springline.runner.scenario import load_scenario

    scenario = load_scenario("paper/nominal", {"simulation.duration": _DURATION})
    try:
        lanes, casadi = (simulate(scenario, engine=engine) for engine in ("lanes", "casadi"))
    except ToolchainError as error:
        return Check("engines", str(error), False)
    same = lanes.trajectory.equals(casadi.trajectory) and lanes.metrics.equals(casadi.metrics)
    found = "lanes and casadi give the same bits" if same else "lanes and casadi differ: please report this machine"
    return Check("engines", found, same)
