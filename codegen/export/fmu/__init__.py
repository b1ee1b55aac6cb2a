"""The targets `fmu2` and `fmu3`: a part of a system as a Co-Simulation FMU."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
