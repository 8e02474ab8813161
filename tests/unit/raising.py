"""Which of our errors a function can raise by itself: read from its source, and from that of what it calls by name."""

import ast
import inspect
import textwrap
from functools import cache
from importlib import import_module

from airflock.support.errors import AirflockError

DEEP = 2  # calls that are followed: the public function, what it calls, and what that calls


@cache
def raised(function, owner=None, deep=DEEP):
    """Our errors that `function` (of the class `owner`) raises, or what it calls by name, `deep` calls down."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    known = {**vars(inspect.getmodule(function)), **inspect.getclosurevars(function).nonlocals}
    for node in ast.walk(tree):  # what is imported within the function
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("airflock"):
            home = import_module(node.module)
            known |= {alias.asname or alias.name: getattr(home, alias.name, None) for alias in node.names}
    found = set()
    for node in _uncaught(tree):
        if isinstance(node, ast.Raise) and node.exc is not None:
            what = _named(node.exc.func if isinstance(node.exc, ast.Call) else node.exc, known, owner)
            found |= {what} if inspect.isclass(what) and issubclass(what, AirflockError) else set()
        elif isinstance(node, ast.Call) and deep:
            found |= _of(_named(node.func, known, owner), owner, deep - 1)
    return frozenset(found)


def _uncaught(node):
    """Nodes of a tree, but not what stands in a `try` that catches anything: it may be said otherwise there."""
    yield node
    for child in ast.iter_child_nodes(node):
        if not (isinstance(node, ast.Try) and node.handlers and child in node.body):
            yield from _uncaught(child)


def _named(func, known, owner):
    """What a name, a method of `self` or a name in a module stands for; None where that cannot be told."""
    if isinstance(func, ast.Name):
        return known.get(func.id)
    if isinstance(func, ast.Attribute) and isinstance(func.value, ast.Name):
        if func.value.id == "self" and owner is not None:
            return inspect.getattr_static(owner, func.attr, None)
        if inspect.ismodule(known.get(func.value.id)):
            return getattr(known[func.value.id], func.attr, None)
    return None


def _of(what, owner, deep):
    what = inspect.unwrap(what) if callable(what) else what
    if inspect.isclass(what):
        owner, what = what, vars(what).get("__init__")
    if not inspect.isfunction(what) or not what.__module__.startswith("airflock"):
        return frozenset()
    try:
        return raised(what, owner, deep)
    except (OSError, SyntaxError):  # made at run time: has no source
        return frozenset()
