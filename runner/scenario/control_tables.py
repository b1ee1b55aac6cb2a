"""Tables [control.<name>] of a scenario: those of its controller, its observer and a law of the user's own."""

from __future__ import annotations

from pathlib import Path

from springline.runner.scenario import schema
from springline.runner.scenario.user_code import canonical_reference, load_class, read_class

CHOOSERS = ("control.controller", "control.observer", "control.law")
"""Keys that decide which tables there are."""


def table_in(key: str) -> str:
    """The table that a key stands in, if there is one of its name: "control.disturbance.input" -> "disturbance"."""
    table, _, rest = key.partition(".")
    return rest.partition(".")[0] if table == "control" else ""


def table_of(chooser: str, registered: str) -> str:
    """The name of the table that what is registered so has for itself; "" if it has none."""
    registry, _ = schema.DOORS[("control", chooser.partition(".")[2])]
    shared = chooser == "control.law" and registry.is_packaged(registered)  # theirs are keys of [control] itself
    item = registry[registered]
    return str(item.name) if item.parameters and not shared else ""


def table_chosen(chooser: str, value: object, folder: Path, where: str) -> str:
    """As `table_of`, of what `value` names in a file; "" where that is unknown, which the table's own check tells.

    folder  what a path in it counts from;  where: for messages
    Raises InputError for a user's file that cannot be had.
    """
    registry, _ = schema.DOORS[("control", chooser.partition(".")[2])]
    if schema.names_file(value):
        user = read_class(canonical_reference(str(value), folder, where, chooser), where, chooser)
        load_class(user, registry, where, chooser)
        return table_of(chooser, user.key)
    return table_of(chooser, value) if isinstance(value, str) and registry.is_packaged(value) else ""
