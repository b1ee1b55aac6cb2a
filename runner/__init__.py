"""Scenarios in, tables and figures out: `load_scenario`, `simulate`, `batch`.

What is wrong with a scenario or its numbers is an InputError (a ValueError), which names file, key and what was
expected; an argument of another kind, such as a scenario's name where a Scenario belongs, is a TypeError.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from springline.runner.batch import batch
    from springline.runner.errors import InputError
    from springline.runner.scenario import load_scenario
    from springline.runner.simulate import simulate

__all__ = ["InputError", "batch", "load_scenario", "simulate"]

_HOME = {"InputError": "errors", "batch": "batch", "load_scenario": "scenario", "simulate": "simulate"}


class _Package(ModuleType):
    """The functions are imported on demand, for CasADi and Arrow take a second that `springline --help` has no use for.

    Two of them have their submodule's name. The import of a submodule binds it in the package, but what a class says
    comes before what an instance holds, so here the name is always the function.
    """


def _on_demand(name: str, home: str) -> property:
    def function(_: ModuleType) -> object:
        return getattr(import_module(f"springline.runner.{home}"), name)

    return property(function, lambda _package, _submodule: None)


for _name, _home in _HOME.items():
    setattr(_Package, _name, _on_demand(_name, _home))
sys.modules[__name__].__class__ = _Package
