"""Delays and periods as axes of a sweep: one kernel for all delays, the edges of PAPER.md E11, and their figures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from springline.codegen.kernel import CHATTERING, KernelSpec, kernel
from springline.runner.run import kernel_structure, loop_settings, simulate
from springline.runner.scenario import Scenario, load_scenario
from springline.runner.sweep import Dataset, Plan, load_sweep, open_pool, place, run_sweep, summarize, versions
from springline.runner.sweep.figures import summary_figures

PERIODS, DELAYS = (1e-4, 5e-4, 1e-3, 2e-3, 2.1e-3), (0.0, 1e-4, 2e-4, 5e-4, 6e-4, 7e-4, 9e-4)


def delayed(period: float, delay: float) -> Scenario:
    changes = {"control.mode": "sampled", "control.period": period, "actuator.delay": delay}
    return load_scenario("paper/nominal", {**changes, "simulation.output_every": 1000})


@pytest.fixture(scope="module")
def swept(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The paper's controller over a lattice of periods and delays: plan, summary."""
    folder: Path = tmp_path_factory.mktemp("delays")
    (folder / "sweep.toml").write_text(
        f"""
        scenario = "paper/nominal"
        method = "grid"
        [set]
        control.mode = "sampled"
        control.period = 1e-3
        [vary]
        control.period = {{ values = {list(PERIODS)} }}
        actuator.delay = {{ values = {list(DELAYS)} }}
        """
    )
    plan, dataset = Plan(load_sweep(folder / "sweep.toml")), Dataset(place(str(folder / "data")))
    dataset.begin(plan, versions(), resume=False)
    with open_pool(2, "") as pool:
        assert run_sweep(plan, dataset, pool, set()).left == 0
    return plan, summarize(plan, dataset)


def test_the_papers_edges_come_out(swept: Any) -> None:
    """PAPER.md E11, to whole 0.1 ms: what survived, and at 1 and 2 ms that the next delay does not."""
    _, summary = swept
    ended = {(row["control.period"], row["actuator.delay"]): row["status"] == "ok" for row in summary.shown.to_pylist()}
    assert all(ended[1e-4, delay] for delay in DELAYS)  # E11 asks for 0.7 ms
    for period, largest, first in ((5e-4, 7e-4, 9e-4), (1e-3, 5e-4, 6e-4), (2e-3, 1e-4, 2e-4)):
        assert all(ended[period, delay] for delay in DELAYS if delay <= largest), period
        assert not any(ended[period, delay] for delay in DELAYS if delay >= first), period
    assert not any(ended[2.1e-3, delay] for delay in DELAYS)


def test_all_delays_share_a_kernel_and_none_has_its_own(swept: Any) -> None:
    plan, _ = swept
    assert len(plan.groups) == len(PERIODS) * len(DELAYS)
    assert len({group.work.identity for group in plan.groups}) == 2
    assert len({group.work.spec for group in plan.groups}) == 2


def test_a_shared_kernel_gives_the_bits_of_one_with_just_that_delay() -> None:
    scenario = delayed(1e-3, 3e-4)
    settings = loop_settings(scenario, trajectory=True)
    assert (scenario.structure().delay, settings.delay) == (3, 3)
    assert kernel_structure(scenario).delay == kernel_structure(delayed(1e-3, 5e-4)).delay > 5
    assert kernel_structure(delayed(1e-3, 0.1)).delay == 1024
    own = kernel(KernelSpec(scenario.structure(), True)).run(scenario.values()[None], settings)
    table = simulate(scenario).trajectory
    assert own.trajectory is not None
    np.testing.assert_array_equal(
        own.trajectory[0], np.array([table[name].to_numpy() for name in table.column_names]).T
    )


def test_a_delay_that_a_kernel_has_no_room_for_is_refused() -> None:
    scenario = delayed(1e-3, 0.0065)
    loop = kernel(KernelSpec(delayed(1e-3, 3e-4).structure(), True))
    with pytest.raises(ValueError, match="delay is 65, expected at most the 3 steps"):
        loop.run(scenario.values()[None], loop_settings(scenario, trajectory=False))


def test_periods_and_delays_are_axes_of_the_maps(swept: Any) -> None:
    plan, summary = swept
    assert [axis.key for axis in plan.numeric_axes()] == ["control.period", "actuator.delay"]
    assert list(summary.outcomes) == ["all"]
    assert (summary.units["control.period"], summary.units["actuator.delay"]) == ("s", "s")
    figures = summary_figures(plan, summary)
    assert list(figures) == ["map", "error_map", "outcomes"]
    axes, bar = figures["outcomes"].axes
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("period [ms]", "delay [ms]")
    assert f"chattering above {CHATTERING:g}" in bar.get_ylabel()
    named = [line.get_label() for line in axes.lines]
    assert {"chatters beyond", "stops beyond", "stopped early"} <= set(named)
    uneasy, stopped = (lines.get_segments() for lines in axes.collections[-2:])
    assert len(uneasy) >= len(PERIODS)
    # Without chatter in between both lines are one: at 0.1 ms nothing stops, at 2.1 ms all does.
    edge = {tuple(map(tuple, part)) for part in stopped}
    assert len(edge & {tuple(map(tuple, part)) for part in uneasy}) >= 2


def test_columns_of_curves_split_groups_by_their_first_key(tmp_path: Path) -> None:
    """Four values of one key and two of another: four columns with two lines in each panel."""
    (tmp_path / "sweep.toml").write_text(
        """
        scenario = "paper/nominal"
        method = "grid"
        [set]
        simulation.duration = 0.002
        [vary]
        simulation.settling_band = { each = [0.02, 0.05, 0.1, 0.2] }
        simulation.bound = { each = [1e5, 1e6] }
        control.k1 = { values = [2.0, 3.0, 4.0] }
        """
    )
    plan, dataset = Plan(load_sweep(tmp_path / "sweep.toml")), Dataset(place(str(tmp_path / "data")))
    dataset.begin(plan, versions(), resume=False)
    with open_pool(2, "") as pool:
        assert run_sweep(plan, dataset, pool, set()).left == 0
    figure = summary_figures(plan, summarize(plan, dataset))["curve"]
    assert len(figure.axes) == 16
    assert [axes.get_title() for axes in figure.axes[:4]] == ["0.02", "0.05", "0.1", "0.2"]
    for axes in figure.axes[8:]:
        labelled = [line for line in axes.lines if line.get_label().startswith("bound = ")]
        assert [len(line.get_xdata()) for line in labelled] == [3, 3]
