"""modelDescription.xml and buildDescription.xml as others read them: two schema validators and a strict reader."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path

import fmi_reader
import pytest
from fmi_client import CONTINUOUS, SAMPLED, Build, Values, client_library

from springline.codegen.program import Program


def described(path: Path, name: str = "modelDescription.xml") -> bytes:
    with zipfile.ZipFile(path) as archive:
        return archive.read(name)


@pytest.fixture(params=[("controller", 2), ("controller", 3), ("plant", 2), ("plant", 3), ("loop", 2), ("loop", 3)])
def exported(request: pytest.FixtureRequest, build: Build) -> Path:
    """Every part in every version, with the settings that the other tests build it with."""
    part, version = request.param
    return build(part, version, CONTINUOUS if (part, version) == ("loop", 2) else SAMPLED)


def test_valid_by_the_standards_schemas(exported: Path) -> None:
    """fmpy checks with libxml2; this is another validator on the same schemas."""
    xmlschema = client_library("xmlschema")
    folder = Path(client_library("fmpy").__file__).parent / "schema"
    two = exported.stem.endswith("2")
    model = folder / ("fmi2/fmi2ModelDescription.xsd" if two else "fmi3/fmi3ModelDescription.xsd")
    pairs = [("modelDescription.xml", model)]
    pairs.append(("sources/buildDescription.xml", folder / "fmi3" / "fmi3BuildDescription.xsd"))
    for name, schema in pairs:
        content = described(exported, name).decode()
        checked = xmlschema.XMLSchema(str(schema))
        assert list(checked.iter_errors(content)) == []
        assert list(checked.iter_errors(content.replace("modelIdentifier", "modelidentifier"))) != []


def test_a_strict_reader_reads_it(exported: Path, shaken: Program, values_of: Values) -> None:
    values = dict(zip((slot.key for slot in shaken.system.slots), values_of(shaken), strict=True))
    variables = fmi_reader.read(described(exported))
    parameters = [v for v in variables if v.causality == "parameter"]
    assert parameters
    for variable in parameters:
        assert variable.start == min(values[variable.name], 1e300)
    if "plant" not in exported.stem:
        limits = [v for v in parameters if v.name.startswith("control.U_max")]
        assert [(v.start, v.high) for v in limits] == [(1e300, None)] * 2
        assert b"1e+300 or more means no limit" in described(exported)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('start="1e+300"', 'start="INF"', "'INF' is no number"),
        ('start="0.05"', 'start="NaN"', "'NaN' is no number"),
        ('min="1e-300"', 'min="5e-324"', "is denormal"),
        ('start="1e+300"', 'start="1e999"', "overflows"),
        ('valueReference="3"', 'valueReference="2"', "a value reference twice"),
        ('name="control.delta"', 'name="control.alpha"', "a name twice"),
        ('variability="tunable"', 'variability="continuous"', "do not go together"),
        ('unit="rad"', 'unit="deg"', "is not defined"),
        ('causality="input"', 'causality="input" colour="red"', "unknown attributes"),
        ('start="0.05"', 'start="-0.05"', "starts below min"),
    ],
)
def test_the_strict_reader_is_strict(build: Build, old: str, new: str, message: str) -> None:
    content = described(build("controller", 3)).decode()
    assert old in content
    with pytest.raises(fmi_reader.DescriptionError, match=message):
        fmi_reader.read(content.replace(old, new, 1).encode())


def test_parameters_have_units_starts_and_ranges(build: Build, shaken: Program, values_of: Values) -> None:
    fmpy = client_library("fmpy")
    values = dict(zip((slot.key for slot in shaken.system.slots), values_of(shaken), strict=True))
    seen = set()
    for part in ("controller", "plant", "loop"):
        description = fmpy.read_model_description(str(build(part, 3)))
        for variable in description.modelVariables:
            if variable.causality != "parameter":
                continue
            slot = next(slot for slot in shaken.system.slots if slot.key == variable.name)
            seen.add((part, slot.key))
            assert variable.unit == slot.unit
            assert float(variable.start) == min(values[slot.key], 1e300)
            for bound, outwards in ((variable.min, -math.inf), (variable.max, math.inf)):
                if bound is not None:  # the last number that is admissible, but for the tiny ones next to 0
                    number = float(bound)
                    assert slot.bounds.holds(number)
                    assert not slot.bounds.holds(0.0 if number == 1e-300 else math.nextafter(number, outwards))
            assert variable.variability == ("fixed" if slot.key.startswith("initial.") else "tunable")
    assert ("controller", "control.delta") in seen and ("controller", "plant.m3") not in seen
    assert ("plant", "plant.m3") in seen and ("plant", "control.delta") not in seen
    assert {key for part, key in seen if part == "loop"} >= {key for part, key in seen}
