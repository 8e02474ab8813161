"""Namespaces: where rules are gathered from."""

from collections.abc import Mapping
from typing import Any

from airflock.support import RuleError, shortened


def namespace_names(namespace: Any, name: str = "") -> tuple[dict[str, Any], str]:
    """What a module, a class or a mapping of names holds, and what it is called: `name`, its NAME, or its module's.

    A static method is the function inside, so that the check of rules can name it and its decorator.
    """
    if not isinstance(namespace, Mapping) and not hasattr(namespace, "__dict__"):
        told = shortened(repr(namespace), 80)
        raise RuleError(f"{told} holds no rules; give a module, a class, or names such as globals()")
    found = dict(namespace) if isinstance(namespace, Mapping) else dict(vars(namespace))
    found = {key: value.__func__ if isinstance(value, staticmethod) else value for key, value in found.items()}
    return found, name or str(found.get("NAME") or found.get("__name__", "own")).rpartition(".")[2].strip("_")
