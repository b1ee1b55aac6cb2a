"""Turns at deriving expressions: CasADi's simplification is one switch for all threads of a process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property, wraps
from threading import RLock
from typing import Any, ParamSpec, Self, TypeVar, overload

from springline.model import lazy_casadi as ca

P = ParamSpec("P")
T = TypeVar("T")

_TURN = RLock()


def derivation(function: Callable[P, T]) -> Callable[P, T]:
    """A function that builds expressions: one thread at a time is in any of them, and none while `as_written` holds."""

    @wraps(function)
    def in_turn(*args: P.args, **kwargs: P.kwargs) -> T:
        with _TURN:
            return function(*args, **kwargs)

    return in_turn


class derived_property(cached_property[T]):  # noqa: N801  a decorator, like the one that it refines
    """A cached property that builds expressions: derived in turn, and once, whichever threads ask for it."""

    @overload
    def __get__(self, instance: None, owner: type[Any] | None = None) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type[Any] | None = None) -> T: ...

    def __get__(self, instance: object, owner: type[Any] | None = None) -> Self | T:
        """The value, derived where it is not yet known."""
        with _TURN:
            return super().__get__(instance, owner)


@contextmanager
def as_written() -> Iterator[None]:
    """Within this block CasADi builds expressions literally, without rewriting a * (1/b) into a / b and the like."""
    with _TURN:
        before = ca.GlobalOptions.getSimplificationOnTheFly()
        ca.GlobalOptions.setSimplificationOnTheFly(False)
        try:
            yield
        finally:
            ca.GlobalOptions.setSimplificationOnTheFly(before)
