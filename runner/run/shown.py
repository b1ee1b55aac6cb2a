"""A Result as people see it: in a line, and in a notebook with its metrics and a figure."""

from __future__ import annotations

import base64
import html
import math
from typing import TYPE_CHECKING

from springline.codegen.kernel import METRICS
from springline.runner.files import units

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from springline.runner.run.simulated import Simulated
    from springline.runner.scenario import Scenario

_PICTURE = "width: min(100%, 40em); background: white"  # readable on a dark page


def line_of(result: Simulated) -> str:
    """Status, size and message."""
    rows, columns = result.trajectory.num_rows, result.trajectory.num_columns
    return f"Result({result.status}, trajectory of {rows} x {columns}: {result.message})"


def figure_of(scenario: Scenario, result: Simulated, name: str) -> Figure:
    """One of the figures of `run_figures`. Raises ValueError, with those that there are, for an unknown name."""
    from springline.runner.run.figures import run_figures  # noqa: PLC0415 - Matplotlib, which a run by itself spares

    figures = run_figures(scenario, result)
    if name not in figures:
        raise ValueError(f"there is no figure {name!r}, expected one of {', '.join(figures)}")
    return figures[name]


def page_of(scenario: Scenario, result: Simulated) -> str:
    """What a notebook shows: the message, the metrics with their units, one column a joint, and the tracking."""
    from springline.runner.report import figure_files  # noqa: PLC0415 - Matplotlib likewise

    [values], unit = result.metrics.to_pylist(), units(result.metrics)
    joints = [joint.name for joint in scenario.system().joints]
    rows = [["", *joints]]
    for metric in METRICS:
        cells = (_cell(values[f"{metric}_{joint}"], unit[f"{metric}_{joint}"]) for joint in joints)
        rows.append([metric.replace("_tv", " total variation").replace("_", " "), *cells])
    table = "".join(f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    picture = base64.b64encode(
        figure_files("tracking", figure_of(scenario, result, "tracking"))["tracking.png"]
    ).decode()
    return (
        f"<p>{html.escape(result.message)}</p><table>{table}</table>"
        f'<img alt="tracking" style="{_PICTURE}" src="data:image/png;base64,{picture}">'
    )


def _cell(value: float | None, unit: str) -> str:
    if value is None or math.isnan(value):
        return "–"
    return f"{value:.4g} {unit}".rstrip() if unit != "1" else f"{value:.4g}"
