"""Error against work of the integrators for sampled control, beside scipy's on the same loop.

    python -m benchmarks.work_precision [--write]

The paper's arm on a base at rest, the first 0.6 s of paper/nominal, control sampled at 1 ms and held. Work is the
number of plant evaluations per second of simulated time; the error is the largest of q1 of either joint (m or rad) over
all samples, against dop853 with twenty steps a sample. springline's integrators take so many equal steps a sample;
scipy's choose theirs for a tolerance, relative and absolute, and begin anew at every sample. --write puts what was
measured into docs/performance.md and the figure into docs/images/.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from springline.model.integrators import INTEGRATORS
from springline.model.quantities import Q1
from springline.runner.report import COLUMN, LINES, figure_files, house_style, legend_above, panels, put, symbol
from springline.runner.run import simulate
from springline.runner.scenario import Scenario, load_scenario

Floats = NDArray[np.float64]

DOCS = Path(__file__).parent.parent / "docs"
NAME = "work_precision"

PERIOD = 1e-3  # s
DURATION = 0.6  # s
STEPS = {"rk4": (1, 2, 4, 5, 10, 20, 40), "dopri5": (1, 2, 4, 5, 10, 20), "dop853": (1, 2, 4, 5)}
"""Integrator -> steps a sample."""
REFERENCE = ("dop853", 20)
TOLERANCES = tuple(10.0**-k for k in range(3, 12))
METHODS = ("DOP853", "LSODA")


@dataclass(frozen=True, slots=True)
class Point:
    """One measurement: who, with which steps or tolerance, plant evaluations per second, largest error of q1."""

    who: str
    how: str
    evaluations: float
    error: float


def scenario(integrator: str, steps: int) -> Scenario:
    """The run with so many steps a sample, a row of the trajectory per sample."""
    return load_scenario(
        "paper/nominal",
        {
            "control.mode": "sampled",
            "control.period": PERIOD,
            "simulation.duration": DURATION,
            "simulation.integrator": integrator,
            "simulation.step": PERIOD / steps,
            "simulation.output_every": steps,
        },
    )


def ours(integrator: str, steps: int) -> Floats:
    """q1 at every sample, (samples + 1, joints); steps is steps a sample. NaN after a run that stopped."""
    chosen = scenario(integrator, steps)
    table = simulate(chosen).trajectory
    q1 = np.full((round(DURATION / PERIOD) + 1, chosen.system().n), np.nan)
    q1[: len(table)] = np.column_stack([table[entry.name] for entry in Q1.entries(chosen.system().joints)])
    return q1


def scipys(method: str, tolerance: float) -> tuple[Floats, int]:
    """The same by solve_ivp, from sample to sample, and how often it evaluated the plant."""
    chosen = scenario("rk4", 1)
    system, p, d = chosen.system(), chosen.values(), np.zeros(0)
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", system.x.numel()), ca.SX.sym("u", system.n)
    w = system.function("signals")(t, d, p)
    control = ca.Function("control", [t, x], [system.function("loop_control")(w, x, p)[0]])
    plant = ca.Function("plant", [t, x, u], [system.function("loop_plant")(w, x, u, p)])
    now = system.function("start")(0.0, d, p).full().ravel()
    q1, count = [now[: system.n]], 0
    for k in range(round(DURATION / PERIOD)):
        held = control(k * PERIOD, now)

        def slope(t: float, x: Any, held: ca.DM = held) -> Floats:
            return np.asarray(plant(t, x, held)).ravel()

        span = (k * PERIOD, (k + 1) * PERIOD)
        solution = solve_ivp(slope, span, now, method, t_eval=span[1:], rtol=tolerance, atol=tolerance)
        now, count = solution.y[:, -1], count + solution.nfev
        q1.append(now[: system.n])
    return np.array(q1), count


def measure() -> list[Point]:
    """All points, in the order of the figure's lines."""
    exact = ours(*REFERENCE)
    points = [
        Point(
            integrator,
            f"{1e3 * PERIOD / steps:g} ms",
            INTEGRATORS[integrator].stages * steps / PERIOD,
            float(np.max(np.abs(ours(integrator, steps) - exact))),
        )
        for integrator, chosen in STEPS.items()
        for steps in chosen
    ]
    for method in METHODS:
        for tolerance in TOLERANCES:
            q1, count = scipys(method, tolerance)
            points.append(
                Point(f"scipy {method}", f"{tolerance:.0e}", count / DURATION, float(np.max(np.abs(q1 - exact))))
            )
    return points


def table(points: list[Point]) -> str:
    """The points in Markdown."""
    lines = ["| integrator | step or tolerance | plant evaluations a second | error of q1 |", "|---|---|---:|---:|"]
    lines += [f"| {point.who} | {point.how} | {point.evaluations:,.0f} | {point.error:.1e} |" for point in points]
    return "\n".join(lines) + "\n"


def summary(points: list[Point]) -> str:
    """What the points say, in a paragraph that stands above their table."""
    high, low = (
        next(point for point in points if (point.who, point.how) == chosen)
        for chosen in (("dop853", "1 ms"), ("rk4", "0.1 ms"))
    )
    better, longer = low.error / high.error, low.evaluations / high.evaluations
    lines = [
        f"`dop853` in steps of {high.how}, one a sample: off by {high.error:.1e}, with"
        f" {high.evaluations:,.0f} evaluations a second.",
        f"`rk4` in steps of {low.how}: {low.error:.1e}, {low.evaluations:,.0f}. That is {better:.1f} times the error",
        f"for {longer:.1f} times the work.",
    ]
    return "\n".join([*lines, "", table(points)])


def figure(points: list[Point]) -> Figure:
    """Error over work, a line an integrator."""
    with house_style():
        drawn, grid = panels(width=1.4 * COLUMN, height=2.6)
        axes = grid[0, 0]
        for who, line, marker in zip(dict.fromkeys(point.who for point in points), LINES, "os^vD", strict=False):
            own = [point for point in points if point.who == who]
            work, errors = [point.evaluations for point in own], [point.error for point in own]
            axes.plot(work, errors, label=who, marker=marker, markersize=3.5, **line)
        axes.set(xscale="log", yscale="log")
        axes.margins(x=0.04)
        axes.set_xlabel("plant evaluations per second of simulated time")
        axes.set_ylabel(f"largest error of {symbol(Q1)} [m or rad]")
        legend_above(drawn, columns=3)
        return drawn


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--write", action="store_true", help="put table and figure into docs/")
    write = parser.parse_args().write
    points = measure()
    sys.stdout.write(summary(points))
    if write:
        page = DOCS / "performance.md"
        page.write_text(put(page.read_text(encoding="utf-8"), NAME, summary(points)), encoding="utf-8")
        name = f"{NAME}.png"
        (DOCS / "images" / name).write_bytes(figure_files(NAME, figure(points))[name])
    return 0


if __name__ == "__main__":
    sys.exit(main())
