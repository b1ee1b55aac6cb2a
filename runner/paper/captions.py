"""What to see in each figure: one sentence, with numbers measured in the runs that it shows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from springline.runner.paper.cases import LAWS
from springline.runner.paper.claims import crossings, growth, on_linear_surface
from springline.runner.paper.measured import Floats
from springline.runner.paper.numbers import number
from springline.runner.paper.runs import Study

_BURST = 0.05
"""Half the time around a burst in which it is looked at, s."""

SEA_STATE_6 = (0.3, 0.64)
"""m/s^2, RMS: heave of a vessel of 83 m at a significant wave height of 5 m, head and beam seas (E14)."""


def _error_of(quantity: str) -> tuple[str, str]:
    """The joint that a figure's quantity belongs to, and the column of its error."""
    joint = "lift" if "lift" in quantity else "rotation"
    return joint, f"{'velocity_error' if 'vel' in quantity else 'e'}_{joint}"


def _late(quantity: str) -> tuple[float, str]:
    """Share of a run from which its largest error is told, and its name: as Table 4 and the claims have them."""
    return (0.5, "second half") if "vel" in quantity else (0.75, "last quarter")


def _largest(study: Study, quantity: str, scenario: str) -> str:
    """Largest error late in a run, in thousandths."""
    return number(1e3 * study.evidence.runs[scenario].largest(_error_of(quantity)[1], _late(quantity)[0]), 2)


def sea(study: Study) -> str:
    """What our shake is, beside a vessel's in sea state 6."""
    terms = study.scenarios["paper/group1_shake"].document["base_motion"].get("heave", [])  # another kind has none
    parts = [term["amplitude"] * term["omega"] ** 2 / math.sqrt(2) for term in terms]
    heave = math.hypot(*parts)
    low, high = SEA_STATE_6
    said = (
        f"Our shake accelerates the base by {number(heave, 2)} m/s² RMS, of which its terms have "
        f"{' and '.join(f'{number(part, 2)} m/s²' for part in parts) or 'none'}"
    )
    vessel = (
        f"a vessel of 83 m has {low:g} (head seas) to {high:g} m/s² (beam seas) at a significant wave height of 5 m"
    )
    return f"{said}: a worst case beyond sea state 6, in which {vessel}." if heave > high else f"{said}; {vessel}."


def _first(quantity: str, unit: str) -> Callable[[Study], str]:
    def sentence(study: Study) -> str:
        joint, _ = _error_of(quantity)
        names = ("shake", "pitch", "roll")
        times = [study.evidence.runs[f"paper/group1_{name}"].metric("settling_time", joint) for name in names]
        # Upwards, for they settle within it.
        settled = f"All settle within {math.ceil(100 * max(times)) / 100:.2f} s"
        if not all(map(math.isfinite, times)):
            settled = "Not all settle"
        sizes = [_largest(study, quantity, f"paper/group1_{name}") for name in names]
        return (
            f"{settled}; in the {_late(quantity)[1]} of the run the errors reach {sizes[0]} (shake), "
            f"{sizes[1]} (pitch) and {sizes[2]} {unit} (roll)."
        )

    return sentence


def _laws(quantity: str, unit: str) -> Callable[[Study], str]:
    def sentence(study: Study) -> str:
        new, double, power = (_largest(study, quantity, f"paper/group2_{law}") for law in LAWS)
        text = (
            f"In the {_late(quantity)[1]} of the run the errors reach {new} (variable power log), {double} "
            f"(double power) and {power} {unit} (power)."
        )
        return f"{text} {_burst(study)}".rstrip() if quantity == "angular velocity" else text

    return sentence


def _burst(study: Study) -> str:
    """The burst of the traditional laws in Figure 15: when, how fast, and how small sigma is there; "" without one."""
    run = study.evidence.law("power")
    t, sigma = run["t"], run["sigma_rotation"]
    step = float(t[1] - t[0])
    fast = run.above("velocity_error_rotation", 50.0)
    looked_at = (t > 0.5 * run.end) & (t < 0.95 * run.end)
    when = float(t[np.argmax(np.where(looked_at, np.abs(fast), 0.0))])
    there = np.abs(t - when) <= _BURST
    frequency = np.count_nonzero(np.diff(np.sign(fast[there]))) / (2 * step * np.count_nonzero(there))
    small, large = (float(np.max(np.abs(sigma[rows]))) for rows in (there, looked_at))
    if small > 0.2 * large:
        return ""
    return (
        f"The burst of the traditional laws around {when:.1f} s ({frequency:.0f} Hz) is the rotation's spring, which "
        f"they drive where |σ| is small (up to {number(small, 2)} rad/s, elsewhere {number(large, 2)} rad/s): the "
        "slope of |σ|^α grows without bound towards 0."
    )


def _payloads(quantity: str, unit: str) -> Callable[[Study], str]:
    def sentence(study: Study) -> str:
        names = ("payload_minus", "nominal", "payload_plus")
        sizes = [_largest(study, quantity, f"paper/group3_{name}") for name in names]
        return (
            f"With −20 %, 0 and +20 % of payload the errors reach {', '.join(sizes[:2])} and {sizes[2]} {unit} in the "
            f"{_late(quantity)[1]} of the run."
        )

    return sentence


def _without(quantity: str, unit: str) -> Callable[[Study], str]:
    """How the distance to the run with fast control grows, from the first tenth of the run without it to its last."""

    def sentence(study: Study) -> str:
        joint, _ = _error_of(quantity)
        column = f"{'dq1' if 'vel' in quantity else 'q1'}_{joint}"
        off, on = (study.evidence.runs[f"paper/group4_fast_{name}"] for name in ("off", "on"))
        rows = min(len(off["t"]), len(on["t"]))
        gap: Floats = np.abs(off[column][:rows] - on[column][:rows])
        first, last = (number(float(np.max(part)), 1) for part in (gap[: rows // 10], gap[-(rows // 10) :]))
        ends = "leaves its bound" if off.status != "ok" else "ends"
        text = (
            f"The run without fast control {ends} at {number(off.end, 2)} s; its distance to the other is {first} "
            f"{unit} at most in the first tenth of that time, {last} {unit} in the last"
        )
        if "vel" not in quantity:
            return f"{text}."
        rate, frequency = growth(off["t"][:rows], off[column][:rows] - on[column][:rows])
        return f"{text}. Over the second half it grows at {number(rate, 2)} 1/s, with {number(frequency)} Hz."

    return sentence


def _reaching(study: Study) -> str:
    flattest, overtaken, steepest = (number(sigma, 2) for sigma in crossings(study.evidence))
    return (
        f"The new law is the flattest below |σ| = {flattest}; from {overtaken} to {steepest} the double power law is "
        "the steepest, beyond that the new one (claim 10)."
    )


def _linear(study: Study) -> str:
    times, over = on_linear_surface(study.evidence)
    each = ", ".join(f"{number(time, 2)} s ({LAWS[law]})" for law, time in times.items())
    passed = ", ".join(f"{number(share, 1)}" for share in over.values())
    return f"On the rotation σ stays within 1 % of its start from {each} on, and passes 0 by {passed} of it (claim 10)."


def _literal(study: Study) -> str:
    printed, layer = (
        " and ".join(
            f"{number(run.metric('steady_state_error', joint), 2)} {unit}"
            for joint, unit in (("lift", "m"), ("rotation", "rad"))
        )
        for run in (study.literal["limited"][0], study.layers["0.05"][0])
    )
    return f"In the last quarter of the run the errors reach {printed} without a boundary layer, {layer} with one."


def _readings(study: Study) -> str:
    base, power = (study.readings[key][0].variation_rate("sigma_lift", 1.0) for key in ("base", "power"))
    return (
        f"After 1 s σ varies by {number(base)} m/s per s where the logarithms are read as bases, and by "
        f"{number(power)} read as powers."
    )


def _two_numbers(study: Study) -> str:
    found, others = [], []
    for symbol, runs in (("δ", study.layers), ("a_max", study.limits)):
        errors = {key: run.metric("steady_state_error", "lift") for key, (run, _) in runs.items()}
        least = min((error for error in errors.values() if math.isfinite(error)), default=math.nan)
        calm = [key for key, error in errors.items() if error < 10 * least]
        found.append(f"{symbol} from {calm[0]} to {calm[-1]}" if calm else f"no {symbol}")
        others += [error for key, error in errors.items() if key not in calm and math.isfinite(error)]
    rest = f"; the others leave up to {number(max(others), 2)} m, or diverge" if others else ""
    return f"Of the values tried, those that leave less than ten times the least error are {' and '.join(found)}{rest}."


def _always(text: str) -> Callable[[Study], str]:
    return lambda _: text


def _of_group(
    first: int, names: tuple[tuple[str, str], ...], how: Callable[[str, str], Callable[[Study], str]]
) -> dict[str, Callable[[Study], str]]:
    return {f"figure_{number:02d}": how(name, unit) for number, (name, unit) in enumerate(names, first)}


_FOUR = (("lift", "mm"), ("rotation", "mrad"), ("lift velocity", "mm/s"), ("angular velocity", "mrad/s"))

SEEN: Mapping[str, Callable[[Study], str]] = {
    "figure_04": _reaching,
    "figure_05": _linear,
    "figure_06": _always(
        "The slow control sees the joints alone; what damps a spring is the difference of the rates at its two ends."
    ),
    "figure_07": sea,
    **_of_group(8, _FOUR, _first),
    **_of_group(12, _FOUR, _laws),
    **_of_group(16, (*_FOUR, *_FOUR[2:]), _payloads),
    **_of_group(22, tuple((name, unit.removeprefix("m") or unit) for name, unit in _FOUR), _without),
    "literal_law": _literal,
    "log_readings": _readings,
    "our_numbers": _two_numbers,
}
"""Figure name -> what to see in it."""
