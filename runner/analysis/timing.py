"""What an export prints about sample periods and delays: boundaries of its scenario, in sentences."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from springline.runner.analysis.crossings import delay_max
from springline.runner.analysis.loop import Boundary, LinearLoop, linear_loop
from springline.runner.analysis.reaching import AMPLITUDES
from springline.runner.analysis.sampled import period_max
from springline.runner.files import InputError
from springline.runner.scenario import Scenario

_UNBOUNDED = 3.0  # gain at the least amplitude, by that at the scenario's: power laws have 30, bounded ones 1.1
_DIGITS = 2  # as many as every machine's linear algebra agrees on
_USUAL = 1e-3  # s, the period that the exported main.c samples at where the scenario has none

Finder = Callable[[LinearLoop], Sequence[Boundary]]


def unbounded_gain(least: LinearLoop, here: LinearLoop) -> str:
    """That the law's gain grows without bound as sigma goes to zero, in words; "" where it does not.

    least, here  the loop at the least amplitude of AMPLITUDES and at the scenario's
    """
    small, own = (float(np.max(np.abs(loop.N))) for loop in (least, here))
    if small <= _UNBOUNDED * own:
        return ""
    return (
        f"the law's gain grows without bound as sigma goes to zero ({small / own:.2g} times as much at an amplitude of "
        f"{AMPLITUDES[0]:g} as at {_size_of(here)})"
    )


def timing(scenario: Scenario) -> tuple[str, ...]:
    """Sentences on the largest sample period and the largest delay of a scenario's loop, for those who embed it.

    Nothing is run. Numbers are rounded down to two digits, so that all machines say the same. Of a loop that cannot be
    linearised they say why.
    """
    try:
        return _sentences(scenario)
    except ValueError as error:
        problems = error.problems if isinstance(error, InputError) else ()
        reason = "; ".join(problem.expected for problem in problems) or str(error)
        return (f"What sample periods and delays the loop bears is not known: {reason}.",)


def _sentences(scenario: Scenario) -> tuple[str, ...]:
    amplitude = scenario.sigma_amplitude
    own = linear_loop(scenario, amplitude)
    gained = bool(np.any(own.N != 0.0))
    ends = [linear_loop(scenario, each) for each in AMPLITUDES] if gained else []
    why = unbounded_gain(ends[0], own) if gained else ""
    if why:
        return (
            f"No sample period and no delay is short enough for every oscillation to die out: {why}. The shorter both "
            "are, the smaller is the limit cycle that is left; `springline analyze` predicts it.",
        )
    loops = [own, *ends]
    delay = scenario.structure().delay * scenario.step
    having = f", with the scenario's delay of {_shown(delay)}," if delay else ", without delay,"
    found = [_sentence("sample period", having, loops, period_max)]
    if scenario.control_every:
        period = scenario.control_every * scenario.step
        found.append(_sentence("delay of the command", f" at the period of {_shown(period)}", loops, delay_max))
    else:
        found.append(_sentence("delay of the command", " under continuous control", loops, delay_max))
        steps = round(_USUAL / scenario.step)
        if steps and math.isclose(steps * scenario.step, _USUAL):
            sampled = scenario.with_overrides({"control.mode": "sampled", "control.period": steps * scenario.step})
            held = [linear_loop(sampled, loop.amplitude) for loop in loops]
            found.append(_sentence("delay of the command", f" at a period of {_shown(_USUAL)}", held, delay_max))
    holds = "They are computed for the exported scenario linearised about points of its reference, limits left out"
    if gained:
        low, high = AMPLITUDES
        rest = "in brackets for others from" if any("(" in each for each in found) else "others give the same, from"
        holds += f", for oscillations of sigma of amplitude {_size_of(own)}; {rest} {low:g} to {high:g}"
    bounded = any("about" in sentence for sentence in found)
    return (*found, f"{holds}. They are boundaries: stay well below." if bounded else f"{holds}.")


def _size_of(loop: LinearLoop) -> str:
    """The amplitude of sigma that a loop holds for, or one of each joint."""
    return " and ".join(f"{size:g}" for size in dict.fromkeys(np.atleast_1d(loop.amplitude).tolist()))


def _sentence(what: str, having: str, loops: Sequence[LinearLoop], finder: Finder) -> str:
    """What a finder says of the loop at the scenario's amplitude, which is first, and at others."""
    own, *others = (finder(loop)[0] for loop in loops)
    if own.value is None:
        return f"Largest {what}{having.rstrip(',')}: none; {own.reason}."
    texts = [_floor(item.value) if item.value is not None else "none" for item in (own, *others)]
    span = ""
    if others:
        low, high = min(texts[1:], key=_size), max(texts[1:], key=_size)
        span = "" if low == high == texts[0] else f" ({low})" if low == high else f" ({low} to {high})"
    return f"Largest {what}{having.rstrip(',')}: about {texts[0]}{span}."


def _size(text: str) -> float:
    return math.inf if text == "none" else float(text.split(maxsplit=1)[0])


def _shown(seconds: float) -> str:
    return f"{1e3 * seconds:g} ms"


def _floor(seconds: float) -> str:
    """A time in ms, rounded down."""
    value = 1e3 * seconds
    unit = math.floor(math.log10(value)) - (_DIGITS - 1)
    return f"{math.floor(value / 10.0**unit) * 10.0**unit:.{max(-unit, 0)}f} ms"
