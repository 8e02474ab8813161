"""Which fields of a record a rule reads, judged by its text and by those of the functions that it hands the record."""

import ast
import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

from airflock.core.rules.integers import resolve_function, tree_of
from airflock.core.rules.nodes import walk_tree


@cache
def fields_read(rule: Callable[..., Any], record: str) -> frozenset[str] | None:
    """Fields that a rule may read of the record that it calls by this name; None where its text does not tell."""
    nodes = walk_tree(tree_of(rule))
    found: set[str] = set()
    told = 0
    for item in nodes:
        if isinstance(item, ast.Attribute) and _is(item.value, record):
            found.add(item.attr)
            told += 1
        elif isinstance(item, ast.Call):
            for place, given in enumerate(item.args):
                if _is(given, record):
                    below = _read_below(item, place, rule)
                    if below is None:
                        return None
                    found |= below
                    told += 1
    return frozenset(found) if told == sum(_is(item, record) for item in nodes) else None


def _is(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name


def _read_below(call: ast.Call, place: int, rule: Callable[..., Any]) -> frozenset[str] | None:
    """What a function reads of the record that a rule hands it at this place."""
    called = resolve_function(call.func.id, rule) if isinstance(call.func, ast.Name) else None
    if called is None or any(isinstance(given, ast.Starred) for given in call.args):
        return None
    names = list(inspect.signature(called).parameters)
    return fields_read(called, names[place]) if place < len(names) else None
