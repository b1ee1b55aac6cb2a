"""The smallest boundary layer delta that a loop is stable with."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from springline.runner.analysis.loop import AMPLITUDE, Boundary, Points, linearised, points_of
from springline.runner.analysis.sampled import rates_of
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]

_LAYERS = (1e-5, 10.0)
_PER_DECADE = 5


def delta_critical(
    scenario: Scenario,
    amplitude: ArrayLike = AMPLITUDE,
    *,
    times: ArrayLike | None = None,
    columns: Mapping[str, ArrayLike] | None = None,
) -> tuple[Boundary, ...]:
    """The boundary layer below which the loop as its scenario has it is unstable at some time, one a run.

    It is the smallest from which on all larger ones, up to 10, are stable: of the continuous loop, or of the sampled
    one with its delay. Arguments as of `linear_loop`.
    """
    if not linearised(scenario).reads("control.delta"):
        name = scenario.document["control"]["controller"]
        return (Boundary(None, f"the controller {name} has no boundary layer delta"),) * _runs(scenario, columns)
    points = points_of(scenario, times=times, columns=columns)
    return tuple(_least_layer(points.of_run(run), amplitude) for run in range(len(points.values)))


def _runs(scenario: Scenario, columns: Mapping[str, ArrayLike] | None) -> int:
    return len(scenario.values_for(columns)) if columns else 1


def _least_layer(points: Points, amplitude: ArrayLike) -> Boundary:
    def rates(layers: Floats) -> Floats:
        return rates_of(points.with_control("control.delta", layers).loop(amplitude))

    low, high = np.log10(_LAYERS)
    layers = np.logspace(low, high, round((high - low) * _PER_DECADE) + 1)
    unstable = rates(layers).max(axis=1) >= 0.0
    if unstable[-1]:
        return Boundary(None, "no boundary layer delta makes the loop stable")
    if not unstable.any():
        return Boundary(None, f"every boundary layer from {_LAYERS[0]:g} on is stable")
    last = int(np.flatnonzero(unstable)[-1])
    value = refined(lambda layer: rates(layer).max(axis=1) < 0.0, layers[last], layers[last + 1])
    worst = int(rates(np.array([value]))[0].argmax())
    return Boundary(value, "unstable below", float(points.times[worst]))


def refined(holds: Callable[[Floats], NDArray[np.bool_]], low: float, high: float) -> float:
    """Where between two positive numbers `holds` changes, to a part in 1e5; it is asked of eight at a time."""
    first = bool(holds(np.array([low]))[0])
    while high - low > 1e-5 * high:
        inner = np.linspace(low, high, 10)[1:-1]
        changed = np.flatnonzero(holds(inner) != first)
        k = int(changed[0]) if changed.size else len(inner)
        points = np.concatenate([[low], inner, [high]])
        low, high = float(points[k]), float(points[k + 1])
    return (low + high) / 2
