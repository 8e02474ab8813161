"""Certificates: what flights show of a limit, and checks of what was shown."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
