"""Where a base motion of a user's own jumps, in position or in rate, and has no accelerations for the arm to feel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from springline.model import lazy_casadi as ca
from springline.model.base_motion import BaseMotion, signals_of
from springline.model.parameters import ParameterVector
from springline.model.signals import constant_zero
from springline.model.symbolic import derivation, over_runs

Floats = NDArray[np.float64]

_SAMPLES = 4096
_MOST_LOOKED_AT = 100  # switches, which take a millisecond each
_JUMP = 1e-9  # of the largest value there is: rounding is less

_CHOICES = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_FLOOR, ca.OP_CEIL}


@dataclass(frozen=True, slots=True)
class Corner:
    """A jump of a coordinate's position or rate.

    key    of the coordinate;  t: when first, s;  size: m or rad, or per s
    count  of such jumps that were found
    """

    key: str
    of: Literal["position", "rate"]
    t: float
    size: float
    count: int


@derivation
def corners(motion: BaseMotion, given: Mapping[str, float], duration: float) -> list[Corner]:
    """The jumps of a motion from 0 to `duration`, s, with its parameters as given.

    Looked at are the times at which an operation switches that could make one: abs, sign, min, max, floor, remainders,
    comparisons, the branch of atan2. Where what it switches between meets with its rate, there is none.
    """
    t, vector = ca.SX.sym("t"), ParameterVector()
    moving = {
        key: signal
        for key, signal in signals_of(motion, t, vector.table("base_motion", motion.parameters, ())).items()
        if signal is not constant_zero()
    }
    switches = _switches(ca.vertcat(*(signal.value for signal in moving.values())), t, vector.sx) if moving else []
    if not switches:
        return []
    p = np.array([given[item.name] for item in motion.parameters])
    switching = ca.Function("switches", [t, vector.sx], [ca.vertcat(*switches)])
    kinds: tuple[Literal["position", "rate"], ...] = ("position", "rate")
    sought = [(key, of) for key in moving for of in kinds]
    written = [item for signal in moving.values() for item in (signal.value, signal.rate)]
    values = ca.Function("values", [t, vector.sx], [ca.densify(ca.vertcat(*written))])

    def at(function: ca.Function, times: Floats) -> Floats:
        (result,) = over_runs(function, times[None], np.tile(p[:, None], len(times)))
        return result[:, :, 0]

    grid = np.linspace(0.0, duration, _SAMPLES)
    states, sizes = at(switching, grid), np.abs(at(values, grid)).max(axis=0)
    places = np.argwhere((states[1:] != states[:-1]) & ~(np.isnan(states[1:]) & np.isnan(states[:-1])))
    found: dict[tuple[str, str], list[tuple[float, float]]] = {}
    seen: set[float] = set()
    for k, switch in places[:_MOST_LOOKED_AT].tolist():
        left, right = float(grid[k]), float(grid[k + 1])
        while left < (middle := left + (right - left) / 2) < right:
            same = at(switching, np.array([middle]))[0, switch] == states[k, switch]
            left, right = (middle, right) if same else (left, middle)
        if right in seen:
            continue
        seen.add(right)
        # One double beyond either side, for at zero itself a sign is neither.
        before, after = at(values, np.nextafter([left, right], [-np.inf, np.inf]))
        for i, what in enumerate(sought):
            jump = abs(float(after[i] - before[i]))
            if not jump <= _JUMP * sizes[i]:
                found.setdefault(what, []).append((right, jump))
    return [
        Corner(key, of, *found[key, of][0], len(found[key, of]))
        for key, of in sought
        if (key, of) in found and (of == "position" or (key, "position") not in found)
    ]


def _switches(column: ca.SX, t: ca.SX, p: ca.SX) -> list[ca.SX]:
    """What is piecewise constant in time, and changes where an operation of `column` switches."""
    function, work, result = ca.Function("motion", [t, p], [column]), {}, []
    symbols = (t, p)
    for k in range(function.n_instructions()):
        op, into, taken = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
        if op == ca.OP_OUTPUT:
            continue
        if op == ca.OP_CONST:
            work[into[0]] = ca.SX(function.instruction_constant(k))
            continue
        if op == ca.OP_INPUT:
            work[into[0]] = symbols[taken[0]][taken[1]]
            continue
        given = [work[place] for place in taken]
        made = ca.SX.unary(op, *given) if len(given) == 1 else ca.SX.binary(op, *given)
        if op in _CHOICES:
            result.append(made)
        elif op in (ca.OP_FABS, ca.OP_SIGN):
            result.append(given[0] >= 0)
        elif op in (ca.OP_FMIN, ca.OP_FMAX):
            result.append(given[0] >= given[1])
        elif op == ca.OP_COPYSIGN:
            result.append(given[1] >= 0)
        elif op == ca.OP_ATAN2:
            result.append(given[0] >= 0)
        elif op in (ca.OP_FMOD, ca.OP_REMAINDER):
            result.append(ca.floor(given[0] / given[1] + (0.5 if op == ca.OP_REMAINDER else 0.0)))
        work[into[0]] = made
    return [item for item in result if ca.depends_on(item, t)]
