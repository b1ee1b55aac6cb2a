"""documentation/index.html of an FMU: what it is, what goes in and out, and how it steps."""

from __future__ import annotations

from springline.codegen.export import Export, provenance
from springline.codegen.export.fmu.settings import FmiVersion, Settings
from springline.codegen.export.fmu.variables import NO_LIMIT, Interface, base_is_input, force_is_input
from springline.codegen.files import render

_CAUSALITIES = {
    "Inputs": "input",
    "Outputs": "output",
    "States of the controller": "local",
    "Parameters": "parameter",
}

_WHAT = {
    "controller": "The control law of an arm on a moving base: references and measurements in, motor commands out.",
    "plant": "An arm on a moving base: motor commands in, its state out.",
    "loop": "An arm on a moving base with its controller and its reference: the whole closed loop.",
}


def description(interface: Interface) -> str:
    """One sentence on a part."""
    return _WHAT[interface.part]


def document(
    export: Export, interface: Interface, settings: Settings, version: FmiVersion, *, name: str, identifier: str
) -> bytes:
    """The page, UTF-8."""
    variables = interface.variables
    return render(
        "springline.codegen.export.fmu",
        "index.html.j2",
        name=name,
        identifier=identifier,
        version=version,
        description=_WHAT[interface.part],
        part=interface.part,
        mechanism=export.system.mechanism,
        controller=export.system.controller,
        integrator=export.system.tableau.title,
        step=f"{settings.step:g}",
        period=f"{settings.period:g}",
        sampled=settings.period > 0.0,
        sensed=interface.part != "controller" and bool(export.system.measured),
        noisy=bool(export.system.noise.numel()),
        seed=export.seed,
        run=export.run,
        memory="memory" in interface.blocks,
        base_is_input=base_is_input(export.system, interface.part),
        force_is_input=force_is_input(export.system, interface.part),
        limits=settings.limits,
        unlimited=any(variable.bounds.infinite for variable in variables),
        no_limit=f"{NO_LIMIT:g}",
        sections=[
            (title, [variable for variable in variables if variable.causality == causality])
            for title, causality in _CAUSALITIES.items()
        ],
        timing=export.timing,
        provenance=provenance(export),
    ).encode()
