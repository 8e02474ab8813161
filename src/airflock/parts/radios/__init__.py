"""Layer 2: radios, one kind per file: plain rules for which packets arrive, when, and what is believed since.

Copy the shape of `congestion.py` or, for links that remember, of `bursts.py` for a kind of your
own; docs/radios.md shows one.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
