"""CasADi without a compiler: its virtual machine, and its interface to CVODES."""

from __future__ import annotations

from functools import cache, partial

import casadi as ca
import numpy as np

from springline.benchmarks import problem
from springline.benchmarks.contenders import casadi_model

START = (*problem.INITIAL_STATE, 0.0)


def build_step(mode: problem.Control) -> problem.Runner:
    """Every step is a call from Python."""
    step = casadi_model.step_function(mode)

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        final = []
        for d in delta.tolist():
            state = ca.DM(START)
            for _ in range(steps):
                state = step(state, d)
            final.append(state.full()[:8, 0])
        return np.array(final)

    return run


def build_chain(mode: problem.Control, kind: str) -> problem.Runner:
    """QUANTUM steps in a call, by mapaccum (which keeps every state) or fold."""
    step = casadi_model.step_function(mode)
    chain = step.mapaccum(problem.QUANTUM) if kind == "mapaccum" else step.fold(problem.QUANTUM)

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        final = []
        for d in delta.tolist():
            state = ca.DM(START)
            for _ in range(steps // problem.QUANTUM):
                state = chain(state, d)[:, -1]
            final.append(state.full()[:8, 0])
        return np.array(final)

    return run


def build_cvodes() -> problem.Runner:
    """CVODES with CasADi's own Jacobians, relative tolerance 1e-6."""
    t, x, delta = ca.SX.sym("t"), ca.SX.sym("x", 8), ca.SX.sym("delta")
    ode = casadi_model.plant(t, x, casadi_model.control(t, x, delta))
    system = {"t": t, "x": x, "p": delta, "ode": ode}
    options = {"reltol": 1e-6, "abstol": 1e-9, "max_num_steps": 10_000_000}

    @cache
    def solver(steps: int) -> ca.Function:
        return ca.integrator("solve", "cvodes", system, 0.0, steps * problem.STEP, options)

    def run(delta: problem.Floats, steps: int) -> problem.Floats:
        solve = solver(steps)
        return np.array([solve(x0=problem.INITIAL_STATE, p=d)["xf"].full()[:, 0] for d in delta.tolist()])

    return run


CONTENDERS = (
    problem.Contender("CasADi cvodes", "continuous", "continuous", build_cvodes, adaptive=True, tolerance=5e-3),
    *(
        problem.Contender("CasADi VM, step from Python", mode, mode, partial(build_step, mode))
        for mode in problem.MODES
    ),
    *(
        problem.Contender(f"CasADi VM, {kind}", mode, mode, partial(build_chain, mode, kind))
        for kind in ("mapaccum", "fold")
        for mode in problem.MODES
    ),
)
