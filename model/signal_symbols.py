"""Symbols of reference, base motion and disturbance: parameters where they are formulas, data where they are tables."""

from __future__ import annotations

from typing import Literal

from springline.model import lazy_casadi as ca
from springline.model import signals as formulas
from springline.model.base import COORDINATES, moving
from springline.model.base_motion import MOTIONS, signals_of
from springline.model.parameters import Joint, ParameterVector
from springline.model.signals import Signal, constant_zero
from springline.model.structure import SignalShape, TableLayout

SignalTableName = Literal["reference", "base_motion", "disturbance"]

_C_NAMES = {c.key: c.alias for c in COORDINATES if c.alias}
"""What C has called the terms of a coordinate before it had its name of today, and still does."""


class SignalSymbols:
    """Makes the symbols of one signal after the other.

    t       time, s
    tables  layout of d, the data of those that come from tables
    """

    def __init__(self, t: ca.SX, vector: ParameterVector) -> None:
        """`vector` gets the parameters."""
        self.t = t
        self.tables: tuple[TableLayout, ...] = ()
        self._vector = vector
        self._data: list[ca.SX] = []

    @property
    def d(self) -> ca.SX:
        """The data of all tables, one column."""
        return ca.vertcat(*self._data)

    def signal(
        self,
        table: SignalTableName,
        shape: SignalShape,
        coordinates: list[tuple[str, str]],
    ) -> list[Signal]:
        """Expressions of one vector signal; appends its parameters to the vector or its data to d."""
        if shape.kind in ("none", "input"):
            return [constant_zero()] * len(coordinates)
        if shape.kind == "table":
            return self._table(table, shape, [key for key, _ in coordinates])
        one = self._via_points if shape.kind == "polynomial" else self._sines
        return [one(table, key, unit, count) for (key, unit), count in zip(coordinates, shape.terms, strict=True)]

    def base_motion(self, shape: SignalShape, joints: tuple[Joint, ...]) -> list[Signal]:
        """Expressions of the base's coordinates that are there (`moving`), likewise."""
        coordinates = moving(shape.terms)
        if shape.kind == "own":
            motion = MOTIONS[shape.own]
            found = signals_of(motion, self.t, self._vector.table("base_motion", motion.parameters, joints))
            return [found[c.key] for c in coordinates]
        counts = dict(zip((c.key for c in COORDINATES), shape.terms, strict=False))
        there = SignalShape(shape.kind, tuple(counts.get(c.key, 0) for c in coordinates))
        return self.signal("base_motion", there, [(c.key, c.unit) for c in coordinates])

    def _table(self, table: SignalTableName, shape: SignalShape, coordinates: list[str]) -> list[Signal]:
        tau = ca.SX.sym(f"{table}_tau")
        channels = tuple(i for i, count in enumerate(shape.terms) if count)
        start = sum(symbol.numel() for symbol in self._data)
        self.tables += (TableLayout(table, start, channels),)
        blocks = {i: ca.SX.sym(f"{table}_{coordinates[i]}", 4) for i in channels}
        self._data += [tau, *blocks.values()]
        return [formulas.cubic(tau, blocks[i]) if i in blocks else constant_zero() for i in range(len(coordinates))]

    def _via_points(self, table: str, key: str, unit: str, count: int) -> Signal:
        def points(name: str, unit: str, meaning: str) -> list[ca.SX]:
            return [
                self._vector.scalar(
                    f"{table}.{key}.{name}.{k}", f"{table}_{key}_{name}_{k}", unit, 0.0, f"{meaning} {k} of {key}"
                )
                for k in range(count)
            ]

        return formulas.via_points(self.t, points("t", "s", "time of via point"), points("q", unit, "via point"))

    def _sines(self, table: str, key: str, unit: str, count: int) -> Signal:
        offset = ca.SX(0)
        dotted, stem = f"{table}.{key}", f"{table}_{_C_NAMES.get(key, key)}"
        if table != "base_motion":
            offset = self._vector.scalar(
                f"{dotted}.offset", f"{stem}_offset", unit, 0.0, f"offset of the {key} {table}"
            )
            dotted += ".terms"
        terms = [
            (
                self._vector.scalar(
                    f"{dotted}.{k}.amplitude",
                    f"{stem}_{k}_amplitude",
                    unit,
                    0.0,
                    f"amplitude of {key} term {k}",
                ),
                self._vector.scalar(
                    f"{dotted}.{k}.omega",
                    f"{stem}_{k}_omega",
                    "rad/s",
                    0.0,
                    f"angular frequency of {key} term {k}",
                ),
                self._vector.scalar(
                    f"{dotted}.{k}.phase",
                    f"{stem}_{k}_phase",
                    "rad",
                    0.0,
                    f"phase of {key} term {k}",
                ),
            )
            for k in range(count)
        ]
        return formulas.sine_sum(self.t, offset, terms)
