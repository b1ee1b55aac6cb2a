"""From symbolic Functions to C, and from C to loaded code. The rooms in it have doors of their own."""

import lazy_loader  # type: ignore[import-untyped] # has no types

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, submodules=("elementary", "export", "files", "kernel", "program")
)
