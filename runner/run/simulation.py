"""One scenario in, one Result out: trajectory and metrics as Arrow tables with units."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
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
from springline.model.parameters import Joint
from springline.model.quantities import entries
from springline.model.system import System
from springline.runner.files import to_pandas, to_polars
from springline.runner.run.columns import metrics_table, trajectory_table
from springline.runner.run.crew import Crew, results
from springline.runner.run.limits import refuse_large
from springline.runner.run.settings import kernel_structure, loop_settings
from springline.runner.run.shown import figure_of, line_of, page_of
from springline.runner.run.simulated import Simulated
from springline.runner.scenario import Scenario, expect_scenario, kernel_tables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True, repr=False)
class Result(Simulated):
    """What a run gave, and what was simulated.

    scenario  what was simulated
    """

    scenario: Scenario

    def __repr__(self) -> str:
        """Status, size of the trajectory, message."""
        return line_of(self)

    def _repr_html_(self) -> str:
        """What a notebook shows: message, metrics and a figure."""
        return page_of(self.scenario, self)

    def plot(self, name: str = "tracking") -> Figure:
        """One figure of the run, as `springline run` draws it.

        name  "tracking", "error", "force"; "sliding", "phase_plane", "springs", "base_motion", "disturbance",
              "measured", "controller_states", "tip" where there is such a thing
        Raises ValueError, with the names that there are, for any other.
        """
        return figure_of(self.scenario, self, name)

    def to_pandas(self) -> Any:
        """The trajectory as a pandas.DataFrame, the units in its ``attrs["units"]``; see `to_pandas` for any table."""
        return to_pandas(self.trajectory)

    def to_polars(self) -> Any:
        """The trajectory as a polars.DataFrame, columns named with their units; see `to_polars` for any table."""
        return to_polars(self.trajectory)


def outcome(system: System, runs: Runs, run: int, settings: LoopSettings) -> tuple[str, str]:
    """Status and message of one run."""
    status, end = STATUS[runs.status[run]], runs.end_time[run]
    if status == "ok":
        return status, f"done: {end:g} s in {settings.steps} steps{_chatter_text(system.joints, runs, run)}"
    place = int(runs.quantity[run])
    quantity = quantity_name(system, place)
    if place >= len(system.trajectory) - 1:  # no column has its name
        quantity = f"the {system.judged[place].meaning}"
    if status == "out_of_limits":
        low, high = settings.limits[place]
        left = f"its limits ({low:g} <= {quantity} <= {high:g})"
    else:
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
    loop = kernel(KernelSpec(kernel_structure(scenario), scenario.control_every > 0, options=options))
    settings = loop_settings(scenario, trajectory=True)
    tables = kernel_tables(scenario.tables())
    values = scenario.values()[None, :]

    def report() -> None:
        if progress is not None:
            progress(crew.underway() / settings.steps)

    with Crew(1) as crew:  # a thread of its own, so that Ctrl-C and a progress bar reach a long run
        [runs] = results(
            [crew.begin(lambda watch: loop.run(values, settings, tables, numbers=[scenario.run_number], watch=watch))],
            report,
        )
    system = scenario.system()
    assert runs.trajectory is not None and runs.rows is not None
    rows = runs.trajectory[0, : runs.rows[0]]
    trajectory = trajectory_table(system, rows)
    status, message = outcome(system, runs, 0, settings)
    return Result(trajectory, metrics_table(system, runs), status, message, scenario)
