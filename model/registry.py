"""What is known by name: what comes with springline, and what a user's files have brought."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from springline.model.declared import expect_methods

T = TypeVar("T")


class Registry(dict[str, T]):
    """Things of one kind by name.

    base   the class that all of them are instances of
    check  raises ValueError, with what was expected, for one that is not complete
    Whoever goes through it, or counts, sees what comes with springline, in its order. What a user's file has brought is
    found by its key alone, which has a hash of the file, so that it means the same in every process.
    """

    def __init__(self, base: type[Any], packaged: Mapping[str, T], check: Callable[[T], None]) -> None:
        super().__init__(packaged)
        self.base = base
        self._check = check
        self._brought: dict[str, T] = {}

    def __missing__(self, name: str) -> T:
        return self._brought[name]

    def __contains__(self, name: object) -> bool:
        return super().__contains__(name) or name in self._brought

    def is_packaged(self, name: str) -> bool:
        """Whether it comes with springline."""
        return super().__contains__(name)

    def bring(self, key: str, item: T) -> None:
        """Add what a user's file holds. Raises ValueError if it is not complete, or called as one that there is."""
        expect_methods(item, self.base)
        self._check(item)
        name = str(getattr(item, "name", ""))
        if super().__contains__(name):
            raise ValueError(f"its name is {name!r}, as that of one that comes with springline: give it another")
        self._brought[key] = item
