"""The kernel: the loop printed around a Program, compiled once, loaded, and called with arrays."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
