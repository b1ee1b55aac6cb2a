"""One scenario in, one Result out: trajectory and metrics as Arrow tables with units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from springline.codegen.kernel import (
    CHATTERING,
    METRICS,
    ONE_RUN,
    STATUS,
    Engine,
    KernelSpec,
    LoopSettings,
    Runs,
    chatters,
    kernel,
    quantity_name,
)
from springline.codegen.memory import memory
from springline.model.parameters import Joint
from springline.model.quantities import entries
from springline.model.system import System
from springline.runner.crew import Crew, results
from springline.runner.errors import InputError, Problem
from springline.runner.scenario import Scenario, expect_scenario
from springline.runner.tables import kernel_tables

Floats = NDArray[np.float64]
_MOST_ROWS = 10_000_000
_COPIES = 3  # of a trajectory in memory: the loop's rows, the table's columns, the file
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True)
class Result:
    """What a run gave.

    trajectory  columns as System.trajectory has them: t, the state, q1d_, e_, sigma_, U_ per joint, the base
    metrics     one row, columns as System.metrics has them; null where there is none
    status      "ok", "diverged" or "out_of_bounds"
    message     one sentence: for a run that stopped, the quantity and the time at which it left its bound; for one that
                chatters, how much
    """

    trajectory: pa.Table
    metrics: pa.Table
    status: str
    message: str


def field(name: str, unit: str, kind: pa.DataType | None = None) -> pa.Field:
    """An Arrow field that carries its SI unit in its metadata."""
    return pa.field(name, kind or pa.float64(), metadata={"unit": unit})


def trajectory_schema(system: System) -> pa.Schema:
    """Columns of a trajectory, in the order of the loop's rows."""
    return pa.schema([field(entry.name, entry.unit) for entry in system.trajectory])


def metrics_schema(system: System) -> pa.Schema:
    """Columns of a table of metrics, metric by metric, then status and t_end."""
    judged = [field(entry.name, entry.unit) for entry in system.metrics]
    return pa.schema([*judged, field("status", "", pa.string()), field("t_end", "s")])


def metrics_table(system: System, runs: Runs) -> pa.Table:
    """Metrics of all runs, one row each."""
    columns: list[pa.Array] = []
    for k in range(len(METRICS)):
        for j in range(system.n):
            values = runs.metrics[:, j, k]
            columns.append(pa.array(values, mask=np.isnan(values)))
    status = pa.array([STATUS[i] for i in runs.status], pa.string())
    return pa.Table.from_arrays([*columns, status, pa.array(runs.end_time)], schema=metrics_schema(system))


def loop_settings(scenario: Scenario, *, trajectory: bool) -> LoopSettings:
    """What the loop is told about the scenario."""
    return LoopSettings(
        steps=scenario.steps,
        step=scenario.step,
        bound=scenario.bound,
        hold=max(scenario.control_every, 1),
        output_every=scenario.output_every if trajectory else 0,
        response_band=scenario.response_band,
        settling_band=scenario.settling_band,
        response_error=scenario.response_error,
        settling_error=scenario.settling_error,
    )


def outcome(system: System, runs: Runs, run: int, settings: LoopSettings) -> tuple[str, str]:
    """Status and message of one run."""
    status, end = STATUS[runs.status[run]], runs.end_time[run]
    if status == "ok":
        return status, f"done: {end:g} s in {settings.steps} steps{_chatter_text(system.joints, runs, run)}"
    place = int(runs.quantity[run])
    quantity = quantity_name(system, place)
    if place >= len(system.trajectory) - 1:  # no column has its name
        quantity = f"the {system.judged[place].meaning}"
    left = "the finite numbers" if status == "diverged" else f"its bound (|{quantity}| <= {settings.bound:g})"
    states = (*entries(system.drive.state, system.joints), *system.memory)
    if quantity in {entry.name for entry in states}:
        when = f"at t = {end + settings.step:g} s; results end at t = {end:g} s"
    else:  # the state that it was computed from is still there
        when = f"at t = {end:g} s, where results end"
    return status, f"{status}: {quantity} left {left} {when}"


def _chatter_text(joints: Sequence[Joint], runs: Runs, run: int) -> str:
    """Of a run that chatters, which command does it and how much; "" for a calm one."""
    chatter = runs.metrics[run, :, METRICS.index("chatter")]
    judged = zip(joints, chatter, chatters(chatter, runs.end_time[run]), strict=True)
    found = [f"U_{joint.name} by {value:.3g} 1/s" for joint, value, does in judged if does]
    return f"; chattering: {' and '.join(found)} (calm is up to {CHATTERING:g})" if found else ""


def simulate(scenario: Scenario, *, engine: Engine = "lanes", progress: Progress | None = None) -> Result:
    """Simulate a scenario with a kernel in which every number is tunable (a changed number compiles nothing).

    engine    "lanes", or "casadi" for the C that CasADi prints; the results are the same to the last bit
    progress  called now and then with the share that is done (0 .. 1)
    Raises TypeError for what is no Scenario, InputError (a ValueError) if the trajectory would have more than 10
    million rows or not fit into memory, ValueError for an unknown engine, ToolchainError if there is no C compiler.
    """
    expect_scenario(scenario)
    options = replace(ONE_RUN, engine=engine)
    refuse_large(scenario)
    loop = kernel(KernelSpec(scenario.structure(), scenario.control_every > 0, options=options))
    settings = loop_settings(scenario, trajectory=True)
    tables = kernel_tables(scenario.tables())
    values = scenario.values()[None, :]

    def report() -> None:
        if progress is not None:
            progress(crew.underway() / settings.steps)

    with Crew(1) as crew:  # a thread of its own, so that Ctrl-C and a progress bar reach a long run
        [runs] = results([crew.begin(lambda watch: loop.run(values, settings, tables, watch=watch))], report)
    system = scenario.system()
    assert runs.trajectory is not None and runs.rows is not None
    rows = runs.trajectory[0, : runs.rows[0]]
    trajectory = pa.Table.from_arrays([pa.array(column) for column in rows.T], schema=trajectory_schema(system))
    status, message = outcome(system, runs, 0, settings)
    return Result(trajectory, metrics_table(system, runs), status, message)


def row_size(scenario: Scenario) -> int:
    """Bytes of the numbers in a trajectory row."""
    return 8 * len(trajectory_schema(scenario.system()))


def refuse_rows(scenario: Scenario, most: int, why: str) -> None:
    """Raise InputError if the trajectory has more rows than `most`; `why` says what sets this limit."""
    rows = loop_settings(scenario, trajectory=True).rows
    if rows > most:
        enough = -(-scenario.steps // max(most - 2, 1))  # the first row and the last come besides
        text = f"expected at least {enough} for {scenario.steps} steps: {rows} rows are more than {most}, {why}"
        raise InputError(Problem(scenario.source, "simulation.output_every", text, str(scenario.output_every)))


def refuse_large(scenario: Scenario) -> None:
    """Raise InputError if the trajectory, with the copies that become tables and files, would not fit into memory."""
    refuse_rows(scenario, _MOST_ROWS, "the most of a trajectory")
    there = memory()
    refuse_rows(
        scenario, there // (_COPIES * row_size(scenario)), f"all that {there / 1e9:.3g} GB of memory have room for"
    )
