"""The shape of a scenario file: which tables and keys there are, and what each may hold.

Names, units, bounds and defaults of everything numeric come from the model's declarations; pydantic checks the tables.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Annotated, Any, Literal, cast, get_args

from pydantic import BaseModel, ConfigDict, Field, GetCoreSchemaHandler, ValidationError, create_model
from pydantic_core import CoreSchema, ErrorDetails, PydanticCustomError, core_schema

from springline.codegen.kernel import LARGEST_SEED, MOST_STEPS
from springline.codegen.nearest import nearest
from springline.codegen.numbers import double
from springline.model.base import COORDINATES, MOUNT, MOUNT_RPY
from springline.model.base_motion import MOTIONS
from springline.model.control import (
    CONTROLLERS,
    INPUT,
    LARGEST_SURFACE_EXPONENT,
    LAWS,
    OBSERVERS,
    VELOCITY_CUTOFF,
    Controller,
    LogForm,
    Observer,
)
from springline.model.drive import DRIVES, EPSILON, DriveKind, friction_parameters
from springline.model.hardware import ACTUATORS, SENSORS
from springline.model.integrators import INTEGRATORS
from springline.model.mechanisms import MECHANISMS, Mechanism
from springline.model.parameters import LIMIT, NON_NEGATIVE, POSITIVE, REAL, UNIT_OPEN, Bounds, Joint, Parameter
from springline.model.registry import Registry
from springline.model.structure import Feedforward, Structure
from springline.model.system import control_parameters, own_control_tables
from springline.runner.files import Problem, unknown, value_text
from springline.runner.scenario.signal_csv import UNITS
from springline.runner.scenario.splines import ENDS

Mode = Literal["continuous", "sampled"]
Kind = Literal["none", "sine", "polynomial", "table"]

SIZE = "n"
"""The key of [mechanism] for the number of joints of a mechanism that comes in several sizes."""

MOTOR_STARTS = ("unloaded", "equilibrium")

NOT_WITH_VELOCITY = {"measured": "velocity_cutoff", "differenced": "velocity_noise"}
"""Where the controller has rates from, the default first -> the key of [sensor] that says nothing then."""

_DEFAULT = Structure()


def unit_text(unit: str, joints: Sequence[Joint]) -> str:
    """A unit for people; one that stands for every joint's lists them: "m or rad"."""
    return " or ".join(dict.fromkeys(unit.format(q=joint.unit, F=joint.force) for joint in joints))


def number_text(bounds: Bounds, unit: str) -> str:
    """What is expected of a number: "a number > 0 [kg]"."""
    return f"{bounds} [{unit}]" if unit not in ("1", "SI", "") else str(bounds)


def _wrong(
    expected: str, *, at: tuple[str | int, ...] = (), given: object = None, **context: Any
) -> PydanticCustomError:
    """The error of a leaf; `at` leads to the value inside it that is wrong, if not the whole."""
    told = {"expected": expected, "at": at, **context}
    return PydanticCustomError("expected", "{expected}", told | ({"given": given} if at else {}))


@dataclass(frozen=True)
class Leaf:
    """A pydantic annotation for one value.

    expected  what is expected, for messages
    check     returns the value in its final form, or raises
    names     what may stand there, without quotes, where it can be listed
    entries   what may stand at each place, where it may be a list
    """

    expected: str
    check: Callable[[object], Any]
    names: tuple[str, ...] = ()
    entries: tuple[Leaf, ...] = ()

    def __get_pydantic_core_schema__(self, source: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self.check)


def number(unit: str = "1", bounds: Bounds = REAL) -> Leaf:
    """A float within bounds."""
    expected = number_text(bounds, unit)

    def check(value: object) -> float:
        try:
            if bounds.holds(double(value)):
                return double(value)
        except (TypeError, ValueError):
            pass
        raise _wrong(f"expected {expected}")

    return Leaf(expected, check)


def per_joint(numbers: Sequence[Leaf], joints: Sequence[Joint]) -> Leaf:
    """One number for all joints, or a list with one for each; kept as a list."""
    kinds = " or ".join(dict.fromkeys(item.expected for item in numbers))
    names = ", ".join(joint.name for joint in joints)
    expected = f"{kinds}, for all joints or as a list of {len(joints)} ({names})"

    def check(value: object) -> list[float]:
        if not isinstance(value, list):
            return [_checked(item, value, expected) for item in numbers]
        if len(value) != len(joints):
            raise _wrong(f"expected {expected}")
        pairs = enumerate(zip(numbers, value, strict=True))
        return [_checked(item, entry, item.expected, at=(i,), given=entry) for i, (item, entry) in pairs]

    return Leaf(expected, check, entries=tuple(numbers))


def plant_value(own: Leaf, scale: Leaf) -> Leaf:
    """A value of the plant's own, or { scale = factor on the controller's }."""
    expected = f"{own.expected}, or {{ scale = {POSITIVE} }}"

    def check(value: object) -> object:
        if not isinstance(value, dict):
            return own.check(value) if isinstance(value, list) else _checked(own, value, expected)
        for name in value:
            if name != "scale":
                raise _wrong("unknown key", at=(str(name),), given=str(name), name=str(name), valid=("scale",))
        factor = value.get("scale", "")
        return {"scale": _checked(scale, factor, scale.expected, at=("scale",), given=factor)}

    return Leaf(expected, check, entries=own.entries)


def whole(most: int, *, odd: bool = False) -> Leaf:
    """A positive integer up to `most`, odd if so asked."""
    expected = f"a positive {'odd ' * odd}integer up to {most}"

    def check(value: object) -> int:
        if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= most and (value % 2 or not odd):
            return value
        raise _wrong(f"expected {expected}")

    return Leaf(expected, check)


def count(most: int) -> Leaf:
    """An integer from 0 up to `most`."""
    expected = f"an integer from 0 to {most}"

    def check(value: object) -> int:
        if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= most:
            return value
        raise _wrong(f"expected {expected}")

    return Leaf(expected, check)


def one_of(numbers: Sequence[int], meaning: str) -> Leaf:
    """One of several integers."""
    expected = f"the {meaning}, one of {', '.join(map(str, numbers))}"

    def check(value: object) -> int:
        if isinstance(value, int) and not isinstance(value, bool) and value in numbers:
            return value
        raise _wrong(f"expected {expected}")

    return Leaf(expected, check, tuple(map(str, numbers)))


def flag() -> Leaf:
    """A truth value."""

    def check(value: object) -> bool:
        if isinstance(value, bool):
            return value
        raise _wrong("expected true or false")

    return Leaf("true or false", check, ("true", "false"))


def text() -> Leaf:
    """A text that is not empty."""

    def check(value: object) -> str:
        if isinstance(value, str) and value:
            return value
        raise _wrong("expected a text in quotes")

    return Leaf("a text in quotes", check)


def choice(kind: str, names: Iterable[str]) -> Leaf:
    """One of several names; `kind` says what they name."""
    names = tuple(names)

    def check(value: object) -> str:
        if isinstance(value, str) and value in names:
            return value
        raise _wrong(f"unknown {kind}", name=value if isinstance(value, str) else "", valid=names)

    return Leaf(" or ".join(f'"{name}"' for name in names), check, names)


def names_file(text: object) -> bool:
    """Whether a name in a scenario means a class of a user's file: "my_arm.py:MyArm"."""
    return isinstance(text, str) and (".py:" in text or text.endswith(".py"))


def door(kind: str, registry: Registry[Any]) -> Leaf:
    """One of those that come with springline, or a class of a user's file; `kind` says what they name."""
    packaged = choice(kind, registry)

    def check(value: object) -> str:
        return str(value) if names_file(value) else str(choice(kind, registry).check(value))

    return Leaf(f'{packaged.expected} or "FILE.py:CLASS"', check, packaged.names)


def scale() -> Leaf:
    """A factor on the numbers of a column."""
    expected = "a finite number other than 0, -1.0 for a column of the other sign"

    def check(value: object) -> float:
        try:
            if math.isfinite(double(value)) and double(value) != 0.0:
                return double(value)
        except (TypeError, ValueError):
            pass
        raise _wrong(f"expected {expected}")

    return Leaf(expected, check)


def triple(entries: Sequence[tuple[str, str, str]]) -> Leaf:
    """A list of three numbers, each with a name, a unit and a meaning."""
    names = ", ".join(f"{name} ({meaning})" for name, _, meaning in entries)
    expected = f"a list of three finite numbers [{entries[0][1]}]: {names}"
    numbers = [number(unit) for _, unit, _ in entries]

    def check(value: object) -> list[float]:
        if not isinstance(value, list) or len(value) != len(numbers):
            raise _wrong(f"expected {expected}")
        pairs = enumerate(zip(numbers, value, strict=True))
        return [_checked(item, entry, item.expected, at=(i,), given=entry) for i, (item, entry) in pairs]

    return Leaf(expected, check, entries=tuple(numbers))


def several(item: Leaf) -> Leaf:
    """A list of at least one."""
    expected = f"a list, not empty, each {item.expected}"

    def check(value: object) -> list[Any]:
        if not isinstance(value, list) or not value:
            raise _wrong(f"expected {expected}")
        return [_checked(item, entry, item.expected, at=(i,), given=entry) for i, entry in enumerate(value)]

    return Leaf(expected, check)


def joint_limits(joints: Sequence[Joint]) -> Leaf:
    """A pair low < high for each joint, either of them infinite where there is no limit."""
    names = ", ".join(f"{joint.name} [{joint.unit}]" for joint in joints)
    expected = f"a pair [low, high] with low < high for each joint ({names}), inf for none"

    def pair(i: int, given: object) -> list[float]:
        low_high = f"expected [low, high] with low < high [{joints[i].unit}]"
        try:
            low, high = map(double, given if isinstance(given, list) else ())
        except (TypeError, ValueError):
            raise _wrong(low_high, at=(i,), given=given) from None
        if not low < high:
            raise _wrong(low_high, at=(i,), given=given)
        return [low, high]

    def check(value: object) -> list[list[float]]:
        if not isinstance(value, list) or len(value) != len(joints):
            raise _wrong(f"expected {expected}")
        return [pair(i, given) for i, given in enumerate(value)]

    return Leaf(expected, check)


def motor_start(given: Leaf) -> Leaf:
    """How the springs stand at t = 0, by name or as motor coordinates."""
    named = choice("start of the motors", MOTOR_STARTS)

    def check(value: object) -> object:
        return named.check(value) if isinstance(value, str) else given.check(value)

    return Leaf(f"{named.expected} or {given.expected}", check, named.names, given.entries)


def _checked(leaf: Leaf, value: object, expected: str, **context: Any) -> Any:
    """`leaf.check`, with another text for what was expected."""
    try:
        return leaf.check(value)
    except PydanticCustomError as error:
        raise _wrong(f"expected {expected}", **context) from error


class Section(BaseModel):
    """A table of the file: no other keys than its own."""

    model_config = ConfigDict(extra="forbid", frozen=True, protected_namespaces=())


_EXPONENT = whole(LARGEST_SURFACE_EXPONENT, odd=True)


class ControlStructure(Section):
    """The keys of [control] that are no numbers of the model."""

    controller: Annotated[str, door("controller", CONTROLLERS)] = _DEFAULT.controller
    observer: Annotated[str, door("observer", OBSERVERS)] = _DEFAULT.observer
    feedforward: Annotated[str, choice("feedforward", get_args(Feedforward))] = _DEFAULT.feedforward
    law: Annotated[str, door("law", LAWS)] = _DEFAULT.law
    log_form: Annotated[str, choice("log_form", get_args(LogForm))] = _DEFAULT.log_form
    l: Annotated[int, _EXPONENT] = _DEFAULT.exponents.l  # noqa: E741 - the paper's letter
    m: Annotated[int, _EXPONENT] = _DEFAULT.exponents.m
    p: Annotated[int, _EXPONENT] = _DEFAULT.exponents.p
    r: Annotated[int, _EXPONENT] = _DEFAULT.exponents.r
    fast: Annotated[bool, flag()] = True
    mode: Annotated[str, choice("mode", get_args(Mode))] = "continuous"
    period: Annotated[float | None, number("s", POSITIVE)] = None


class Simulation(Section):
    """[simulation]: time, output and thresholds of the metrics (bands: fractions of |e_i(0)|; errors: |e_i|)."""

    duration: Annotated[float, number("s", POSITIVE)] = 4.0
    step: Annotated[float, number("s", POSITIVE)] = 1e-4
    integrator: Annotated[str, choice("integrator", INTEGRATORS)] = _DEFAULT.integrator
    output_every: Annotated[int, whole(MOST_STEPS)] = 10
    bound: Annotated[float, number("SI", LIMIT)] = 1e6
    response_band: Annotated[float | None, number("1", UNIT_OPEN)] = None
    settling_band: Annotated[float | None, number("1", UNIT_OPEN)] = None
    response_error: Annotated[float | None, number("SI", POSITIVE)] = None
    settling_error: Annotated[float | None, number("SI", POSITIVE)] = None


class Analysis(Section):
    """[analysis]: the amplitude of sigma at which the reaching law counts as a gain."""

    sigma_amplitude: Annotated[float, number("SI", POSITIVE)] = 0.1


BANDS = (("response_band", "response_error"), ("settling_band", "settling_error"))
"""Keys of [simulation] that exclude each other."""
EXCLUDED_BY = {
    f"simulation.{key}": f"simulation.{other}" for pair in BANDS for key, other in (pair, tuple(reversed(pair)))
}
"""Dotted key of a band or an error -> the one whose place it takes."""
DEFAULT_BANDS = {"response_band": 0.10, "settling_band": 0.05}


def excluded_bands(keys: Container[str], where: str, label: str = "") -> list[Problem]:
    """What is wrong with dotted keys that name a band and the error in its place; `label` stands before each."""
    return [
        Problem(where, f"{label}simulation.{error}", f"does not go with simulation.{band}: give one of them")
        for band, error in BANDS
        if f"simulation.{band}" in keys and f"simulation.{error}" in keys
    ]


@dataclass(frozen=True)
class Schema:
    """The tables of a scenario for one mechanism and kind of drive.

    sections  table -> its keys, for the tables whose keys do not depend on a kind
    kinds     table -> kind -> its keys, for the others
    """

    sections: Mapping[str, type[Section]]
    kinds: Mapping[str, Mapping[str, type[Section]]]


TABLES = (
    *(
        "mechanism",
        "drive",
        "plant",
        "control",
        "sensor",
        "actuator",
        "reference",
        "base_motion",
        "disturbance",
        "initial",
    ),
    "analysis",
    "simulation",
)


DEFAULT_KINDS = {"drive": "elastic", "reference": "sine", "base_motion": "none", "disturbance": "none"}
"""Table -> the kind that it has where none is given."""


DOORS: Mapping[tuple[str, str], tuple[Registry[Any], str]] = {
    ("mechanism", "name"): (MECHANISMS, _DEFAULT.mechanism),
    ("control", "controller"): (CONTROLLERS, _DEFAULT.controller),
    ("control", "observer"): (OBSERVERS, _DEFAULT.observer),
    ("control", "law"): (LAWS, _DEFAULT.law),
    ("base_motion", "kind"): (MOTIONS, _DEFAULT.base_motion.kind),
}
"""Table and key that may name a class of a user's file -> what else it may name, and what it is by default."""
DOOR_KEYS = tuple(f"{table}.{key}" for table, key in DOORS)

TIMING_UNITS = dict.fromkeys(("control.period", "actuator.delay", "simulation.step", "simulation.duration"), "s")
"""Of numbers that the loop counts steps by, and that no System knows."""
"""They as dotted keys."""


@lru_cache
def schema(
    name: str,
    drive: DriveKind,
    controller: str = _DEFAULT.controller,
    law: str = _DEFAULT.law,
    size: int = 0,
    motion: str = "",
    observer: str = _DEFAULT.observer,
) -> Schema:
    """The schema for the mechanism, kind of drive, controller, law and observer that are registered as such.

    size    how many joints the mechanism has, 0 for as many as it has by default
    motion  what a base motion of a user's own is registered as, which is then a kind too; "" if there is none
    Raises ValueError for a controller, law or observer whose table [control.<its name>] would be a key already, and
    for a mechanism with a default for a parameter that none has.
    """
    mechanism = MECHANISMS[name].of_size(size)
    joints = mechanism.joints
    arm, moving = mechanism.parameters, _drive_parameters(drive, mechanism)
    named = (Annotated[str, door("mechanism", MECHANISMS)], name)
    limits = (Annotated[Any, joint_limits(joints)], [list(pair) for pair in mechanism.limits] or None)
    shared = _numbers(control_parameters(mechanism, drive), joints)
    own = own_control_tables(Structure(name, law, drive=drive, controller=controller, size=size, observer=observer))
    for taken in own:
        if taken in shared or taken in ControlStructure.model_fields:
            raise ValueError(f"{taken!r} is a key of [control] already: give the class another name")
    _expect_control_defaults(mechanism, own)
    tables = _own_tables(own, joints, _inputs(observer, drive))
    position, rate = (_each("{q}", REAL, joints), _each("{q}/s", REAL, joints))
    initial = {
        "q": (Annotated[Any, position], list(mechanism.start_position)),
        "dq": (Annotated[Any, rate], list(mechanism.start_rate)),
        "q_motor": (Annotated[Any, motor_start(position)], MOTOR_STARTS[0]),
        "on_reference": (Annotated[bool, flag()], False),
    }
    if drive == "rigid":
        del initial["q_motor"]
    return Schema(
        sections={
            "mechanism": _section(
                "mechanism", {"name": named, **_size(mechanism), "limits": limits, **_numbers(arm, joints)}
            ),
            "plant": _section("plant", {item.name: _plant(item, joints) for item in (*arm, *moving)}),
            "control": _section("control", shared | tables, ControlStructure),
            "sensor": _section("sensor", _sensor(joints)),
            "actuator": _section("actuator", _actuator(joints)),
            "initial": _section("initial", initial),
            "analysis": Analysis,
            "simulation": Simulation,
        },
        kinds={
            "drive": {kind: _drive_section(cast(DriveKind, kind), mechanism) for kind in DRIVES},
            "reference": {
                "sine": _reference_sines(mechanism),
                "polynomial": _reference_polynomials(mechanism),
                "table": _table_section({joint.name: joint.unit for joint in joints}),
            },
            "base_motion": _base_motion_sections(motion, joints),
            "disturbance": {
                "none": _section("none", {"kind": (Literal["none"], ...)}),
                "sine": _section("sine", {"kind": (Literal["sine"], ...), **_disturbance_sines(joints)}),
                "table": _table_section({joint.name: joint.force for joint in joints}),
            },
        },
    )


def _expect_control_defaults(mechanism: Mechanism, own: Mapping[str, Iterable[Parameter]]) -> None:
    """Raise ValueError for a name in `control_defaults` that means nothing to what comes with springline or was chosen.

    "<table>.<name>" of a table that neither has may be meant for a class of another file.
    """
    packaged: list[Controller | Observer] = [*CONTROLLERS.values(), *OBSERVERS.values()]
    tables = {item.name: [each.name for each in item.parameters] for item in packaged}
    tables |= {table: [item.name for item in declared] for table, declared in own.items()}
    shared = [item.name for item in control_parameters(mechanism)]
    known = [*shared, *(name for names in tables.values() for name in names)]
    dotted = [f"{table}.{name}" for table, names in tables.items() for name in names]
    for name in mechanism.control_defaults:
        table, dot, _ = name.partition(".")
        if name not in (known if not dot else dotted) and (not dot or table in tables):
            valid = dotted if dot else known
            text = f"mechanism {mechanism.name}: control_defaults: there is no parameter {name!r}"
            other = "" if dot else " (of a class of another file: '<its name>.<parameter>')"
            raise ValueError(f"{text}; did you mean {nearest(name, valid, 0.0)!r}?{other}")


def _sensor(joints: Sequence[Joint]) -> dict[str, Any]:
    """[sensor]: what sensors do to what they show, what their noise goes by, and where rates come from."""
    return {
        **_numbers([item for effect in SENSORS for item in effect.parameters], joints),
        "velocity": (Annotated[str, choice("velocity", NOT_WITH_VELOCITY)], next(iter(NOT_WITH_VELOCITY))),
        **_numbers([VELOCITY_CUTOFF], joints),
        "seed": (Annotated[int, count(LARGEST_SEED)], 0),
        "run": (Annotated[int, count(MOST_STEPS)], 0),
    }


def _actuator(joints: Sequence[Joint]) -> dict[str, Any]:
    """[actuator]: what becomes of a command on its way to the motors' force."""
    delay = {"delay": (Annotated[float, number("s", NON_NEGATIVE)], 0.0)}
    return delay | _numbers([item for effect in ACTUATORS for item in effect.parameters], joints)


def _size(mechanism: Mechanism) -> dict[str, Any]:
    """The key for the number of joints, of a mechanism that comes in several sizes."""
    if not mechanism.sizes:
        return {}
    return {SIZE: (Annotated[int, one_of(mechanism.sizes, "number of joints")], len(mechanism.joints))}


def _base_motion_sections(motion: str, joints: Sequence[Joint]) -> dict[str, type[Section]]:
    """[base_motion] by kind; an arm stands somewhere on a base that is at rest, too."""
    mount: dict[str, Any] = {
        "mount": (Annotated[Any, triple(MOUNT)], [0.0, 0.0, 0.0]),
        "mount_rpy": (Annotated[Any, triple(MOUNT_RPY)], [0.0, 0.0, 0.0]),
    }
    sines: dict[str, Any] = {c.key: (_terms(c.unit), []) for c in COORDINATES}
    sections = {
        "none": _section("none", {"kind": (Literal["none"], ...), **mount}),
        "sine": _section("sine", {"kind": (Literal["sine"], ...), **sines, **mount}),
        "table": _table_section({c.key: c.unit for c in COORDINATES}, mount),
    }
    if motion:
        kind = {"kind": (Annotated[str, text()], ...)}
        sections[motion] = _section("own", {**kind, **_numbers(MOTIONS[motion].parameters, joints), **mount})
    return sections


def _inputs(observer: str, drive: DriveKind) -> Mapping[str, Any]:
    """The key of an observer's table for what drives it: the springs do where there are some."""
    found = OBSERVERS[observer]
    names = [name for name in found.inputs if drive == "elastic" or name != "spring"] or ["command"]
    keys = {INPUT: (Annotated[str, choice("input", names)], names[0])} if len(found.inputs) > 1 else {}
    return {found.name: keys}


def _own_tables(
    own: Mapping[str, Iterable[Parameter]], joints: Sequence[Joint], others: Mapping[str, Any]
) -> dict[str, Any]:
    """Fields of the tables [control.<name>]; `others` has by table what is no number."""
    sections = {
        name: _section(name, {**others.get(name, {}), **_numbers(parameters, joints)})
        for name, parameters in own.items()
    }
    return {name: (made, made.model_validate({})) for name, made in sections.items()}


def _drive_parameters(kind: DriveKind, mechanism: Mechanism) -> tuple[Parameter, ...]:
    """All numbers that a drive of one kind may have and the plant too, whether or not they are zero."""
    return (*DRIVES[kind].parameters(mechanism), *friction_parameters(kind))


def _drive_section(kind: DriveKind, mechanism: Mechanism) -> type[Section]:
    """[drive] of one kind; only springs split the system into a slow and a fast one."""
    parameters = _drive_parameters(kind, mechanism)
    split = (EPSILON,) if kind == "elastic" else ()
    return _section("drive", {"kind": (Literal[kind], kind), **_numbers((*parameters, *split), mechanism.joints)})


def _section(name: str, fields: Mapping[str, Any], base: type[Section] = Section) -> type[Section]:
    made: type[Section] = create_model(name, __base__=base, **dict(fields))
    return made


def _each(unit: str, bounds: Bounds, joints: Sequence[Joint]) -> Leaf:
    return per_joint([number(unit_text(unit, [joint]), bounds) for joint in joints], joints)


def _leaf(parameter: Parameter, joints: Sequence[Joint]) -> Leaf:
    if parameter.per_joint:
        return _each(parameter.unit, parameter.bounds, joints)
    return number(unit_text(parameter.unit, joints), parameter.bounds)


def _numbers(parameters: Iterable[Parameter], joints: Sequence[Joint]) -> dict[str, Any]:
    """Fields of declared parameters."""

    def default(item: Parameter) -> float | list[float]:
        values = item.defaults(joints)
        return list(values) if item.per_joint else values[0]

    return {item.name: (Annotated[Any, _leaf(item, joints)], default(item)) for item in parameters}


def _plant(parameter: Parameter, joints: Sequence[Joint]) -> Any:
    """Field of a parameter that the plant may have for itself."""
    scale = _each("1", POSITIVE, joints) if parameter.per_joint else number("1", POSITIVE)
    return Annotated[Any, plant_value(_leaf(parameter, joints), scale)], None


def _terms(unit: str) -> Any:
    """The type of a list of sine terms."""
    fields = {
        "amplitude": (Annotated[float, number(unit)], ...),
        "omega": (Annotated[float, number("rad/s")], ...),
        "phase": (Annotated[float, number("rad")], 0.0),
    }
    return list[_section("term", fields)]  # type: ignore[misc] # a type made at run time


def _reference_sines(mechanism: Mechanism) -> type[Section]:
    """A joint that is given has offset 0 and no terms unless it says so; one that is not has the mechanism's."""
    fields: dict[str, Any] = {"kind": (Literal["sine"], "sine")}
    for i, joint in enumerate(mechanism.joints):
        offset = (Annotated[float, number(joint.unit)], 0.0)
        made = _section(joint.name, {"offset": offset, "terms": (_terms(joint.unit), [])})
        terms = [asdict(item) for item in mechanism.reference_terms[i]]
        default = made.model_validate({"offset": mechanism.reference_offset[i], "terms": terms})
        fields[joint.name] = (made, default)
    return _section("sine", fields)


def _disturbance_sines(joints: Sequence[Joint]) -> dict[str, Any]:
    """A constant force and sine terms for each joint; none for one that is not given."""
    fields: dict[str, Any] = {}
    for joint in joints:
        offset = (Annotated[float, number(joint.force)], 0.0)
        made = _section(joint.name, {"offset": offset, "terms": (_terms(joint.force), [])})
        fields[joint.name] = (made, made.model_validate({}))
    return fields


def _reference_polynomials(mechanism: Mechanism) -> type[Section]:
    """Via points of each joint; one that is not given stands where the mechanism starts."""
    fields: dict[str, Any] = {"kind": (Literal["polynomial"], ...)}
    for joint, start in zip(mechanism.joints, mechanism.start_position, strict=True):
        made = _section(
            joint.name,
            {"t": (Annotated[Any, several(number("s"))], ...), "q": (Annotated[Any, several(number(joint.unit))], ...)},
        )
        fields[joint.name] = (made, made.model_validate({"t": [0.0], "q": [start]}))
    return _section("polynomial", fields)


def _table_section(units: Mapping[str, str], others: Mapping[str, Any] | None = None) -> type[Section]:
    """A signal from a CSV file: a column for the time and any of the coordinates, whose SI units are `units`."""
    names = {key: (Annotated[str | None, text()], None) for key in units}
    columns = _section("columns", {"t": (Annotated[str, text()], ...), **names})
    known = {key: choice("unit", UNITS.get(si, {si: 1.0})) for key, si in {"t": "s", **units}.items()}
    scales = _section("scale", {key: (Annotated[float | None, scale()], None) for key in units})
    in_units = _section("units", {key: (Annotated[str | None, leaf], None) for key, leaf in known.items()})
    return _section(
        "table",
        {
            "kind": (Literal["table"], ...),
            "path": (Annotated[str, text()], ...),
            "columns": (columns, ...),
            "units": (in_units, Field(default_factory=in_units)),
            "scale": (scales, Field(default_factory=scales)),
            "t0": (Annotated[float, number("s")], 0.0),
            "ends": (Annotated[str, choice("ends", ENDS)], ENDS[0]),
            "max_gap": (Annotated[float | None, number("s", POSITIVE)], None),
            **(others or {}),
        },
    )


def check(
    section: type[Section], value: Mapping[str, Any], key: str, where: str
) -> tuple[dict[str, Any], list[Problem]]:
    """A table in its final form, every default filled in, without the keys that are wrong; and what is wrong with them.

    key    the table's name
    where  what it came from, for messages
    """
    try:
        return section.model_validate(value).model_dump(exclude_none=True), []
    except ValidationError as error:
        details = error.errors(include_url=False)
    problems = [_problem(section, key, where, item) for item in details]
    wrong = {str(item["loc"][0]) for item in details}
    try:
        kept = section.model_validate({k: v for k, v in value.items() if k not in wrong}).model_dump(exclude_none=True)
    except ValidationError:  # a key without a default is missing
        kept = {}
    return {name: item for name, item in kept.items() if name not in wrong}, problems


def _problem(section: type[Section], table: str, where: str, error: ErrorDetails) -> Problem:
    context = error.get("ctx", {})
    loc = (*error["loc"], *context.get("at", ()))
    key = ".".join([table, *map(str, loc)])
    given = given_text(context.get("given", error["input"]))
    if error["type"] == "expected":
        valid, name = context.get("valid", ()), context.get("name", "")
        return Problem(where, key, context["expected"], given, name, valid)
    owner = _owner(section, loc)
    name = str(loc[-1]) if loc else table
    if error["type"] == "extra_forbidden":
        return unknown(where, key, "key", name, owner.model_fields)
    if error["type"] == "missing":
        leaf = next((item for item in owner.model_fields[name].metadata if isinstance(item, Leaf)), None)
        what = leaf.expected if leaf else f"a table with {_keys(_owner(section, (*loc, '')))}"
        return Problem(where, key, f"is missing: expected {what}")
    inner = _owner(section, (*loc, ""))
    what = "a list of tables with" if error["type"] == "list_type" else "a table with"
    return Problem(where, key, f"expected {what} {_keys(inner)}", given)


def _owner(section: type[Section], loc: Sequence[str | int]) -> type[Section]:
    """The section that the last name of `loc` stands in."""
    for part in loc[:-1]:
        if isinstance(part, str):  # a number is a place in a list of sections
            annotation = section.model_fields[part].annotation
            section = cast(type[Section], next(iter(get_args(annotation)), annotation))
    return section


def _keys(section: type[Section]) -> str:
    return f"{{ {', '.join(section.model_fields)} }}"


def given_text(value: object) -> str:
    """A value as the user would write it in TOML."""
    try:
        return value_text(value)
    except TypeError:
        return repr(value)
