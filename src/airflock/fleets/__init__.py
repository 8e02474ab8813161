"""Fleets: many nodes with vehicles and a radio channel in software, on a virtual clock or the real one."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
