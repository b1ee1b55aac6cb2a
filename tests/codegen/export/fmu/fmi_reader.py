"""A strict reader of modelDescription.xml, as importers of the FMI Library's kind are: what it does not know is wrong.

It is written from the standards' tables alone, reads FMI 2.0.3 and FMI 3.0 and knows nothing of how ours are written.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass
from xml.etree import ElementTree as ET

_DOUBLE = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")  # xs:double less INF, -INF, NaN
_NATURAL = re.compile(r"0|[1-9][0-9]*")
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")

_ROOT = {"fmiVersion", "modelName", "description", "author", "version", "copyright", "license", "generationTool"}
_ROOT |= {"generationDateAndTime", "variableNamingConvention"}
_VARIABLE = {"name", "valueReference", "description", "causality", "variability", "initial"}
_REAL = {"declaredType", "quantity", "unit", "displayUnit", "relativeQuantity", "min", "max", "nominal", "unbounded"}
_REAL |= {"start", "derivative", "reinit"}
_SIMULATION = {
    2: {
        "modelIdentifier",
        "needsExecutionTool",
        "canHandleVariableCommunicationStepSize",
        "canInterpolateInputs",
        "maxOutputDerivativeOrder",
        "canRunAsynchronuously",
        "canBeInstantiatedOnlyOncePerProcess",
        "canNotUseMemoryManagementFunctions",
        "canGetAndSetFMUstate",
        "canSerializeFMUstate",
        "providesDirectionalDerivative",
    },
    3: {
        "modelIdentifier",
        "needsExecutionTool",
        "canBeInstantiatedOnlyOncePerProcess",
        "canGetAndSetFMUState",
        "canSerializeFMUState",
        "canHandleVariableCommunicationStepSize",
        "fixedInternalStepSize",
        "hasEventMode",
    },
}
# (causality, variability) -> what `initial` may be, its default first; None: none at all
_INITIAL: dict[tuple[str, str], tuple[str | None, ...]] = {
    ("parameter", "fixed"): ("exact",),
    ("parameter", "tunable"): ("exact",),
    ("input", "continuous"): (None,),
    ("input", "discrete"): (None,),
    ("independent", "continuous"): (None,),
    ("output", "continuous"): ("calculated", "exact", "approx"),
    ("output", "discrete"): ("calculated", "exact", "approx"),
}


class DescriptionError(Exception):
    """What an importer would refuse."""


@dataclass(frozen=True)
class Described:
    """A variable as read; numbers are None where they are not given."""

    name: str
    reference: int
    causality: str
    unit: str | None
    start: float | None
    low: float | None
    high: float | None


def need(condition: object, message: str) -> None:
    if not condition:
        raise DescriptionError(message)


def number(text: str, where: str) -> float:
    """A finite double that is zero or normal: C's readers report a range error for anything else."""
    need(_DOUBLE.fullmatch(text), f"{where}: {text!r} is no number")
    value = float(text)
    need(abs(value) <= sys.float_info.max, f"{where}: {text} overflows")
    need(value == 0.0 or abs(value) >= sys.float_info.min, f"{where}: {text} is denormal")
    return value


def natural(text: str, where: str) -> int:
    need(_NATURAL.fullmatch(text), f"{where}: {text!r} is no whole number")
    need(int(text) < 2**32, f"{where}: {text} has more than 32 bits")
    return int(text)


def known(element: ET.Element, attributes: set[str], *, without_text: bool = True) -> None:
    need(not set(element.attrib) - attributes, f"{element.tag}: unknown attributes {set(element.attrib) - attributes}")
    if without_text:
        need(not (element.text or "").strip(), f"{element.tag}: text where none belongs")


def read(content: bytes) -> list[Described]:
    """The variables. Raises DescriptionError."""
    root = ET.fromstring(content)  # noqa: S314 - our own
    need(root.tag == "fmiModelDescription", "the root is another element")
    version = {"2.0": 2, "3.0": 3}[root.get("fmiVersion", "")]
    token = "guid" if version == 2 else "instantiationToken"
    known(root, _ROOT | {token})
    need(re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", root.get(token, "")), "no token")
    need(root.get("modelName"), "no modelName")
    order = [
        "CoSimulation",
        "UnitDefinitions",
        "LogCategories",
        "DefaultExperiment",
        "ModelVariables",
        "ModelStructure",
    ]
    need([child.tag for child in root] == order, "children are unknown, missing or in another order")
    simulation, units, _, experiment, variables, structure = root

    known(simulation, _SIMULATION[version])
    identifier = simulation.get("modelIdentifier", "")
    need(_IDENTIFIER.fullmatch(identifier) and len(identifier) < 128, "modelIdentifier is no C identifier")
    if "fixedInternalStepSize" in simulation.attrib:
        need(number(simulation.get("fixedInternalStepSize", ""), "fixedInternalStepSize") > 0, "a step of 0 s")

    names = set()
    for unit in units:
        known(unit, {"name"})
        need(unit.get("name") and unit.get("name") not in names, "a unit without a name, or twice")
        names.add(unit.get("name"))
        for base in unit:
            need(base.tag == "BaseUnit", f"{base.tag} in a unit")
            known(base, {"kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset"})
            for exponent in set(base.attrib) - {"factor", "offset"}:
                need(re.fullmatch(r"-?[1-9]", base.get(exponent, "")), f"exponent of {exponent}")

    known(experiment, {"startTime", "stopTime", "tolerance", "stepSize"})
    times = {name: number(text, name) for name, text in experiment.items()}
    need(times["stopTime"] > times["startTime"] and times["stepSize"] > 0, "the default experiment is none")

    found = [_variable(element, version, names) for element in variables]
    need(len({v.name for v in found}) == len(found), "a name twice")
    need(len({v.reference for v in found}) == len(found), "a value reference twice")
    need([v.causality for v in found].count("independent") == 1, "not exactly one independent variable")
    _structure(structure, found, version)
    return found


def _variable(element: ET.Element, version: int, units: set[str | None]) -> Described:
    name = element.get("name", "")
    need(name and "\n" not in name, "a variable without a name")
    if version == 2:
        need(element.tag == "ScalarVariable" and len(element) == 1, f"{name}: no scalar variable")
        known(element, _VARIABLE | {"canHandleMultipleSetPerTimeInstant"})
        (typed,) = element
        kind, real = typed.tag, "Real"
        known(typed, _REAL if kind == real else {"declaredType", "start"})
    else:
        typed, kind, real = element, element.tag, "Float64"
        more = {"clocks", "previous", "intermediateUpdate", "canHandleMultipleSetPerTimeInstant"}
        known(element, _VARIABLE | more | (_REAL if kind == real else {"declaredType", "start"}))
    need(kind in (real, "Boolean"), f"{name}: type {kind}")
    causality, variability = element.get("causality", "local"), element.get("variability", "continuous")
    need((causality, variability) in _INITIAL, f"{name}: {causality} and {variability} do not go together")
    need(kind == real or variability != "continuous", f"{name}: a continuous Boolean")
    allowed = _INITIAL[causality, variability]
    need("initial" not in element.attrib or element.get("initial") in allowed, f"{name}: initial")
    initial = element.get("initial", allowed[0])
    start = typed.get("start")
    if causality == "input" or initial in ("exact", "approx"):
        need(start is not None, f"{name}: no start")
    else:
        need(start is None, f"{name}: a start that nothing starts with")
    if kind == "Boolean":
        return Described(name, natural(element.get("valueReference", ""), name), causality, None, None, None, None)
    need(typed.get("unit") is None or typed.get("unit") in units, f"{name}: unit {typed.get('unit')} is not defined")
    values = {k: None if typed.get(k) is None else number(typed.get(k, ""), f"{name}: {k}") for k in ("min", "max")}
    value = None if start is None else number(start, f"{name}: start")
    if value is not None:
        need(values["min"] is None or values["min"] <= value, f"{name}: starts below min")
        need(values["max"] is None or value <= values["max"], f"{name}: starts above max")
    reference = natural(element.get("valueReference", ""), name)
    return Described(name, reference, causality, typed.get("unit"), value, values["min"], values["max"])


def _structure(structure: ET.Element, variables: list[Described], version: int) -> None:
    outputs = [v for v in variables if v.causality == "output"]
    if version == 2:
        need([child.tag for child in structure] == ["Outputs", "InitialUnknowns"], "ModelStructure")
        groups = [list(child) for child in structure]
        key, places = "index", {i + 1: v for i, v in enumerate(variables)}
    else:
        groups = [structure.findall("Output"), structure.findall("InitialUnknown")]
        need(len(structure) == sum(map(len, groups)), "ModelStructure")
        key, places = "valueReference", {v.reference: v for v in variables}
    for group in groups:
        seen = []
        for element in group:
            known(element, {key, "dependencies", "dependenciesKind"})
            at = natural(element.get(key, ""), "ModelStructure")
            need(at in places, f"ModelStructure names {at}, which is no variable")
            seen.append(places[at])
            dependencies = [natural(text, "dependencies") for text in element.get("dependencies", "").split()]
            need(all(k in places for k in dependencies), "dependencies on what is no variable")
            need(len(set(dependencies)) == len(dependencies), "a dependency twice")
        need(seen == outputs, "not every output, once, in order")
