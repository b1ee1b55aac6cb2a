"""Names for the parts of a formula, which generated C shows where a reader of the formula looks for them.

    with section("reaching law", "(20)"):
        size = named("size", ca.fabs(sigma))

`named` gives its expression back unchanged. What has a name is computed as such: sums and products are put together
anew on either side of it (symbolic/association.py), never across it. What is named in no section, or not at all, is
printed too, under a number.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

from springline.model import lazy_casadi as ca
from springline.model.declared import expect_names, expect_text


@dataclass(frozen=True)
class Term:
    """A named part of a formula.

    section    what the part belongs to, and where that is written: "reaching law", "(20)"
    name       without the joints
    joint      index of the joint that it belongs to, None for one that has an entry of each, or none
    value      a scalar, n x 1 or n x n
    """

    section: tuple[str, str]
    name: str
    joint: int | None
    value: ca.SX

    def labels(self, joints: tuple[str, ...]) -> list[str]:
        """A name for each entry of `value`, column by column: "size_lift", "H_lift_rotation"."""
        rows, columns = self.value.shape
        if self.joint is not None:
            return [f"{self.name}_{joints[self.joint]}"]
        if rows * columns == 1 and len(joints) > 1:
            return [self.name]
        if columns == 1:
            return [f"{self.name}_{joint}" for joint in joints[:rows]]
        return [f"{self.name}_{row}_{column}" for column in joints[:columns] for row in joints[:rows]]


_TERMS: ContextVar[list[Term] | None] = ContextVar("terms", default=None)
_SECTION: ContextVar[tuple[str, str]] = ContextVar("section", default=("", ""))
_JOINT: ContextVar[int | None] = ContextVar("joint", default=None)


def named(name: str, value: ca.SX) -> ca.SX:
    """`value`, which is called `name`: a letter, then letters, digits and underscores. Raises ValueError for others."""
    terms = _TERMS.get()
    if terms is not None:
        expect_names("named", "name", [name])
        terms.append(Term(_SECTION.get(), name, _JOINT.get(), ca.SX(value)))
    return value


@contextmanager
def section(title: str, equations: str = "") -> Iterator[None]:
    """Within, what is named belongs to this part; `equations`: where it is written, "(18), (19)" in docs/paper.md.

    Raises ValueError for a text that a comment in C cannot hold.
    """
    for text in (title, equations):
        expect_text("section", "title and equations", text)
    before = _SECTION.set((title, equations))
    try:
        yield
    finally:
        _SECTION.reset(before)


@contextmanager
def of_joint(index: int) -> Iterator[None]:
    """Within, what is named belongs to one joint."""
    before = _JOINT.set(index)
    try:
        yield
    finally:
        _JOINT.reset(before)


@contextmanager
def noted() -> Iterator[list[Term]]:
    """Within, what is named gets into the list, in order."""
    terms: list[Term] = []
    before = _TERMS.set(terms)
    try:
        yield terms
    finally:
        _TERMS.reset(before)
