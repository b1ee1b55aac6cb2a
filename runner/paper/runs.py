"""Every run that repeats the paper, once with the scenarios' step and once with half of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from os import cpu_count
from threading import Lock
from typing import Any

import numpy as np
import pyarrow as pa

from springline.codegen.kernel import ONE_RUN, KernelSpec, LoopSettings, Watch, kernel
from springline.codegen.program import program
from springline.model.control import SurfaceExponents
from springline.model.structure import Structure
from springline.model.theory import felt_acceleration
from springline.runner.analysis import proof_of, reaching_law, signals_along
from springline.runner.files import InputError, Problem, numpy_array
from springline.runner.paper.cases import INPUTS, LAWS, cases, under
from springline.runner.paper.evidence import Evidence, Inherent
from springline.runner.paper.measured import Floats, Measured
from springline.runner.paper.numbers import exact
from springline.runner.run import Crew, Progress, Result, results, simulate, trajectory_table
from springline.runner.scenario import Scenario, load_scenario

Overrides = Mapping[str, Any]

ROW_INTERVAL = 2e-4
"""Time between trajectory rows, s: 30 of them in a period of the springs' slowest oscillation."""

LINEAR_GAIN = 5.0
"""1/s. Coefficient c of the linear surface sigma = de/dt + c e of Figure 5, which the paper does not publish: ours."""

E8_SHAKE: Overrides = {
    "base_motion.kind": "sine",
    "base_motion.shake": [{"amplitude": 0.07, "omega": 11.0}, {"amplitude": 0.0, "omega": 0.0}],
}
"""The shake under which the two readings of the logarithms are compared (E8): 0.07 sin 11t. With a second, empty term
these runs have the structure of Table 2's, and need no kernels of their own."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """A run besides Table 2's: what it varies, in words and as overrides of a packaged scenario."""

    name: str
    scenario: str
    overrides: Overrides


LITERAL: Mapping[str, Experiment] = {
    "unlimited": Experiment("δ = 0, no limits", "paper/as_printed", {}),
    "limited": Experiment("δ = 0, a_max = 200 m/s², rad/s²", "paper/as_printed", {"control.a_max": 200.0}),
}
"""The law as it is printed: no boundary layer."""

READINGS: Mapping[str, Experiment] = {
    "power": Experiment("logarithms to a power", "paper/nominal", E8_SHAKE),
    "base": Experiment("logarithms to a base", "paper/nominal", {**E8_SHAKE, "control.log_form": "base"}),
    "double_power": Experiment("double power law", "paper/nominal", {**E8_SHAKE, "control.law": "double_power"}),
    "power_law": Experiment("power law", "paper/nominal", {**E8_SHAKE, "control.law": "power"}),
}
"""The two readings of the logarithms of (18), and the traditional laws beside them."""

LAYERS: Mapping[str, Experiment] = {
    f"{delta:g}": Experiment(f"δ = {delta:g}", "paper/nominal", {"control.delta": delta})
    for delta in (0.005, 0.01, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05, 0.1)
}
"""Width of the boundary layer, base at rest."""

LIMITS: Mapping[str, Experiment] = {
    f"{a_max:g}": Experiment(f"a_max = {exact(a_max)}", "paper/nominal", {"control.a_max": a_max})
    for a_max in (50.0, 100.0, 200.0, 500.0, 1000.0, 1500.0, float("inf"))
}
"""Limit on the reaching law, base at rest."""

SAMPLING: Mapping[str, Experiment] = {
    f"{law} {period:g}": Experiment(
        f"{name}, sampled at {1e3 * period:g} ms",
        f"paper/group2_{law}",
        {"control.mode": "sampled", "control.period": period},
    )
    for period in (1.9e-3, 2.0e-3, 2.1e-3)
    for law, name in LAWS.items()
}
"""The three laws under shake with sampled control (E11). Periods are multiples of the scenarios' step and its half."""

SOLVER: Mapping[str, Experiment] = {
    "fine": Experiment("a_max = 50 m/s², rad/s², step 0.1 ms", "paper/group4_fast_off", {"control.a_max": 50.0}),
    "coarse": Experiment(
        "a_max = 50 m/s², rad/s², step 1 ms", "paper/group4_fast_off", {"control.a_max": 50.0, "simulation.step": 1e-3}
    ),
    "motors": Experiment(
        "motors limited to 2000 N and 5000 N m instead of the law, step 0.1 ms",
        "paper/group4_fast_off",
        {"control.a_max": float("inf"), "control.U_max": [2000.0, 5000.0]},
    ),
}
"""Without fast control: what decides how long a run lasts (E11). RK4 damps the springs at a step of a millisecond."""

_TABLES = (LITERAL, READINGS, LAYERS, LIMITS, SAMPLING, SOLVER)
"""In the order of Study's fields."""

Key = tuple[Any, ...]
"""What a run is for: ("case", scenario name, whether the step is halved), or an experiment's likewise."""

Twice = tuple[Measured, Measured]
"""A run with the scenario's step, and with half of it."""


@dataclass(frozen=True, slots=True)
class Study:
    """All runs of a reproduction.

    groups     groups of Table 2 that were run
    changes    overrides of all scenarios, by dotted key
    inputs     the set of INPUTS whose scenarios these are, named as in "paper/"
    whole      whether the rest was run too: Figures 4 to 7 and the sections on what the paper leaves open
    scenarios  scenario name -> scenario of each case
    evidence, halved  what the claims look at, with the scenarios' step and with half of it
    literal, readings, layers, limits, sampling, solver  the experiments of these names; empty unless `whole`
    beside     other set of INPUTS -> scenario name -> group 2 under that; empty unless `whole`
    """

    groups: tuple[int, ...]
    changes: Overrides
    inputs: str
    whole: bool
    scenarios: Mapping[str, Scenario]
    evidence: Evidence
    halved: Evidence
    beside: Mapping[str, Mapping[str, Measured]]
    literal: Mapping[str, Twice]
    readings: Mapping[str, Twice]
    layers: Mapping[str, Twice]
    limits: Mapping[str, Twice]
    sampling: Mapping[str, Twice]
    solver: Mapping[str, Twice]


def study(
    groups: Sequence[int],
    *,
    whole: bool,
    changes: Overrides | None = None,
    inputs: str = "law_limit",
    progress: Progress | None = None,
) -> Study:
    """Run everything that a reproduction of these groups needs.

    inputs    one of INPUTS, the set of what the paper does not publish
    changes   overrides of all scenarios; where an experiment varies the same key, the experiment's counts
    progress  called now and then with the share that is done (0 .. 1)
    Raises InputError for overrides that a scenario refuses or that the report has no analysis for, ValueError for a
    group that the paper does not have, ToolchainError if there is no C compiler.
    """
    changed = dict(changes or {})
    names = [case.scenario for case in cases(groups)]
    tables = _TABLES if whole else ()
    wanted: dict[Key, tuple[str, Overrides]] = {("case", name): (name, {}) for name in names}
    wanted |= {
        (number, key): (experiment.scenario, experiment.overrides)
        for number, table in enumerate(tables)
        for key, experiment in table.items()
    }
    others = [other for other in INPUTS if whole and other != inputs]
    scenarios = {
        (*key, half): _scenario(under(inputs, name), {**changed, **overrides}, half)
        for key, (name, overrides) in wanted.items()
        for half in (False, True)
    }
    linear = (
        {
            (law, half): _scenario(under(inputs, "paper/nominal"), {**changed, "control.law": law}, half)
            for law in LAWS
            for half in (False, True)
        }
        if whole
        else {}
    )
    beside = {
        ("beside", other, case.scenario): _scenario(under(other, case.scenario), changed, half=False)
        for other in others
        for case in cases([2])
    }
    straight = {("linear", *key): scenario for key, scenario in linear.items()}
    runs = _run_all({**scenarios, **straight, **beside}, progress)

    mechanical = {key: value for key, value in changed.items() if not key.startswith("base_motion")}

    def evidence(half: bool) -> Evidence:
        measured = {name: runs["case", name, half] for name in names}
        return Evidence(
            runs=measured,
            theory={
                name: proof_of(scenarios["case", name, half], run.columns)
                for name, run in measured.items()
                if run.status == "ok"
            },
            laws={
                law: reaching_law(load_scenario(under(inputs, "paper/nominal"), {**changed, "control.law": law}))
                for law in LAWS
            },
            inherent=inherent_of(load_scenario(under(inputs, "paper/group1_shake"), mechanical)),
            linear={law: runs["linear", law, half] for law in LAWS} if whole else {},
        )

    def experiments(number: int, table: Mapping[str, Experiment]) -> Mapping[str, Twice]:
        return {key: (runs[number, key, False], runs[number, key, True]) for key in table} if whole else {}

    return Study(
        tuple(sorted(set(groups))),
        changed,
        inputs,
        whole,
        {name: scenarios["case", name, False] for name in names},
        evidence(False),
        evidence(True),
        {other: {case.scenario: runs["beside", other, case.scenario] for case in cases([2])} for other in others},
        *(experiments(number, table) for number, table in enumerate(_TABLES)),
    )


def _scenario(name: str, overrides: Overrides, half: bool) -> Scenario:
    plain = load_scenario(name, dict(overrides))
    if plain.signal_tables:
        text = "the report's bounds need signals that are formulas: expected another kind than a table"
        raise InputError(Problem(f"override of {name}", "", text))
    step = plain.step / 2 if half else plain.step
    return load_scenario(
        name, {**overrides, "simulation.step": step, "simulation.output_every": max(1, round(ROW_INTERVAL / step))}
    )


def _run_all(scenarios: Mapping[Key, Scenario], progress: Progress | None) -> dict[Key, Measured]:
    """Run all scenarios, those that are the same only once; kernels are compiled side by side."""
    jobs: dict[Structure, dict[object, list[Key]]] = {}
    for key, scenario in scenarios.items():
        structure = _linear_structure(scenario) if key[0] == "linear" else scenario.structure()
        program(structure)  # derived here, so that threads do not wait for each other
        same = (
            scenario.values().tobytes(),
            scenario.step,
            scenario.steps,
            scenario.output_every,
            scenario.control_every,
        )
        jobs.setdefault(structure, {}).setdefault(same, []).append(key)
    total = sum(len(runs) for runs in jobs.values())
    done: dict[Key, Measured] = {}
    guard, finished = Lock(), 0

    def work(runs: Iterable[list[Key]], watch: Watch) -> None:
        nonlocal finished
        for keys in runs:
            if watch.stop.value:
                return
            scenario = scenarios[keys[0]]
            result = _linear(scenario) if keys[0][0] == "linear" else simulate(scenario)
            with guard:
                run = measure(scenario, result)
                if any(key[0] == "case" for key in keys):
                    run = with_velocities(scenario, run)
                done.update((key, run) for key in keys)
                finished += 1

    def report() -> None:
        if progress is not None:
            progress(finished / total)

    with Crew(cpu_count() or 1) as crew:
        results([crew.begin(partial(work, list(runs.values()))) for runs in jobs.values()], report)
    return done


def measure(scenario: Scenario, result: Result) -> Measured:
    """A Result as it is judged, with NaN for metrics that do not exist."""
    columns = {name: numpy_array(result.trajectory[name]) for name in result.trajectory.column_names}
    (row,) = result.metrics.to_pylist()
    metrics = {key: float("nan") if value is None else float(value) for key, value in row.items() if key != "status"}
    return Measured(columns, metrics, result.status, result.message)


def with_velocities(scenario: Scenario, run: Measured) -> Measured:
    """The run with the wished velocities and their errors beside its columns."""
    system, columns = scenario.system(), dict(run.columns)
    wished = signals_along(scenario, run["t"])[system.n : 2 * system.n]
    for joint, rate in zip(system.joints, wished, strict=True):
        columns[f"dq1d_{joint.name}"] = rate
        columns[f"velocity_error_{joint.name}"] = rate - columns[f"dq1_{joint.name}"]
    return replace(run, columns=columns)


def inherent_of(scenario: Scenario) -> Inherent:
    """What mechanism and surface of a scenario whose base heaves say by themselves (E5, E10)."""
    system, values = scenario.system(), scenario.values()
    angles = np.linspace(-np.pi, np.pi, 721)
    still = np.zeros(len(system.base.coordinates))
    heave = (np.array([item.key for item in system.base.coordinates]) == "heave").astype(float)
    q = np.array([np.zeros_like(angles), angles])
    force = system.function("base_disturbance")(still, still, heave, q, np.zeros_like(q), values).full()
    mass = system.function("slow_mass")(q, values).full()
    felt = felt_acceleration(mass.reshape(system.n, -1, system.n).swapaxes(0, 1), force)
    printed = values.copy()
    printed[[slot.key for slot in system.slots].index("control.delta")] = 0.0

    def at_rest(joint: str, errors: Floats, p: Floats) -> Floats:
        i = [item.name for item in system.joints].index(joint)
        x = np.zeros((system.x.numel(), len(errors)))
        x[i] = -errors
        zero = np.zeros((system.n, 1))
        _, _, sigma = system.function("slow_control")(zero, zero, zero, x, p)
        size: Floats = np.abs(sigma.full()[i])
        return size

    return Inherent(angles, felt, partial(at_rest, p=values), partial(at_rest, p=printed))


def _linear_structure(scenario: Scenario) -> Structure:
    return replace(scenario.structure(), exponents=SurfaceExponents(l=1, m=1, p=1, r=3))


def _linear(scenario: Scenario) -> Result:
    """The scenario with the linear surface sigma = de/dt + c e, which no scenario can ask for."""
    structure = _linear_structure(scenario)
    system = program(structure).system
    values = scenario.values().copy()
    for i, slot in enumerate(system.slots):
        if slot.key.startswith("control.mu."):
            values[i] = LINEAR_GAIN
        if slot.key == "control.lambda":
            values[i] = 0.0
    settings = LoopSettings(scenario.steps, scenario.step, scenario.bound, output_every=scenario.output_every)
    runs = kernel(KernelSpec(structure, options=ONE_RUN)).run(values[None, :], settings)
    assert runs.trajectory is not None
    return Result(trajectory_table(system, runs.trajectory[0]), pa.table({"status": ["ok"]}), "ok", "", scenario)
