"""What ten percent of each parameter does: to settling time, steady-state error, and the smallest stable delta."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from springline.runner.files import numpy_array
from springline.runner.scenario import Scenario
from springline.runner.sweep import batch

Floats = NDArray[np.float64]

SHARE = 0.1
"""How far each parameter moves, of itself, both ways."""

_TABLES = ("mechanism", "drive", "control")


@dataclass(frozen=True, slots=True)
class Effect:
    """What each parameter does to one quantity.

    title, unit  of the quantity
    nominal      its value as the scenario stands, NaN where there is none
    low, high    its values with each parameter a tenth smaller and larger, (keys,), NaN where there is none
    """

    title: str
    unit: str
    nominal: float
    low: Floats
    high: Floats

    @property
    def reach(self) -> Floats:
        """Largest change either way, relative to the nominal value; what ceases to exist counts as one of 1."""
        moved = np.stack([self.low, self.high])
        with np.errstate(invalid="ignore", divide="ignore"):
            change = np.abs(moved - self.nominal) / abs(self.nominal)
        return np.asarray(np.max(np.where(np.isnan(change), 1.0, change), axis=0), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Sensitivities:
    """Effects of the parameters `keys` on several quantities."""

    keys: tuple[str, ...]
    effects: tuple[Effect, ...]


def varied_keys(scenario: Scenario) -> dict[str, float]:
    """Every parameter that ten percent can be taken of, and its value; the plant's payload apart, as a factor.

    A mechanism's parameter moves the arm and what the controller knows of it, "plant.m3.scale" the arm alone.
    """
    keys = scenario.numeric_keys()
    found: dict[str, float] = {}
    for slot in scenario.system().slots:
        table, _, name = slot.key.partition(".")
        if table in _TABLES:
            key, value = slot.key, scenario.number_of(slot.key)
        elif table == "plant" and f"mechanism.{name}" in keys:
            head, *place = name.split(".")
            key = ".".join(["plant", head, "scale", *place])
            own, nominal = (scenario.number_of(k) for k in (slot.key, f"mechanism.{name}"))
            value = own / nominal if nominal else 0.0
        else:
            continue
        bounds = keys[key].bounds
        ends = [value * (1 - SHARE), value * (1 + SHARE)]
        if value and math.isfinite(value) and not bounds.even and all(map(bounds.holds, ends)):
            found[key] = value
    return found


def sensitivities(scenario: Scenario, boundary: Callable[[dict[str, Floats]], Floats] | None) -> Sensitivities:
    """Run the scenario with each parameter ten percent smaller and larger.

    boundary  the smallest stable delta by columns of numeric keys, NaN where there is none; None without a delta
    Parameters that do nothing to any of the quantities are left out.
    """
    values = varied_keys(scenario)
    names = list(values)
    runs = 1 + 2 * len(names)
    columns = {key: np.full(runs, value) for key, value in values.items()}
    for k, key in enumerate(names):
        columns[key][1 + 2 * k : 3 + 2 * k] *= [1 - SHARE, 1 + SHARE]
    table = batch(scenario, columns)
    joints = scenario.system().joints

    def column(metric: str, joint: str) -> Floats:
        return numpy_array(table[f"{metric}_{joint}"])

    found = []
    for metric, title in (("settling_time", "settling time"), ("steady_state_error", "steady-state error")):
        by_joint = {joint: column(metric, joint.name) for joint in joints}
        worst = max(by_joint, key=lambda joint: np.nan_to_num(by_joint[joint][0], nan=-1.0))
        unit = "s" if metric == "settling_time" else worst.unit
        found.append((f"{title}, {worst.name}", unit, by_joint[worst]))
    if boundary is not None:
        found.append(("smallest stable delta", scenario.numeric_keys()["control.delta"].unit, boundary(columns)))
    effects = [Effect(title, unit, float(moved[0]), moved[1::2], moved[2::2]) for title, unit, moved in found]
    known = [effect for effect in effects if not math.isnan(effect.nominal)]
    matters = [k for k in range(len(names)) if any(effect.reach[k] > 1e-9 for effect in known)]
    return Sensitivities(
        tuple(names[k] for k in matters),
        tuple(Effect(item.title, item.unit, item.nominal, item.low[matters], item.high[matters]) for item in known),
    )
