"""What users write and read: errors that name the place, TOML, tables with units on disk."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
