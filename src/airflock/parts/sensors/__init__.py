"""Layer 2: sensors, one kind per file: plain rules for what an agent believes of its own position and velocity.

Copy the shape of `gnss.py` or, for equal errors along each axis, of `langevin.py` for a kind of
your own; docs/sensors.md shows one.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
