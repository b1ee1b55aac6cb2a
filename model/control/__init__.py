"""Control: sliding surface, reaching laws, and the composite law of slow and fast control."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
