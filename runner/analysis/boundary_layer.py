"""The smallest boundary layer delta that a loop is stable with."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from springline.runner.analysis.loop import AMPLITUDE, Boundary, Points, linearised, points_of
from springline.runner.analysis.roots import root
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
    value = root(lambda layer: float(rates(np.array([layer])).max()), layers[last : last + 2], 1e-6)
    worst = int(rates(np.array([value]))[0].argmax())
    return Boundary(value, "unstable below", float(points.times[worst]))
