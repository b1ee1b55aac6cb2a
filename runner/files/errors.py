"""What a user got wrong, said so that it can be put right: file, key, what was expected, the nearest valid name."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from springline.codegen.nearest import nearest

# Longer values and lists of names would bury the message.
_LONGEST_VALUE = 60
_MOST_NAMES = 40


@dataclass(frozen=True, slots=True)
class Problem:
    """One mistake.

    where     the file (or "override of FILE") that holds it
    key       dotted key, "" for the file as a whole
    expected  what was expected there, or what is wrong, as a phrase
    given     the value as the user would write it, "" if there is none
    name      the mistaken name itself, if the mistake is a name
    valid     the names that would have been valid; the nearest one is suggested
    """

    where: str
    key: str
    expected: str
    given: str = ""
    name: str = ""
    valid: tuple[str, ...] = ()

    @property
    def nearest(self) -> str:
        """The valid name that is most like the mistaken one, or ""."""
        return nearest(self.name, self.valid)

    def __str__(self) -> str:
        text = ": ".join(part for part in (self.where, self.key, self.expected) if part)
        if self.given:
            text += f", got {shortened(self.given)}"
        if self.nearest:
            text += f"; did you mean {self.nearest!r}?"
        if self.valid:
            more = ", …" if len(self.valid) > _MOST_NAMES else ""
            text += f" (valid: {', '.join(self.valid[:_MOST_NAMES])}{more})"
        return text


class InputError(ValueError):
    """The user's input is wrong. `problems` holds every mistake that was found, one line each in the text."""

    exit_code = 2

    def __init__(self, *problems: Problem) -> None:
        super().__init__(*problems)
        self.problems = problems

    def __str__(self) -> str:
        return "\n".join(str(problem) for problem in self.problems)


def unknown(where: str, key: str, kind: str, name: str, valid: Iterable[str]) -> Problem:
    """A name that is none of `valid`; `kind` says what it should name: "key", "law", …"""
    return Problem(where, key, f"unknown {kind}", repr(name), name, tuple(valid))


def shortened(text: str) -> str:
    """`text`, or its beginning when it is long."""
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + "…"
