"""The notebook of `springline init notebook`: what is committed of it, and that all its cells do what it says."""

from __future__ import annotations

import copy
import importlib.util
import os
import re
from importlib.metadata import metadata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

import springline as sl
from springline.runner.cli import app

NEEDED = ("ipykernel", "nbclient", "pandas", "polars")
LINE = 120  # of text, as in all files; code has 80, as it is shown in documentation
OFFLINE = """
import socket

def refused(*arguments, **options):
    raise OSError("nothing of the notebook needs a network")

socket.getaddrinfo = socket.create_connection = refused
"""


@pytest.fixture(scope="module")
def needed() -> None:
    """In CI what executes the notebook is there; elsewhere its absence is said."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        text = f"{', '.join(missing)} not installed: pip install '.[dev]'"
        (pytest.fail if os.environ.get("CI") == "true" else pytest.skip)(text)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The notebook as a user gets it."""
    folder = tmp_path_factory.mktemp("notebook")
    done = CliRunner().invoke(app, ["init", "notebook", "-o", str(folder)], prog_name="springline")
    assert done.exit_code == 0, done.output
    assert done.stdout.splitlines()[-1] == f"next: jupyter lab {folder / 'notebook.ipynb'}"
    return folder / "notebook.ipynb"


@pytest.fixture(scope="module")
def read(needed: None, written: Path) -> Any:
    """The notebook, found to be one by the format's own checker."""
    import nbformat  # noqa: PLC0415

    notebook = nbformat.read(written, as_version=nbformat.NO_CONVERT)
    nbformat.validate(notebook)
    return notebook


def test_the_notebook_is_committed_as_nobody_has_run_it(read: Any, written: Path) -> None:
    import nbformat  # noqa: PLC0415

    assert (read.nbformat, read.nbformat_minor) == (4, 5)
    assert read.metadata == {"language_info": {"name": "python"}}
    assert written.read_text("utf-8") == nbformat.writes(read) + "\n"
    names = [cell.id for cell in read.cells]
    assert len(set(names)) == len(names)
    for cell in read.cells:
        assert re.fullmatch("[a-z][a-z-]+", cell.id), "a name, and not what a program has drawn"
        assert cell.metadata == {}
        longest = max(map(len, cell.source.splitlines()))
        if cell.cell_type == "code":
            assert cell.outputs == [] and cell.execution_count is None
            assert longest <= 80
        else:
            assert longest <= LINE


@pytest.fixture(scope="module")
def executed(read: Any, written: Path) -> dict[str, list[Any]]:
    """What each cell shows, by its name: all cells in a process and a folder of their own, without network."""
    from nbclient import NotebookClient  # noqa: PLC0415
    from nbformat.v4 import new_code_cell  # noqa: PLC0415

    notebook = copy.deepcopy(read)
    notebook.cells.insert(0, new_code_cell(OFFLINE))
    client = NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(written.parent)}}
    )
    # As a user has it: conftest.py has chosen a backend that shows nothing.
    client.execute(env={name: value for name, value in os.environ.items() if name != "MPLBACKEND"})
    cells = [cell for cell in notebook.cells[1:] if cell.cell_type == "code"]
    assert [path.name for path in written.parent.iterdir()] == [written.name]
    return {cell.id: cell.outputs for cell in cells}


def test_no_cell_warns_and_each_shows_something(executed: dict[str, list[Any]]) -> None:
    for name, outputs in executed.items():
        assert outputs, name
        assert not [output.text for output in outputs if output.get("name") == "stderr"], name


def shown(outputs: list[Any], kind: str) -> Any:
    """What a cell shows in one of the formats that a notebook knows."""
    (found,) = (output.data[kind] for output in outputs if kind in output.get("data", {}))
    return found


def printed(outputs: list[Any]) -> str:
    """What a cell prints."""
    return "".join(output.text for output in outputs if output.get("name") == "stdout")


def test_a_run_is_shown_with_its_numbers(executed: dict[str, list[Any]]) -> None:
    result = sl.simulate(sl.load_scenario("paper/nominal"))
    page = shown(executed["simulate"], "text/html")
    settling = result.metrics["settling_time_lift"][0].as_py()
    assert f"<td>settling time</td><td>{settling:.4g} s</td>" in page
    assert 'src="data:image/png;base64,' in page
    force = np.abs(result.trajectory["U_lift"]).max()
    assert printed(executed["pandas"]) == f"largest force of the lift: {force:.4g} N\n"
    assert force < result.metrics["U_max_lift"][0].as_py()
    table = shown(executed["polars"], "text/html")
    assert "<th>e_lift [m]</th>" in table
    rows = re.findall(r"<tr><td>([\d.]+)</td><td>(-?[\d.]+)</td>", table)
    assert [float(t) for t, _ in rows] == result.trajectory["t"].to_pylist()[-3:]
    assert [float(q) for _, q in rows] == pytest.approx(result.trajectory["q1_lift"].to_pylist()[-3:], abs=1e-6)


def test_figures_are_pictures(executed: dict[str, list[Any]]) -> None:
    assert shown(executed["plot"], "image/png").startswith("iVBOR")
    assert shown(executed["draw"], "image/png").startswith("iVBOR")


def test_what_is_said_of_a_thin_boundary_layer_is_computed(executed: dict[str, list[Any]]) -> None:
    nominal = sl.load_scenario("paper/nominal")
    thin = nominal.with_overrides({"control.delta": 0.02})
    message = printed(executed["thin"])
    assert message == f"{sl.simulate(thin).message}\n" and "chattering" in message
    critical = sl.analyze(thin).row("delta_critical")
    assert printed(executed["analyze"]) == f"{critical.text}\n" and critical.text.startswith("unstable")
    answers = sl.analyze(nominal)
    for name in ("period_max", "delay_max"):
        row = answers.row(name)
        assert f"{name} = {row.value:.4g} s: {row.text}\n" in printed(executed["margins"])


def test_the_map_is_what_single_runs_give(executed: dict[str, list[Any]]) -> None:
    """Of the line in it, the text says that runs are calm above it, and a little below."""
    nominal = sl.load_scenario("paper/nominal")
    delta, payload = np.meshgrid(np.linspace(0.01, 0.05, 17), np.linspace(0.7, 1.3, 13))
    keys = {"control.delta": delta.ravel(), "plant.m3.scale": payload.ravel()}
    table = sl.batch(nominal, keys)
    chatter = np.asarray(table["chatter_lift"])
    calm = np.count_nonzero(chatter < 20)
    assert printed(executed["batch"]) == f"{len(chatter)} runs, {calm} of them calm\n"
    for run in (25, 180):
        alone = sl.simulate(nominal.with_overrides({key: column[run] for key, column in keys.items()}))
        assert alone.metrics["chatter_lift"][0].as_py() == chatter[run]
    believed = keys["plant.m3.scale"] == 1.0
    critical = sl.analyze(nominal).row("delta_critical").value
    assert critical is not None
    above = keys["control.delta"] > critical
    assert (chatter[believed & above] < 20).all()
    assert (chatter[believed & (keys["control.delta"] < 0.85 * critical)] > 20).all()


def test_what_it_tells_to_type_exists(read: Any) -> None:
    """Its commands, and the extra that it wants installed."""
    text = "\n".join(cell.source for cell in read.cells if cell.cell_type == "markdown")
    commands = re.findall(r"`springline ([^`]+)`", text)
    assert len(commands) > 6
    for command in commands:
        done = CliRunner().invoke(app, [*command.split(), "--help"], prog_name="springline")
        assert done.exit_code == 0, command
    [extra] = re.findall(r"`pip install 'springline\[(\w+)\]'`", text)
    assert extra in metadata("springline").get_all("Provides-Extra")
