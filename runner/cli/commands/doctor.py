"""`springline doctor`: does this machine have what springline needs, and what each further use of it needs?"""

from __future__ import annotations

import re
import shutil
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from springline.runner.cli.terminal import print_json, print_table, say

if TYPE_CHECKING:
    from springline.codegen.kernel import Check

_DURATION = 0.05  # s: long enough for every state to have moved
_REQUIREMENT = re.compile(r"([\w.-]+)(?:\[[^]]*\])?[^;]*(?:;.*extra == [\"'](\w+)[\"'])?")

# What each extra of the package is for; that of springline's own developers is no use of it.
_EXTRAS = {
    "fmu": "check of FMUs",
    "distributed": "batches on clusters",
    "compiler": "compiler without a system's",
    "bench": "contenders of bench",
    "verify": "independent engines",
    "notebook": "notebooks",
    "docs": "documentation as a site",
}

# Programs, what they are for, and the packages of Debian and Ubuntu that have them.
_PROGRAMS = (
    ("firmware for Cortex-M", ("arm-none-eabi-gcc", "qemu-system-arm"),
     "gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"),
    ("cross compile: aarch64", ("aarch64-linux-gnu-gcc", "qemu-aarch64"),
     "gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user"),
    ("cross compile: riscv64", ("riscv64-linux-gnu-gcc", "qemu-riscv64"),
     "gcc-riscv64-linux-gnu libc6-dev-riscv64-cross qemu-user"),
    ("cross compile: s390x", ("s390x-linux-gnu-gcc", "qemu-s390x"),
     "gcc-s390x-linux-gnu libc6-dev-s390x-cross qemu-user"),
    ("cross compile: AVR", ("avr-gcc", "simavr"), "gcc-avr avr-libc simavr"),
    ("CMake project", ("cmake", "pkg-config"), "cmake pkg-config"),
    ("proofs of rounding errors", ("gappa",), "gappa"),
)  # fmt: skip


class Capability(NamedTuple):
    """One row: a use of springline, what of it was found, and whether it can be had; None: not, but it is optional."""

    name: str
    value: str
    ok: bool | None


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Print the checks as JSON.")] = False,
) -> None:
    """Check what springline needs on this machine.

    Compiler, cache, packages and both engines, which must compute the same bits; then what further uses need. What is
    missing is told with the line that installs it. The exit code is 1 if something fails that every use needs.

    Example: springline doctor --json
    """
    from springline.codegen.kernel import checks
    from springline.runner.version import __version__

    core, extras = _packages()
    rows = [*checks(), *core]
    if all(row.ok for row in rows):
        rows.append(_engines())
    fine = all(row.ok for row in rows)
    further = [*extras, *(_programs(*row) for row in _PROGRAMS)]
    everything: list[Check | Capability] = [*rows, *further]
    if as_json:
        print_json("doctor", [row._asdict() for row in everything], {}, "ok" if fine else "failed")
    else:
        say(f"springline {__version__}")
        for title, shown in (("needed", rows), ("further uses", further)):
            print_table([title, "found", ""], [[row.name, row.value, _VERDICTS[row.ok]] for row in shown])
    if not fine:
        raise typer.Exit(1)


_VERDICTS = {True: "ok", False: "FAILS", None: "–"}


def _packages() -> tuple[list[Check], list[Capability]]:
    """The packages that springline requires, and those of its extras, as its own metadata name them."""
    from importlib.metadata import requires

    wanted: dict[str, list[str]] = {}
    for text in requires("springline") or ():
        found = _REQUIREMENT.match(text)
        assert found is not None, text
        wanted.setdefault(found[2] or "", []).append(found[1])
    extras = [_extra(title, name, wanted[name]) for name, title in _EXTRAS.items() if name in wanted]
    return [_package(name) for name in wanted[""]], extras


def _version(name: str) -> str | None:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _package(name: str) -> Check:
    from springline.codegen.kernel import Check

    version = _version(name)
    return Check(name, version or f"is not installed: pip install {name}", version is not None)


def _extra(title: str, extra: str, names: list[str]) -> Capability:
    versions = {name: _version(name) for name in dict.fromkeys(names)}
    missing = ", ".join(name for name, version in versions.items() if version is None)
    if missing:
        return Capability(title, f"missing {missing}: pip install 'springline[{extra}]'", None)
    return Capability(title, ", ".join(f"{name} {version}" for name, version in versions.items()), True)


def _programs(title: str, programs: tuple[str, ...], packages: str) -> Capability:
    missing = ", ".join(name for name in programs if shutil.which(name) is None)
    if missing:
        return Capability(title, f"missing {missing}: apt-get install {packages} (Debian, Ubuntu)", None)
    return Capability(title, ", ".join(programs), True)


def _engines() -> Check:
    """A short run of the default scenario, compiled by both engines."""
    from springline.codegen.kernel import Check, ToolchainError
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
