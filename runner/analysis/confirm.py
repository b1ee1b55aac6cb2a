"""Boundaries found again by runs: does a small disturbance of the loop grow, or does it die out?

A run is held at one point of the reference, with the base at rest and motors that give what they are asked for. It
starts with the springs' oscillations as they are at the boundary, at the amplitude that this was computed for. What
grows is told from the size of the joints' rates in the middle of the run and at its end. Candidates are simulated
together, and the boundary lies between two of them that differ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from springline.codegen.kernel import ONE_RUN, KernelSpec, LoopSettings, kernel
from springline.model.hardware import LONGEST_DELAY
from springline.model.structure import Structure
from springline.runner.analysis.loop import LinearLoop, points_of
from springline.runner.analysis.sampled import OpenLoop, cut, delay_of, period_of, sampled
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]

CANDIDATES = 12
"""Runs a round."""

_RESOLUTION = 0.01
_SPREAD = 1.35  # of the first candidates about what is expected, either way
_WIDENED = 3
_FEWEST_PERIODS, _PERIODS = 20.0, 150.0  # of the critical oscillation, in a run
_DECAYS = 8.0  # times over that all else dies out meanwhile
_STEPS = 45.0  # a radian of the fastest oscillation takes so many steps / (2 pi) at least
_SHARES = ((0.35, 0.5), (0.85, 1.0))
_FINE = 100  # steps of a delay, and of a period beside one
_COARSE = 30  # samples of a delay, where oscillations at a continuous loop's boundary are told
_SAMPLE_STEPS = 20  # of a period by itself
_NOTHING = 1e-6  # of the amplitude: what falls below has died out, and goes on in rounding
_ROUGH = (
    ("sensor", "position_noise", 0.0),
    ("sensor", "velocity_noise", 0.0),
    ("sensor", "position_resolution", 0.0),
    ("actuator", "rate_limit", float("inf")),
)  # effects that are nothing in the small, or drown it, and without which there are none


@dataclass(frozen=True, slots=True)
class Held:
    """What a run came to: times, rates and sigma of the joints (a row each), and whether it went to the end."""

    t: Floats
    rates: Floats
    sigma: Floats
    complete: bool

    def grows(self, amplitude: float) -> bool:
        """Whether the rates' oscillation of any joint is larger at the end than in the middle, both above rounding."""
        if not self.complete:
            return True
        middle, late = (_sizes(self.t, self.rates, share) for share in _SHARES)
        return bool(np.any((late > middle) & (late > _NOTHING * amplitude)))

    def oscillation(self) -> tuple[Floats, float]:
        """Amplitude of sigma per joint at the end of the run, and the frequency of the largest, rad/s."""
        rows = self.t >= self.t[0] + 0.75 * (self.t[-1] - self.t[0])
        t, sigma = self.t[rows], self.sigma[rows]
        swing = (np.max(sigma, axis=0) - np.min(sigma, axis=0)) / 2
        one = sigma[:, int(np.argmax(swing))]
        one = one - np.mean(one)
        up = np.flatnonzero((one[:-1] < 0) & (one[1:] >= 0))
        if len(up) < 3:
            return swing, float("nan")
        at = t[up] - one[up] * (t[up + 1] - t[up]) / (one[up + 1] - one[up])
        return swing, float(2 * np.pi * (len(at) - 1) / (at[-1] - at[0]))


def _sizes(t: Floats, values: Floats, share: tuple[float, float]) -> Floats:
    """Root mean square over a share of the run, less the mean, per column."""
    span = t[-1] - t[0]
    rows = (t >= t[0] + share[0] * span) & (t <= t[0] + share[1] * span)
    sizes: Floats = np.std(values[rows], axis=0)
    return sizes


@dataclass(frozen=True)
class Bench:
    """A scenario held at a point, and how to run it with other numbers.

    scenario   whose loop it is;  q: the point, n;  amplitude: of the joints' rates at the start
    duration   of a run, s;  fastest: of the oscillations, rad/s
    modes      eigenvectors of the plant's state, one an oscillation: nx x modes
    """

    scenario: Scenario
    q: Floats
    amplitude: float
    duration: float
    fastest: float
    modes: NDArray[np.complex128]

    @cached_property
    def held(self) -> Scenario:
        """The scenario with a reference that stands still, the base at rest, and motors whose start is given."""
        given, joints = self.scenario, self.scenario.system().joints
        changes: dict[str, object] = {}
        kept = given.document["reference"]["kind"] == "sine"
        for joint, value in zip(joints, self.q, strict=True):
            terms = given.document["reference"][joint.name]["terms"] if kept else []
            still = [{**term, "amplitude": 0.0} for term in terms]
            changes[f"reference.{joint.name}"] = {"offset": float(value), "terms": still}
        if not kept:
            changes["reference.kind"] = "sine"
        changes["base_motion.kind"] = "none"
        changes["disturbance.kind"] = "none"
        if "limits" in given.document["mechanism"]:
            changes["mechanism.limits"] = [[-float("inf"), float("inf")]] * len(joints)
        changes["control.U_max"] = [float("inf")] * len(joints)
        silent = given.with_overrides(changes)
        for table, name, quiet in _ROUGH:
            if name in given.document[table]:
                silent = silent.with_overrides({f"{table}.{name}": [quiet] * len(joints)})
        return silent.with_overrides(self._start(silent))

    def _start(self, scenario: Scenario) -> dict[str, object]:
        """Every oscillation with the largest rate of a joint at `amplitude`, its motor at the end of its swing."""
        system, n = scenario.system(), scenario.system().n
        q, dq, motor = self.q.copy(), np.zeros(n), self.q.copy()
        elastic = scenario.structure().drive == "elastic"
        for mode in self.modes.T:
            joint = int(np.argmax(np.abs(mode[n : 2 * n])))
            turned = mode * self.amplitude / abs(mode[n + joint])
            still = turned[3 * n + joint] if elastic else 1j * turned[n + joint]
            turned = turned * (1j * np.conj(still) / abs(still) if abs(still) else 1.0)  # that rate is zero
            q, dq = q + turned[:n].real, dq + turned[n : 2 * n].real
            if elastic:
                motor = motor + turned[2 * n : 3 * n].real
        found: dict[str, object] = {"initial.q": q.tolist(), "initial.dq": dq.tolist()}
        if elastic:
            values = scenario.values()
            gravity = system.function("gravity")(self.q, values).full().ravel()
            stiffness = np.array([_plant(scenario, item.name, i) for i, item in enumerate(system.mechanism.stiffness)])
            found["initial.q_motor"] = (motor + gravity / stiffness).tolist()
        return found

    @property
    def step(self) -> float:
        """A step that the oscillations are exact with, s: the scenario's or a smaller one."""
        return min(self.scenario.step, 2 * np.pi / _STEPS / self.fastest)

    def runs(self, values: Floats, structure: Structure, step: float, hold: int) -> list[Held]:
        """Runs with the parameters `values`, (runs, slots); hold 0 for a continuous control."""
        loop = kernel(KernelSpec(structure, hold > 0, options=ONE_RUN))
        system = self.held.system()
        every = max(1, int(2 * np.pi / self.fastest / 12 / step))
        settings = LoopSettings(
            steps=round(self.duration / step),
            step=step,
            bound=self.scenario.bound,
            hold=max(hold, 1),
            output_every=every,
        )
        found = loop.run(values, settings)
        assert found.trajectory is not None and found.rows is not None
        names = [entry.name for entry in system.trajectory]

        def columns(stem: str) -> list[int]:
            return [names.index(f"{stem}_{joint.name}") for joint in system.joints]

        rates, sigma = columns("dq1"), columns("sigma" if system.sliding else "e")
        if structure.drive == "elastic":
            rates += columns("dq2")
        return [
            Held(rows[:count, 0], rows[:count][:, rates], rows[:count][:, sigma], status == 0)
            for rows, count, status in zip(found.trajectory, found.rows, found.status, strict=True)
        ]


def bench_of(loop: LinearLoop, opened: OpenLoop) -> Bench:
    """Where the runs of a loop are held: at its one time along the reference, with what oscillates at its boundary.

    opened  the loop at its boundary, where one of its oscillations neither grows nor dies out
    """
    n, nx = loop.n, loop.A.shape[-1]
    values, vectors = (item.astype(complex) for item in np.linalg.eig(opened.closed[0, 0]))
    if opened.period is not None:
        values = np.log(np.where(np.abs(values) > 0.0, values, 1e-300)) / opened.period
    vectors = vectors[:nx]
    turning = values.imag > 1e-6 * np.abs(values)
    chosen = turning if turning.any() else values.imag >= 0.0
    chosen = chosen & (np.abs(vectors[n : 2 * n]).max(axis=0) > 1e-9)
    chosen = np.flatnonzero(chosen)  # the least damped ones, one for each spring: a delay has more of its own
    chosen = chosen[np.argsort(-values.real[chosen])][:n]
    critical = int(chosen[0])
    turn = 2 * np.pi / max(abs(values[critical]), 1e-3)
    others = np.abs(values.real[np.abs(values.imag) != abs(values[critical].imag)])
    calm = max(float(others.min(initial=np.inf)), 1e-9)
    duration = min(max(_FEWEST_PERIODS * turn, _DECAYS / calm), _PERIODS * turn)
    fastest = float(np.abs(values[chosen]).max())
    amplitude = float(np.max(loop.amplitude))
    return Bench(loop.scenario, loop.x[0, 0, :n].copy(), amplitude, duration, fastest, vectors[:, chosen])


def at_rest(loop: LinearLoop) -> Scenario:
    """The loop's scenario as its runs are held: standing still at its one time along the reference."""
    return bench_of(loop, cut(loop)).held


def _plant(scenario: Scenario, name: str, joint: int) -> float:
    """A number of the plant, which may be one for all joints or the joint's own."""
    keys = {slot.key for slot in scenario.system().slots}
    key = f"plant.{name}" if f"plant.{name}" in keys else f"plant.{name}.{joint}"
    return scenario.number_of(key)


def bisected(grows: Callable[[Floats], Sequence[bool]], expected: float, *, above: bool) -> tuple[float | None, int]:
    """The value at which what grows begins to die out, to one percent, and how many runs that took.

    grows     whether the oscillation grows, for each of several candidates
    expected  about where the boundary is
    above     whether it grows above the boundary (a delay) or below it (delta)
    None where all candidates about it are alike.
    """
    low, high, runs = expected / _SPREAD, expected * _SPREAD, 0
    for _ in range(_WIDENED):
        found = None
        while found is None or found[1] / found[0] > 1 + _RESOLUTION:
            low, high = found or (low, high)
            candidates = np.geomspace(low, high, CANDIDATES)
            grown = np.array(grows(candidates))
            runs += len(candidates)
            unstable = grown if above else grown[::-1]
            if unstable.all() or not unstable.any():
                if found is not None:
                    return float(np.sqrt(low * high)), runs
                break
            first = int(np.argmax(unstable))
            if first == 0:  # what is beyond the boundary dies out: the runs do not order themselves
                break
            place = first if above else CANDIDATES - first
            found = float(candidates[place - 1]), float(candidates[place])
        else:
            return float(np.sqrt(found[0] * found[1])), runs
        low, high = low / _SPREAD**2, high * _SPREAD**2
    return None, runs


def confirmed_layer(loop: LinearLoop, expected: float) -> tuple[float | None, str]:
    """The smallest delta that lets a disturbance die out, and how it was found; loop: at one time, as all below."""
    scenario = loop.scenario
    key = "control.delta"
    edge = points_of(scenario, times=loop.times).with_control(key, np.array([expected]))
    bench = bench_of(loop, cut(edge.loop(loop.amplitude)))
    held = bench.held
    delay = scenario.structure().delay
    step, hold = bench.step, 0
    if scenario.control_every:
        step = scenario.step
        hold = scenario.control_every

    def grows(candidates: Floats) -> list[bool]:
        values = held.values_for({key: candidates})
        structure = replace(held.structure(), delay=delay)
        return [run.grows(bench.amplitude) for run in bench.runs(values, structure, step, hold)]

    value, runs = bisected(grows, expected, above=False)
    return value, _how(runs, bench, step)


def confirmed_period(loop: LinearLoop, expected: float) -> tuple[float | None, str]:
    """The longest sample period, s, at which it dies out: with the scenario's own delay, none if that has none."""
    scenario, bench = loop.scenario, bench_of(loop, sampled(loop, expected, delay_of(loop)))
    held = bench.held
    values = held.values()[None, :]
    delay = scenario.structure().delay * scenario.step
    steps = min(max(round(delay / (expected / _FINE)), 1), LONGEST_DELAY) if delay else 0
    finest = [0.0]

    def grows(candidates: Floats) -> list[bool]:
        found = []
        for period in candidates:
            step = delay / steps if steps else min(period / _SAMPLE_STEPS, bench.step)
            hold = max(round(period / step), 1)
            step = step if steps else period / hold
            finest[0] = step
            structure = replace(held.structure(), delay=steps)
            found += [run.grows(bench.amplitude) for run in bench.runs(values, structure, step, hold)]
        return found

    value, runs = bisected(grows, expected, above=True)
    return value, _how(runs, bench, finest[0])


def confirmed_delay(loop: LinearLoop, expected: float) -> tuple[float | None, str]:
    """The longest delay, s, at which it dies out: at the scenario's period, or of a control at every step."""
    scenario, bench = loop.scenario, bench_of(loop, sampled(loop, period_of(loop) or expected / _COARSE, expected))
    held = bench.held
    values = held.values()[None, :]
    period = scenario.control_every * scenario.step
    steps = min(max(_FINE, round(_FINE * expected / period)), LONGEST_DELAY) if period else _FINE
    finest = [0.0]

    def grows(candidates: Floats) -> list[bool]:
        found = []
        for delay in candidates:
            hold = max(round(steps * period / delay), 1) if period else 1
            step = period / hold if period else delay / steps
            finest[0] = step
            structure = replace(held.structure(), delay=steps)
            found += [run.grows(bench.amplitude) for run in bench.runs(values, structure, step, hold)]
        return found

    value, runs = bisected(grows, expected, above=True)
    return value, _how(runs, bench, finest[0])


def confirmed_cycle(loop: LinearLoop) -> tuple[Floats, float, str]:
    """Amplitude of sigma per joint, and frequency (rad/s), of what a run ends in, and how they were found."""
    scenario, bench = loop.scenario, bench_of(loop, cut(loop))
    held = bench.held
    step = scenario.step if scenario.control_every else bench.step
    bench = replace(bench, duration=_PERIODS / _FEWEST_PERIODS * bench.duration)  # until it changes no more
    structure = replace(held.structure(), delay=scenario.structure().delay)
    [run] = bench.runs(held.values()[None, :], structure, step, scenario.control_every)
    if not run.complete:
        return np.full(len(held.system().joints), np.nan), float("nan"), "the run left its bound"
    amplitude, frequency = run.oscillation()
    return amplitude, frequency, _how(1, bench, step)


def _how(runs: int, bench: Bench, step: float) -> str:
    return f"{runs} runs of {bench.duration:.2g} s, steps of {step:.2g} s"
