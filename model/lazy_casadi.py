"""CasADi, imported when a name of it is first used: what only tells which arms and laws there are does not wait for it.

    from springline.model import lazy_casadi as ca

Aliases of types, which are computed when a file is imported, name its classes in quotes: Mapping[str, "ca.SX"].
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_NAME = "casadi"


def __getattr__(name: str) -> Any:
    """A name of CasADi's, looked up there once. Raises AttributeError where it has none."""
    value = globals()[name] = getattr(import_module(_NAME), name)
    return value


def __dir__() -> list[str]:
    """All names of CasADi's."""
    return dir(import_module(_NAME))
