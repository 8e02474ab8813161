"""Layer 2: what lies between a wish and a motion: body, sensors, radio, wind.

The package can be called: `airflock.body(globals())` gathers a body of your own (`core.contract.body`).
"""

import sys
from types import ModuleType
from typing import Any

from airflock.core.contract import Body
from airflock.core.contract import body as _gathered


class _Callable(ModuleType):
    """The package, which is also the function that gathers a body."""

    def __call__(self, namespace: Any, name: str = "") -> Body:
        """Gather a body from a module, a class or a mapping of names."""
        return _gathered(namespace, name)


sys.modules[__name__].__class__ = _Callable
