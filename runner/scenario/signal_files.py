"""The CSV files that the runs of a scenario read, and the scenario as it reads wherever they lie beside it.

A dataset, and the folder of a replayed run, keep these files, so that neither depends on where the originals were. Code
they do not keep, for what lies in a folder of results must not run by itself: they name it, with its hash.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256

from springline.runner.files import document_text
from springline.runner.scenario.locate import canonical_path, read_signal_file
from springline.runner.scenario.scenario import Scenario
from springline.runner.scenario.schema import DOORS

FOLDER = "tables"

_SECTIONS = ("reference", "base_motion", "disturbance")


@dataclass(frozen=True, slots=True)
class Record:
    """A CSV file and the table of the scenario ("base_motion") that reads it."""

    section: str
    content: bytes

    @property
    def sha256(self) -> str:
        """Hash of the content."""
        return sha256(self.content).hexdigest()


def records(scenario: Scenario) -> list[Record]:
    """The files that a scenario reads, read now. Raises InputError if one is gone."""
    where = scenario.source
    found = []
    for name, table in _reading(scenario):
        path = canonical_path(table["path"], scenario.folder, where, f"{name}.path")
        found.append(Record(name, read_signal_file(path, where, f"{name}.path")))
    return found


def path_keys() -> tuple[str, ...]:
    """Dotted keys of a scenario that name a CSV file."""
    return tuple(f"{name}.path" for name in _SECTIONS)


def portable_text(scenario: Scenario, paths: Mapping[str, str], names: Mapping[str, str]) -> str:
    """The complete scenario as TOML, with other paths to its files.

    paths  table of the scenario -> path of its CSV file;  names: reference to a user's class -> how it is named
    """
    document = {**scenario.document, **{name: {**table, "path": paths[name]} for name, table in _reading(scenario)}}
    for table, key in DOORS:
        document[table] = {**document[table], key: names.get(document[table][key], document[table][key])}
    return document_text(document)


def _reading(scenario: Scenario) -> list[tuple[str, Mapping[str, str]]]:
    return [(name, scenario.document[name]) for name in _SECTIONS if "path" in scenario.document[name]]
