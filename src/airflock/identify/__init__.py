"""Layer 6: from flight logs to the numbers of a scenario, with intervals and with reasons where there are none.

The package and its public function share a verb: the module can be called (docs/decisions/0010).
"""

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    """The module itself, which may be called like `airflock.identify.run.identify`."""

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        from airflock.identify.run import identify

        return identify(*arguments, **keywords)


sys.modules[__name__].__class__ = _Callable
