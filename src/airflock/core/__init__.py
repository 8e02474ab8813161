"""Layer 0: plain scalar Python. Nothing here knows arrays, compilers or files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
