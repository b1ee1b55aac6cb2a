"""Figures: which there are, that they can be read, and that they are the same bytes every time."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from springline.model.control import CONTROLLERS, ArmModel, Control, Controller
from springline.model.parameters import Values
from springline.runner.report import figure_files, house_style
from springline.runner.run import Result, run_figures, simulate
from springline.runner.scenario import Scenario, load_scenario

ALWAYS = {"tracking", "error", "phase_plane", "sliding", "force", "springs", "tip"}

Run = tuple[Scenario, Result]


def simulated(name: str, **overrides: object) -> Run:
    scenario = load_scenario(name, {key.replace("__", "."): value for key, value in overrides.items()})
    return scenario, simulate(scenario)


@pytest.fixture(scope="module")
def at_rest() -> Run:
    return simulated("paper/nominal", simulation__duration=0.5)


@pytest.fixture(scope="module")
def at_sea() -> Run:
    return simulated("ship/vessel_10hz", simulation__duration=2.0)


@pytest.fixture(scope="module")
def diverged() -> Run:
    return simulated("paper/nominal", control__fast=False)


def test_figures_of_a_run(at_rest: Run) -> None:
    assert set(run_figures(*at_rest)) == ALWAYS


def test_what_a_run_does_not_have_has_no_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    rigid = simulated("paper/nominal", simulation__duration=0.1, drive__kind="rigid")
    assert set(run_figures(*rigid)) == ALWAYS - {"springs"}

    class Proportional(Controller):
        def control(self, r: Values, y: Values, z: Values, model: ArmModel, p: Values) -> Control:
            return Control(1e3 * (r.q - y.q1) - 1e2 * y.dq1, r.q - y.q1)

    monkeypatch.setitem(CONTROLLERS, "proportional", Proportional())
    run = simulated("paper/nominal", simulation__duration=0.1, control__controller="proportional")
    assert set(run_figures(*run)) == ALWAYS - {"sliding", "phase_plane"}


def test_a_recorded_base_motion_is_set_against_the_error(at_sea: Run) -> None:
    figures = run_figures(*at_sea)
    assert set(figures) == ALWAYS | {"base_motion", "error_over_base", "error_against_base"}
    assert [axes.get_ylabel() for axes in figures["base_motion"].axes] == [
        "heave [m]", "pitch [mrad]", "roll [mrad]", "surge [m]", "sway [m]", "yaw [mrad]",
    ]  # fmt: skip
    assert len(figures["error_against_base"].axes) == 2 * 6


def test_forces_on_the_links_are_seen_against_none() -> None:
    """On those joints that any acts on; what does not change is seen by its size, too."""
    quiet = {"disturbance__kind": "sine", "simulation__duration": 0.1}
    assert "disturbance" not in run_figures(*simulated("paper/nominal", **quiet))
    steady = simulated("paper/nominal", **quiet, disturbance__lift={"offset": 1500.0, "terms": []})
    (axes,) = run_figures(*steady)["disturbance"].axes
    assert axes.get_ylabel() == "lift\ndisturbance $F_d$ [N]"
    low, high = axes.get_ylim()
    assert low < 0.0 and high > 1500.0
    assert [line.get_label() for line in axes.lines] == ["no force", "force, positive along +q₁"]
    both = {"lift": {"offset": 0.0, "terms": [{"amplitude": 9.0, "omega": 8.0}]}, "rotation": {"offset": -3.0}}
    run = simulated("paper/nominal", **quiet, **{f"disturbance__{joint}": table for joint, table in both.items()})
    upper, lower = run_figures(*run)["disturbance"].axes
    assert np.array_equal(upper.lines[1].get_ydata(), run[1].trajectory["disturbance_lift"].to_numpy())
    assert lower.get_ylabel() == "rotation\ndisturbance $F_d$ [N · m]" and lower.get_ylim()[0] < -3.0


def test_a_run_that_stopped_says_so_and_when(diverged: Run) -> None:
    figures = run_figures(*diverged)
    assert set(figures) == ALWAYS
    end = diverged[1].metrics["t_end"][0].as_py()
    for figure in figures.values():
        assert f"out of bounds at {end:g} s" in legend_names(figure)


def test_a_run_that_starts_on_its_reference_has_no_bands() -> None:
    figures = run_figures(*simulated("paper/nominal", simulation__duration=0.1, initial__q=[0.0, 1.0]))
    assert not any("|e(0)|" in name for name in legend_names(figures["error"]))


def test_tracking_shows_link_and_reference(at_rest: Run) -> None:
    scenario, result = at_rest
    start, whole = run_figures(scenario, result)["tracking"].axes[:2]
    assert start.get_title() == "the first 0.375 s" and whole.get_title() == "the whole run"
    lift = whole
    drawn = {line.get_label(): line.get_ydata() for line in lift.lines}
    assert np.array_equal(drawn["link q₁"], result.trajectory["q1_lift"].to_numpy())
    assert np.array_equal(drawn["reference"], result.trajectory["q1d_lift"].to_numpy())


def test_what_is_left_of_the_error_has_a_scale_of_its_own(at_rest: Run) -> None:
    """In the unit that suits it; the start does not fix the scale."""
    start, rest = run_figures(*at_rest)["error"].axes[:2]
    assert start.get_ylabel() == "lift\nerror e [m]" and rest.get_ylabel() == "error e [mm]"
    assert start.get_ylim()[0] < -0.79 and rest.get_ylim()[0] > -1e-2
    worst = at_rest[1].metrics["steady_state_error_lift"][0].as_py()
    limits = [line.get_ydata()[0] for line in rest.lines if line.get_label() == "± steady-state error"]
    assert limits == [-worst, worst]
    assert all(text.get_text() == "" or "e" not in text.get_text() for text in rest.yaxis.get_ticklabels())


def test_the_surface_is_where_sigma_is_zero(at_rest: Run) -> None:
    """It is drawn where error and rate alone decide sigma; once there, the run stays on it."""
    axes = run_figures(*at_rest)["phase_plane"].axes[0]
    (surface,) = axes.collections[-1].get_paths()
    run = next(line for line in axes.lines if line.get_label() == "run")
    e, de = run.get_xdata(), run.get_ydata()
    assert (e[0], de[0]) == pytest.approx((-0.8, np.pi))
    order = np.argsort(surface.vertices[:, 0])
    near = np.interp(e, *surface.vertices[order].T)
    late = (np.abs(e) < 0.1) & (np.abs(e) > 0.02)
    assert late.sum() > 20 and np.max(np.abs(near - de)[late]) < 0.05


def legend_names(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


@pytest.mark.parametrize("run", ["at_rest", "at_sea", "diverged"])
def test_every_figure_can_be_read(run: str, request: pytest.FixtureRequest) -> None:
    """Units on the axes, no word beyond the edge, no legend over data."""
    for name, figure in run_figures(*request.getfixturevalue(run)).items():
        with house_style():
            figure.draw_without_rendering()
        page = figure.bbox.padded(1.0)
        bottom = [axes for axes in figure.axes if axes.get_xlabel()]
        assert bottom and all("[" in axes.get_xlabel() for axes in bottom), name
        left = [axes for axes in figure.axes if axes.get_ylabel()]
        assert left and all("[" in axes.get_ylabel() for axes in left), name
        for axes in figure.axes:
            for word in (axes.xaxis.label, axes.yaxis.label):
                box = word.get_window_extent()
                assert page.containsx(box.x0) and page.containsx(box.x1), (name, word)
                assert page.containsy(box.y0) and page.containsy(box.y1), (name, word)
            for legend in figure.legends:
                box = legend.get_window_extent()
                assert page.containsx(box.x0) and page.containsx(box.x1), name
                assert not box.overlaps(axes.get_window_extent()), name


def test_the_same_run_gives_the_same_bytes_whatever_the_users_settings(at_rest: Run) -> None:
    def tracking() -> dict[str, bytes]:
        return figure_files("tracking", run_figures(*at_rest)["tracking"])

    first = tracking()
    with mpl.rc_context({"font.size": 30, "lines.linewidth": 9, "svg.hashsalt": "other", "text.color": "red"}):
        assert tracking() == first
        assert mpl.rcParams["font.size"] == 30
    assert first["tracking.png"].startswith(b"\x89PNG")
    assert b"<svg" in first["tracking.svg"] and b"dc:date" not in first["tracking.svg"]


def test_bands_are_named_as_they_are_read() -> None:
    """What a sweep draws has sixteen digits; a legend has four, with a prefix."""
    scenario = load_scenario("paper/nominal", {
        "simulation.duration": 0.5, "simulation.settling_error": 0.09340437, "simulation.response_band": 0.27071234,
    })  # fmt: skip
    figure = run_figures(scenario, simulate(scenario))["error"]
    names = {text.get_text() for legend in figure.legends for text in legend.get_texts()}
    assert {"±27.07 % of |e(0)|", "±93.4 mm", "±93.4 mrad"} <= names
