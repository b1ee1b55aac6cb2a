"""Answers before the simulation: the loop linearised at frozen times, its boundaries, margins and time scales."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
