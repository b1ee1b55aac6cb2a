"""Parameters: what a number of the model is called, means, and may be.

A `Parameter` is declared beside the equations that use it. A `ParameterVector` turns declarations into the
symbolic column vector p that every Function takes last; each scalar entry of p is a `Slot`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from springline.model import lazy_casadi as ca


@dataclass(frozen=True, slots=True)
class Bounds:
    """The interval a value must lie in; `even` asks for a positive even integer besides."""

    low: float = -math.inf
    high: float = math.inf
    low_open: bool = False
    high_open: bool = False
    even: bool = False
    infinite: bool = False

    def holds(self, value: float) -> bool:
        """Whether `value` is admissible; NaN never is, an infinite value only where `infinite` says so."""
        if math.isnan(value) or (math.isinf(value) and not self.infinite):
            return False
        if value < self.low or (self.low_open and value == self.low):
            return False
        if value > self.high or (self.high_open and value == self.high):
            return False
        return not self.even or (value == int(value) and int(value) % 2 == 0)

    def __str__(self) -> str:
        if self.even:
            return "a positive even integer"
        if self.low == -math.inf and self.high == math.inf:
            return "a finite number"
        if self.high == math.inf:
            text = f"a number {'>' if self.low_open else '>='} {self.low:g}"
            return text + (" (inf means no limit)" if self.infinite else "")
        left, right = "([" if self.low_open else "[[", ")]" if self.high_open else "]]"
        return f"a number in {left[0]}{self.low:g}, {self.high:g}{right[0]}"


REAL = Bounds()
POSITIVE = Bounds(low=0.0, low_open=True)
NON_NEGATIVE = Bounds(low=0.0)
UNIT_OPEN = Bounds(low=0.0, high=1.0, low_open=True, high_open=True)
LIMIT = Bounds(low=0.0, low_open=True, infinite=True)
EVEN = Bounds(low=2.0, even=True)


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint of a mechanism: its name and the SI units of its coordinate and of its generalised force."""

    name: str
    unit: str
    force: str


@dataclass(frozen=True, slots=True)
class Parameter:
    """A named number of the model.

    name       key in its TOML table and in the code
    unit       SI unit; "{q}" and "{F}" stand for the joint's coordinate and force unit
    default    a number; where there is an entry per joint, also one for each
    meaning    one sentence without a full stop
    bounds     what values are admissible
    per_joint  whether there is an entry per joint
    Raises ValueError for several defaults of a parameter that has one entry.
    """

    name: str
    unit: str
    default: float | tuple[float, ...]
    meaning: str
    bounds: Bounds = REAL
    per_joint: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.default, tuple) and not self.per_joint:
            raise ValueError(f"parameter {self.name} has {len(self.default)} defaults: say per_joint=True")

    def defaults(self, joints: Sequence[Joint]) -> tuple[float, ...]:
        """One default per entry: a number stands for every joint.

        Raises ValueError if there are as many as neither one nor the joints.
        """
        if not isinstance(self.default, tuple):
            return (self.default,) * (len(joints) if self.per_joint else 1)
        if len(self.default) != len(joints):
            names = ", ".join(joint.name for joint in joints)
            raise ValueError(
                f"parameter {self.name} has {len(self.default)} defaults, expected one per joint ({names})"
            )
        return self.default

    def unit_of(self, joint: Joint) -> str:
        """Unit of a joint's entry."""
        return self.unit.format(q=joint.unit, F=joint.force)


@dataclass(frozen=True, slots=True)
class Slot:
    """One scalar entry of the parameter vector p.

    key     dotted name, as in a scenario file: "control.mu.0"
    symbol  identifier for symbols and C: "control_mu_lift"
    """

    key: str
    symbol: str
    unit: str
    default: float
    meaning: str
    bounds: Bounds


class Values(Mapping[str, "ca.SX"]):
    """Symbols of one table of parameters, by name or as attributes: scalars, or n x 1 columns (per joint)."""

    def __init__(self, symbols: Mapping[str, ca.SX]) -> None:
        self._symbols = dict(symbols)

    def __getitem__(self, name: str) -> ca.SX:
        return self._symbols[name]

    def __getattr__(self, name: str) -> ca.SX:
        if name.startswith("_") or name not in self._symbols:
            raise AttributeError(f"there is no {name!r} here, but {', '.join(self._symbols) or 'nothing'}")
        return self._symbols[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._symbols)

    def __len__(self) -> int:
        return len(self._symbols)

    def __or__(self, other: Values) -> Values:
        return Values({**self._symbols, **other._symbols})


class ParameterVector:
    """The vector p while it is being declared: symbols (`sx`) and their meaning (`slots`), in one order."""

    def __init__(self) -> None:
        self.slots: list[Slot] = []
        self._symbols: list[ca.SX] = []

    @property
    def sx(self) -> ca.SX:
        """All symbols as a column, one per slot."""
        return ca.vertcat(*self._symbols)

    def scalar(self, key: str, symbol: str, unit: str, default: float, meaning: str, bounds: Bounds = REAL) -> ca.SX:
        """Append one entry and return its symbol."""
        self.slots.append(Slot(key, symbol, unit, float(default), meaning, bounds))
        self._symbols.append(ca.SX.sym(symbol))
        return self._symbols[-1]

    def table(self, table: str, parameters: Iterable[Parameter], joints: tuple[Joint, ...]) -> Values:
        """Append every parameter of one TOML table and return its symbols by name."""
        symbols: dict[str, ca.SX] = {}
        for item in parameters:
            stem = f"{table.replace('.', '_')}_{item.name}"
            defaults = item.defaults(joints)
            if item.per_joint:
                entries = [
                    self.scalar(
                        f"{table}.{item.name}.{i}",
                        f"{stem}_{joint.name}",
                        item.unit_of(joint),
                        default,
                        f"{item.meaning} ({joint.name})",
                        item.bounds,
                    )
                    for i, (joint, default) in enumerate(zip(joints, defaults, strict=True))
                ]
                symbols[item.name] = ca.vertcat(*entries)
            else:
                unit = " or ".join(dict.fromkeys(item.unit_of(joint) for joint in joints))
                symbols[item.name] = self.scalar(
                    f"{table}.{item.name}", stem, unit, defaults[0], item.meaning, item.bounds
                )
        return Values(symbols)
