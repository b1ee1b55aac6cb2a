"""Jumps of a user's base motion are found where they are, and smooth ones are not taken for any."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import casadi as ca
import pytest

from springline.model import BaseMotion, Parameter
from springline.model.corners import corners
from springline.model.parameters import Values


def motion(function: Callable[[ca.SX, Values], ca.SX], key: int = 2) -> BaseMotion:
    class Own(BaseMotion):
        parameters = (Parameter("at", "s", 1.3, "when"),)

        def motion(self, t: ca.SX, p: Values) -> Sequence[ca.SX | float]:
            return [function(t, p) if k == key else 0.0 for k in range(6)]

    return Own()


def quintic(t: ca.SX) -> ca.SX:
    s = ca.fmax(0, ca.fmin(1, t))
    return s**3 * (10 - 15 * s + 6 * s**2)


JUMPS = [
    ("a step", lambda t, p: ca.if_else(t < p.at, 0, 0.5), "position", 1.3, 0.5, 1),
    ("a step by sign", lambda t, p: 0.1 * ca.sign(t - 2.5), "position", 2.5, 0.2, 1),
    ("a step between", lambda t, p: ca.if_else(ca.logic_and(t > 1, t < 2), 0.2, 0), "position", 1.0, 0.2, 2),
    ("a saw", lambda t, p: 0.3 * ca.fmod(t, 1.5), "position", 1.5, 0.45, 6),
    ("stairs", lambda t, p: 0.1 * ca.floor(t / 4), "position", 4.0, 0.1, 2),
    ("an angle that wraps", lambda t, p: ca.atan2(ca.sin(t), ca.cos(t)), "position", 3.141592653589793, 6.283185307, 2),
    ("a kink", lambda t, p: 2 * ca.fabs(t - p.at), "rate", 1.3, 4.0, 1),
    ("a ramp that begins", lambda t, p: ca.if_else(t < 2, 0, 0.7 * (t - 2)), "rate", 2.0, 0.7, 1),
    ("an end stop", lambda t, p: ca.fmin(0.3 * t, 1.2), "rate", 4.0, 0.3, 1),
    ("rectified", lambda t, p: ca.fabs(ca.sin(t)), "rate", 3.141592653589793, 2.0, 3),
]  # fmt: skip
SMOOTH = [
    ("a sine", lambda t, p: ca.sin(t)),
    ("a quintic between rests", lambda t, p: quintic(t - p.at)),
    ("parabolas that meet", lambda t, p: ca.if_else(t < 2, t**2, 4 * t - 4)),
    ("a square of abs", lambda t, p: ca.fabs(t - 2) * (t - 2)),
    ("a switch after the run", lambda t, p: ca.if_else(t < 11, 0, 1)),
    ("a switch that time does not move", lambda t, p: ca.fabs(p.at - 2) * ca.sin(t)),
    ("a tanh", lambda t, p: ca.tanh((t - 2) / 0.05)),
    ("an angle that is unwound", lambda t, p: ca.atan2(ca.sin(t), 2 + ca.cos(t))),
]


@pytest.mark.parametrize(("name", "function", "of", "t", "size", "count"), JUMPS)
def test_a_jump_is_found(
    name: str, function: Callable[[ca.SX, Values], ca.SX], of: str, t: float, size: float, count: int
) -> None:
    (found,) = corners(motion(function), {"at": 1.3}, 10.0)
    assert (found.key, found.of, found.count) == ("heave", of, count)
    assert (found.t, found.size) == (pytest.approx(t, rel=1e-14), pytest.approx(size, rel=1e-9))


@pytest.mark.parametrize(("name", "function"), SMOOTH)
def test_what_is_smooth_enough_has_none(name: str, function: Callable[[ca.SX, Values], ca.SX]) -> None:
    assert corners(motion(function), {"at": 1.3}, 10.0) == []


def test_its_parameters_and_the_run_say_when() -> None:
    kinked = motion(lambda t, p: ca.fabs(t - p.at), key=3)
    (found,) = corners(kinked, {"at": 0.25}, 1.0)
    assert (found.key, found.of, found.t) == ("roll", "rate", 0.25)
    assert corners(kinked, {"at": 1.5}, 1.0) == [] and len(corners(kinked, {"at": 1.5}, 2.0)) == 1
