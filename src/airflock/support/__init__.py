"""Support: errors, files, locks, cache, threads, spelling, the machine. Knows nothing of flocks."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
