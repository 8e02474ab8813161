"""The law of rules: what a rule's text may contain. Checked for ours in the tests and for users' before compiling."""

import ast
import inspect
import math
from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import Any

from airflock.core.rule_syntax import BITWISE, integer_names, is_integer, tree_of, walk_tree
from airflock.support import RuleError

ALLOWED_CALLS = {"min", "max", "abs", "float", "int", "range", "len"}
RENAMED_BUILTINS = {"min": "least", "max": "most"}  # what a driver calls instead: no name for a variable beside it
CAST_NAME = "real"  # what a driver makes of every literal
INSTEAD = {"random": "percept.normal(0) or percept.uniform(0) in decide", "time": "percept.time in decide"}
NOT_FINITE = {"inf", "nan", "isinf", "isnan", "isfinite"}  # compiled arithmetic takes all numbers for finite
INNER = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)
HEAPED = ast.List, ast.Dict, ast.Set
FORBIDDEN = (
    ast.Try, ast.With, ast.Raise, ast.Lambda, ast.ListComp, ast.DictComp, ast.SetComp, ast.GeneratorExp, ast.NamedExpr,
)  # fmt: skip


def rule_errors(rule: Callable[..., Any]) -> list[str]:
    """Everything in a rule that a compiler or a GPU would not take, each as one line with its place."""
    if not inspect.isfunction(rule):
        name = getattr(rule, "__name__", type(rule).__name__)
        what = "has a decorator" if hasattr(rule, "__wrapped__") or hasattr(rule, "py_func") else "is an object"
        raise RuleError(f"{place_of(rule)}: rule {name} {what}; a rule is a plain function")
    node = tree_of(rule)
    # All errors of a rule are collected before one is raised, so that an author mends a file in one
    # go.
    errors: list[tuple[ast.AST, str]] = [(node, text) for text in _of_signature(node, rule.__code__.co_varnames)]
    for item in walk_tree(node):
        errors += [(item, text) for text in (*_of_text(item, node), *_of_numbers(item, rule), *_of_names(item, rule))]
    return [f"{place_of(rule, getattr(item, 'lineno', 1) - 1)}: rule {rule.__name__}: {text}" for item, text in errors]


def _of_signature(node: ast.FunctionDef, variables: tuple[str, ...]) -> Iterator[str]:
    if node.decorator_list:
        yield "has a decorator; a rule is a plain function"
    if node.args.kwonlyargs or node.args.vararg or node.args.kwarg:
        yield "has * in its arguments; a rule is called with values in their order"
    if CAST_NAME in variables:
        yield f"{CAST_NAME} is what the engine calls here; give the variable another name"


def _of_text(item: ast.AST, node: ast.FunctionDef) -> Iterator[str]:
    """Statements and expressions that no rule has."""
    if isinstance(item, FORBIDDEN):
        yield f"{type(item).__name__} is not allowed in a rule"
    if isinstance(item, HEAPED):
        yield f"{type(item).__name__} is not allowed in a rule; write a tuple, or a name for each number"
    if isinstance(item, (ast.Global, ast.Nonlocal)):
        yield f"sets {', '.join(item.names)} outside; what an agent keeps between decisions is its Memory"
    if isinstance(item, INNER) and item is not node:
        yield f"{item.name} is defined inside; write it beside the rule"


def _of_numbers(item: ast.AST, rule: Callable[..., Any]) -> Iterator[str]:
    """Integers among floats, and numbers that are not finite."""
    if isinstance(item, ast.BinOp) and not isinstance(item.op, (ast.Pow, *BITWISE)):
        integers = integer_names(rule)
        for side, other in ((item.left, item.right), (item.right, item.left)):
            if isinstance(side, ast.Constant) and type(side.value) is int and not is_integer(other, integers, rule):
                yield f"integer {side.value} in float arithmetic; write {side.value}.0"
    if isinstance(item, ast.Name) and not _finite(rule.__globals__.get(item.id)):
        yield f"{item.id} is not finite; write 1e30 for what is far"


def _of_names(item: ast.AST, rule: Callable[..., Any]) -> Iterator[str]:
    """Names that the engine has for itself, and names of modules."""
    if isinstance(item, ast.Call) and isinstance(item.func, ast.Name) and item.func.id in RENAMED_BUILTINS:
        called = RENAMED_BUILTINS[item.func.id]
        if called in rule.__code__.co_varnames:
            yield f"{called} is what the engine calls here; give the variable another name"
        if len(item.args) < 2:
            yield f"{item.func.id} of fewer than two numbers; write {item.func.id}(a, b)"
    if isinstance(item, ast.Attribute) and isinstance(item.value, ast.Name):
        module = rule.__globals__.get(item.value.id)
        if module is math and item.attr in NOT_FINITE:
            yield f"math.{item.attr}: compiled, every number counts as finite; write 1e30 for what is far"
        elif inspect.ismodule(module) and module is not math:
            instead = f"; write math.{item.attr}" if hasattr(math, item.attr) else _instead(module, item.attr)
            yield f"{item.value.id}.{item.attr}: only math may be used through a module name{instead}"


def place_of(rule: Any, line: int = 0) -> str:
    """File and line of a rule, also of one that a decorator hides; `line` counts within it, from 0."""
    code = getattr(inspect.unwrap(getattr(rule, "py_func", rule)), "__code__", None)
    return f"{code.co_filename}:{code.co_firstlineno + line}" if code is not None else "?"


def _finite(value: object) -> bool:
    """Return True if a global is no number, or a finite one."""
    return not isinstance(value, float) or math.isfinite(value)


def _instead(module: Any, name: str) -> str:
    """Return a hint what to write in place of a name of a module."""
    source = INSTEAD.get(module.__name__, INSTEAD["random"] if name == "random" else "")
    return f"; write {source}" if source else ""


@lru_cache(maxsize=4096)
def _rule_errors(rule: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(rule_errors(rule))


def check_rule(rule: Callable[..., Any]) -> None:
    """Raise a RuleError that lists every error of a rule; do nothing if it has none. Each rule is checked once."""
    errors = _rule_errors(rule)
    if errors:
        raise RuleError("\n".join(errors))
