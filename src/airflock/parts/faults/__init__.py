"""Layer 2: faults of one agent, one kind per file: plain rules that a flight calls while the fault lasts.

All kinds are our own definitions; sources of their numbers stand beside them.
Copy the shape of `motor.py` for a kind of your own; docs/faults.md shows one.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
