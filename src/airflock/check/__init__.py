"""The standing list of truths that any law, order parameter, body, sensor, radio or topology must pass."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
