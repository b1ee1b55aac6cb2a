"""The continuous loop at frozen times: its spectrum, and the smallest boundary layer that it is stable with."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from springline.runner.analysis.loop import AMPLITUDE, Boundary, LinearLoop, linear_loop, linearised
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

_LAYERS = (1e-5, 10.0)
_PER_DECADE = 5


def spectrum(loop: LinearLoop) -> Complex:
    """Eigenvalues of the continuous closed loop, (runs, times, states), 1/s, in no order."""
    found: Complex = np.linalg.eigvals(loop.closed()).astype(complex)
    return found


def growth(loop: LinearLoop) -> Floats:
    """Largest real part of the continuous closed loop's eigenvalues over the times, (runs,), 1/s: unstable above 0."""
    largest: Floats = spectrum(loop).real.max(axis=(1, 2))
    return largest


def delta_critical(
    scenario: Scenario,
    amplitude: ArrayLike = AMPLITUDE,
    *,
    times: ArrayLike | None = None,
    columns: Mapping[str, ArrayLike] | None = None,
) -> tuple[Boundary, ...]:
    """The boundary layer below which the continuous loop is unstable at some time, one a run.

    It is the smallest from which on all larger ones, up to 10, are stable. Arguments as of `linear_loop`.
    """
    if not linearised(scenario).reads("control.delta"):
        name = scenario.document["control"]["controller"]
        return (Boundary(None, f"the controller {name} has no boundary layer delta"),) * _runs(scenario, columns)
    values = scenario.values_for(columns) if columns else scenario.values()[None, :]
    place = [slot.key for slot in scenario.system().slots].index("control.delta")
    return tuple(_least_layer(scenario, amplitude, times, run, place) for run in values)


def _runs(scenario: Scenario, columns: Mapping[str, ArrayLike] | None) -> int:
    return len(scenario.values_for(columns)) if columns else 1


def _least_layer(
    scenario: Scenario, amplitude: ArrayLike, times: ArrayLike | None, run: Floats, place: int
) -> Boundary:
    def loops(layers: Floats) -> LinearLoop:
        values = np.tile(run, (len(layers), 1))
        values[:, place] = layers
        return linear_loop(scenario, amplitude, times=times, values=values)

    low, high = np.log10(_LAYERS)
    layers = np.logspace(low, high, round((high - low) * _PER_DECADE) + 1)
    unstable = growth(loops(layers)) >= 0.0
    if unstable[-1]:
        return Boundary(None, "no boundary layer delta makes the loop stable")
    if not unstable.any():
        return Boundary(None, f"every boundary layer from {_LAYERS[0]:g} on is stable")
    last = int(np.flatnonzero(unstable)[-1])
    value = refined(lambda layer: growth(loops(layer)) < 0.0, layers[last], layers[last + 1])
    at = loops(np.array([value]))
    worst = int(spectrum(at).real.max(axis=2)[0].argmax())
    return Boundary(value, "unstable below", float(at.times[worst]))


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
