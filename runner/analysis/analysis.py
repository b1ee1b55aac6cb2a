"""`analyze`: what a design can do, before it runs; each by a number and in words, and found again by runs on demand."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from springline.runner.analysis import confirm as by_runs
from springline.runner.analysis.boundary_layer import delta_critical
from springline.runner.analysis.crossings import Margins, delay_max, margins
from springline.runner.analysis.floquet import floquet_exponent
from springline.runner.analysis.limit_cycle import LimitCycle, limit_cycle
from springline.runner.analysis.limits import limits_from
from springline.runner.analysis.loop import Boundary, LinearLoop, linear_loop, linearised
from springline.runner.analysis.modes import TimeScales, fast_gain, time_scales
from springline.runner.analysis.proof import Proof, proof_of, proof_reaches
from springline.runner.analysis.reaching import AMPLITUDES
from springline.runner.analysis.sampled import period_max, rates_of
from springline.runner.analysis.timing import unbounded_gain
from springline.runner.files import InputError, Problem, numpy_array
from springline.runner.run import Progress, simulate
from springline.runner.scenario import Scenario, expect_scenario, given_text

Floats = NDArray[np.float64]
Ranges = Mapping[str, tuple[float, float]]

DISAGREE = 0.05
"""Relative difference between a boundary and its runs above which a verdict says so."""

SEPARATED = 0.1
"""Slow bandwidth over slowest fast mode up to which the slow and the fast part may be designed apart."""

SLIM_GAIN, SLIM_PHASE = 2.0, math.radians(30.0)
"""Margins below which a verdict fails: 6 dB and 30 degrees."""

_SMALL = 1e-6  # amplitude of sigma, where limit cycles begin
_MOST_RANGES = 6


@dataclass(frozen=True, slots=True)
class Row:
    """One verdict.

    name, value, unit  value None: there is no such number, or none that is finite; the text says why
    ok                 None: no verdict
    text               the verdict in words: what the number means here and what to change
    confirmed          what simulated runs found in its place; None without them
    """

    name: str
    value: float | None
    unit: str
    ok: bool | None
    text: str
    confirmed: float | None = None

    def plain(self) -> dict[str, Any]:
        """The row as plain data."""
        return asdict(self)


@dataclass(frozen=True, eq=False, repr=False)
class Analysis:
    """What was found of one scenario.

    scenario, ranges  that was analysed
    rows    verdicts;  notes: what holds for all of them, a sentence each
    status  "ok", or "unstable" for a loop that is
    loop    linearised along the reference;  cycle: the limit cycle that is predicted, if one is
    proof   section 6 for the scenario's run; None where it says nothing of it
    damping  of the springs' modes that smallest gains K_f were sought for
    """

    scenario: Scenario
    ranges: Ranges
    rows: tuple[Row, ...]
    notes: tuple[str, ...]
    status: str
    loop: LinearLoop
    cycle: LimitCycle | None
    proof: Proof | None
    damping: float

    def __repr__(self) -> str:
        """Status, and which verdicts say no."""
        failed = ", ".join(row.name for row in self.rows if row.ok is False)
        return f"Analysis({self.status}, {len(self.rows)} rows{': no to ' + failed if failed else ''})"

    def _repr_html_(self) -> str:
        """What a notebook shows: every row, the number with its unit, and what it means here."""
        said = {True: "yes", False: "no", None: ""}
        rows = [
            (row.name, "–" if row.value is None else _number(row.value, row.unit), said[row.ok], row.text)
            for row in self.rows
        ]
        cells = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows)
        notes = "".join(f"<p>{escape(note)}</p>" for note in self.notes)
        return f"<table>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>{notes}"

    def row(self, name: str) -> Row:
        """The verdict of a name; KeyError if there is none."""
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(f"no row {name!r}; there are: {', '.join(row.name for row in self.rows)}")


def analyze(
    scenario: Scenario,
    ranges: Ranges | None = None,
    *,
    confirm: bool = False,
    damping: float = 0.1,
    progress: Progress | None = None,
) -> Analysis:
    """Time scales, stability and its boundaries, margins, and the proof's reach of a scenario's design.

    ranges    numbers that may lie anywhere between two, by numeric key: {"plant.m3.scale": (0.8, 1.2)}
    confirm   find every boundary again by simulated runs
    damping   damping ratio of the springs' modes that the smallest K_f is sought for
    progress  called now and then with the share that is done (0 .. 1)
    Raises TypeError for what is no Scenario, InputError (a ValueError) for an unknown key, numbers out of bounds or in
    the wrong order, and a damping that is no ratio; ToolchainError if there is no C compiler.
    """
    expect_scenario(scenario)
    columns = _columns(scenario, ranges or {})
    if not 0.0 < damping < 1.0:
        raise InputError(Problem("--damping", "", "expected a damping ratio between 0 and 1", repr(damping)))
    work = _Work(scenario, ranges or {}, columns, damping)
    report = progress or (lambda share: None)
    share = 0.3 if confirm else 1.0
    rows: list[Row] = []
    makers = (_delta, _period, _delay, _epsilon, _fast_damping, _k1, _margins, _cycle, _floquet)
    for k, make in enumerate(makers):
        rows += make(work)
        report(share * (k + 1) / len(makers))
    if confirm:
        rows = _confirmed(work, rows, lambda done: report(share + (1 - share) * done))
    status = "unstable" if work.unstable else "ok"
    return Analysis(
        scenario, ranges or {}, tuple(rows), work.notes(), status, work.loop, work.cycle, work.proof[0], damping
    )


def _columns(scenario: Scenario, ranges: Ranges) -> dict[str, Floats]:
    """The corners of the ranges, and points between them where there are few: columns of numeric keys."""
    where = f"range of {scenario.source}"
    problems = [
        Problem(where, key, "expected LOW < HIGH, two finite numbers", given_text([low, high]))
        for key, (low, high) in ranges.items()
        if not (math.isfinite(low) and math.isfinite(high) and low < high)
    ]
    if len(ranges) > _MOST_RANGES:
        problems.append(Problem(where, "", f"expected at most {_MOST_RANGES} ranges", str(len(ranges))))
    if problems:
        raise InputError(*problems)
    scenario.columns_for({key: np.array(pair) for key, pair in ranges.items()})
    points = 5 if len(ranges) == 1 else 3 if len(ranges) <= 3 else 2
    grid = itertools.product(*(np.linspace(*pair, points) for pair in ranges.values()))
    return {key: np.array(column) for key, column in zip(ranges, zip(*grid, strict=True), strict=True)}


class _Work:
    """What several verdicts are computed from, each once."""

    def __init__(self, scenario: Scenario, ranges: Ranges, columns: dict[str, Floats], damping: float) -> None:
        self.scenario, self.ranges, self.columns, self.damping = scenario, ranges, columns, damping
        self.amplitude = scenario.sigma_amplitude
        self.joints = scenario.system().joints
        self.sampled = scenario.control_every > 0
        self.period = scenario.control_every * scenario.step
        self.delay = scenario.structure().delay * scenario.step
        self.at: dict[str, float | None] = {}  # where along the reference a boundary was found

    @cached_property
    def loop(self) -> LinearLoop:
        return linear_loop(self.scenario, self.amplitude)

    @cached_property
    def ranged(self) -> LinearLoop:
        return linear_loop(self.scenario, self.amplitude, columns=self.columns)

    @cached_property
    def loops(self) -> tuple[LinearLoop, LinearLoop]:
        """At the least and the largest amplitude of the range."""
        low, high = (linear_loop(self.scenario, amplitude) for amplitude in AMPLITUDES)
        return low, high

    def rate_of(self, loop: LinearLoop) -> float:
        """Largest growth rate of a loop as it runs, 1/s."""
        return float(rates_of(loop).max())

    @cached_property
    def rate(self) -> float:
        return self.rate_of(self.loop)

    @property
    def unstable(self) -> bool:
        return self.rate > 0.0

    @cached_property
    def gained(self) -> bool:
        """Whether there is a law or a sliding variable whose gain depends on the amplitude."""
        return bool(np.any(self.loop.N != 0.0))

    @cached_property
    def unbounded(self) -> str:
        """That the gain grows without bound as sigma goes to zero, in words; "" where it does not."""
        if not self.gained:
            return ""
        return unbounded_gain(self.loops[0], self.loop)

    @cached_property
    def found_cycle(self) -> LimitCycle | None:
        """What describing functions say, small oscillations growing or not."""
        return limit_cycle(self.scenario) if self.gained else None

    @cached_property
    def cycle(self) -> LimitCycle | None:
        """The limit cycle that the loop ends in however small it begins."""
        found = self.found_cycle
        if found is None or found.amplitude is None:
            return None
        return found if self.rate_of(linear_loop(self.scenario, _SMALL)) > 0.0 else None

    @cached_property
    def proof(self) -> tuple[Proof | None, str]:
        """Section 6 for the run, or why there is none."""
        reason = proof_reaches(self.scenario)
        if reason:
            return None, reason
        every = max(1, round(_ROWS / self.scenario.step), -(-self.scenario.steps // _MOST_ROWS))
        result = simulate(self.scenario.with_overrides({"simulation.output_every": every}))
        if result.status != "ok":
            return None, f"the run does not last, so that no disturbance can be told ({result.message})"
        columns = {name: numpy_array(result.trajectory[name]) for name in result.trajectory.column_names}
        return proof_of(self.scenario, columns), ""

    def notes(self) -> tuple[str, ...]:
        """What holds for all verdicts."""
        found = [
            f"Boundaries hold for oscillations of sigma of {self.amplitude:g} ([analysis] sigma_amplitude), about "
            "points of the reference taken one by one; that is no proof for the motion between them."
        ]
        if not self.gained:
            found = ["Boundaries hold about points of the reference taken one by one; that is no proof for the motion."]
        if self.scenario.structure().differenced:
            found.append(
                "Rates are made of differences: boundaries and margins are of that loop, sampled; time scales, fast "
                "damping and the Floquet exponent are of rates as they are."
            )
        if self.scenario.structure().effects:
            found.append("Noise, resolution and rate limits of sensors and motors are no part of it either.")
        limits = limits_from(self.scenario)
        size = "" if limits.value is None else f" (|sigma| from {limits.value:.3g} on)"
        found.append(f"Limits of law and motors are no part of it: {limits.reason}{size}.")
        return tuple(found)


_ROWS = 2e-4
_MOST_ROWS = 20_000


def _at(work: _Work, boundary: Boundary, others: Sequence[Boundary], unit: str) -> str:
    """What amplitude a boundary holds for, and its range over the others'."""
    if not work.gained:
        return "whatever the amplitude"
    values = [item.value for item in (boundary, *others) if item.value is not None]
    span = f"{AMPLITUDES[0]:g} … {AMPLITUDES[1]:g}"
    if len(values) < 1 + len(others):
        none = " and ".join(f"{a:g}" for a, item in zip(AMPLITUDES, others, strict=True) if item.value is None)
        return f"at sigma amplitude {work.amplitude:g}; none at {none}"
    return f"at sigma amplitude {work.amplitude:g}; {_quantity(min(values))} … {_number(max(values), unit)} over {span}"


def _quantity(value: float) -> str:
    return f"{value:.3g}"


def _number(value: float, unit: str) -> str:
    return f"{value:.3g} {unit}" if unit not in ("", "1") else f"{value:.3g}"


def _over_ranges(
    work: _Work, found: Sequence[Boundary], unit: str, *, worst: Callable[[Sequence[float]], float]
) -> str:
    """What becomes of a boundary over --range, as a sentence; "" without ranges."""
    if not work.columns:
        return ""
    over = ", ".join(f"{key} = {low:g} … {high:g}" for key, (low, high) in work.ranges.items())
    values = [item.value for item in found if item.value is not None]
    if len(values) < len(found):
        k = next(i for i, item in enumerate(found) if item.value is None)
        at = ", ".join(f"{key} = {column[k]:.4g}" for key, column in work.columns.items())
        return f" Over {over} there is none everywhere: at {at} {found[k].reason}."
    k = [item.value for item in found].index(worst(values))
    at = ", ".join(f"{key} = {column[k]:.4g}" for key, column in work.columns.items())
    return f" Over {over}: {_quantity(min(values))} … {_number(max(values), unit)}, worst at {at}."


def _unstable(work: _Work) -> str:
    return f"unstable: an oscillation of the loop grows at {work.rate:.3g} 1/s"


def _delta(work: _Work) -> list[Row]:
    name, key = "delta_critical", "control.delta"
    keys = work.scenario.numeric_keys()
    unit = keys[key].unit if key in keys else "1"
    boundary = delta_critical(work.scenario, work.amplitude)[0]
    work.at[name] = boundary.at
    others = [delta_critical(work.scenario, amplitude)[0] for amplitude in AMPLITUDES] if boundary.value else []
    given = work.scenario.number_of(key) if key in keys else math.nan
    if work.unbounded and boundary.value is not None:
        text = f"no finite boundary: {work.unbounded}, so that every delta ends in a limit cycle"
        return [Row(name, None, unit, False if work.unstable else None, text + _cycle_text(work))]
    if boundary.value is None:
        text = boundary.reason if not work.unstable else f"{_unstable(work)}; {boundary.reason}"
        return [Row(name, None, unit, False if work.unstable else None, text)]
    over = delta_critical(work.scenario, work.amplitude, columns=work.columns) if work.columns else ()
    most = max([boundary.value, *(item.value if item.value is not None else math.inf for item in over)])
    ok = bool(given > most)
    holds = _at(work, boundary, others, unit)
    if given <= boundary.value:
        verdict = (
            f"unstable: delta = {given:g} is below the smallest stable one, {boundary.value:.3g} ({holds}); raise it"
        )
    elif not ok:
        verdict = f"delta = {given:g} is stable above {boundary.value:.3g} ({holds}), but not over the ranges; raise it"
    else:
        verdict = f"delta = {given:g} is {given / boundary.value:.3g} times the smallest stable one ({holds})"
    text = verdict + "." + _over_ranges(work, over, unit, worst=max)
    return [Row(name, boundary.value, unit, ok, text)]


def _time_limit(
    work: _Work, name: str, given: float, finder: Callable[[LinearLoop], Sequence[Boundary]], words: Sequence[str]
) -> list[Row]:
    """period_max and delay_max. words: what the given one is called, what holds without one, and what to do."""
    called, without, remedy = words
    boundary = finder(work.loop)[0]
    work.at[name] = boundary.at
    if work.unbounded and boundary.value is not None:
        text = f"no finite boundary: {work.unbounded}; however small it is, the loop ends in a limit cycle"
        return [Row(name, None, "s", False if work.unstable else None, text + _cycle_text(work))]
    if boundary.value is None:
        text = boundary.reason if not work.unstable else f"{_unstable(work)}; {boundary.reason}"
        return [Row(name, None, "s", False if work.unstable else None, text)]
    others = [finder(loop)[0] for loop in work.loops] if work.gained else []
    over = finder(work.ranged) if work.columns else ()
    holds = _at(work, boundary, others, "s")
    least = min([boundary.value, *(item.value if item.value is not None else 0.0 for item in over)])
    if not given:
        ok, verdict = None, f"{without} up to {boundary.value:.3g} s ({holds})"
    elif given <= least:
        ok = True
        verdict = f"{called} {given:.3g} s is {given / boundary.value:.2g} of the largest stable one ({holds})"
    else:
        ok = False
        beyond = "unstable: " if given > boundary.value else ""
        verdict = f"{beyond}{called} {given:.3g} s is beyond {least:.3g} s ({holds}); {remedy}"
    return [Row(name, boundary.value, "s", ok, verdict + "." + _over_ranges(work, over, "s", worst=min))]


def _period(work: _Work) -> list[Row]:
    delayed = f" with its delay of {work.delay:.3g} s" if work.delay else ""
    return _time_limit(
        work,
        "period_max",
        work.period,
        period_max,
        (
            f"a sample period{delayed} of",
            "the control is continuous; sampled, without delay, it stays stable with periods",
            "sample faster, or make the loop slower",
        ),
    )


def _delay(work: _Work) -> list[Row]:
    sampled = f"sampled at {work.period:.3g} s it has no delay, and stays stable with one" if work.sampled else ""
    return _time_limit(
        work,
        "delay_max",
        work.delay,
        delay_max,
        (
            "a delay of",
            sampled or "the control is continuous and has no delay; it stays stable with one",
            "shorten the way of the command, or make the loop slower",
        ),
    )


def _scales(work: _Work) -> TimeScales | None:
    return time_scales(work.loop) if work.loop.elastic else None


_RIGID = "the drive is rigid: there are no fast modes"


def _epsilon(work: _Work) -> list[Row]:
    scales = _scales(work)
    if scales is None:
        return [Row("epsilon_ratio", None, "1", None, _RIGID)]
    ratios = scales.epsilon_ratio[0]
    k = int(np.argmax(ratios))
    fast = float(np.min(np.abs(scales.fast_free[0])))
    ok = bool(ratios[k] <= SEPARATED)
    what = f"slow bandwidth up to {np.max(scales.slow_bandwidth[0]):.3g} 1/s, slowest fast mode {fast:.4g} rad/s"
    spread = f"{np.min(ratios):.2g} … {np.max(ratios):.2g} along the reference"
    verdict = (
        "far enough apart for a design of two time scales"
        if ok
        else "too close for a design of two time scales: stiffer springs, lighter motors, or a slower law"
    )
    epsilon = work.scenario.number_of("drive.epsilon")
    text = f"{what}; {spread}: {verdict} (epsilon = {epsilon:g} only scales, the ratio decides)"
    return [Row("epsilon_ratio", float(ratios[k]), "1", ok, text)]


def mode_text(value: complex) -> str:
    """An eigenvalue and its conjugate for people; a real part that is rounding is 0."""
    real = value.real if abs(value.real) > 1e-9 * abs(value) else 0.0
    return f"{real:.3g} ± {abs(value.imag):.4g}i"


def _modes(values: Sequence[complex]) -> str:
    return " and ".join(map(mode_text, values))


def _fast_damping(work: _Work) -> list[Row]:
    scales = _scales(work)
    if scales is None:
        return [Row("fast_damping", None, "1", None, _RIGID)]
    value = float(scales.fast_damping[0])
    ratios = -scales.fast_composite[0].real / np.abs(scales.fast_composite[0])
    k = int(np.argmin(np.min(ratios, axis=-1)))
    free, alone, composite = (
        _modes(item[0, k]) for item in (scales.fast_free, scales.fast_alone, scales.fast_composite)
    )
    wanted = fast_gain(work.scenario, work.amplitude, work.damping)
    gains = ", ".join(
        f"{joint.name} {_number(item.value, joint.force + ' s/' + joint.unit)}" if item.value is not None
        else f"{joint.name} none ({item.reason})"
        for joint, item in zip(work.joints, wanted, strict=True)
    )  # fmt: skip
    verdict = "the springs' modes die out" if value > 0 else "unstable: the springs' modes grow; raise control.K_f"
    text = (
        f"{verdict}: {composite} 1/s in the closed loop, {alone} with fast control alone, {free} without; smallest K_f "
        f"for a damping of {work.damping:g} by fast control alone: {gains}"
    )
    return [Row("fast_damping", value, "1", bool(value > 0), text)]


def _k1(work: _Work) -> list[Row]:
    proof, reason = work.proof
    unit = " or ".join(dict.fromkeys(f"{joint.unit}/s^2" for joint in work.joints))
    if proof is None:
        rows = [Row("k1_margin", None, unit, None, reason)]
        return rows + [Row(f"k1_margin_{joint.name}", None, f"{joint.unit}/s^2", None, reason) for joint in work.joints]
    k1 = work.scenario.number_of("control.k1")
    largest = proof.disturbed.per_joint
    margins = k1 - largest
    k = int(np.argmin(margins))
    bounds = proof.bounds
    if work.unstable and margins[k] <= 0:
        verdict = (
            f"the disturbance met, {largest[k]:.3g} ({work.joints[k].name}), is that of an unstable loop's own "
            f"oscillation and no measure of k1 = {k1:g}: make the loop stable first"
        )
    elif margins[k] > 0:
        verdict = f"k1 = {k1:g} exceeds the disturbance met, {largest[k]:.3g} ({work.joints[k].name}), along the run"
    else:
        verdict = (
            f"k1 = {k1:g} is less than the disturbance met, {largest[k]:.3g} ({work.joints[k].name}): the proof gives "
            "no time to reach sigma = 0, and what holds sigma is the rest of the law; raise k1 above it for a proof"
        )
    total = ", ".join(
        f"{joint.name} {bound:.3g} s" if math.isfinite(bound) else f"{joint.name} none"
        for joint, bound in zip(work.joints, bounds.total, strict=True)
    )
    # A bound takes the base's share of d alone: beside a margin below zero it would promise what does not hold.
    settling = f"; bounds on settling: {total}" if margins[k] > 0 else ""
    rows = [Row("k1_margin", float(margins[k]), unit, bool(margins[k] > 0), verdict + settling)]
    for i, joint in enumerate(work.joints):
        size = f"sigma stays within {proof.residual[i]:.3g} {joint.unit}/s (in the run: {proof.remaining[i]:.3g})"
        if not math.isfinite(proof.residual[i]):
            size = "no size of sigma is safe: the law never exceeds the disturbance"
        text = (
            f"largest |d sigma/dt - law| {largest[i]:.3g} {joint.unit}/s^2 after the first quarter of the run; {size}"
        )
        ok = bool(margins[i] > 0)
        rows.append(Row(f"k1_margin_{joint.name}", float(margins[i]), f"{joint.unit}/s^2", ok, text))
    return rows


def _margins(work: _Work) -> list[Row]:
    if work.unstable:
        text = f"{_unstable(work)}, so there is no margin"
        return [
            Row(f"{name}{suffix}", None, unit, False, text)
            for name, unit in (("gain_margin", "1"), ("phase_margin", "rad"))
            for suffix in ("", *(f"_{joint.name}" for joint in work.joints))
        ]
    found = margins(work.loop)[0]
    gains, phases = np.array(found.gain, dtype=float), np.array(found.phase, dtype=float)
    rows = []
    distance = np.where(np.isfinite(gains) & (gains > 0), np.abs(np.log(np.where(gains > 0, gains, 1.0))), np.inf)
    for name, values, sizes in (("gain_margin", gains, distance), ("phase_margin", phases, phases)):
        known = np.where(np.isnan(sizes), np.inf, sizes)
        k = int(np.argmin(known))
        words = _gain_words if name == "gain_margin" else _phase_words
        whole = Row(name, *words(work, found, k, values))
        rows.append(whole)
        rows += [Row(f"{name}_{joint.name}", *words(work, found, i, values)) for i, joint in enumerate(work.joints)]
    return rows


def _enough(work: _Work, slim: bool) -> bool | None:
    """Whether what is stable is so by enough; None where smaller oscillations meet a gain without bound."""
    return None if work.unbounded else not slim


def _margin_holds(work: _Work) -> str:
    """The amplitude that a margin is for, where there is one."""
    if not work.gained:
        return ""
    smaller = ", smaller ones meet more gain" if work.unbounded else ""
    return f" (at sigma amplitude {work.amplitude:g}{smaller})"


def _gain_words(work: _Work, found: Margins, i: int, values: Floats) -> tuple[float | None, str, bool | None, str]:
    joint, value = work.joints[i].name, float(values[i])
    if not math.isfinite(value) or value <= 0:
        return None, "1", True, f"no gain of the {joint} motor's channel makes the loop unstable"
    slim = max(value, 1 / value) < SLIM_GAIN
    how = f"slim, below a factor of {SLIM_GAIN:g} (6 dB): " if slim else ""
    side = "rises" if value > 1 else "falls"
    at = f", at {found.gain_frequency[i]:.4g} rad/s" if math.isfinite(found.gain_frequency[i]) else ""
    text = f"{how}stable until the gain of the {joint} motor's channel {side} to {value:.3g} times its own{at}"
    return value, "1", _enough(work, slim), text + _margin_holds(work)


def _phase_words(work: _Work, found: Margins, i: int, values: Floats) -> tuple[float | None, str, bool | None, str]:
    joint, value = work.joints[i].name, float(values[i])
    if not math.isfinite(value):
        return None, "rad", True, f"the {joint} motor's channel has a gain below 1 at every frequency"
    slim = value < SLIM_PHASE
    how = f"slim, below {math.degrees(SLIM_PHASE):.0f} degrees: " if slim else ""
    at = f" at {found.phase_frequency[i]:.4g} rad/s" if found.phase_frequency[i] > 0 else ""
    text = f"{how}stable until the phase of the {joint} motor's channel turns by {math.degrees(value):.3g} degrees{at}"
    delay, frequency = float(found.delay[i]), float(found.delay_frequency[i])
    if math.isfinite(delay):
        text += f"; a delay of this channel alone may be {delay:.3g} s, by its crossover at {frequency:.4g} rad/s"
    return value, "rad", _enough(work, slim), text + _margin_holds(work)


def _cycle_text(work: _Work) -> str:
    cycle = work.cycle
    if cycle is None or cycle.amplitude is None:
        return f"; none is predicted of a size above {_SMALL:g}"
    return f"; predicted: sigma {float(cycle.amplitude.max()):.3g} at {cycle.frequency:.4g} rad/s"


def _calmer(work: _Work) -> str:
    """What to change against a limit cycle, of what the scenario has."""
    keys = work.scenario.numeric_keys()
    raised = [key for key in ("control.delta", "control.K_f") if key in keys and linearised(work.scenario).reads(key)]
    ways = ([f"raise {' or '.join(raised)}"] if raised else []) + (["sample faster"] if work.sampled else [])
    return f". To calm it, {', or '.join(ways)}" if ways else ""


def _cycle(work: _Work) -> list[Row]:
    cycle = work.cycle
    if cycle is None or cycle.amplitude is None or cycle.frequency is None:
        return []
    k = int(np.argmax(cycle.amplitude))
    text = (
        f"small oscillations grow and large ones die out: a limit cycle, mostly of the {work.joints[k].name}; sigma "
        f"swings by {cycle.amplitude[k]:.3g} at {cycle.frequency:.4g} rad/s{_calmer(work)}"
    )
    unit = " or ".join(dict.fromkeys(f"{item.unit}/s" for item in work.joints))
    rows = [
        Row("limit_cycle_amplitude", float(cycle.amplitude[k]), unit, False, text),
        Row("limit_cycle_frequency", cycle.frequency, "rad/s", False, text),
    ]
    return rows + [
        Row(f"limit_cycle_amplitude_{joint.name}", float(size), f"{joint.unit}/s", False, f"sigma of the {joint.name}")
        for joint, size in zip(work.joints, cycle.amplitude, strict=True)
    ]


def _floquet(work: _Work) -> list[Row]:
    found = floquet_exponent(work.scenario, work.amplitude)
    if found.value is None:
        return [Row("floquet_exponent", None, "1/s", None, found.reason)]
    stable = bool(found.value < 0)
    verdict = (
        "disturbances of the periodic motion die out"
        if stable
        else "unstable: disturbances of the periodic motion grow"
    )
    text = f"{verdict}, {found.value:.3g} 1/s; {found.reason}{_margin_holds(work)}"
    return [Row("floquet_exponent", found.value, "1/s", _enough(work, slim=False) if stable else False, text)]


# Runs beside the boundaries


def _confirmed(work: _Work, rows: Sequence[Row], report: Callable[[float], None]) -> list[Row]:
    """The rows with what runs found; boundaries and limit cycles alone can be found again by runs."""
    finders: dict[str, Callable[[LinearLoop, float], tuple[float | None, str]]] = {
        "delta_critical": by_runs.confirmed_layer,
        "period_max": by_runs.confirmed_period,
        "delay_max": by_runs.confirmed_delay,
    }
    found = list(rows)
    for k, row in enumerate(rows):
        if row.value is not None and row.name in finders:
            loop = linear_loop(work.scenario, work.amplitude, times=work.at[row.name])
            value, how = finders[row.name](loop, row.value)
            found[k] = _beside(row, value, how)
            if value is not None and _disagree(row.value, value):
                found[k] = replace(found[k], text=found[k].text + _at_rest(row.name, loop, value))
        report((k + 1) / len(rows))
    if work.cycle is None or work.cycle.amplitude is None:
        return found
    at = linear_loop(work.scenario, work.cycle.amplitude, times=work.cycle.at)
    sizes, frequency, how = by_runs.confirmed_cycle(at)
    seen = {f"limit_cycle_amplitude_{joint.name}": size for joint, size in zip(work.joints, sizes, strict=True)}
    seen |= {"limit_cycle_amplitude": sizes.max(), "limit_cycle_frequency": frequency}
    for k, row in enumerate(rows):
        if row.name not in seen:
            continue
        value = None if math.isnan(seen[row.name]) else float(seen[row.name])
        found[k] = _beside(row, value, how)
        if value is not None and row.value is not None and _disagree(row.value, value):
            swing = float(work.cycle.amplitude.max()) / float(work.cycle.frequency or 1.0)
            why = f" Only sigma's law is taken for bent: e swings by {swing:.2g} there, over which a surface bends too."
            found[k] = replace(found[k], text=found[k].text + why)
    return found


def _disagree(value: float, runs: float) -> bool:
    return abs(runs / value - 1) > DISAGREE


def _at_rest(name: str, loop: LinearLoop, runs: float) -> str:
    """Whether a boundary and its runs are apart because these stand still, as a sentence; "" where that is not why."""
    held = by_runs.at_rest(loop)
    if name == "delta_critical":
        (still,) = delta_critical(held, loop.amplitude, times=[0.0])
    else:
        finder = period_max if name == "period_max" else delay_max
        (still,) = finder(linear_loop(held, loop.amplitude, times=[0.0]))
    if still.value is None or _disagree(still.value, runs):
        return ""
    return f" Runs stand still where the reference moves on; of a loop at rest it is {still.value:.3g}."


def _beside(row: Row, value: float | None, how: str) -> Row:
    assert row.value is not None
    if value is None:
        return replace(row, text=f"{row.text} Runs do not confirm it: none of them found a boundary near it ({how}).")
    off = value / row.value - 1
    said = f"Runs: {_number(value, row.unit)} ({how})"
    if _disagree(row.value, value):
        said = f"Runs disagree by {off:+.0%}: {_number(value, row.unit)} ({how})"
    return replace(row, confirmed=value, text=f"{row.text.rstrip('.')}. {said}.")
