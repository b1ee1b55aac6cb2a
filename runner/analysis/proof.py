"""What the paper proves of one run, with the disturbance that it meets, and where the proof does not reach it.

The disturbance is what the law has to overcome, d = d sigma/dt - law(sigma) (docs/paper.md, E12): the base's motion,
what the controller does not know of the arm, and the springs at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from springline.model import theory
from springline.model.control import LAWS
from springline.model.symbolic import derivation, over_runs
from springline.model.system import System
from springline.model.theory import Gap, Margin, SettlingBounds
from springline.runner.analysis.loop import signal_values
from springline.runner.analysis.reaching import limited, reaching_law
from springline.runner.scenario import Scenario

Floats = NDArray[np.float64]

STRUCK = 0.25
"""Share of a run before which the disturbance does not count: it is of springs that the start strikes."""

SETTLED = 0.5
"""Share of a run after which sigma is expected to be no larger than the disturbance since then keeps it."""

_FELT_EVERY = 1e-3
"""s, between two samples of H^-1 S, which is as slow as the base."""


@dataclass(frozen=True, slots=True)
class Proof:
    """Section 6 for one run.

    disturbed  k1's margin over the largest |d| after the first quarter of the run: what the law has to overcome
    margin     k1 - S0, with S0 the largest |H^-1 S| of the whole run: the condition as the theorem has it
    bounds     t_smax, t_q, t_a, from `margin`
    gaps       where the proof does not reach this run (E9)
    residual   per joint, the |sigma| below which the law is no larger than the largest |d|
    remaining  per joint, the largest |sigma| of the second half
    ringing    per joint, the largest |d| of the first quarter: mostly of springs that the start strikes
    tail       rate at which e decays once |e| << delta, 1/s
    """

    disturbed: Margin
    margin: Margin
    bounds: SettlingBounds
    gaps: tuple[Gap, ...]
    residual: tuple[float, ...]
    remaining: tuple[float, ...]
    ringing: tuple[float, ...]
    tail: float


def proof_reaches(scenario: Scenario) -> str:
    """Why section 6 says nothing of a scenario's controller; "" where it does."""
    controller = scenario.system().controller
    if controller.law is None:
        return f"the controller ({controller.title}) has no reaching law"
    if controller.name != "terminal_sliding":
        return f"the proof is of the terminal surface, and the controller ({controller.title}) has another"
    if all(parameter.name != "k1" for parameter in controller.law.parameters):
        return f"the law ({controller.law.title}) has no gain k1"
    return ""


def signals_along(scenario: Scenario, t: Floats) -> Floats:
    """w = [q1d, dq1d, ddq1d, b, db, ddb] along time, one column a time."""
    found: Floats = signal_values(scenario, scenario.values()[None, :], t)[0].T
    return found


def disturbance(scenario: Scenario, columns: Mapping[str, Floats]) -> tuple[Floats, Floats]:
    """sigma and d along a run, n x rows, by its trajectory's columns; the controller has a reaching law.

    d is m/s^2 or rad/s^2. Raises ValueError where sigma depends on the reference's acceleration, whose rate no
    signal has.
    """
    system, values = scenario.system(), scenario.values()

    def along(name: str) -> Floats:
        return np.array([columns[f"{name}_{joint.name}"] for joint in system.joints])

    t, n = columns["t"], system.n
    x = np.vstack([along(item.name) for item in system.drive.state])
    z = np.array([columns[entry.name] for entry in system.memory]).reshape(-1, len(t))
    w = signals_along(scenario, t)
    p = np.repeat(values[:, None], len(t), axis=1)
    rates = over_runs(system.function("loop_plant"), w, x, along("U"), p)[0][:, :, 0].T
    moved = np.zeros_like(w)
    moved[: 2 * n] = w[n : 3 * n]
    memory = [z] if system.memory else []
    sigma, rate = (item[:, :, 0].T for item in over_runs(_sliding(system), w, x, *memory, moved, rates, p))
    law = reaching_law(scenario)
    limits = [float(limit) for limit in _per_joint(scenario, "a_max")]
    asked = np.array([limited(law, limit)(row) for limit, row in zip(limits, sigma, strict=True)])
    return sigma, rate - asked


@derivation
def _sliding(system: System) -> ca.Function:
    """sigma and d sigma/dt of w, x, z, the rates of w and x, and p."""
    dw, dx = ca.SX.sym("dw", system.w.numel()), ca.SX.sym("dx", system.x.numel())
    memory = [system.z] if system.memory else []
    sigma = system.function("loop_error")(system.w, system.x, *memory, system.p)[1]
    n = system.n
    if ca.depends_on(sigma, system.w[2 * n : 3 * n]) or (memory and ca.depends_on(sigma, system.z)):
        raise ValueError("sigma depends on what has no rate: the reference's acceleration, or the controller's states")
    rate = ca.jtimes(sigma, system.w, dw) + ca.jtimes(sigma, system.x, dx)
    return ca.Function("sliding", [system.w, system.x, *memory, dw, dx, system.p], [sigma, rate])


def _per_joint(scenario: Scenario, name: str) -> Floats:
    return np.array([scenario.number_of(f"control.{name}.{i}") for i in range(scenario.system().n)])


def proof_of(scenario: Scenario, columns: Mapping[str, Floats]) -> Proof:
    """Section 6 for a run of a scenario that `proof_reaches`, by its trajectory's columns.

    A run that stopped early counts as far as it went.
    """
    system, structure, values = scenario.system(), scenario.structure(), scenario.values()
    number = {slot.key: float(value) for slot, value in zip(system.slots, values, strict=True)}
    t, n = columns["t"], system.n
    sigma, d = disturbance(scenario, columns)
    struck, settled = (t >= t[0] + share * (t[-1] - t[0]) for share in (STRUCK, SETTLED))
    disturbed = theory.margin(d[:, struck], number["control.k1"])

    every = max(1, round(_FELT_EVERY / float(t[1] - t[0])))
    q, dq = (np.array([columns[f"{name}_{joint.name}"][::every] for joint in system.joints]) for name in ("q1", "dq1"))
    w = signals_along(scenario, t[::every])
    base = np.split(w[3 * n : 3 * n + 3 * system.base.b.numel()], 3)
    p = np.repeat(values[:, None], q.shape[1], axis=1)
    (pushed,), (mass,) = (
        over_runs(system.function("base_disturbance"), *base, q, dq, p),
        over_runs(system.function("slow_mass"), q, p),
    )
    felt = theory.felt_acceleration(mass, pushed[:, :, 0].T)
    margin = theory.margin(felt, number["control.k1"])

    law, limits = reaching_law(scenario), _per_joint(scenario, "a_max")
    clipped = bool(np.any(np.abs([law(row) for row in sigma]) > limits[:, None]))
    bounds = theory.settling_bounds(
        sigma[:, 0],
        margin.c1,
        number["control.zeta"],
        _per_joint(scenario, "mu"),
        number["control.lambda"],
        structure.exponents,
    )
    delta = number["control.delta"]

    def asked(limit: float, at: float) -> float:
        return float(limited(law, limit)(np.array([at]))[0])

    residual = [
        theory.residual_set(lambda s, limit=limit: asked(limit, s), float(bound))  # type: ignore[misc] # a default
        for limit, bound in zip(limits, disturbed.per_joint, strict=True)
    ]
    packaged = LAWS.is_packaged(structure.law)
    return Proof(
        disturbed,
        margin,
        bounds,
        theory.gaps(margin, delta, clipped, structure.law if packaged else ""),
        tuple(residual),
        tuple(float(size) for size in np.max(np.abs(sigma[:, settled]), axis=1)),
        tuple(float(size) for size in np.max(np.abs(d[:, ~struck]), axis=1)),
        theory.tail_rate(number["control.lambda"], delta, structure.exponents),
    )
