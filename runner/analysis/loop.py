"""The loop of a scenario, linearised at frozen times along its reference (docs/analysis.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from springline.model import Linearisation, Structure, linearisation_of
from springline.model.symbolic import derivation, over_runs
from springline.runner.analysis.gain import quadrature
from springline.runner.scenario import Scenario, kernel_tables

Floats = NDArray[np.float64]

AMPLITUDE = 0.1
"""Of sigma, where nothing else is said."""

_TIMES = 17
_STILL = 1e3
# 1/s: the rate at which the force of a lag that other runs have goes to zero; nothing drives it, and it drives nothing.


@dataclass(frozen=True, slots=True)
class Boundary:
    """A number beyond which something changes.

    value   None where there is no such number, or none that is finite
    reason  why there is none, or what the number is the boundary of, for people
    at      time along the reference where the boundary is nearest, s; None where there is none
    """

    value: float | None
    reason: str
    at: float | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Points:
    """Where loops of any amplitude are linearised, and the plant there; all arrays are (runs, times, ...), SI units.

    times      s;  values: parameter vectors, (runs, slots)
    x, u, z    operating points: on the reference, with the motors and the forces that carry it
    A, B       of the plant: dx = A x + B u
    """

    scenario: Scenario
    times: Floats
    values: Floats
    x: Floats
    u: Floats
    z: Floats
    A: Floats
    B: Floats

    def loop(self, amplitude: ArrayLike) -> LinearLoop:
        """The loop there; amplitude: one number, one a joint, or (runs, joints)."""
        sizes = np.asarray(amplitude, float)
        sizes = np.broadcast_to(sizes, np.broadcast_shapes(sizes.shape, self.u.shape[-1:]))
        control = _control(self, sizes, 0.0)
        lags = slots_of(self.scenario, "actuator.lag")
        lag = self.values[:, lags] if lags else np.zeros((len(self.values), self.u.shape[-1]))
        reach = control["u_s"]
        return LinearLoop(
            self.scenario, self.times, self.values, self.x, self.u, self.z, self.A, self.B, sizes,
            control["u_x"], control["u_z"], control["dz_x"], control["dz_z"], control["sigma_x"], control["sigma_z"],
            reach, _law_gain(self.scenario, self.values, self.x, reach), lag,
        )  # fmt: skip

    def with_control(self, key: str, numbers: Floats) -> Points:
        """Of one run, as many as there are numbers: each for a parameter of the control."""
        place = [slot.key for slot in linearised(self.scenario).system.slots].index(key)
        values = np.repeat(self.values, len(numbers), axis=0)
        values[:, place] = numbers
        x, u, a, b = (np.repeat(item, len(numbers), axis=0) for item in (self.x, self.u, self.A, self.B))
        z = _states_of_control(self.scenario, values, self.times, x, u)
        return Points(self.scenario, self.times, values, x, u, z, a, b)

    def repeated(self, runs: int) -> Points:
        """Of one run, as many alike."""
        values, x, u, z, a, b = (np.repeat(item, runs, axis=0) for item in self._arrays)
        return Points(self.scenario, self.times, values, x, u, z, a, b)

    def at_time(self, place: int) -> Points:
        """At one of the times."""
        x, u, z, a, b = (item[:, place : place + 1] for item in self._arrays[1:])
        return Points(self.scenario, self.times[place : place + 1], self.values, x, u, z, a, b)

    def of_run(self, run: int) -> Points:
        """One of the runs."""
        values, x, u, z, a, b = (item[run : run + 1] for item in self._arrays)
        return Points(self.scenario, self.times, values, x, u, z, a, b)

    @property
    def _arrays(self) -> tuple[Floats, ...]:
        return self.values, self.x, self.u, self.z, self.A, self.B


@dataclass(frozen=True, eq=False, slots=True)
class LinearLoop(Points):
    """Points with the control there; its arrays are (runs, times, ...) too.

    amplitude  of sigma, (n,) or (runs, n), for which the gains hold
    Cx, Cz     of the control: u = Cx x + Cz z, a law by its equivalent gain
    Dx, Dz     of its states where it is continuous: dz = Dx x + Dz z
    Sx, Sz     of the sliding variable: sigma = Sx x + Sz z; zero without one
    N          equivalent gain of u by sigma, (..., n, n); zero without a sliding variable
    law_gain   of the joints' accelerations by sigma, (..., n, n): on the diagonal the reaching law's slope, 1/s, less
               than zero
    lag        time constants of the motors' forces, (runs, n), s
    """

    amplitude: Floats
    Cx: Floats
    Cz: Floats
    Dx: Floats
    Dz: Floats
    Sx: Floats
    Sz: Floats
    N: Floats
    law_gain: Floats
    lag: Floats

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.B.shape[-1])

    @property
    def elastic(self) -> bool:
        """Whether there are springs between motors and joints."""
        return bool(self.A.shape[-1] == 4 * self.n)

    def driven(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Plant with the lags of its motors as states behind its own: A, B, and Cx for its states; and Dx."""
        late = np.flatnonzero((self.lag > 0.0).any(axis=0))
        if not late.size:
            return self.A, self.B, self.Cx, self.Dx
        nx, more = self.A.shape[-1], late.size
        slow = self.lag[:, late] > 0.0
        rate = np.where(slow, 1 / np.where(slow, self.lag[:, late], 1.0), 0.0)
        states, motors = range(nx, nx + more), late.tolist()
        a = np.zeros((*self.A.shape[:2], nx + more, nx + more))
        b = np.zeros((*self.A.shape[:2], nx + more, self.n))
        a[..., :nx, :nx] = self.A
        a[..., :nx, nx:] = self.B[..., late] * slow[:, None, None, :]
        a[..., states, states] = -np.where(slow, rate, _STILL)[:, None, :]
        b[..., :nx, :] = self.B
        b[..., :nx, late] *= ~slow[:, None, None, :]
        b[..., states, motors] = rate[:, None, :]
        return a, b, _padded(self.Cx, more), _padded(self.Dx, more)

    def closed(self) -> Floats:
        """The continuous closed loop, (runs, times, m, m): states x, those of lags, z."""
        a, b, cx, dx = self.driven()
        return joined(a + b @ cx, b @ self.Cz, dx, self.Dz)

    def held(self, period: float) -> tuple[Floats, Floats, Floats, Floats]:
        """Cx, Cz, Ex, Ez of the control with samples of `period` s: u = Cx x + Cz z, and z' = Ex x + Ez z at the next.

        Of rates that are made of differences, z has what they are made of behind the controller's own states.
        """
        if not linearised(self.scenario).held and (not self.z.shape[-1] or linearised(self.scenario).euler):
            return self.Cx, self.Cz, period * self.Dx, np.eye(self.z.shape[-1]) + period * self.Dz
        found = _control(self, self.amplitude, period)
        return found["u_x"], found["u_z"], found["ahead_x"], found["ahead_z"]


def _padded(rows: Floats, n: int) -> Floats:
    return np.concatenate([rows, np.zeros((*rows.shape[:-1], n))], axis=-1)


def joined(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """[[a, b], [c, d]] of stacks of matrices."""
    result: Floats = np.concatenate([np.concatenate([a, b], axis=-1), np.concatenate([c, d], axis=-1)], axis=-2)
    return result


def linear_loop(
    scenario: Scenario,
    amplitude: ArrayLike = AMPLITUDE,
    *,
    times: ArrayLike | None = None,
    columns: Mapping[str, ArrayLike] | None = None,
    values: Floats | None = None,
) -> LinearLoop:
    """The loop of a scenario linearised along its reference.

    amplitude  of sigma, for which the law's gain is taken, one number or one a joint, SI units
    times      along the reference, s; 17 over the run where they are not given
    columns    numbers that are other for each run, by numeric key; one run without
    values     parameter vectors (runs, slots) in place of columns
    Limits U_max, noise, resolution and rate limits are not part of it: they are inactive in the small (`limits_from`).
    Rates that are made of differences have a linear loop where they are sampled (`LinearLoop.held`); all else is of
    rates as they are. Raises InputError for columns that a scenario refuses, ValueError for a controller that cannot be
    cut at its sigma.
    """
    return points_of(scenario, times=times, columns=columns, values=values).loop(amplitude)


def points_of(
    scenario: Scenario,
    *,
    times: ArrayLike | None = None,
    columns: Mapping[str, ArrayLike] | None = None,
    values: Floats | None = None,
) -> Points:
    """Where `linear_loop` linearises; arguments and what it raises as there."""
    if values is None:
        values = scenario.values_for(columns) if columns else scenario.values()[None, :]
    at = np.atleast_1d(np.asarray(np.linspace(0.0, _duration(scenario), _TIMES) if times is None else times, float))
    values = unlimited(scenario, values)
    x, u, plant = _operating_points(scenario, values, at)
    z = _states_of_control(scenario, values, at, x, u)
    return Points(scenario, at, values, x, u, z, plant["A"], plant["B"])


def _law_gain(scenario: Scenario, values: Floats, x: Floats, reach: Floats) -> Floats:
    """H^-1 N with the H that the controller believes in, less than zero where the law opposes sigma."""
    gain: Floats = np.linalg.solve(_believed_mass(scenario, values, x), -reach).astype(np.float64)
    return gain


def _believed_mass(scenario: Scenario, values: Floats, x: Floats) -> Floats:
    system = linearised(scenario).system
    place = {slot.key: k for k, slot in enumerate(system.slots)}
    nominal = values.copy()
    for key, k in place.items():
        table, _, name = key.partition(".")
        source = next((place[f"{t}.{name}"] for t in ("mechanism", "drive") if f"{t}.{name}" in place), None)
        if table == "plant" and source is not None:
            nominal[:, k] = values[:, source]
    runs, times = x.shape[:2]
    (mass,) = over_runs(system.function("slow_mass"), _flat(x[..., : system.n]), _repeated(nominal, times))
    return mass.reshape(runs, times, system.n, system.n)


def _duration(scenario: Scenario) -> float:
    return scenario.step * scenario.steps


@lru_cache(maxsize=16)
def linearised(scenario: Scenario) -> Linearisation:
    """The scenario's loop, linearised symbolically."""
    return linearisation_of(scenario.structure())


def slots_of(scenario: Scenario, key: str) -> list[int]:
    """Places in p of a parameter with one entry per joint."""
    return [k for k, slot in enumerate(linearised(scenario).system.slots) if slot.key.rpartition(".")[0] == key]


def unlimited(scenario: Scenario, values: Floats) -> Floats:
    """Parameter vectors without the limits of the motors."""
    free = values.copy()
    free[:, slots_of(scenario, "control.U_max")] = np.inf
    return free


def _flat(stack: Floats) -> Floats:
    """(runs, times, entries) as columns of a Function's inputs."""
    return np.ascontiguousarray(stack.reshape(stack.shape[0] * stack.shape[1], stack.shape[2]).T)


def _repeated(values: Floats, times: int) -> Floats:
    return np.repeat(values, times, axis=0).T


def signal_values(scenario: Scenario, values: Floats, times: Floats) -> Floats:
    """w at each of the times for each run, (runs, times, entries)."""
    rows = np.tile(_table_rows(scenario, times), (len(values), 1)).T
    function, at = linearised(scenario).system.function("signals"), np.tile(times, len(values))[None, :]
    (found,) = over_runs(function, at, rows, _repeated(values, len(times)))
    return found[:, :, 0].reshape(len(values), len(times), -1)


def _table_rows(scenario: Scenario, times: Floats) -> Floats:
    """d at each of the times: seconds since the sample before, and the coefficients from there on, of all tables."""
    columns = [np.zeros((len(times), 0))]
    for table in kernel_tables(scenario.tables()):
        places = (times - table.t0) / table.dt
        count = len(table.coefficients)
        k = np.floor(places).astype(np.int64)
        tau = (places - k) * table.dt
        if table.periodic:
            k = k % count
        else:
            tau = np.where(k < 0, 0.0, np.where(k >= count, table.dt, tau))
            k = np.clip(k, 0, count - 1)
        columns += [tau[:, None], table.coefficients[k].reshape(len(times), -1)]
    return np.concatenate(columns, axis=1)


def _operating_points(scenario: Scenario, values: Floats, times: Floats) -> tuple[Floats, Floats, dict[str, Floats]]:
    """x and u that keep the arm on its reference, and the plant's matrices there."""
    n, runs, count = linearised(scenario).system.n, len(values), len(times)
    function = linearised(scenario).plant
    w = signal_values(scenario, values, times)
    q, dq, ddq = (w[..., k * n : (k + 1) * n] for k in range(3))
    elastic = linearised(scenario).system.structure.drive == "elastic"
    x = np.concatenate([q, dq, q, dq] if elastic else [q, dq], axis=-1)
    u = np.zeros((runs, count, n))

    def plant() -> dict[str, Floats]:
        found = over_runs(function, _flat(w), _flat(x), _flat(u), _repeated(values, count))
        return dict(zip(("dx", "A", "B"), (item.reshape(runs, count, *item.shape[1:]) for item in found), strict=True))

    # Springs and motors enter linearly: one step of Newton's method finds what carries the joints, a second rounds off.
    rates = list(range(n, 2 * n)) + [k for k in range(3 * n, 4 * n) if elastic]
    springs = list(range(2 * n, 3 * n)) if elastic else []
    wanted = np.concatenate([ddq, ddq] if elastic else [ddq], axis=-1)
    found = plant()
    for _ in range(2):
        left = wanted - found["dx"][..., rates, 0]
        matrix = np.concatenate([found["A"][..., rates, :][..., springs], found["B"][..., rates, :]], axis=-1)
        step = np.linalg.solve(matrix, left[..., None])[..., 0]
        x[..., springs] += step[..., : len(springs)]
        u += step[..., len(springs) :]
        found = plant()
    return x, u, found


def _states_of_control(scenario: Scenario, values: Floats, times: Floats, x: Floats, u: Floats) -> Floats:
    """z with which the controller commands what carries the arm, as near to its start as may be; else its start."""
    start = np.array(linearised(scenario).system.z_start)[: linearised(scenario).own_states]
    z = np.tile(start, (*x.shape[:2], 1))
    for _ in range(3 if start.size else 0):
        found = _control(Points(scenario, times, values, x, u, z, x, u), None, 0.0)
        left = u - found["u"][..., 0]
        z = z + (np.linalg.pinv(found["u_z"]) @ left[..., None])[..., 0]
    return np.where(np.isfinite(z), z, start)


@derivation
@lru_cache(maxsize=64)
def _swept(structure: Structure, held: bool) -> ca.Function:
    """Equivalent gains of u, dz, ahead by each entry of sigma at amplitudes s, by the arguments of `by_sigma`."""
    linear = linearisation_of(structure)
    function = linear.held_by_sigma if held else linear.by_sigma
    given = [ca.SX.sym(function.name_in(i), *function.size_in(i)) for i in range(function.n_in())]
    s = given.pop(3)
    outputs = function(*given[:3], s, *given[3:])
    # What does not depend on s is computed once, not at every node.
    written, symbols, known = ca.extract_parametric(ca.vertcat(*outputs), ca.vertcat(*given))
    once = ca.vertcat(*symbols, *given)
    node = ca.Function("node", [s, once], [written])
    amplitudes, at = ca.SX.sym("amplitude", s.numel()), ca.vertcat(*known, *given)
    gains = []
    for j in range(s.numel()):
        total = ca.SX(0)
        for sine, weight in zip(*quadrature(), strict=True):
            place = ca.SX(s.numel(), 1)
            place[j] = amplitudes[j] * float(sine)
            total = total + float(weight) * node(place, at)
        gains.append(total / amplitudes[j])
    ends = np.cumsum([0, *(output.numel() for output in outputs)]).tolist()
    parts = ca.vertsplit(ca.densify(ca.horzcat(*gains)), ends)
    return ca.Function("swept", [*given[:3], amplitudes, *given[3:]], parts)


def _control(points: Points, amplitude: Floats | None, period: float) -> dict[str, Floats]:
    """What the control is at operating points, by name, each (runs, times, rows, columns).

    Derivatives u_x, ... have the law's part in them; u_s, dz_s, ahead_s are its equivalent gains by sigma. Without an
    amplitude they are zero. With a period, rates are made of differences where the scenario's are.
    """
    scenario, x = points.scenario, points.x
    linear = linearised(scenario)
    held = linear.held if period > 0.0 else None
    function = held or linear.control
    runs, count, n = len(points.values), len(points.times), linearised(scenario).system.n
    w = signal_values(scenario, points.values, points.times)
    number = runs * count
    p = _repeated(points.values, count)
    z = _remembered(points, period)
    before, after = (_flat(w), _flat(x), _flat(z)), (np.full((1, number), period), p)
    rest = np.zeros((n if linear.cut else 0, number))
    names = [function.name_out(k) for k in range(function.n_out())]

    def apart(results: list[Floats]) -> list[Floats]:
        return [item.reshape(runs, count, *item.shape[1:]) for item in results]

    found = dict(zip(names, apart(over_runs(function, *before, rest, *after)), strict=True))
    if amplitude is None or not linear.cut:
        gains = [np.zeros((runs, count, found[name].shape[-2], n)) for name in ("u", "dz", "ahead")]
    else:
        sizes = _repeated(np.broadcast_to(amplitude, (runs, n)), count)
        gains = apart(over_runs(_swept(linear.system.structure, held is not None), *before, sizes, *after))
    for name, gain in zip(("u", "dz", "ahead"), gains, strict=True):
        found[f"{name}_s"] = gain
        for by in ("x", "z") if linear.cut else ():
            found[f"{name}_{by}"] = found[f"{name}_{by}"] + gain @ found[f"sigma_{by}"]
    return found


def _remembered(points: Points, period: float) -> Floats:
    """z whole: behind the controller's own states, each position a sample before, and the rate that it made of them."""
    more = linearised(points.scenario).system.z.numel() - points.z.shape[-1]
    if not more:
        return points.z
    n = points.u.shape[-1]
    blocks = np.split(points.x, points.x.shape[-1] // n, axis=-1)
    pairs = zip(blocks[::2], blocks[1::2], strict=True)
    past = [item for q, dq in pairs for item in (q - period * dq, dq)]
    whole: Floats = np.concatenate([points.z, *past, np.ones((*points.z.shape[:2], 1))], axis=-1)
    return whole
