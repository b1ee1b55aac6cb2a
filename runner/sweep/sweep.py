"""What a sweep file says: the axes along which keys of a scenario vary, and how many runs they make (sweep_file.py)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from springline.codegen.numbers import double
from springline.runner.files import value_text
from springline.runner.scenario import Scenario

Method = Literal["grid", "random", "sobol", "latin_hypercube"]
Kind = Literal["uniform", "log_uniform", "normal", "values", "each", "tie"]


@dataclass(frozen=True, slots=True)
class Axis:
    """How one key varies.

    kind    how its values are drawn
    span    uniform, log_uniform: lowest and highest value; normal: mean and standard deviation
    values  values and each: what it takes; tie: what it takes beside the other's values, () if it follows the other
    points  grid: points of a uniform or log_uniform axis, 0 otherwise
    tie     the key that this one moves with, "" if none;  factor  of a tie that follows the other's numbers
    """

    key: str
    kind: Kind
    span: tuple[float, float] = (0.0, 0.0)
    values: tuple[Any, ...] = ()
    points: int = 0
    tie: str = ""
    factor: float = 1.0

    def reach(self, axes: Sequence[Axis]) -> tuple[float, ...]:
        """Numbers that the axis takes: all of a list's, of a range both ends but zero; the others are for a tie."""
        source = next((axis for axis in axes if axis.key == self.tie), self)
        if self.values or source.values:
            found = self.values or tuple(self.factor * value for value in source.values if is_number(value))
            return tuple(float(value) for value in found if is_number(value))
        return tuple(self.factor * value for value in source.span if value)

    def as_toml(self) -> dict[str, Any]:
        """The axis as a sweep file has it."""
        if self.kind == "tie":
            rest = {"values": list(self.values)} if self.values else {}
            return {"tie": self.tie} | rest | ({"factor": self.factor} if self.factor != 1.0 else {})
        if self.kind in ("values", "each"):
            return {self.kind: list(self.values)}
        return {self.kind: list(self.span)} | ({"points": self.points} if self.points else {})


@dataclass(frozen=True)
class Sweep:
    """A sweep file, checked; which values a key admits is checked by the Plan.

    source    the file or packaged name;  scenario  what is varied, overrides applied
    axes      in the order of the file
    samples   rows to draw; of a grid the product of its axes
    chunk     runs per part, 0: to be chosen
    keep      store the trajectory of every `keep`-th run, 0: of none
    held      values of tables [control.<name>] that the scenario does not have, for the runs that do
    """

    source: str
    scenario: Scenario
    method: Method
    samples: int
    seed: int
    chunk: int
    keep: int
    axes: tuple[Axis, ...]
    held: Mapping[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """What decides the runs beside the scenario, as plain data; the order of the keys is part of it."""
        held = [{"key": key, "value": value_text(value)} for key, value in self.held.items()]
        return {
            "method": self.method,
            "samples": self.samples,
            "seed": self.seed,
            "keep": {"trajectories": self.keep} if self.keep else {},
            "vary": [{"key": axis.key, "axis": value_text(axis.as_toml())} for axis in self.axes],
        } | ({"set": held} if held else {})


def is_number(value: object) -> bool:
    """Whether a value of a file is a finite number."""
    try:
        return math.isfinite(double(value))
    except (TypeError, ValueError):
        return False
