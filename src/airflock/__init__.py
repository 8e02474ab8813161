"""Airflock: decentralised flocks of drones and birds. The public names load on first use; `__init__.pyi` lists them."""

import lazy_loader

__version__ = "0.1.0"

_attached, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ = [*__all__, "__version__"]


def __getattr__(name: str) -> object:
    if name == "open":  # not in __all__: `from airflock import *` would hide Python's own
        name = "Flight"
    if name not in __all__:
        raise AttributeError(f"module 'airflock' has no attribute {name!r}")
    return _attached(name)
