"""Bytes and their meaning: MAVLink 2 frames, signatures, messages, autopilots."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(__name__, ["orders"])
