"""`springline list`: what there is to choose from, with units, defaults and meaning."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from springline.runner.cli.completion import scenario_names
from springline.runner.cli.options import Changes, NoCode
from springline.runner.cli.overrides import overrides
from springline.runner.cli.terminal import complain, print_json, print_table
from springline.runner.files import InputError, Problem

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from springline.model.control import Controller, Observer
    from springline.model.parameters import Joint, Parameter
    from springline.runner.scenario import Scenario

Row = dict[str, Any]


class What(StrEnum):
    """The lists."""

    mechanisms = "mechanisms"
    controllers = "controllers"
    laws = "laws"
    parameters = "parameters"
    scenarios = "scenarios"
    sweeps = "sweeps"


def list_(
    what: Annotated[What, typer.Argument(help="Which list.")],
    scenario: Annotated[
        str,
        typer.Argument(
            help="Whose parameters: a TOML file, or the name of a packaged scenario.",
            show_default=False,
            autocompletion=scenario_names,
        ),
    ] = "",
    changes: Changes = None,
    no_code: NoCode = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the list as JSON.")] = False,
) -> None:
    """List mechanisms, controllers, laws, scenarios and the like.

    With a scenario, the parameters of its own arm, drive and controller, and their values.

    Example: springline list parameters paper/nominal
    """
    if scenario and what is not What.parameters:
        raise InputError(Problem(scenario, "", f"only goes with springline list parameters, not with {what.value}"))
    if changes and not scenario:
        raise InputError(Problem("", "", "--set goes with a scenario: springline list parameters SCENARIO --set ..."))
    listed = {
        "mechanisms": mechanisms,
        "controllers": controllers,
        "laws": laws,
        "parameters": parameters,
        "scenarios": scenarios,
        "sweeps": sweeps,
    }
    rows = _own_rows(scenario, changes) if scenario else listed[what.value]()
    if as_json:
        print_json("list", rows, {})
        return
    for kind in dict.fromkeys(row.get("kind") for row in rows):  # a table of each
        shown = [{key: value for key, value in row.items() if key != "kind"} for row in rows if row.get("kind") == kind]
        columns = list(shown[0])
        titles = [kind if kind and column == "name" else column for column in columns]
        print_table(titles, [[_text(row[column]) for column in columns] for row in shown])


def mechanisms() -> list[Row]:
    """Every mechanism with its joints and parameters."""
    from springline.model.mechanisms import MECHANISMS

    return [
        {
            "name": mechanism.name,
            "joints": [f"{joint.name} [{joint.unit}]" for joint in mechanism.joints],
            "parameters": [
                item.name for item in (*mechanism.parameters, *mechanism.motor_inertia, *mechanism.stiffness)
            ],
        }
        for mechanism in MECHANISMS.values()
    ]


def controllers() -> list[Row]:
    """Every controller, then every observer, with its own parameters, beside those of [control] that all have."""
    from springline.model.control import CONTROLLERS, OBSERVERS

    kinds: dict[str, Iterable[Controller | Observer]] = {
        "controller": CONTROLLERS.values(),
        "observer": OBSERVERS.values(),
    }
    return [
        {"kind": kind, "name": item.name, "title": item.title, "parameters": [each.name for each in item.parameters]}
        for kind, items in kinds.items()
        for item in items
    ]


def laws() -> list[Row]:
    """Every reaching law with its parameters."""
    from springline.model.control import LAWS

    return [
        {"name": law.name, "title": law.title, "parameters": [item.name for item in law.parameters]}
        for law in LAWS.values()
    ]


def parameters() -> list[Row]:
    """Every parameter of mechanism, drive and controller: scenario key, unit, default, bounds, meaning.

    What differs from joint to joint has a list of defaults, and of units; what is not the same for all mechanisms has
    a row for each, with its name.
    """
    from springline.model.drive import EPSILON, friction_parameters
    from springline.model.hardware import ACTUATORS, SENSORS
    from springline.model.mechanisms import MECHANISMS
    from springline.model.system import control_parameters

    rows: list[tuple[Row, list[str]]] = []
    for mechanism in MECHANISMS.values():
        tables = {
            "mechanism": mechanism.parameters,
            "sensor": tuple(item for effect in SENSORS for item in effect.parameters),
            "actuator": tuple(item for effect in ACTUATORS for item in effect.parameters),
            "drive": (*mechanism.motor_inertia, *mechanism.stiffness, *friction_parameters("elastic"), EPSILON),
            "control": control_parameters(mechanism),
        }
        for table, declared in tables.items():
            for row in _rows(table, declared, mechanism.joints):
                same = next((names for known, names in rows if known == row), None)
                if same is None:
                    rows.append((row, [mechanism.name]))
                else:
                    same.append(mechanism.name)
    return [
        {"key": row["key"], "mechanism": "" if len(names) == len(MECHANISMS) else ", ".join(names), **row}
        for row, names in rows
    ]


def parameters_of(scenario: Scenario) -> list[Row]:
    """Every parameter that a scenario has: as `parameters`, with the value there instead of the mechanism.

    Those of its controller, its law and its base motion are among them where these have any of their own, and the
    plant's where [plant] says anything of them; else the mechanism's and the drive's are the plant's, too.
    """
    from springline.model.base_motion import MOTIONS
    from springline.model.drive import DRIVES, EPSILON, friction_parameters
    from springline.model.mechanisms import MECHANISMS
    from springline.model.system import control_parameters, own_control_tables

    structure = scenario.structure()
    mechanism = MECHANISMS[structure.mechanism].of_size(structure.size)
    split = (EPSILON,) if structure.drive == "elastic" else ()
    drive = (*DRIVES[structure.drive].parameters(mechanism), *friction_parameters(structure.drive))
    given = scenario.document["plant"]
    tables: dict[str, tuple[Parameter, ...]] = {
        "mechanism": mechanism.parameters,
        "drive": (*drive, *split),
        "plant": tuple(item for item in (*mechanism.parameters, *drive) if item.name in given),
        "control": control_parameters(mechanism, structure.drive),
        **{f"control.{name}": declared for name, declared in own_control_tables(structure).items()},
    }
    if structure.base_motion.own:
        tables["base_motion"] = MOTIONS[structure.base_motion.own].parameters
    rows = [row for table, declared in tables.items() for row in _rows(table, declared, mechanism.joints)]
    return [{"key": row["key"], "value": _value(scenario, row["key"]), **row} for row in rows]


def _value(scenario: Scenario, key: str) -> object:
    found: Any = scenario.document
    for name in key.split("."):
        found = found[name]
    return found


def _own_rows(name: str, changes: list[str] | None) -> list[Row]:
    from springline.runner.scenario import load_scenario

    scenario = load_scenario(name, overrides(changes, name))
    for note in scenario.notes:
        complain(note)
    return parameters_of(scenario)


def scenarios() -> list[Row]:
    """Every packaged scenario with the comment that it begins with."""
    from springline.runner.scenario import packaged_scenarios

    return _titled("", packaged_scenarios())


def sweeps() -> list[Row]:
    """Every packaged sweep with the comment that it begins with."""
    from springline.runner.scenario import packaged_sweeps

    return _titled("sweeps/", packaged_sweeps())


def _titled(folder: str, names: Iterable[str]) -> list[Row]:
    from springline.runner.scenario import scenarios_folder

    files = {name: scenarios_folder().joinpath(*f"{folder}{name}.toml".split("/")) for name in names}
    return [{"name": name, "title": _title(file.read_text("utf-8"))} for name, file in files.items()]


def _title(text: str) -> str:
    first = text.partition("\n")[0]
    return first.lstrip("# ") if first.startswith("#") else ""


def _rows(table: str, declared: tuple[Parameter, ...], joints: tuple[Joint, ...]) -> Iterator[Row]:
    from springline.runner.scenario import unit_text

    for item in declared:
        units = [item.unit_of(joint) for joint in joints] if item.per_joint else [unit_text(item.unit, joints)]
        yield {
            "key": f"{table}.{item.name}",
            "unit": units[0] if len(set(units)) == 1 else units,
            "default": list(item.defaults(joints)) if item.per_joint else item.defaults(joints)[0],
            "bounds": str(item.bounds),
            "meaning": item.meaning,
        }


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return "".join(f"{{ {name} = {_text(item)} }}" for name, item in value.items())
    if isinstance(value, list):
        return ", ".join(_text(item) for item in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)
