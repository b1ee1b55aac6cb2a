"""The target `c`: a typed C interface with test vectors, ready to be built elsewhere."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
