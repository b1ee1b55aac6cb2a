"""Figures of an analysis."""

from __future__ import annotations

import math
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
from springline.runner.analysis.sensitivity import Effect, Sensitivities
from springline.runner.report import LINES, PAGE, label, legend_above, panels

Floats = NDArray[np.float64]
Places = NDArray[np.intp]

_MOST_BARS = 12
_VISIBLE = 1e-2  # of the longest bar: shorter ones cannot be seen
_CLIPPED, _LONG = 3.0, 4  # bars end at so many times that one of them, counted from the longest, which is 0
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_GIVEN: Mapping[str, Any] = {"color": "0.25", "linewidth": 0.9, "linestyle": (0, (1, 1.5))}
_LIMIT: Mapping[str, Any] = {"color": "0.25", "linewidth": 0.9, "linestyle": (0, (4, 2))}
_LAYERS = 61


def spectrum_by_delta(found: Analysis) -> Figure | None:
    """Largest real part of the loop's eigenvalues against delta, at three amplitudes; None without a delta."""
    row, key = found.row("delta_critical"), "control.delta"
    keys = found.scenario.numeric_keys()
    if row.value is None or key not in keys:
        return None
    given = found.scenario.number_of(key)
    low, high = min(row.value, given or row.value) / 4, max(row.value, given) * 4
    layers = np.geomspace(low, high, _LAYERS)
    figure, grid = panels(width=PAGE, height=2.6)
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
    figure, grid = panels(width=PAGE, height=2.2)
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
    figure, grid = panels(2, 1, width=PAGE, height=1.8)
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


def tornado(found: Sensitivities, units: Mapping[str, str]) -> Figure | None:
    """What ten percent of each parameter does, the strongest on top; None where nothing does anything.

    units  of the parameters, by key
    """
    ranked = [(effect, _strongest(effect)) for effect in found.effects] if found.keys else []
    ranked = [(effect, order) for effect, order in ranked if len(order)]
    if not ranked:
        return None
    bars = max(len(order) for _, order in ranked)
    figure, grid = panels(1, len(ranked), width=PAGE, height=0.5 + 0.2 * bars, share_x=False)
    for axes, (effect, order) in zip(grid[0], ranked, strict=True):
        _bars(axes, effect, order)
        names = [_short(found.keys[k], units.get(found.keys[k], "")) for k in order]
        axes.set_yticks(range(len(order)), names)
        axes.tick_params(axis="y", labelsize=6)
        axes.set_ylim(bars - 0.4, -0.6)
        axes.grid(visible=False, axis="y")
    legend_above(figure)
    return figure


def _strongest(effect: Effect) -> Places:
    """The parameters that move a quantity most, at most _MOST_BARS; what ceases to exist comes first."""
    change = np.abs(np.stack([effect.low, effect.high]) - effect.nominal)
    most = np.where(np.isnan(change), np.inf, change).max(axis=0)
    order: Places = np.argsort(-most, kind="stable")[:_MOST_BARS]
    finite = most[np.isfinite(most)]
    least = _VISIBLE * float(finite.max()) if finite.size else 0.0
    kept: Places = order[most[order] > least]
    return kept


def _bars(axes: Axes, effect: Effect, order: Places) -> None:
    """The quantity's own values, above one another for less and more; a bar that is far too long has its number."""
    sides = [side[order] for side in (effect.low, effect.high)]
    change = np.abs(np.stack(sides) - effect.nominal)
    finite = np.sort(change[np.isfinite(change)])[::-1]
    reach = float(min(finite[0], _CLIPPED * finite[min(_LONG, len(finite) - 1)])) if finite.size else 1.0
    reach = reach or float(finite[0]) or 1.0
    power = 3 * math.floor(math.log10(max(reach, abs(effect.nominal))) / 3)
    unit = 10.0**power
    low, high = effect.nominal - reach, effect.nominal + reach
    for side, offset, line, name in zip(sides, (-0.19, 0.19), LINES, ("10 % less", "10 % more"), strict=False):
        ends = np.clip(np.where(np.isnan(side), effect.nominal, side), low, high)
        places = np.arange(len(order)) + offset
        axes.barh(places, (ends - effect.nominal) / unit, 0.36, effect.nominal / unit, color=line["color"], label=name)
        for place, value, end in zip(places, side, ends, strict=True):
            if np.isnan(value) or value != end:
                text = "none" if np.isnan(value) else f"{value / unit:.3g}"
                away = "right" if end < effect.nominal else "left"
                axes.text(end / unit, place, f" {text} ", color=line["color"], fontsize=5, va="center", ha=away)
    axes.axvline(effect.nominal / unit, color="black", linewidth=0.6)
    axes.margins(x=0.18)
    scale = "" if not power else f"10{str(power).translate(_RAISED)} "
    shown = f" [{scale}{effect.unit}]".replace(" ]", "]") if scale or effect.unit else ""
    axes.set_title(effect.title, fontsize=7)
    axes.set_xlabel(f"its value{shown}")


def _short(key: str, unit: str) -> str:
    """A key as it labels a bar: without the table that says nothing, and with its unit."""
    name = key.removeprefix("mechanism.").removeprefix("control.").removeprefix("drive.")
    if " or " in unit:
        return f"{name} [{unit}]"
    return label(name, unit) if unit not in ("", "1", "SI") else name


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
            "**Sensitivities.** Each parameter moved by ten percent of itself, from the value that the scenario has "
            "(line); mechanism and drive move the arm and what the controller knows of it, plant.*.scale the arm "
            "alone. Bars that would be too long have their number; the table has all.",
            tornado(sensitivity, {key: item.unit for key, item in found.scenario.numeric_keys().items()}),
        ),
    )
    return [(name, caption, figure) for name, caption, figure in made if figure is not None]
