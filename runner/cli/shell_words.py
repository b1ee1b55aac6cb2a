"""The words of a line that a shell wants completed, whichever shell it is.

Shells ask by environment variables, which typer reads and wants as all but bash send them.
"""

from __future__ import annotations

from collections.abc import MutableMapping, Sequence

_INSTRUCTION = "_SPRINGLINE_COMPLETE"
KEY = "_SPRINGLINE_COMPLETE_KEY"
"""The key whose value bash wants, which it takes for a word of its own."""


def prepare(environment: MutableMapping[str, str]) -> bool:
    """Whether a shell asks what could come next; if so, its words are as others send them, too.

    bash takes "=" for a word of its own, and what is completed for the word behind the last one.
    """
    instruction = environment.get(_INSTRUCTION, "")
    if not instruction.startswith("complete_"):
        return False
    if instruction == "complete_bash":
        words, at = environment.get("COMP_WORDS", "").split("\n"), environment.get("COMP_CWORD", "")
        if at.isdecimal() and int(at) < len(words):
            before, key, word = _unbroken(words[: int(at) + 1])
            environment.update({"COMP_WORDS": "\n".join([*before, word]), "COMP_CWORD": str(len(before)), KEY: key})
    return True


def _unbroken(words: Sequence[str]) -> tuple[list[str], str, str]:
    """Words as they were typed, what stands before the last "=" of the last one, and what stands behind it.

    An option whose value is the last word is a word by itself.
    """
    *before, last = _joined(words)
    if words[-1] and "=" in words[-2:]:
        head, _, last = last.rpartition("=")
        if head.startswith("-"):
            option, _, head = head.partition("=")
            before.append(option)
        return before, head, last
    return before, "", last


def _joined(words: Sequence[str]) -> list[str]:
    """Words without gaps around "="; an empty word is one that has been begun behind a blank."""
    found: list[str] = []
    for before, word in zip(["", *words], words, strict=False):
        if found and word and "=" in (before, word):
            found[-1] += word
        else:
            found.append(word)
    return found
