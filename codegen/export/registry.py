"""Which targets there are: the folders beside this file whose door lists `target_files` (README.md: a new one)."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:  # CasADi takes long, and `springline --help` asks for the names
    from springline.codegen.export.bound import Export

_PACKAGE = __name__.rpartition(".")[0]
_ENTRY = "target_files"


def targets() -> dict[str, str]:
    """Name of every target -> the first line of its door, which says what it is. None of their code is imported."""
    beside = pkgutil.iter_modules(importlib.import_module(_PACKAGE).__path__)
    doors = {item.name: importlib.import_module(f"{_PACKAGE}.{item.name}") for item in beside if item.ispkg}
    return {name: (door.__doc__ or name).splitlines()[0] for name, door in doors.items() if _ENTRY in door.__all__}


def target_files(target: str, export: Export) -> dict[str, bytes]:
    """What a target of `targets` makes of an Export: path inside the folder (``/`` between parts) -> content."""
    files = cast(
        "Callable[[Export], dict[str, bytes]]", getattr(importlib.import_module(f"{_PACKAGE}.{target}"), _ENTRY)
    )
    return files(export)
