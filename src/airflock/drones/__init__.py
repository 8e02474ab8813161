"""Drones: what runs on board, and the bytes that it exchanges with autopilots."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
