"""modelDescription.xml of FMI 2.0 and 3.0, and buildDescription.xml.

Built as trees, not printed from templates: which attributes an element has depends on FMI's version and on the
variable, and the library that writes the tree sees to it that the XML is well-formed.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import version as installed
from xml.etree import ElementTree as ET

from springline.codegen.export.fmu.settings import FmiVersion, Settings
from springline.codegen.export.fmu.units import base_exponents
from springline.codegen.export.fmu.variables import Interface, Variable

_CAPABILITIES = {
    2: {
        "canHandleVariableCommunicationStepSize": "true",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    },
    3: {
        "canHandleVariableCommunicationStepSize": "true",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
    },
}


def build_description(identifier: str) -> bytes:
    """sources/buildDescription.xml: one file, C99, and the flag that equal bits ask for."""
    root = ET.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = ET.SubElement(root, "BuildConfiguration", {"modelIdentifier": identifier})
    ET.SubElement(
        ET.SubElement(
            build, "SourceFileSet", {"language": "C99", "compiler": "gcc", "compilerOptions": "-ffp-contract=off"}
        ),
        "SourceFile",
        {"name": "all.c"},
    )
    return _xml(root)


def model_description(
    interface: Interface,
    settings: Settings,
    version: FmiVersion,
    *,
    identifier: str,
    name: str,
    description: str,
    token: str,
) -> bytes:
    """modelDescription.xml.

    identifier   of the C code and the binary
    name         modelName, for people
    token        guid (FMI 2) or instantiationToken (FMI 3)
    """
    two = version == 2
    root = ET.Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{version}.0",
            "modelName": name,
            "guid" if two else "instantiationToken": token,
            "description": description,
            "generationTool": f"springline {installed('springline')}",
            "variableNamingConvention": "flat",
        },
    )
    simulation = ET.SubElement(root, "CoSimulation", {"modelIdentifier": identifier, **_CAPABILITIES[version]})
    if two:
        ET.SubElement(ET.SubElement(simulation, "SourceFiles"), "File", {"name": "all.c"})
    elif interface.part != "controller":
        simulation.set("fixedInternalStepSize", repr(settings.step))
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in sorted({variable.unit for variable in interface.variables if not variable.boolean}):
        exponents = base_exponents(unit)
        element = ET.SubElement(units, "Unit", {"name": unit})
        if exponents is not None:
            ET.SubElement(element, "BaseUnit", {base: str(exponent) for base, exponent in exponents.items()})
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(
        categories, "Category", {"name": "logStatusError", "description": "what was refused or went wrong, and why"}
    )
    # Controller and plant may meet in a master that exchanges values after the step, and so delays the command by it:
    # the sample period is often too long for that.
    step = (settings.period or settings.step) if interface.part == "loop" else settings.step
    experiment = {"startTime": "0.0", "stopTime": repr(settings.duration), "stepSize": repr(step)}
    ET.SubElement(root, "DefaultExperiment", experiment)
    variables = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(interface.variables):
        (_variable_2 if two else _variable_3)(variables, reference, variable)
    structure = ET.SubElement(root, "ModelStructure")
    depends = interface.depends
    if two:
        outputs, unknowns = (ET.SubElement(structure, tag) for tag in ("Outputs", "InitialUnknowns"))
        for reference in interface.of("output"):
            index = {"index": str(reference + 1)}
            ET.SubElement(outputs, "Unknown", index | {"dependencies": _list(k + 1 for k in depends[reference])})
            ET.SubElement(unknowns, "Unknown", index)
    else:
        for reference in interface.of("output"):
            ET.SubElement(
                structure, "Output", {"valueReference": str(reference), "dependencies": _list(depends[reference])}
            )
        for reference in interface.of("output"):
            ET.SubElement(structure, "InitialUnknown", {"valueReference": str(reference)})
    return _xml(root)


def _list(numbers: Iterable[int]) -> str:
    return " ".join(str(number) for number in numbers)


def _variable_2(parent: ET.Element, reference: int, variable: Variable) -> None:
    attributes = {"name": variable.name, "valueReference": str(reference), **_common(variable)}
    if variable.causality in ("parameter", "output", "local"):
        attributes["initial"] = "exact" if variable.causality == "parameter" else "calculated"
    element = ET.SubElement(parent, "ScalarVariable", attributes)
    ET.SubElement(element, "Boolean" if variable.boolean else "Real", _numbers(variable))


def _variable_3(parent: ET.Element, reference: int, variable: Variable) -> None:
    attributes = {"name": variable.name, "valueReference": str(reference), **_common(variable), **_numbers(variable)}
    if variable.causality in ("output", "local"):
        attributes["initial"] = "calculated"
    ET.SubElement(parent, "Boolean" if variable.boolean else "Float64", attributes)


def _common(variable: Variable) -> dict[str, str]:
    text = variable.meaning
    if variable.causality == "parameter":
        text += f"; {variable.expected}"
    return {"description": text, "causality": variable.causality, "variability": variable.variability}


def _numbers(variable: Variable) -> dict[str, str]:
    if variable.boolean:
        return {}
    attributes = {"unit": variable.unit}
    if variable.causality == "parameter":
        low, high = variable.closed_range
        attributes |= {name: repr(value) for name, value in (("min", low), ("max", high)) if value is not None}
    if variable.start is not None:
        attributes["start"] = repr(variable.start)
    return attributes


def _xml(root: ET.Element) -> bytes:
    ET.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode").encode() + b"\n"
