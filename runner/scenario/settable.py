"""Every key of a scenario that may be set to another value: what may stand there, and what does."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

from springline.model.parameters import POSITIVE
from springline.runner.files import read_toml
from springline.runner.scenario import schema
from springline.runner.scenario.dotted import flat, scale_key
from springline.runner.scenario.locate import read_scenario
from springline.runner.scenario.scenario import Scenario, draft_scenario


@dataclass(frozen=True, slots=True)
class Settable:
    """What a key may be set to.

    expected  what may stand there, for people
    names     those that may, where they can be listed; without quotes
    value     what stands there, as plain data; None: nothing
    """

    expected: str
    names: tuple[str, ...] = ()
    value: object = None


def settable_keys(scenario: Scenario) -> dict[str, Settable]:
    """The keys of a scenario by their dotted names; beside a list's own key, each of its places has one."""
    made = scenario.structure()
    shape = schema.schema(
        made.mechanism, made.drive, made.controller, made.law, made.size, made.base_motion.own, made.observer
    )
    found: dict[str, Settable] = {}
    for table, given in scenario.document.items():
        section = shape.sections.get(table)
        if section is None:
            kinds = shape.kinds[table]
            own = made.base_motion.own if table == "base_motion" else ""
            found |= _keys(kinds[own or given["kind"]], table, given)
            names = tuple(name for name in kinds if name != own)
            found[f"{table}.kind"] = Settable(" or ".join(f'"{name}"' for name in names), names, given["kind"])
        else:
            found |= _keys(section, table, given)
    return found | dict(_of_the_plant(found))


_OF_AN_ARM = ("mechanism", "drive", "plant", "reference", "disturbance")
"""Tables whose keys are an arm's."""


def settable_without_code(source: str | Path) -> dict[str, Settable]:
    """As `settable_keys`, of a scenario that cannot be loaded without running a user's file, or not at all.

    Those that stand in its file, and the default scenario's but for what a class of a user's has of its own.
    """
    try:
        document = read_toml(read_scenario(source)[0])
    except ValueError:  # InputError, too
        document = {}
    given = dict(flat(document))
    of_files = {table for table, key in schema.DOORS if schema.names_file(given.get(f"{table}.{key}"))}
    own_arm = "mechanism" in of_files
    own = (of_files & {"base_motion"}) | {*(_OF_AN_ARM if own_arm else ())}

    def known_of(key: str) -> bool:
        table, *_, last = key.split(".")
        return last == "kind" or key in schema.DOOR_KEYS or (table not in own and not (own_arm and last.isdecimal()))

    known = {key: item for key, item in settable_keys(draft_scenario("paper/nominal")).items() if known_of(key)}
    return known | {key: replace(known.get(key, Settable("")), value=value) for key, value in given.items()}


def _keys(section: type[schema.Section], path: str, given: Mapping[str, Any]) -> Iterator[tuple[str, Settable]]:
    for name, field in section.model_fields.items():
        key, value = f"{path}.{name}", given.get(name)
        listed = get_args(field.annotation)
        inner: Any = listed[0] if listed else field.annotation
        if not (inspect.isclass(inner) and issubclass(inner, schema.Section)):
            leaf = next((item for item in field.metadata if isinstance(item, schema.Leaf)), schema.text())
            yield key, Settable(leaf.expected, leaf.names, value)
            for k, entry in enumerate(leaf.entries):
                yield f"{key}.{k}", Settable(entry.expected, entry.names, value[k] if isinstance(value, list) else None)
        elif not listed:
            yield from _keys(inner, key, value or {})
        else:
            yield key, Settable(f"a list of tables with {', '.join(inner.model_fields)}")
            for k, item in enumerate(value or ()):
                yield from _keys(inner, f"{key}.{k}", item)


def _of_the_plant(found: Mapping[str, Settable]) -> Iterator[tuple[str, Settable]]:
    """What the plant has of the controller's as long as it has none of its own, and its factor on that."""
    for key, item in found.items():
        table, _, name = key.partition(".")
        if table != "plant":
            continue
        own = found[f"plant.{name.partition('.')[0]}"].value
        if own is None:
            nominal = next((found[f"{t}.{name}"].value for t in ("mechanism", "drive") if f"{t}.{name}" in found), None)
            yield key, replace(item, value=nominal)
        if "." not in name and not isinstance(own, list):  # whose places are no factors
            factor = own.get("scale") if isinstance(own, dict) else 1.0
            yield scale_key(key), Settable(schema.number_text(POSITIVE, ""), value=factor)
