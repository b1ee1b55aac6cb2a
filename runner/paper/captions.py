"""What to see in each figure: one sentence, with numbers measured in the runs that it shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from springline.runner.paper.numbers import number
from springline.runner.paper.runs import Study

_BURST = 0.05
"""Half the time around a burst in which it is looked at, s."""


def _late(study: Study, column: str, scenario: str) -> float:
    return study.evidence.runs[scenario].largest(column)


def _error_of(quantity: str) -> tuple[str, str]:
    """The joint that a figure's quantity belongs to, and the column of its error."""
    joint = "lift" if "lift" in quantity else "rotation"
    return joint, f"{'velocity_error' if 'vel' in quantity else 'e'}_{joint}"


def _sea(study: Study) -> str:
    terms = study.scenarios["paper/group1_shake"].document["base_motion"].get("heave", [])  # another kind has none
    parts = [term["amplitude"] * term["omega"] ** 2 / np.sqrt(2) for term in terms]
    heave = float(np.sqrt(sum(part**2 for part in parts)))
    return (
        f"Our shake accelerates the base by {heave:.2g} m/s² (RMS), of which its terms have "
        f"{' and '.join(f'{part:.2g}' for part in parts) or 'none'}: a worst case, for a vessel of 83 m has 0.3 to "
        "0.64 m/s² in sea state 6 (E14)."
    )


def _first(quantity: str, unit: str) -> Callable[[Study], str]:
    def sentence(study: Study) -> str:
        joint, column = _error_of(quantity)
        names = ("shake", "pitch", "roll")
        settled = max(study.evidence.runs[f"paper/group1_{name}"].metric("settling_time", joint) for name in names)
        sizes = [number(1e3 * _late(study, column, f"paper/group1_{name}"), 2) for name in names]
        return (
            f"All settle within {settled:.2f} s; in the second half of the run the errors reach {sizes[0]} (shake), "
            f"{sizes[1]} (pitch) and {sizes[2]} (roll) {unit}."
        )

    return sentence


def _laws(quantity: str, unit: str) -> Callable[[Study], str]:
    def sentence(study: Study) -> str:
        _, column = _error_of(quantity)
        new, double, power = (
            number(1e3 * study.evidence.law(law).largest(column), 2)
            for law in ("variable_power_log", "double_power", "power")
        )
        text = (
            f"In the second half of the run the errors reach {new} (new law), {double} (double power) and {power} "
            f"(power) {unit}"
        )
        return f"{text}. {_burst(study)}" if quantity == "angular velocity" else f"{text}."

    return sentence


def _burst(study: Study) -> str:
    """The burst of the traditional laws in Figure 15: when, how fast, and how small sigma is there."""
    run = study.evidence.law("power")
    t, sigma = run["t"], run["sigma_rotation"]
    step = float(t[1] - t[0])
    fast = run.above("velocity_error_rotation", 50.0)
    looked_at = (t > 0.5 * run.end) & (t < 0.95 * run.end)
    when = float(t[np.argmax(np.where(looked_at, np.abs(fast), 0.0))])
    there = np.abs(t - when) <= _BURST
    frequency = np.count_nonzero(np.diff(np.sign(fast[there]))) / (2 * step * np.count_nonzero(there))
    small, large = (float(np.max(np.abs(sigma[rows]))) for rows in (there, looked_at))
    return (
        f"The burst of the traditional laws around {when:.1f} s ({frequency:.0f} Hz) is the rotation's spring, which "
        f"they drive where σ is small (below {small:.1g} rad/s, elsewhere up to {large:.1g}): the slope of |σ|^α grows "
        "without bound towards 0."
    )


def _payloads(quantity: str, unit: str) -> Callable[[Study], str]:
    def sentence(study: Study) -> str:
        _, column = _error_of(quantity)
        sizes = [
            number(1e3 * _late(study, column, f"paper/group3_{name}"), 2)
            for name in ("payload_minus", "nominal", "payload_plus")
        ]
        return (
            f"With −20 %, 0 and +20 % of payload the errors reach {', '.join(sizes[:2])} and {sizes[2]} {unit} in the "
            "second half of the run."
        )

    return sentence


def _without(study: Study) -> str:
    off = study.evidence.runs["paper/group4_fast_off"]
    return (
        f"On the logarithmic scale the distance to the run with fast control grows along a line until {off.end:.2f} s, "
        "where the run without it leaves its bound."
    )


def _always(text: str) -> Callable[[Study], str]:
    return lambda _: text


def _of_group(
    first: int, names: tuple[tuple[str, str], ...], how: Callable[[str, str], Callable[[Study], str]]
) -> dict[str, Callable[[Study], str]]:
    return {f"figure_{number:02d}": how(name, unit) for number, (name, unit) in enumerate(names, first)}


_FOUR = (("lift", "mm"), ("rotation", "mrad"), ("lift velocity", "mm/s"), ("angular velocity", "mrad/s"))

SEEN: Mapping[str, Callable[[Study], str]] = {
    "figure_04": _always("Where the curves cross stands at claim 10; on the right the lower curve is the flatter law."),
    "figure_05": _always("When σ comes within 1 % of its start, and by how much it passes 0, stands at claim 10."),
    "figure_06": _always(
        "The slow law sees the joints alone; it is the difference of the rates on both sides of a spring that damps it."
    ),
    "figure_07": _sea,
    **_of_group(8, _FOUR, _first),
    **_of_group(12, _FOUR, _laws),
    **_of_group(16, (*_FOUR, ("lift velocity", "mm/s"), ("angular velocity ", "mrad/s")), _payloads),
    **{f"figure_{number}": _without for number in range(22, 26)},
    "literal_law": _always("Without a boundary layer the error never comes to rest; a limit on the law does not help."),
    "log_readings": _always(
        "Read as bases, the logarithms are steep enough to drive the springs; read as powers, not."
    ),
    "our_numbers": _always(
        "Over a wide range of both numbers the error is the same; beyond its ends the springs take part."
    ),
}
"""Figure name -> what to see in it."""
