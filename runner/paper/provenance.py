"""Where a reproduction's numbers come from: what ran, by which the same can be run again and compared."""

from __future__ import annotations

from springline.codegen.kernel.toolchain import find_compiler
from springline.runner.files import value_text
from springline.runner.paper.runs import Study
from springline.runner.report import Block, Heading, Table, Text, scenario_hash, shown_name
from springline.runner.sweep import kernel_identity
from springline.runner.version import __version__

_DIGITS = 16
"""Of a kernel's hash: enough to tell kernels apart."""


def provenance(study: Study) -> list[Block]:
    """Version, compiler, inputs, and the scenario and kernel of every case; no path, date or name of a machine.

    Raises ToolchainError if there is no C compiler.
    """
    compiler = find_compiler()
    changes = ", ".join(f"`{key} = {value_text(value)}`" for key, value in study.changes.items())
    rows = [
        ("springline", __version__),
        ("C compiler", f"{compiler.family} {compiler.version}, {compiler.target}"),
        ("set of inputs", f"`{study.inputs}`"),
        ("values set for all runs", changes or "none"),
    ]
    scenarios = list(study.scenarios.values())
    ran = [(f"`{shown_name(s)}`", f"`{scenario_hash(s)}`", f"`{kernel_identity(s)[:_DIGITS]}`") for s in scenarios]
    every = ", ".join(dict.fromkeys(str(scenario.output_every) for scenario in scenarios))
    said = f"""The hash is of the scenario with every default filled in; the report of
        `springline run SCENARIO --set simulation.output_every={every}`, with the values set for all runs, shows the
        same. Equal kernels compute equal bits, whatever compiles them. The second run of a case has half the step;
        what experiments change stands where they are told."""
    heads = ("scenario", "its SHA-256", f"kernel, the first {_DIGITS} digits")
    return [
        Heading("Provenance"),
        Table(("", ""), rows, labels=2),
        Table(heads, ran, labels=3),
        Text(" ".join(said.split())),
    ]
