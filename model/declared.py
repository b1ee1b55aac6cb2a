"""What a class of a mechanism, law or controller declares, and whether names and comments of C can be made of it.

Each function raises ValueError, with the class's name and what was expected, for what cannot.
"""

from __future__ import annotations

import inspect
import math
import re
from collections import Counter
from collections.abc import Sequence, Set

from springline.model import lazy_casadi as ca
from springline.model.parameters import Joint, Parameter

_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def snake_case(name: str) -> str:
    """A class's name as it is written in a file: "OneLink" is "one_link"."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def expect_names(owner: str, what: str, names: Sequence[object]) -> None:
    """Names that are parts of names in C: ASCII letters, digits and underscores after a letter, each only once."""
    for name in names:
        if not isinstance(name, str) or not _IDENTIFIER.fullmatch(name):
            raise ValueError(f"{owner}: {what}: expected a letter, then letters, digits and underscores, got {name!r}")
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"{owner}: {what}: {twice[0]!r} is there twice")


def expect_text(owner: str, what: str, text: object) -> None:
    """A line that a comment in C can hold."""
    if not isinstance(text, str) or not text.isprintable() or "*/" in text or "/*" in text or text.endswith("\\"):
        raise ValueError(f"{owner}: {what}: expected a line of text without /* and */, got {text!r}")


def expect_parameters(owner: str, what: str, parameters: object, joints: Sequence[Joint]) -> None:
    """A tuple of Parameters with different names and admissible defaults."""
    if not isinstance(parameters, tuple) or not all(isinstance(item, Parameter) for item in parameters):
        raise ValueError(f"{owner}: {what}: expected a tuple of Parameter, got {parameters!r}")
    expect_names(owner, what, [item.name for item in parameters])
    for item in parameters:
        for text in (item.unit, item.meaning):
            expect_text(owner, f"{what}, {item.name}", text)
        for value in item.defaults(joints) if joints or not item.per_joint else ():
            if not is_number(value) or not item.bounds.holds(value):
                raise ValueError(f"{owner}: {what}, {item.name}: expected as default {item.bounds}, got {value!r}")


def expect_methods(item: object, base: type) -> None:
    """What the class of `item` has instead of a method of `base` takes the arguments that it will be called with."""
    for name, method in inspect.getmembers(base, inspect.isfunction):
        own = getattr(type(item), name)
        if name.startswith("_") or own is method:
            continue
        wanted = list(inspect.signature(method).parameters)
        try:
            given = inspect.signature(getattr(item, name))
            given.bind(*wanted[1:])
        except TypeError as error:
            found = f"{name}{inspect.signature(own)}" if inspect.isfunction(own) else repr(own)
            raise ValueError(f"{type(item).__name__}: expected {name}({', '.join(wanted)}), got {found}") from error


def expect_numbers(owner: str, what: str, values: object, count: int) -> None:
    """A tuple or list of so many finite numbers."""
    if not isinstance(values, tuple | list) or len(values) != count:
        raise ValueError(f"{owner}: {what}: expected {count} entries, one per joint, got {values!r}")
    if not all(is_number(value) and math.isfinite(value) for value in values):
        raise ValueError(f"{owner}: {what}: expected finite numbers, got {values!r}")


def is_number(value: object) -> bool:
    """Whether it is a plain number, which True is not."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def column(owner: str, what: str, value: object, rows: int, known: Set[int]) -> ca.SX:
    """An expression of `rows` entries that depends on symbols of `known` alone, which `symbols_of` gives."""
    if not isinstance(value, ca.SX | ca.DM | int | float):
        raise ValueError(f"{owner}: {what}: expected a CasADi SX expression, got {type(value).__name__}")
    made: ca.SX = ca.SX(value)
    if made.shape != (rows, 1):
        shape = "a scalar" if rows == 1 else f"{rows} x 1"
        raise ValueError(f"{owner}: {what}: expected {shape}, got {made.shape[0]} x {made.shape[1]}")
    expect_given(owner, what, made, known)
    return made


def expect_given(owner: str, what: str, made: ca.SX, known: Set[int]) -> None:
    """An expression of what its author was given, symbols of `known`, without NaN."""
    foreign = [item.name() for item in ca.symvar(made) if hash_of(item) not in known]
    if foreign:
        raise ValueError(f"{owner}: {what}: depends on {foreign[0]!r}, which it was not given")
    if _has_nan(made):  # a float of a symbol is one, silently
        text = "contains NaN, which float() and the functions of math make of an expression: use those of casadi"
        raise ValueError(f"{owner}: {what}: {text}")


def _has_nan(expression: ca.SX) -> bool:
    """Whether a constant in it is NaN."""
    graph = ca.Function("graph", ca.symvar(expression), [expression])
    return any(
        graph.instruction_id(k) == ca.OP_CONST and math.isnan(graph.instruction_constant(k))
        for k in range(graph.n_instructions())
    )


def symbols_of(*expressions: ca.SX) -> Set[int]:
    """The symbols of some columns, each as what tells it apart from another of the same name."""
    return {hash_of(item) for item in ca.symvar(ca.vertcat(*expressions))}


def hash_of(symbol: ca.SX) -> int:
    """What tells two symbols of one name apart."""
    return int(symbol.element_hash())
