"""Displays: shapes of points in the sky, assignment of drones, a master that mends."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
