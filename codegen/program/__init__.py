"""The Program: a system as frozen Functions, and how their instructions are printed in C."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
