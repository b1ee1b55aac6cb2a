"""Base motions of a user's own: what such a class has to tell, its parameters and six expressions of time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cache
from typing import ClassVar

from springline.model import lazy_casadi as ca
from springline.model.base import ALIASES, COORDINATES, MOTION_ORDER
from springline.model.declared import column, expect_names, expect_parameters, expect_text, snake_case, symbols_of
from springline.model.parameters import Parameter, ParameterVector, Values
from springline.model.registry import Registry
from springline.model.signals import Signal, constant_zero

RESERVED = ("kind", "mount", "mount_rpy", *(c.key for c in COORDINATES), *ALIASES)
"""Keys of [base_motion] that no parameter of such a class may be called."""


class BaseMotion(ABC):
    """How a base moves. A subclass says at least its motion.

    name        the class's name in snake_case unless the class says otherwise
    title       for people: the name unless the class says otherwise
    parameters  one number each; they stand in [base_motion] beside `kind`
    """

    name: ClassVar[str]
    title: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]] = ()

    def __init_subclass__(cls) -> None:
        """Name the class unless it names itself."""
        cls.name = vars(cls).get("name", snake_case(cls.__name__))
        cls.title = vars(cls).get("title", cls.name)

    @abstractmethod
    def motion(self, t: ca.SX, p: Values) -> Sequence[ca.SX | float]:
        """Surge, sway, heave, roll, pitch, yaw (m, rad) at time t, s.  p.<name>: its parameters.

        Rates and accelerations follow by differentiation. What is the number 0 does not move and costs nothing.
        """


def signals_of(motion: BaseMotion, t: ca.SX, p: Values) -> dict[str, Signal]:
    """The motion by the coordinates' keys; one that is exactly zero is constant_zero().

    Raises ValueError, with the class's name, for what are no six scalar expressions of t and p.
    """
    owner = f"base motion {motion.name}"
    given = motion.motion(t, p)
    if isinstance(given, ca.SX | ca.DM):
        given = ca.vertsplit(ca.SX(given)) if given.numel() else []
    names = ", ".join(MOTION_ORDER)
    if not isinstance(given, list | tuple):
        raise ValueError(f"{owner}: motion: expected six expressions ({names}), got {type(given).__name__}")
    if len(given) != len(MOTION_ORDER):
        raise ValueError(f"{owner}: motion: expected six expressions ({names}), got {len(given)}")
    result, known = {}, symbols_of(t, *p.values())
    for key, item in zip(MOTION_ORDER, given, strict=True):
        value = column(owner, f"motion, {key}", item, 1, known)
        rate = ca.gradient(value, t)
        result[key] = constant_zero() if value.is_zero() else Signal(value, rate, ca.gradient(rate, t))
    return result


@cache
def moving_terms(motion: BaseMotion) -> tuple[int, ...]:
    """1 for each of COORDINATES that moves, else 0. Raises ValueError as `signals_of` does."""
    p = ParameterVector().table("base_motion", motion.parameters, ())
    found = signals_of(motion, ca.SX.sym("t"), p)
    return tuple(int(found[c.key] is not constant_zero()) for c in COORDINATES)


def check_motion(motion: BaseMotion) -> None:
    """Raise ValueError, with what was expected, for a base motion that cannot be computed with."""
    owner = f"base motion {type(motion).__name__}"
    expect_names(owner, "name", [motion.name])
    expect_text(owner, "title", motion.title)
    expect_parameters(owner, "parameters", motion.parameters, ())
    for item in motion.parameters:
        if item.per_joint:
            raise ValueError(f"{owner}: parameters, {item.name}: expected one number, not one per joint")
        if item.name in RESERVED:
            raise ValueError(f"{owner}: parameters: {item.name!r} is a key of [base_motion] already")
    moving_terms(motion)


MOTIONS: Registry[BaseMotion] = Registry(BaseMotion, {}, check_motion)
