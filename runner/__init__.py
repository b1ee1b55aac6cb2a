"""Scenarios in, tables and figures out: `load_scenario`, `simulate`, `batch`.

What is wrong with a scenario or its numbers is an InputError (a ValueError), which names file, key and what was
expected; an argument of another kind, such as a scenario's name where a Scenario belongs, is a TypeError.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
