"""Numbers that may differ from run to run within one structure: how they are called, and what they may be."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from springline.model.parameters import POSITIVE, UNIT_OPEN, Bounds
from springline.model.structure import Structure
from springline.model.system import System
from springline.runner.scenario import schema
from springline.runner.scenario.dotted import other_spellings, scale_key


@dataclass(frozen=True, slots=True)
class NumericKey:
    """A number that may differ from run to run within one structure.

    leaves  the entries of the scenario that it sets: itself, or one for each joint
    """

    unit: str
    bounds: Bounds
    meaning: str
    leaves: tuple[str, ...]


@lru_cache(maxsize=64)
def numeric_keys(system: System) -> dict[str, NumericKey]:
    """The numeric keys of a system; who asks for every chunk of a sweep gets the same.

    "mechanism.m3" moves the controller's value, and the plant's unless the plant has its own; "plant.m3" and
    "plant.m3.scale" move the plant's alone; "control.mu" moves all joints, "control.mu.0" one. Bands of the metrics are
    such keys too.
    """
    keys = {}
    groups: dict[str, list[str]] = {}
    for slot in system.slots:
        if slot.key.startswith("initial.") and _is_idle(slot.key, system.structure):
            continue
        unit = schema.unit_text(slot.unit, system.joints)
        for key in (slot.key, *other_spellings(slot.key)):
            keys[key] = NumericKey(unit, slot.bounds, slot.meaning, (slot.key,))
        if slot.key.startswith("plant."):
            scale = scale_key(slot.key)
            keys[scale] = NumericKey("1", POSITIVE, f"{slot.meaning}, as a factor on the controller's", (scale,))
    for key in keys:
        stem, _, last = key.rpartition(".")
        if last.isdigit() and not stem.startswith("base_motion."):
            groups.setdefault(stem, []).append(key)
    for stem, leaves in groups.items():
        units = " or ".join(dict.fromkeys(keys[leaf].unit for leaf in leaves))
        first = keys[leaves[0]]
        meaning = first.meaning.rpartition(" (")[0]
        keys[stem] = NumericKey(units, first.bounds, f"{meaning} (all joints)", tuple(leaves))
    return keys | _band_keys(system)


def _band_keys(system: System) -> dict[str, NumericKey]:
    """What metrics take for settled, which moves nothing of the run itself."""
    unit = schema.unit_text("{q}", system.joints)
    keys = {}
    for band, error in schema.BANDS:
        of = f"band of the {band.partition('_')[0]} time"
        for name, given in (
            (band, ("1", UNIT_OPEN, f"{of}, a fraction of |e(0)|")),
            (error, (unit, POSITIVE, f"{of}, an error")),
        ):
            keys[f"simulation.{name}"] = NumericKey(*given, (f"simulation.{name}",))
    return keys


def _is_idle(key: str, structure: Structure) -> bool:
    """Whether an initial value is not read, for the structure says how the run starts."""
    if structure.start == "reference":
        return True
    return key.startswith("initial.q_motor.") and structure.initial_motor != "given"


def first_outside(bounds: Bounds, column: NDArray[np.float64]) -> int | None:
    """Index of the first value that is out of bounds; bounds are an interval, so the extremes tell for all."""
    if column.size == 0:
        return None
    inside = not np.isnan(column).any() and bounds.holds(float(column.min())) and bounds.holds(float(column.max()))
    if inside and not (bounds.even and np.any(column % 2)):
        return None
    return next(i for i, value in enumerate(column) if not bounds.holds(float(value)))
