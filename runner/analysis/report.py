"""The report of an analysis: verdicts, tables and figures in one folder."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from springline.codegen.files import canonical_json, write_tree
from springline.runner.analysis.analysis import Analysis, mode_text
from springline.runner.analysis.boundary_layer import delta_critical
from springline.runner.analysis.continuous import spectrum
from springline.runner.analysis.figures import figures
from springline.runner.analysis.limit_cycle import limit_cycle
from springline.runner.analysis.modes import time_scales
from springline.runner.analysis.reaching import LawCurves, law_curves
from springline.runner.analysis.sensitivity import Sensitivities, sensitivities
from springline.runner.report import (
    Block,
    Bullets,
    Document,
    Heading,
    Picture,
    Table,
    Text,
    figure_files,
    figure_text,
    house_style,
    provenance,
    shown_name,
    to_html,
    to_markdown,
    unit_text,
)
from springline.runner.scenario import Scenario
from springline.runner.version import __version__

Floats = NDArray[np.float64]

REPORT = "report.html"
_KIND = "analysis"
_SHOWN = {
    "delta_critical": "spectrum",
    "floquet_exponent": "reference",
    "gain_margin": "channels",
    "phase_margin": "channels",
}
"""The figure that shows a verdict, and its joints' verdicts."""
_WORDS = {True: "[[holds]]", False: "[[fails]]", None: "–"}


@dataclass(frozen=True, slots=True)
class Chatter:
    """The limit cycle that is predicted of a law: how its control runs, amplitude of sigma, and frequency, rad/s."""

    law: str
    control: str
    amplitude: float
    frequency: float


def write_report(found: Analysis, folder: Path, *, force: bool = False) -> Path:
    """Write report.html, report.md, analysis.json and figures/ to `folder`; the path of the report.

    force  replace files that were edited since
    Raises FolderConflict if something else is in the way; nothing is written then. Runs the sensitivities' batch.
    """
    scenario = found.scenario
    curves = law_curves(scenario, _start(scenario))
    chatter = _chatter(scenario, found, list(curves))
    moved = sensitivities(scenario, _boundary(found))
    files: dict[str, bytes] = {}
    pictures: list[Block] = []
    with house_style():
        for name, caption, figure in figures(found, curves, moved):
            drawn = figure_files(name, figure)
            files |= {f"figures/{file}": content for file, content in drawn.items()}
            pictures.append(Picture(f"figures/{name}", drawn[f"{name}.svg"], caption))
    document = _document(found, curves, chatter, moved, pictures)
    files["report.md"] = to_markdown(document).encode()
    files[REPORT] = to_html(document).encode()
    rows = [row.plain() for row in found.rows]
    units = {row.name: row.unit for row in found.rows}
    answer = {"command": "analyze", "version": __version__, "status": found.status, "rows": rows, "units": units}
    files["analysis.json"] = canonical_json(answer | {"notes": list(found.notes)})
    files["scenario.toml"] = scenario.to_toml(folder).encode()
    write_tree(folder, files, {"kind": _KIND}, force=force)
    return folder / REPORT


def _start(scenario: Scenario) -> Floats:
    """sigma of each joint at the start; nothing where there is no sliding variable."""
    system, values = scenario.system(), scenario.values()
    rows = [table.row(0.0) for table in scenario.tables()]
    d = np.concatenate([np.zeros(0), *rows])
    w = system.function("signals")(0.0, d, values)
    x = system.function("start")(0.0, d, values)
    memory = [np.array(system.z_start)] if system.memory else []
    return np.asarray(system.function("loop_error")(w, x, *memory, values)[1].full().ravel(), dtype=np.float64)


def _boundary(found: Analysis) -> Callable[[dict[str, Floats]], Floats] | None:
    """The smallest stable delta of columns of numbers, where there is one; at the point that decides it."""
    if found.row("delta_critical").value is None:
        return None
    at = delta_critical(found.scenario, found.scenario.sigma_amplitude)[0].at
    times = None if at is None else [at]

    def boundary(columns: dict[str, Floats]) -> Floats:
        items = delta_critical(found.scenario, found.scenario.sigma_amplitude, times=times, columns=columns)
        return np.array([math.nan if item.value is None else item.value for item in items])

    return boundary


def _chatter(scenario: Scenario, found: Analysis, names: Sequence[str]) -> list[Chatter]:
    """What each law is predicted to do, as the scenario's control runs and, where that is continuous, sampled too."""
    ways: list[tuple[str, dict[str, object]]] = [("as it is", {})]
    largest = found.row("period_max").value
    if not scenario.control_every and largest is not None:
        period = round(largest / 2 / scenario.step) * scenario.step
        if period > 0:
            ways.append((f"sampled at {period:.3g} s", {"control.mode": "sampled", "control.period": period}))
    worst = int(spectrum(found.loop).real.max(axis=-1)[0].argmax())
    times = [float(found.loop.times[worst])]
    result = []
    for name in names:
        for words, changes in ways:
            cycle = limit_cycle(scenario.with_overrides({"control.law": name, **changes}), times=times)
            size = math.nan if cycle.amplitude is None else float(cycle.amplitude.max())
            frequency = math.nan if cycle.frequency is None else cycle.frequency
            result.append(Chatter(name, words, size, frequency))
    return result


def _shown(value: float | None) -> str:
    return "–" if value is None else figure_text(value, 3)


def _figure_of(name: str, pictures: Sequence[Block]) -> str:
    """Where a verdict is drawn, by its figure's caption; "" where none shows it."""
    for verdict, figure in _SHOWN.items():
        if name == verdict or name.startswith(f"{verdict}_"):
            for picture in pictures:
                if isinstance(picture, Picture) and picture.path == f"figures/{figure}":
                    return f". Figure: {picture.caption.split('**')[1].rstrip('.')}"
    return ""


def _document(
    found: Analysis,
    curves: Mapping[str, LawCurves],
    chatter: Sequence[Chatter],
    moved: Sensitivities,
    pictures: Sequence[Block],
) -> Document:
    scenario, joints = found.scenario, found.scenario.system().joints
    confirmed = any(row.confirmed is not None for row in found.rows)
    columns = ["", "", "value", *(["runs"] if confirmed else []), "unit", ""]
    verdicts = []
    for row in found.rows:
        runs = [_shown(row.confirmed)] if confirmed else []
        text = row.text.rstrip(".") + _figure_of(row.name, pictures)
        verdicts.append([f"`{row.name}`", _WORDS[row.ok], _shown(row.value), *runs, unit_text(row.unit), text])
    blocks: list[Block] = [
        Heading("Verdicts"),
        Table(columns, verdicts, labels=2, words=(len(columns) - 2, len(columns) - 1)),
        Bullets([*found.notes, *scenario.warnings]),
    ]
    if found.loop.elastic:
        scales = time_scales(found.loop)
        modes = np.concatenate([scales.fast_free[0], scales.fast_alone[0], scales.fast_composite[0]], axis=-1)
        points = [
            (f"{t:.3g}", _shown(slow), *(mode_text(mode).replace("-", "−") for mode in row))
            for t, slow, row in list(zip(found.loop.times, scales.slow_bandwidth[0], modes, strict=True))[::4]
        ]
        names = [f"{what}, {k + 1}" for what in ("free", "fast control", "closed loop") for k in range(len(joints))]
        text = """Slow bandwidth and the springs' modes [1/s] at points of the reference: without fast control, with it,
            and in the closed loop."""
        blocks += [
            Heading("Time scales"),
            Text(" ".join(text.split())),
            Table(["t [s]", "slow", *names], points),
        ]
    if found.proof is not None:
        proof = found.proof
        measured = [
            (
                joint.name,
                *map(_shown, (proof.disturbed.per_joint[i], proof.ringing[i], proof.margin.per_joint[i])),
                *map(_shown, (proof.residual[i], proof.remaining[i], proof.bounds.sliding[i], proof.bounds.total[i])),
            )
            for i, joint in enumerate(joints)
        ]
        heads = ["joint", "largest |d|", "|d| at the start", "largest |H⁻¹S|", "residual |σ|", "largest |σ|"]
        caption = (
            "d = σ̇ − law(σ) is what the law has to overcome; its largest size is that after the first quarter of the "
            "run, that of σ is of the second half. t_smax bounds the sliding phase, t_a both."
        )
        blocks += [
            Heading("The proof"),
            Table([*heads, "t_smax [s]", "t_a [s]"], measured, caption),
            Text("Where the proof does not reach this run:"),
            Bullets([f"{gap.value}." for gap in proof.gaps]),
        ]
    if curves:
        compared = [
            (
                curve.title,
                *(_shown(value) for value in curve.reaching_time),
                *(_shown(value) for item in chatter if item.law == name for value in (item.amplitude, item.frequency)),
            )
            for name, curve in curves.items()
        ]
        ways = list(dict.fromkeys(item.control for item in chatter))
        heads = [f"{joint.name}: σ(0) to 1 % [s]" for joint in joints]
        heads += [f"{what}, {way}" for way in ways for what in ("σ of its limit cycle", "[rad/s]")]
        blocks += [
            Heading("Reaching laws"),
            Table(["law", *heads], compared, "–: no limit cycle above 10⁻⁶ is predicted."),
        ]
    if moved.keys:
        keys = scenario.numeric_keys()
        heads = ["parameter", "[unit]"]
        heads += [f"{effect.title}, {way}" for effect in moved.effects for way in ("10 % less", "10 % more")]
        changed = [
            (
                f"`{key}`",
                unit_text(keys[key].unit),
                *(_shown(float(side[k])) for effect in moved.effects for side in (effect.low, effect.high)),
            )
            for k, key in enumerate(moved.keys)
        ]
        now = "; ".join(
            f"{item.title} {_shown(item.nominal)} {unit_text(item.unit)}".rstrip() for item in moved.effects
        )
        blocks += [Heading("Sensitivities"), Table(heads, changed, f"As it is: {now}.", labels=2)]
    blocks += [Heading("Figures"), *pictures]
    subtitle = (
        f"{shown_name(scenario)}, analysed by springline {__version__} from its linearised equations and its proof."
    )
    return Document("What the design can do", subtitle, [*blocks, *provenance(scenario)])
