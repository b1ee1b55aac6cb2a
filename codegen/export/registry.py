"""Which targets there are: the folders beside this file whose door lists `target_files` (README.md: a new one)."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:  # CasADi takes long, and `springline --help` asks for the names
    from springline.codegen.export.bound import Export

_PACKAGE = __name__.rpartition(".")[0]
_ENTRY = "target_files"


@dataclass(frozen=True, slots=True)
class Target:
    """What the door of a target's folder says.

    title    the first line of its docstring: what the target does
    options  those of "prefix" and "real" that it reads of an Export; its door has them as `options`
    """

    title: str
    options: tuple[str, ...] = ()


def targets() -> dict[str, Target]:
    """What each target is, by name. None of their code is imported."""
    beside = pkgutil.iter_modules(importlib.import_module(_PACKAGE).__path__)
    doors = {item.name: importlib.import_module(f"{_PACKAGE}.{item.name}") for item in beside if item.ispkg}
    return {
        name: Target((door.__doc__ or name).splitlines()[0], tuple(getattr(door, "options", ())))
        for name, door in doors.items()
        if _ENTRY in door.__all__
    }


def target_files(target: str, export: Export) -> dict[str, bytes]:
    """What a target of `targets` makes of an Export: path inside the folder (``/`` between parts) -> content."""
    files = cast(
        "Callable[[Export], dict[str, bytes]]", getattr(importlib.import_module(f"{_PACKAGE}.{target}"), _ENTRY)
    )
    return files(export)


def made_with(export: Export) -> dict[str, str]:
    """What a manifest says of the options that an export was made with, as the command line takes them."""
    free = [slot.key for slot in export.tunable_slots]
    tunable = "none" if not free else "all" if len(free) == len(export.slots) else ",".join(free)
    return {"tunable": tunable, "prefix": export.prefix, "real": export.real}
