"""Make a package that has a verb's name callable like the verb's function.

Importing `airflock.evolve` puts the module where a function of that name would stand, so the module itself is called.
"""

import inspect
import sys
from importlib import import_module
from types import ModuleType
from typing import Any


def make_callable(package: str, module: str, function: str) -> None:
    """Let calls of `package` go to a function of one of its modules, which is imported at the first call.

    Signature and help are those of the function.
    """

    def target() -> Any:
        return getattr(import_module(module), function)

    class CallablePackage(ModuleType):
        def __call__(self, *arguments: Any, **keywords: Any) -> Any:
            return target()(*arguments, **keywords)

        @property
        def __signature__(self) -> inspect.Signature:
            return inspect.signature(target())

    sys.modules[package].__class__ = CallablePackage
