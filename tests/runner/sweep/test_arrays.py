"""batch(): bands that differ from run to run, trajectories that are kept, and what a user's function makes of them."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from numpy.typing import NDArray

from springline.runner import batch, load_scenario, simulate
from springline.runner.files import InputError
from springline.runner.scenario import Scenario

Columns = Mapping[str, NDArray[Any]]

DELTAS = np.array([0.02, 0.03, 0.04, 0.05, 0.06])


@pytest.fixture(scope="module")
def short() -> Scenario:
    return load_scenario("paper/nominal", {"simulation.duration": 0.6, "simulation.output_every": 50})


def alone(scenario: Scenario, columns: Mapping[str, Any], run: int) -> Any:
    return simulate(scenario.with_overrides({key: float(values[run]) for key, values in columns.items()}))


# Bands


@pytest.mark.parametrize("columns", [
    {"simulation.response_band": [0.1, 0.3, 0.6], "simulation.settling_band": [0.5, 0.4, 0.3]},
    {"simulation.response_error": [0.05, 0.02, 0.1], "simulation.settling_error": [0.05, 0.1, 0.2]},
    {"simulation.settling_error": [0.2, 0.1, 0.05], "control.delta": [0.02, 0.05, 0.08]},
], ids=["bands", "errors", "with another key"])  # fmt: skip
def test_each_run_has_its_own_bands(short: Scenario, columns: dict[str, list[float]]) -> None:
    """As the run of a scenario with these bands has, of which each drops what stands in its place."""
    long = short.with_overrides({"simulation.duration": 1.5})
    table = batch(long, columns)
    for run in range(3):
        for name, expected in alone(long, columns, run).metrics.to_pylist()[0].items():
            assert table[name][run].as_py() == expected, name
    times = [table[name].to_pylist() for name in ("response_time_lift", "settling_time_lift")]
    assert any(len(set(found)) == 3 for found in times) and not any(None in found for found in times)


def test_what_stands_in_the_place_of_a_band_excludes_it(short: Scenario) -> None:
    both = {"simulation.response_band": [0.1], "simulation.response_error": [0.1]}
    with pytest.raises(InputError, match=r"simulation\.response_error: does not go with simulation\.response_band"):
        batch(short, both)
    with pytest.raises(InputError, match=r"simulation\.settling_error.*a number > 0 \[m or rad\]"):
        batch(short, {"simulation.settling_error": [0.1, 0.0]})
    with pytest.raises(InputError, match=r"simulation\.settling_band.*\(0, 1\)"):
        batch(short, {"simulation.settling_band": [0.1, 1.0]})


# Trajectories


def test_every_so_many_trajectories_are_columns_of_lists(short: Scenario) -> None:
    table = batch(short, {"control.delta": DELTAS}, trajectories=2)
    plain = batch(short, {"control.delta": DELTAS})
    assert table.select(plain.column_names).equals(plain)
    for run in range(len(DELTAS)):
        expected = alone(short, {"control.delta": DELTAS}, run).trajectory
        assert table.column_names == [*plain.column_names, *expected.column_names]
        for name in expected.column_names:
            assert table.schema.field(name).metadata == expected.schema.field(name).metadata
            found = table[name][run].as_py()
            assert found == (expected[name].to_pylist() if run % 2 == 0 else None)
    assert table["t"][4].as_py()[-1] == 0.6


def test_trajectories_of_runs_that_stop_are_as_long_as_these(short: Scenario) -> None:
    wide = short.with_overrides({"simulation.bound": 250.0})
    columns = {"initial.dq.0": np.array([0.0, 20.0, 0.0])}
    found = batch(wide, columns, trajectories=1, reduce=lambda seen: {"rows": np.isfinite(seen["t"]).sum(axis=1)})
    rows = [len(times) for times in found["t"].to_pylist()]
    assert rows == [alone(wide, columns, run).trajectory.num_rows for run in range(3)]
    assert rows == found["rows"].to_pylist() and rows[1] < rows[0]
    assert found["status"].to_pylist() == ["ok", "out_of_bounds", "ok"]


def test_results_do_not_depend_on_threads_and_pieces(short: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    noisy = short.with_overrides({
        "control.mode": "sampled", "control.period": 1e-3, "sensor.position_noise": [1e-4, 1e-4],
    })  # fmt: skip
    columns = {"control.delta": np.linspace(0.03, 0.06, 600), "simulation.settling_error": np.linspace(0.01, 0.2, 600)}
    calls: list[list[int]] = []

    def peak(seen: Columns) -> dict[str, NDArray[Any]]:
        calls.append(list(seen["run"]))
        return {"peak": np.nanmax(np.abs(seen["sigma_lift"]), axis=1), "run_again": seen["run"]}

    whole = batch(noisy, columns, jobs=1, trajectories=7, reduce=peak)
    assert [run for call in calls for run in call] == list(range(600)) == whole["run_again"].to_pylist()
    before = len(calls)
    calls.clear()
    arrays = import_module("springline.runner.sweep.arrays")
    monkeypatch.setattr(arrays, "TRAJECTORY_BYTES", 1.0)
    pieces = batch(noisy, columns, jobs=2, trajectories=7, reduce=peak)
    assert [run for call in calls for run in call] == list(range(600)) and len(calls) > before
    assert pieces.equals(whole)
    for run in (0, 35, 595):
        one = simulate(noisy.with_overrides({"sensor.run": run} | {k: float(v[run]) for k, v in columns.items()}))
        assert whole["U_lift"][run].as_py() == one.trajectory["U_lift"].to_pylist()
        assert whole["peak"][run].as_py() == max(map(abs, one.trajectory["sigma_lift"].to_pylist()))


# A user's function


def test_a_function_sees_every_trajectory_and_gives_columns(short: Scenario) -> None:
    def seen(given: Columns) -> dict[str, Any]:
        late = given["t"] > 0.3
        assert all(values.shape == late.shape for name, values in given.items() if name != "run")
        return {
            "late": np.where(late, np.abs(given["e_lift"]), 0.0).max(axis=1),
            "none": np.full(len(late), np.nan),
            "low": given["q1_lift"][:, -1] < 0.5,
            "name": [f"run {run}" for run in given["run"]],
        }

    table = batch(short, {"control.delta": DELTAS}, reduce=seen)
    assert table.column_names[-4:] == ["late", "none", "low", "name"]
    assert "q1_lift" not in table.column_names
    for run in range(len(DELTAS)):
        rows = alone(short, {"control.delta": DELTAS}, run).trajectory.to_pylist()
        assert table["late"][run].as_py() == max(abs(row["e_lift"]) for row in rows if row["t"] > 0.3)
        assert table["low"][run].as_py() is (rows[-1]["q1_lift"] < 0.5)
    assert table["none"].null_count == len(DELTAS)
    assert table["name"].to_pylist() == [f"run {run}" for run in range(len(DELTAS))]
    assert table.schema.field("low").type == pa.bool_()


def _fails(given: Columns) -> dict[str, Any]:
    raise ZeroDivisionError("no such thing")


@pytest.mark.parametrize(("reduce", "error", "text"), [
    (_fails, ZeroDivisionError, "no such thing"),
    (lambda given: given["t"], TypeError, "reduce, runs 0 to 4: columns such as"),
    (lambda given: {"t_first": given["t"]}, ValueError, r"'t_first' has shape \(5, 121\)"),
    (lambda given: {"few": [1.0, 2.0]}, ValueError, r"'few' has shape \(2,\).*each of 5 runs"),
    (lambda given: {"odd": [object()] * 5}, ValueError, "type object"),
    (lambda given: {"status": given["run"]}, ValueError, "other names than those of columns there are: status"),
    (lambda given: {"q1_lift": given["run"]}, ValueError, "columns there are: q1_lift"),
    (lambda given: {"control.delta": given["run"]}, ValueError, r"columns there are: control\.delta"),
    ("peak", TypeError, "expected a function of trajectories"),
])  # fmt: skip
def test_what_a_function_may_not_give_is_told(short: Scenario, reduce: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text) as found:
        batch(short, {"control.delta": DELTAS}, reduce=reduce)
    if error is ZeroDivisionError:
        assert found.value.__notes__ == ["in reduce, runs 0 to 4"]


def test_a_function_gives_the_same_columns_every_time(short: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(import_module("springline.runner.sweep.arrays"), "TRAJECTORY_BYTES", 1.0)
    with pytest.raises(ValueError, match=r"columns \['of_.*expected those of the runs before, \['of_0'\]"):
        batch(short, {"control.k1": np.linspace(1, 2, 70)}, reduce=lambda seen: {f"of_{seen['run'][0]}": seen["run"]})


@pytest.mark.parametrize("given", [-1, 1.5, True, "all"])
def test_every_how_many_is_a_whole_number(short: Scenario, given: Any) -> None:
    with pytest.raises(ValueError, match=r"trajectories is .*expected a whole number from 0"):
        batch(short, {"control.delta": DELTAS}, trajectories=given)


def test_more_trajectories_than_memory_holds_are_refused(short: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    arrays = import_module("springline.runner.sweep.arrays")
    many: dict[str, NDArray[Any]] = {"control.delta": np.full(500, 0.05)}
    monkeypatch.setattr(arrays, "memory", lambda: 10_000_000)
    with pytest.raises(InputError, match=r"fewer trajectories.* with 500 trajectories of 121 rows"):
        batch(short, many, trajectories=1)
    last: Callable[[Columns], Any] = lambda seen: {"last": seen["t"][:, -1]}  # noqa: E731
    assert batch(short, many, reduce=last)["last"].to_pylist() == [0.6] * 500
