"""Evolve a flock: search spaces, optimisers, a store of every flight, executors; and `airflock.evolve(...)` itself.

The package and its public function share the field's verb: the module can be called (docs/decisions/0010).
"""

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    """The module itself, which may be called like `airflock.evolve.run.evolve`."""

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        from airflock.evolve.run import evolve

        return evolve(*arguments, **keywords)


sys.modules[__name__].__class__ = _Callable
