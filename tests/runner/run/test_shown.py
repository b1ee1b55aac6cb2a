"""A run's result and tables as people see them: in a line, in a notebook, as pandas and Polars have them."""

from __future__ import annotations

import struct
import sys
from typing import Any

import pytest
from matplotlib.figure import Figure

import springline as sl


@pytest.fixture(scope="module")
def result() -> Any:
    return sl.simulate(sl.load_scenario("paper/nominal", {"simulation.duration": 0.5}))


def test_a_result_is_one_line(result: Any) -> None:
    rows, columns = result.trajectory.shape
    assert repr(result) == f"Result(ok, trajectory of {rows} x {columns}: {result.message})"


def test_a_notebook_shows_metrics_with_units_and_a_figure(result: Any) -> None:
    page = result._repr_html_()
    assert "<td>lift</td><td>rotation</td>" in page
    assert f"<td>rms error</td><td>{result.metrics['rms_error_lift'][0].as_py():.4g} m</td>" in page
    assert "<td>settling time</td>" in page
    assert 'src="data:image/png;base64,' in page
    assert "http" not in page


def test_figures_by_name(result: Any) -> None:
    assert isinstance(result.plot(), Figure)
    assert isinstance(result.plot("springs"), Figure)
    picture, size = result.plot()._repr_png_()
    assert picture.startswith(b"\x89PNG") and size["width"] > 500
    assert struct.unpack(">II", picture[16:24]) == (2 * size["width"], 2 * size["height"])
    with pytest.raises(ValueError, match=r"there is no figure 'tip_', expected one of tracking, error"):
        result.plot("tip_")


def test_units_stay_with_pandas(result: Any) -> None:
    pytest.importorskip("pandas")
    frame = result.to_pandas()
    assert list(frame.columns) == result.trajectory.column_names
    assert frame.attrs["units"]["q1_lift"] == "m"
    assert frame["e_rotation"].to_list() == result.trajectory["e_rotation"].to_pylist()
    table = sl.batch(sl.load_scenario("paper/nominal", {"simulation.duration": 0.1}), {"plant.m3": [38.0, 42.0]})
    assert sl.to_pandas(table).attrs["units"]["plant.m3"] == "kg"


def test_units_stay_with_polars(result: Any) -> None:
    pytest.importorskip("polars")
    frame = result.to_polars()
    assert frame.shape == result.trajectory.shape
    assert frame["q1_lift [m]"].to_list() == result.trajectory["q1_lift"].to_pylist()
    assert "status" in sl.to_polars(result.metrics).columns


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_what_is_missing_is_named(result: Any, library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ImportError, match=f"pip install {library}"):
        getattr(result, f"to_{library}")()
