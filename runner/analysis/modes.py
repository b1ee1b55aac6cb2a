"""Time scales: the slow loop, and the springs' fast modes alone, with their control, and in the closed loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from springline.runner.analysis.loop import AMPLITUDE, Boundary, LinearLoop, joined, linear_loop, linearised
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

DAMPING = 0.1
"""Wanted of the fast modes, where nothing else is said."""

_STEPS = 24
_LARGEST_GAIN = 1e3


@dataclass(frozen=True, eq=False, slots=True)
class TimeScales:
    """Slow and fast parts of a loop; arrays are (runs, times, ...). Of a rigid drive there are no fast modes.

    slow_bandwidth  largest |eigenvalue| of the slow subsystem's closed loop (springs without end), 1/s
    fast_free       fast modes of the springs between arm and motors alone, one for each joint, imaginary part >= 0, 1/s
    fast_alone      the same with the fast control, of the fast subsystem (11)
    fast_composite  what they are in the closed loop
    epsilon_ratio   slow bandwidth over the slowest of fast_alone, (runs, times); NaN on a rigid drive
    fast_damping    smallest damping ratio of fast_composite over the times, (runs,); NaN likewise
    """

    slow_bandwidth: Floats
    fast_free: Complex
    fast_alone: Complex
    fast_composite: Complex
    epsilon_ratio: Floats
    fast_damping: Floats


def damping(modes: Complex) -> Floats:
    """Damping ratio -Re / |.| of each mode."""
    found: Floats = -modes.real / np.abs(modes)
    return found


def time_scales(loop: LinearLoop) -> TimeScales:
    """The time scales of a loop."""
    slow = np.abs(np.linalg.eigvals(_slow(loop))).max(axis=-1)
    shape = (*loop.A.shape[:2], loop.n if loop.elastic else 0)
    if not loop.elastic:
        none, missing = np.zeros(shape, complex), np.full(shape[:2], np.nan)
        return TimeScales(slow, none, none, none, missing, missing[:, 0])
    free, alone = _upper(_fast(loop, 0.0), loop.n), _upper(_fast(loop, 1.0), loop.n)
    composite = _composite(loop)
    return TimeScales(
        slow, free, alone, composite, slow / np.abs(alone).min(axis=-1), damping(composite).min(axis=(1, 2))
    )


def _blocks(loop: LinearLoop) -> tuple[Floats, Floats, Floats, Floats]:
    """Of the plant's accelerations: joints' and motors' by q1, dq1, q2, dq2 (n x 4n each); M2^-1; M1."""
    n = loop.n
    joints, motors = loop.A[..., n : 2 * n, :], loop.A[..., 3 * n :, :]
    over_motor = loop.B[..., 3 * n :, :]
    stiffness = -np.linalg.solve(over_motor, motors[..., 2 * n : 3 * n])
    mass = np.linalg.solve(joints[..., 2 * n : 3 * n].swapaxes(-1, -2), stiffness.swapaxes(-1, -2)).swapaxes(-1, -2)
    return joints, motors, over_motor, mass


def _slow(loop: LinearLoop) -> Floats:
    """The closed loop with motors that sit on the joints: states q1, dq1, z."""
    n = loop.n
    if not loop.elastic:
        return joined(loop.A + loop.B @ loop.Cx, loop.B @ loop.Cz, loop.Dx, loop.Dz)
    joints, motors, over_motor, mass = _blocks(loop)
    motor = np.linalg.inv(over_motor)

    def rigid(rows: Floats) -> Floats:
        return rows[..., : 2 * n] + rows[..., 2 * n :]

    total = mass + motor
    by_state = np.linalg.solve(total, mass @ rigid(joints) + motor @ rigid(motors) + rigid(loop.Cx))
    by_memory = np.linalg.solve(total, loop.Cz)
    kinematic = np.zeros((*by_state.shape[:2], n, 2 * n))
    kinematic[..., range(n), range(n, 2 * n)] = 1.0
    a = np.concatenate([kinematic, by_state], axis=-2)
    b = np.concatenate([np.zeros_like(by_memory), by_memory], axis=-2)
    return joined(a, b, rigid(loop.Dx), loop.Dz)


def _fast(loop: LinearLoop, share: float) -> Floats:
    """The springs' deflection q2 - q1 and its rate, with a share of the fast control: what the command has of them."""
    n = loop.n
    joints, motors, over_motor, _ = _blocks(loop)
    bent = (motors - joints + share * over_motor @ loop.Cx)[..., 2 * n :]
    kinematic = np.zeros((*bent.shape[:2], n, 2 * n))
    kinematic[..., range(n), range(n, 2 * n)] = 1.0
    matrix: Floats = np.concatenate([kinematic, bent], axis=-2)
    return matrix


def _upper(matrix: Floats, n: int) -> Complex:
    """One eigenvalue of each pair, (..., n), the slowest first; overdamped ones by the one nearer the axis."""
    values = np.linalg.eigvals(matrix).astype(complex)
    real = np.abs(values.imag) <= 1e-9 * np.abs(values)
    order = np.lexsort((np.abs(values), np.where(real, 0, np.sign(-values.imag))), axis=-1)
    sorted_values = np.take_along_axis(values, order, axis=-1)[..., :n]
    by_size = np.argsort(np.abs(sorted_values), axis=-1)
    found: Complex = np.take_along_axis(sorted_values, by_size, axis=-1)
    return found


def _composite(loop: LinearLoop) -> Complex:
    """Fast modes of the closed loop: those that the fast subsystem's become while the rest of the control is let in."""
    n = loop.n
    a, b, cx, dx = loop.driven()
    fast = np.zeros_like(cx)
    fast[..., 2 * n : 4 * n] = cx[..., 2 * n : 4 * n]
    fast[..., : 2 * n] = -cx[..., 2 * n : 4 * n]
    alone = _upper(_fast(loop, 1.0), n)

    def at(share: float) -> Complex:
        c, d = fast + share * (cx - fast), share * loop.Cz
        found: Complex = np.linalg.eigvals(joined(a + b @ c, b @ d, share * dx, loop.Dz)).astype(complex)
        return found

    modes = alone
    for share in np.linspace(0.0, 1.0, _STEPS + 1):
        values = at(share)
        taken = _assigned(np.abs(values[..., None, :] - modes[..., :, None]))
        modes = np.take_along_axis(values, taken, axis=-1)
    return modes


def _assigned(costs: Floats) -> NDArray[np.intp]:
    """Which column each row takes, no two rows the same one, so that the costs are least, (..., rows)."""
    nearest: NDArray[np.intp] = costs.argmin(axis=-1)
    ordered = np.sort(nearest, axis=-1)
    contested = (ordered[..., 1:] == ordered[..., :-1]).any(axis=-1)
    if contested.any():
        from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - slow to load, and seldom needed

        for place in zip(*np.nonzero(contested), strict=True):
            nearest[place] = linear_sum_assignment(costs[place])[1]
    return nearest


def fast_gain(
    scenario: Scenario,
    amplitude: ArrayLike = AMPLITUDE,
    wanted: float = DAMPING,
    *,
    times: ArrayLike | None = None,
    columns: Mapping[str, ArrayLike] | None = None,
    composite: bool = False,
) -> tuple[Boundary, ...]:
    """Smallest fast control gains K_f with which every fast mode has at least the wanted damping ratio; one a joint.

    composite  in the closed loop, not of the fast subsystem alone
    Each joint's gain is raised or lowered until the damping of its own mode, that of its place in the order of
    sqrt(k (1/m1 + 1/m2)), is as wanted. Of the first run, if there are several.
    """
    system = scenario.system()
    keys = [slot.key for slot in system.slots]
    places = [keys.index(f"control.K_f.{i}") for i in range(system.n)] if "control.K_f.0" in keys else []
    if not places or not linearised(scenario).reads("control.K_f"):
        reason = "a rigid drive has no fast modes" if not places else "the controller has no fast control K_f"
        return (Boundary(None, reason),) * system.n
    run = scenario.values_for(columns)[0] if columns else scenario.values()

    def loop_with(gains: Floats) -> LinearLoop:
        values = run[None, :].copy()
        values[0, places] = gains
        return linear_loop(scenario, amplitude, times=times, values=values)

    first = loop_with(np.zeros(system.n))
    owners = _owners(first)
    free = _upper(_fast(first, 0.0), system.n)
    motor = 1 / np.diagonal(first.B[..., 3 * system.n :, :], axis1=-2, axis2=-1)

    def lowest(gains: Floats) -> Floats:
        loop = loop_with(gains)
        modes = time_scales(loop).fast_composite if composite else _upper(_fast(loop, 1.0), system.n)
        ratios = np.take_along_axis(damping(modes), owners, axis=-1)
        found: Floats = ratios[0].min(axis=0)
        return found

    gains = np.zeros(system.n)
    per_ratio = (2 * np.take_along_axis(np.abs(free), owners, axis=-1) * motor)[0].max(axis=0)
    for _ in range(60):
        step = (wanted - lowest(gains)) * per_ratio
        gains = np.maximum(gains + step, 0.0)
        if np.all(np.abs(step) <= 1e-6 * per_ratio) or np.any(gains > _LARGEST_GAIN * per_ratio):
            break
    reached = lowest(gains) >= wanted - 1e-4
    reason = f"the damping ratio {wanted:g} of the fast modes"
    return tuple(
        Boundary(float(gain) if met else None, reason if met else f"no gain K_f reaches {reason}")
        for gain, met in zip(gains, reached, strict=True)
    )


def _owners(loop: LinearLoop) -> NDArray[np.intp]:
    """Which of the fast modes, the slowest first, is whose, (runs, times, n): by the share of each spring in it."""
    n = loop.n
    values, vectors = np.linalg.eig(_fast(loop, 0.0))
    result = np.empty((*loop.A.shape[:2], n), np.intp)
    for place in np.ndindex(result.shape[:2]):
        upper = np.flatnonzero(values[place].imag >= 0.0)
        order = upper[np.argsort(np.abs(values[place][upper]))][:n]
        shares = np.abs(vectors[place][:n, order])
        weight = np.sqrt(np.abs(1 / loop.B[place][3 * n :, :].diagonal()))
        weighted = shares * weight[:, None]
        result[place] = _assigned(-weighted / weighted.sum(axis=0))
    return result
