"""The report of a run: what was run, what came of it in words and numbers, and its figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from springline.codegen.kernel import CHATTERING, chatters
from springline.model.metrics import METRICS
from springline.model.parameters import Joint
from springline.model.quantities import Q1, Q2, SIGMA, U_CMD, E, U
from springline.runner.files import numpy_array, units
from springline.runner.report import (
    Block,
    Document,
    Heading,
    Picture,
    Table,
    Text,
    described,
    figure_text,
    provenance,
    quantity_text,
    shown_name,
    to_html,
)
from springline.runner.run.simulated import Simulated
from springline.runner.run.trajectory_hash import trajectory_hash
from springline.runner.scenario import Scenario
from springline.runner.version import __version__

Floats = NDArray[np.float64]

REPORT = "report.html"
_AT_LIMIT = 1.0 - 1e-9


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is to be said of a run in one respect: whose it is, in a word, and in a sentence.

    word  "" where a number is told that is neither good nor bad
    """

    what: str
    word: str
    text: str


def verdicts(scenario: Scenario, result: Simulated) -> list[Verdict]:
    """How the run ended, whether each joint settled, whether commands chatter, which limits were reached, how far the
    springs gave.
    """
    run = _Numbers(scenario, result)
    found = [_end(run)]
    found += [_settling(run, joint) for joint in run.joints]
    found += [_chatter(run, joint) for joint in run.joints if result.status == "ok"]
    found += [item for joint in run.joints for item in _motor_limit(run, joint)]
    found += [item for k, joint in enumerate(run.joints) for item in _law_limit(run, k, joint)]
    found += [_joint_limit(run, joint, pair) for joint, pair in zip(run.joints, scenario.limits, strict=False)]
    found += [_spring(run, joint) for joint in run.joints if Q2 in scenario.system().columns]
    return found


def report_files(
    scenario: Scenario, result: Simulated, *, plot: bool = True, progress: Callable[[float], None] | None = None
) -> dict[str, bytes]:
    """report.html and figures/ of a run, by path. The same run gives the same bytes.

    plot      whether there are figures; without them the report has no section for them
    progress  called with the share of the figures that is drawn
    """
    files: dict[str, bytes] = {}
    pictures: list[Picture] = []
    if plot:
        from springline.runner.report import figure_files  # noqa: PLC0415 - Matplotlib, which a run without figures spares
        from springline.runner.run.figures import drawn_figures  # noqa: PLC0415 - likewise

        figures = drawn_figures(scenario, result)
        for name, drawn in figures.items():
            made = figure_files(f"figures/{name}", drawn.figure)
            files |= made
            pictures.append(Picture(f"figures/{name}", made[f"figures/{name}.svg"], drawn.caption))
            if progress is not None:
                progress(len(pictures) / len(figures))
    files[REPORT] = to_html(_document(scenario, result, pictures)).encode()
    return files


def _document(scenario: Scenario, result: Simulated, pictures: Sequence[Picture]) -> Document:
    words = [(v.what, f"[[{v.word}]]" if v.word else "", v.text) for v in verdicts(scenario, result)]
    blocks: list[Block] = [
        Heading("What was run"),
        described(scenario),
        Heading("What came of it"),
        Table(("", "", ""), words, labels=3),
        *(Text(f"**Note:** {note}") for note in scenario.warnings),
        Heading("Numbers"),
        _metrics(scenario, result),
    ]
    blocks += [Heading("Figures"), *pictures] if pictures else []
    rows = str(result.trajectory.num_rows)
    blocks += provenance(
        scenario,
        [("rows of the trajectory", rows), ("SHA-256 of their bits", f"`{trajectory_hash(result.trajectory)}`")],
    )
    subtitle = f"{_outcome(result)} Simulated by springline {__version__}."
    return Document(f"A run of {shown_name(scenario)}", subtitle, blocks)


class _Numbers:
    """A run's columns and metrics."""

    def __init__(self, scenario: Scenario, result: Simulated) -> None:
        self.scenario, self.result = scenario, result
        self.joints = scenario.system().joints
        self.end = float(result.trajectory["t"][-1].as_py())
        self._table: pa.Table = result.trajectory
        self._metrics: Mapping[str, Any] = result.metrics.to_pylist()[0]

    def __getitem__(self, column: str) -> Floats:
        return numpy_array(self._table[column])

    def metric(self, name: str, joint: Joint) -> float | None:
        value: float | None = self._metrics[f"{name}_{joint.name}"]
        return value


def _end(run: _Numbers) -> Verdict:
    status = run.result.status
    text = f"It came to its end, {quantity_text(run.end, 's')}." if status == "ok" else _outcome(run.result)
    return Verdict("the run", status.replace("_", " "), text)


def _outcome(result: Simulated) -> str:
    """How a run ended, as a sentence."""
    said = result.message if result.status == "ok" else f"stopped: {result.message.partition(': ')[2]}"
    return f"{said[0].upper()}{said[1:]}.".replace("<=", "≤")


def _settling(run: _Numbers, joint: Joint) -> Verdict:
    """Whether and when a joint's error comes into its band to stay."""
    scenario = run.scenario
    start = abs(float(run[f"{E.name}_{joint.name}"][0]))
    if scenario.settling_error:
        band, of = scenario.settling_error, ""
    else:
        band, of = scenario.settling_band * start, f" ({100 * scenario.settling_band:.4g} % of its initial error)"
    size = f"{quantity_text(band, joint.unit)}{of}"
    at = run.metric("settling_time", joint)
    what = f"{joint.name}: error"
    if run.result.status != "ok":
        return Verdict(what, "not settled", f"What it would have come to is not known; its band is {size}.")
    if not band:
        return Verdict(what, "", "It starts on its reference, and a band that is a share of the initial error is none.")
    left = run.metric("steady_state_error", joint)
    rest = "" if left is None else f" In the last quarter it is {quantity_text(left, joint.unit)} at most."
    if at is None:
        return Verdict(what, "not settled", f"It is outside of {size} as late as in the last 2 % of the run.{rest}")
    if at == 0.0:
        first = "the first step" if start > band else "the start"
        return Verdict(what, "settled", f"It is within {size} from {first} on.{rest}")
    return Verdict(what, "settled", f"It is within {size} from {quantity_text(at, 's')} on.{rest}")


def _chatter(run: _Numbers, joint: Joint) -> Verdict:
    value = run.metric("chatter", joint)
    if value is None:
        return Verdict(f"{joint.name}: command", "", "Whether it chatters is not known.")
    text = (
        f"In the second half it varies by {figure_text(value, 3)} times its range in a second; calm is up to "
        f"{CHATTERING:g}."
    )
    return Verdict(f"{joint.name}: command", "chatters" if chatters(np.array(value), run.end) else "calm", text)


def _motor_limit(run: _Numbers, joint: Joint) -> list[Verdict]:
    """For what share of the rows a finite U_max limits the command."""
    limits = dict(zip(run.joints, run.scenario.document["control"]["U_max"], strict=True))
    limit = float(limits[joint])
    if math.isinf(limit):
        return []
    commanded = U_CMD if U_CMD in run.scenario.system().columns else U
    size = np.abs(run[f"{commanded.name}_{joint.name}"])
    name = f"{joint.name}: U_max"
    return [_reached(name, float(np.mean(size >= _AT_LIMIT * limit)), size.max(), limit, joint.force)]


def _law_limit(run: _Numbers, k: int, joint: Joint) -> list[Verdict]:
    """For what share of the rows a finite a_max limits the reaching law, where that sees the state as it is."""
    system = run.scenario.system()
    law = system.controller.law
    limit = float(run.scenario.document["control"]["a_max"][k])
    if law is None or SIGMA not in system.columns or system.judges or math.isinf(limit):
        return []
    sigma = run[f"{SIGMA.name}_{joint.name}"]
    wished = system.function(f"law_{law.name}")(sigma[None, :], run.scenario.values())
    size = np.abs(np.asarray(wished)).ravel()
    share = float(np.mean(size >= _AT_LIMIT * limit))
    return [_reached(f"{joint.name}: a_max", share, float(size.max()), limit, f"{joint.unit}/s^2")]


def _reached(what: str, share: float, largest: float, limit: float, unit: str) -> Verdict:
    shown = quantity_text(limit, unit)
    if not share:
        return Verdict(what, "", f"The limit of {shown} is never reached: {quantity_text(largest, unit)} at most.")
    part = f"{figure_text(100 * share, 2)} %"
    return Verdict(what, "at its limit", f"The limit of {shown} is reached in {part} of the rows.")


def _joint_limit(run: _Numbers, joint: Joint, pair: tuple[float, float]) -> Verdict:
    q = run[f"{Q1.name}_{joint.name}"]
    margin = float(min((q - pair[0]).min(), (pair[1] - q).min()))
    if math.isinf(margin):
        return Verdict(f"{joint.name}: travel", "", "It has no limit.")
    return Verdict(
        f"{joint.name}: travel", "", f"It comes as near as {quantity_text(margin, joint.unit)} to its limit."
    )


def _spring(run: _Numbers, joint: Joint) -> Verdict:
    deflection = run[f"{Q2.name}_{joint.name}"] - run[f"{Q1.name}_{joint.name}"]
    at = int(np.argmax(np.abs(deflection)))
    size = quantity_text(abs(float(deflection[at])), joint.unit)
    when = quantity_text(float(run["t"][at]), "s")
    return Verdict(f"{joint.name}: spring", "", f"It gives {size} at most, at {when}.")


def _metrics(scenario: Scenario, result: Simulated) -> Table:
    """The metrics, a row each and a column a joint."""
    joints, unit = scenario.system().joints, units(result.metrics)
    found: Mapping[str, Any] = result.metrics.to_pylist()[0]
    rows = []
    for metric in METRICS:
        columns = [f"{metric.name}_{joint.name}" for joint in joints]
        rows.append(
            (
                f"`{metric.name}`",
                *(quantity_text(found[c], unit[c]) for c in columns),
                metric.meaning.replace("^2", "²"),
            )
        )
    heads = ("", *(joint.name for joint in joints), "what it is")
    caption = "Bands are shares of the initial error unless they are absolute. –: there is no such number."
    return Table(heads, rows, caption, words=(len(joints) + 1,))
