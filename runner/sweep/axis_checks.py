"""Whether the axes of a sweep suit the keys that they move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from springline.codegen.numbers import double
from springline.model.parameters import Bounds
from springline.runner.files import InputError, Problem, unknown
from springline.runner.scenario import NumericKey, Scenario, excluded_bands, given_text, number_text
from springline.runner.sweep.drawing import Drawing, spread
from springline.runner.sweep.sweep import Axis, Sweep

_DEVIATIONS = 8.3  # the farthest that sampling.normal reaches
_SCAN = 65536


@dataclass(frozen=True, eq=False)
class AxisChecks:
    """The axes of a sweep beside the numeric keys of its scenario."""

    sweep: Sweep
    numeric: Mapping[str, NumericKey]
    drawing: Drawing

    def expect_sound(self) -> None:
        """Raises InputError for axes that do not suit their keys."""
        by_key = {axis.key: axis for axis in self.sweep.axes}
        problems: list[Problem] = []
        for axis in self.sweep.axes:
            source = by_key.get(axis.tie, axis)
            if axis.key in self.numeric:
                problems += self._number_problems(axis, source, self.numeric[axis.key])
            else:
                problems += self._structural_problems(axis, source)
        problems += excluded_bands(by_key, self.sweep.source, "vary.")
        if problems:
            raise InputError(*problems)

    def _number_problems(self, axis: Axis, source: Axis, key: NumericKey) -> list[Problem]:
        label = f"vary.{axis.key}"
        expected = f"expected {number_text(key.bounds, key.unit)}"
        values = axis.values or (source.values if axis.kind == "tie" else ())
        try:
            reach = tuple(map(double, values)) or source.span
        except (TypeError, ValueError) as error:
            return [Problem(self.sweep.source, label, f"{expected} ({error})", given_text(list(values)))]
        if source.kind == "normal" and not values:
            mean, deviation = source.span
            reach = (mean - _DEVIATIONS * deviation, mean + _DEVIATIONS * deviation)
        factor = 1.0 if axis.values else axis.factor
        bad = [factor * value for value in reach if not key.bounds.holds(factor * value)]
        if key.bounds.even and not values:
            return [Problem(self.sweep.source, label, f"{expected}: use {{ values = [...] }}")]
        if not bad:
            return []
        if source.kind != "normal" or values:
            return [Problem(self.sweep.source, label, expected, given_text(float(bad[0])))]
        return self._normal_problems(axis, source, key.bounds, expected)

    def _normal_problems(self, axis: Axis, source: Axis, bounds: Bounds, expected: str) -> list[Problem]:
        """A normal axis can reach beyond the bounds: whether it does, only its numbers tell."""
        for row in range(0, self.sweep.samples, _SCAN):
            count = min(_SCAN, self.sweep.samples - row)
            units = dict(
                zip((item.key for item in self.drawing.axes), self.drawing.unit_columns(row, count), strict=True)
            )
            numbers = axis.factor * spread(source, units[source.key])
            bad = [int(i) for i in (numbers.argmin(), numbers.argmax()) if not bounds.holds(float(numbers[i]))]
            if bad:
                text = f"{expected}, but row {row + bad[0]} of the sample is not (a smaller deviation, or uniform?)"
                return [Problem(self.sweep.source, f"vary.{axis.key}", text, given_text(float(numbers[bad[0]])))]
        return []

    def _structural_problems(self, axis: Axis, source: Axis) -> list[Problem]:
        label = f"vary.{axis.key}"
        if axis.kind == "tie" and not axis.values and not (source.values and axis.factor == 1.0):
            text = "no number that runs of one kernel may differ in: expected values = [...] beside the tie"
            return [Problem(self.sweep.source, label, text)]
        if axis.kind != "tie" and not axis.values:
            numeric = self.sweep.scenario.numeric_keys()
            known = {**numeric, **self.numeric, **dict.fromkeys(_document_keys(self.sweep.scenario))}
            if axis.key not in known:
                return [unknown(self.sweep.source, label, "key", axis.key, known)]
            if axis.key in numeric:
                text = "is out of the equations where it is 0: expected { values = [...] }, or a range without 0"
                return [Problem(self.sweep.source, label, text, given_text(axis.as_toml()))]
            text = "no number that runs of one kernel may differ in: expected { values = [...] } or { each = [...] }"
            return [Problem(self.sweep.source, label, text, given_text(axis.as_toml()))]
        return []


def _document_keys(scenario: Scenario) -> list[str]:
    return [f"{table}.{key}" for table, entries in scenario.document.items() for key in entries]
