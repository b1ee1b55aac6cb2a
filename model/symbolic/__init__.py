"""Symbolic expressions: arithmetic that stays as it is written, small linear systems, normal forms."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
