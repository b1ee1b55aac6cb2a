"""Figures of an analysis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from springline.runner.analysis.analysis import Analysis
from springline.runner.analysis.continuous import growth
from springline.runner.analysis.loop import linear_loop
from springline.runner.analysis.reaching import AMPLITUDES, LawCurves
from springline.runner.analysis.sampled import cut, rates_of
from springline.runner.analysis.sensitivity import Sensitivities
from springline.runner.report import COLUMN, LINES, PAGE, label, legend_above, panels

Floats = NDArray[np.float64]

_MOST_BARS = 10
_GIVEN: Mapping[str, Any] = {"color": "0.25", "linewidth": 0.9, "linestyle": (0, (1, 1.5))}
_LIMIT: Mapping[str, Any] = {"color": "0.25", "linewidth": 0.9, "linestyle": (0, (4, 2))}
_LAYERS = 61


def spectrum_by_delta(found: Analysis) -> Figure | None:
    """Largest real part of the loop's eigenvalues against delta, at three amplitudes; None without a delta."""
    row, key = found.row("delta_critical"), "control.delta"
    keys = found.scenario.numeric_keys()
    if row.value is None or key not in keys:
        return None
    given = float(found.scenario.value_of(key))  # type: ignore[arg-type] # a number
    low, high = min(row.value, given or row.value) / 4, max(row.value, given) * 4
    layers = np.geomspace(low, high, _LAYERS)
    figure, grid = panels(width=COLUMN, height=2.0)
    axes = grid[0, 0]
    amplitudes = sorted({AMPLITUDES[0], found.scenario.sigma_amplitude, AMPLITUDES[1]})
    for line, amplitude in zip(LINES, amplitudes, strict=False):
        rates = growth(linear_loop(found.scenario, amplitude, columns={key: layers}))
        axes.plot(layers, rates, label=f"σ amplitude {amplitude:g}", **line)
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.axvline(row.value, label="smallest stable δ", **_LIMIT)
    if given:
        axes.axvline(given, label="δ of the scenario", **_GIVEN)
    axes.set_xscale("log")
    axes.set_xlabel(f"δ [{row.unit}]")
    axes.set_ylabel(label("largest real part", "1/s"))
    _ticks(axes, layers)
    legend_above(figure)
    return figure


def _ticks(axes: Axes, values: Floats) -> None:
    """Plain numbers 1, 2, 5 of each decade along a logarithmic axis."""
    decades = range(int(np.floor(np.log10(values[0]))), int(np.ceil(np.log10(values[-1]))) + 1)
    ticks = [m * 10.0**d for d in decades for m in (1, 2, 5) if values[0] <= m * 10.0**d <= values[-1]]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()


def along_reference(found: Analysis) -> Figure:
    """How fast the least stable mode dies out along the reference; with ranges, the most and the least of them."""
    figure, grid = panels(width=COLUMN, height=1.8)
    axes = grid[0, 0]
    opened = cut(found.loop)
    values = np.linalg.eigvals(opened.closed[0])
    if opened.period is None:
        rates = values.real.max(axis=-1)
    else:
        rates = np.log(np.maximum(np.abs(values), 1e-300)).max(axis=-1) / opened.period
    axes.plot(found.loop.times, rates, label="least stable mode", **LINES[0])
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set_xlabel(label("time along the reference", "s"))
    axes.set_ylabel(label("growth rate", "1/s"))
    low, high = min(float(rates.min()), 0.0), max(float(rates.max()), 0.0)
    axes.set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    return figure


def channels(found: Analysis) -> Figure:
    """The loop's response cut at each motor's channel: its size, and its phase beyond the critical one."""
    loop, opened = found.loop, cut(found.loop)
    joints = found.scenario.system().joints
    time = int(rates_of(loop)[0].argmax())
    f, g, c = (np.asarray(item[0, time]) for item in (opened.F, opened.G, opened.C))
    poles = np.linalg.eigvals(f + g @ c).astype(complex)
    if opened.period is not None:
        poles = np.log(np.where(np.abs(poles) > 0.0, poles, 1e-300)) / opened.period
    sizes = np.abs(poles[np.abs(poles) > 1e-6])
    highest = 10 * float(sizes.max()) if opened.period is None else np.pi / opened.period
    omega = np.geomspace(max(float(sizes.min()) / 10, highest * 1e-5), highest, 1500)
    figure, grid = panels(2, 1, width=COLUMN, height=1.6)
    for joint, line in zip(range(loop.n), LINES * loop.n, strict=False):
        others = [k for k in range(loop.n) if k != joint]
        inner = f + g[:, others] @ c[others]
        point = 1j * omega if opened.period is None else np.exp(1j * omega * opened.period)
        matrix = point[:, None, None] * np.eye(len(f)) - inner
        response = -(c[[joint]] @ np.linalg.solve(matrix, np.broadcast_to(g[:, [joint]], (len(omega), len(f), 1))))
        response = response[:, 0, 0]
        phase = np.degrees(np.angle(response)) % 360.0 - 360.0
        phase[1:][np.abs(np.diff(phase)) > 180.0] = np.nan  # no line across the page where it comes round
        grid[0, 0].plot(omega, np.abs(response), label=joints[joint].name, **line)
        grid[1, 0].plot(omega, phase, **line)
    grid[0, 0].axhline(1.0, color="black", linewidth=0.6)
    grid[0, 0].set_yscale("log")
    grid[0, 0].set_ylabel("|L|")
    grid[1, 0].axhline(-180.0, color="black", linewidth=0.6)
    grid[1, 0].set_ylim(-360.0, 0.0)
    grid[1, 0].set_yticks([-360, -270, -180, -90, 0])
    for axes in grid[:, 0]:
        axes.minorticks_off()
    grid[1, 0].set_ylabel("phase of L [degrees]")
    grid[1, 0].set_xlabel(label("frequency", "rad/s"))
    grid[1, 0].set_xscale("log")
    legend_above(figure)
    return figure


def laws(found: Analysis, curves: Mapping[str, LawCurves]) -> Figure | None:
    """Rate against sigma, and equivalent gain against amplitude, of every law; None without one."""
    if not curves:
        return None
    own = found.scenario.structure().law
    figure, grid = panels(1, 2, width=PAGE, height=2.0, share_x=False)
    order = [own, *(name for name in curves if name != own)]
    for line, name in zip(LINES, order, strict=False):
        curve = curves[name]
        title = f"{curve.title} (the scenario's)" if name == own else curve.title
        grid[0, 0].loglog(curve.sigma, curve.rate, label=title, **line)
        grid[0, 1].loglog(curve.amplitude, curve.gain, **line)
    grid[0, 0].set_xlabel("|σ|")
    grid[0, 0].set_ylabel("|dσ/dt| asked for")
    grid[0, 1].set_xlabel("amplitude of σ")
    grid[0, 1].set_ylabel(label("equivalent gain", "1/s"))
    grid[0, 1].axvspan(*AMPLITUDES, color="0.9", linewidth=0)
    grid[0, 1].axvline(found.scenario.sigma_amplitude, **_GIVEN)
    for axes in grid[0]:
        axes.minorticks_off()
    legend_above(figure, columns=3)
    return figure


def tornado(found: Sensitivities) -> Figure | None:
    """What ten percent of each parameter does, the strongest on top; None where nothing does anything."""
    if not found.effects or not found.keys:
        return None
    count = len(found.effects)
    bars = min(_MOST_BARS, len(found.keys))
    figure, grid = panels(1, count, width=PAGE, height=0.3 + 0.2 * bars, share_x=False)
    for axes, effect in zip(grid[0], found.effects, strict=True):
        order = np.argsort(-effect.reach, kind="stable")[:bars]
        for side, line, name in ((effect.low, LINES[0], "10 % less"), (effect.high, LINES[1], "10 % more")):
            change = 100 * (side[order] - effect.nominal) / abs(effect.nominal)
            axes.barh(np.arange(len(order)), np.nan_to_num(change), 0.7, color=line["color"], label=name, alpha=0.9)
            for place in np.flatnonzero(np.isnan(change)):
                axes.text(0.0, float(place), " none ", color=line["color"], fontsize=6, va="center")
        axes.set_yticks(range(len(order)), [_short(found.keys[k]) for k in order])
        axes.tick_params(axis="y", labelsize=6)
        axes.set_ylim(len(order) - 0.4, -0.6)
        axes.axvline(0.0, color="black", linewidth=0.6)
        axes.margins(x=0.08)
        unit = f" {effect.unit}" if effect.unit else ""
        axes.set_title(f"{effect.title}: {effect.nominal:.3g}{unit}", fontsize=7)
        axes.set_xlabel("change [%]")
    legend_above(figure)
    return figure


def _short(key: str) -> str:
    """A key as it labels a bar: without the table that says nothing."""
    return key.removeprefix("mechanism.").removeprefix("control.").removeprefix("drive.")


def figures(
    found: Analysis, curves: Mapping[str, LawCurves], sensitivity: Sensitivities
) -> Sequence[tuple[str, str, Figure]]:
    """Name, caption and figure of all that there are."""
    made = (
        (
            "spectrum",
            "**Stability against δ.** Largest real part of the eigenvalues over all points of the reference; the loop "
            "is stable where it is below zero.",
            spectrum_by_delta(found),
        ),
        (
            "reference",
            "**Stability along the reference.** How fast the least stable mode grows, at each point taken by itself.",
            along_reference(found),
        ),
        (
            "channels",
            "**Margins.** The loop cut at one motor's channel, the others closed. Where |L| is 1, the distance of the "
            "phase from the line at −180 degrees is the phase margin; where the phase crosses it, 1/|L| is the gain "
            "margin.",
            channels(found),
        ),
        (
            "laws",
            "**Reaching laws** with the scenario's gains and a_max. Left: what they ask for. Right: their equivalent "
            "gain; boundaries are given over the grey amplitudes.",
            laws(found, curves),
        ),
        (
            "tornado",
            "**Sensitivities.** Each parameter moved by ten percent of itself; mechanism and drive move the arm and "
            "what the controller knows of it, plant.*.scale the arm alone.",
            tornado(sensitivity),
        ),
    )
    return [(name, caption, figure) for name, caption, figure in made if figure is not None]
