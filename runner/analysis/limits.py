"""From where on limits act, which a linear loop knows nothing of."""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from springline.model.symbolic import over_runs
from springline.runner.analysis.loop import Boundary, LinearLoop, linear_loop, linearised, signal_values, slots_of
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]

_SMALLEST, _LARGEST = 1e-4, 1e3
_TRIED = 29


def limits_from(scenario: Scenario) -> Boundary:
    """The least |sigma| of a joint, others zero, at which a_max limits the law or U_max a motor, along the reference.

    0 where the reference itself asks a motor for more than it has; None where no limit is met.
    """
    linear = linearised(scenario)
    loop = linear_loop(scenario)
    values = scenario.values()
    most = {name: values[slots_of(scenario, f"control.{name}")] for name in ("a_max", "U_max")}
    if np.any(np.abs(loop.u[0]) > most["U_max"]):
        at = int((np.abs(loop.u[0]) / most["U_max"]).max(axis=1).argmax())
        return Boundary(0.0, "U_max limits what carries the arm along its reference", float(loop.times[at]))
    if not linear.cut or not np.isfinite(np.concatenate(list(most.values()))).any():
        return Boundary(None, "no limit acts" if linear.cut else "the controller has no sliding variable")
    first = ("", np.inf, np.nan)
    for name, function in (("a_max", linear.law), ("U_max", linear.by_sigma)):
        low, high = _SMALLEST, _LARGEST
        for _ in range(3):
            sizes = np.geomspace(low, high, _TRIED)
            met = _beyond(loop, function, most[name], sizes)
            if not met.any():
                break
            k = int(met.any(axis=0).argmax())
            low, high = float(sizes[max(k - 1, 0)]), float(sizes[k])
        if met.any() and high < first[1]:
            first = (name, high, float(loop.times[int(met[:, k].argmax())]))
    if not first[0]:
        return Boundary(None, "no limit acts")
    return Boundary(first[1], f"{first[0]} acts from there on", first[2])


def _beyond(loop: LinearLoop, function: ca.Function, most: Floats, sizes: Floats) -> NDArray[np.bool_]:
    """Whether a Function's first output is beyond `most` at a time for |sigma| of a size, (times, sizes)."""
    n, count = loop.n, len(loop.times)
    both = np.concatenate([sizes, -sizes])
    s = np.kron(np.eye(n), both)
    points = s.shape[1]

    def at_points(stack: Floats) -> Floats:
        return np.repeat(stack[0], points, axis=0).T

    w = signal_values(loop.scenario, loop.values, loop.times)
    given = [at_points(w), at_points(loop.x), at_points(loop.z), np.tile(s, count)]
    given += [np.zeros((1, points * count)), np.tile(loop.values.T, points * count)]
    beyond: NDArray[np.bool_] = np.any(np.abs(over_runs(function, *given)[0][:, :, 0]) > most, axis=1)
    return np.asarray(beyond.reshape(count, n * 2, len(sizes)).any(axis=1), dtype=np.bool_)
