"""The law of rules: what a rule's text may contain. Checked for ours in the tests and for users' before compiling."""

import ast
import inspect
import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from airflock.errors import RuleError
from airflock.rules.integers import BITWISE, integers_of, is_integer, tree_of
from airflock.rules.nodes import walk

ALLOWED_CALLS = {"min", "max", "abs", "float", "int", "range", "len"}
RESERVED = {"min": "least", "max": "most"}  # what a driver calls instead: no name for a variable beside it
TAKEN = "real"  # what a driver makes of every literal
FORBIDDEN = (
    ast.Try, ast.With, ast.Raise, ast.Lambda, ast.ListComp, ast.DictComp, ast.SetComp, ast.GeneratorExp, ast.NamedExpr,
)  # fmt: skip


def faults(rule: Callable[..., Any]) -> list[str]:
    """Everything in a rule that a compiler or a GPU would not take, each as one line with its place."""
    node = tree_of(rule)
    code = rule.__code__
    found = []
    integers = integers_of(rule)

    def complain(where: ast.AST, text: str) -> None:
        line = code.co_firstlineno + getattr(where, "lineno", 1) - 1
        found.append(f"{code.co_filename}:{line}: rule {rule.__name__}: {text}")

    if node.decorator_list:
        complain(node, "has a decorator; a rule is a plain function")
    if TAKEN in code.co_varnames:
        complain(node, f"{TAKEN} is what the engine calls here; give the variable another name")
    for item in walk(node):
        called = RESERVED.get(getattr(item.func, "id", "")) if isinstance(item, ast.Call) else None
        if called in code.co_varnames:
            complain(item, f"{called} is what the engine calls here; give the variable another name")
        if isinstance(item, ast.Call) and getattr(item.func, "id", "") in RESERVED and len(item.args) < 2:
            complain(item, f"{item.func.id} of fewer than two numbers; write {item.func.id}(a, b)")  # type: ignore[attr-defined]
        if isinstance(item, FORBIDDEN):
            complain(item, f"{type(item).__name__} is not allowed in a rule")
        if isinstance(item, ast.BinOp) and not isinstance(item.op, (ast.Pow, *BITWISE)):
            for side, other in ((item.left, item.right), (item.right, item.left)):
                if isinstance(side, ast.Constant) and type(side.value) is int and not is_integer(other, integers, rule):
                    complain(item, f"integer {side.value} in float arithmetic; write {side.value}.0")
        if isinstance(item, ast.Attribute) and isinstance(item.value, ast.Name):
            module = rule.__globals__.get(item.value.id)
            if inspect.ismodule(module) and module.__name__ != "math":
                instead = f"; write math.{item.attr}" if hasattr(math, item.attr) else ""
                complain(item, f"{item.value.id}.{item.attr}: only math may be used through a module name{instead}")
    return found


@lru_cache(maxsize=4096)
def _told(rule: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(faults(rule))


def check(rule: Callable[..., Any]) -> None:
    """Raise a RuleError that lists every fault of a rule; do nothing if it has none. Each is looked for once."""
    found = _told(rule)
    if found:
        raise RuleError("\n".join(found))
