"""Dynamics: the equations of motion of a mechanism, in the form with the fewest operations."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
