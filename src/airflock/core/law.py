"""The law of rules: what a rule's text may contain. Checked for ours in the tests and for users' before compiling."""

import ast
import inspect
import linecache
import math
import os
import textwrap
import types
from collections.abc import Callable, Hashable, Iterable, Iterator
from functools import lru_cache, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

from airflock.support import RuleError

LEAVES = ast.Name, ast.Constant, ast.expr_context, ast.operator, ast.unaryop, ast.boolop, ast.cmpop
WORDS = {"ctx", "op", "ops", "id", "attr", "name", "asname", "module", "level", "names", "kind", "type_comment"}


def walk_tree(tree: ast.AST) -> list[ast.AST]:
    """All nodes of a tree in the order of `ast.walk`, without contexts (`Load`), operators and what is imported."""
    found = [tree]
    # The list grows while the loop reads it: that is the breadth-first order of `ast.walk`, without
    # its queue.
    for node in found:  # which grows
        for name in _FIELDS[type(node)]:
            below = getattr(node, name, None)
            if isinstance(below, list):
                found += [item for item in below if isinstance(item, ast.AST)]
            elif isinstance(below, ast.AST):
                found.append(below)
    return found


class _Fields(dict[type[ast.AST], tuple[str, ...]]):
    """Fields of a kind of node in which others may stand."""

    def __missing__(self, kind: type[ast.AST]) -> tuple[str, ...]:
        below = () if issubclass(kind, LEAVES) else tuple(name for name in kind._fields if name not in WORDS)
        return self.setdefault(kind, below)


_FIELDS = _Fields()


BITWISE = (ast.LShift, ast.RShift, ast.BitAnd, ast.BitOr, ast.BitXor)
KEEPING = {"min", "max", "abs"}  # integers of integers
MAKING = {"int", "len"}


# The user's own rules are taken as they are now, not as they were first read: cells of a notebook are run again,
# files are reloaded.

P = ParamSpec("P")
T = TypeVar("T")
Rule = Callable[..., Any]


def bound_values(rules: Iterable[Any]) -> dict[types.FunctionType, dict[str, Any]]:
    """Return what free names mean now, for each of the user's own rules and of the functions that they call.

    Numbers, texts and NamedTuple classes are values; functions are followed. Rules of the package
    have no entry.
    """
    found: dict[types.FunctionType, dict[str, Any]] = {}
    left = [rule for rule in rules if isinstance(rule, types.FunctionType)]
    while left:
        rule = left.pop()
        if rule in found or (rule.__module__ or "").startswith("airflock."):
            continue
        names = {name for code in _codes(rule.__code__) for name in (*code.co_names, *code.co_freevars)}
        values = {name: resolve_global(name, rule) for name in sorted(names)}
        found[rule] = {name: value for name, value in values.items() if isinstance(value, (int, float, str, type))}
        left += [value for value in values.values() if isinstance(value, types.FunctionType)]
    return found


def text_state(rules: Iterable[Any]) -> Hashable:
    """Return a key that is equal as long as the text of rules, and all that it refers to, is the same."""
    # By repr: 1, 1.0 and True are equal, but compile to different text.
    return tuple(
        (rule.__code__, rule.__defaults__, tuple((k, v if isinstance(v, type) else repr(v)) for k, v in values.items()))
        for rule, values in bound_values(rules).items()
    )


def _codes(code: types.CodeType) -> list[types.CodeType]:
    """Return a code object and all that are nested in it, such as those of generator expressions."""
    return [code, *(inner for item in code.co_consts if isinstance(item, types.CodeType) for inner in _codes(item))]


def cached_by_text(work: Callable[Concatenate[Rule, P], T]) -> Callable[Concatenate[Rule, P], T]:
    """Cache what follows from a rule until it or what it refers to changes: a cell run again, a file reloaded."""

    @lru_cache(maxsize=4096)
    def kept(state: Hashable, rule: Rule, /, *more: P.args, **named: P.kwargs) -> T:
        return work(rule, *more, **named)

    @wraps(work)
    def current(rule: Rule, /, *more: P.args, **named: P.kwargs) -> T:
        return kept(text_state([rule]), rule, *more, **named)  # type: ignore[arg-type]

    return current


@cached_by_text
def _source(rule: Callable[..., Any]) -> str:
    """Text of a rule; finding its end in its file takes longer than all else that is done with it."""
    text = textwrap.dedent(inspect.getsource(rule))
    code = inspect.unwrap(rule).__code__
    if bound_values([rule]) and os.path.isfile(code.co_filename) and not _is_code_of_file(code):
        where = f"{code.co_filename}:{code.co_firstlineno}"
        raise RuleError(f"{where}: rule {rule.__name__}: the file has changed since it was imported; load it again")
    return text


def _is_code_of_file(code: types.CodeType) -> bool:
    """Return False if the file of a function was changed after its import: then its lines hold another text."""
    try:
        file = compile("".join(linecache.getlines(code.co_filename)), code.co_filename, "exec", dont_inherit=True)
    except SyntaxError:
        return False

    def essence(each: types.CodeType) -> tuple[Any, ...]:
        constants = [repr(each) for each in each.co_consts if not isinstance(each, types.CodeType)]
        return each.co_firstlineno, each.co_code, each.co_names, constants

    return any(essence(each) == essence(code) for each in _codes(file))


def tree_of(rule: Callable[..., Any]) -> ast.FunctionDef:
    """Syntax tree of a rule from its own source file or notebook cell."""
    try:
        text = _source(rule)
    except (OSError, TypeError) as error:
        raise RuleError(f"the source of rule {rule.__name__} is not available: {error}") from error
    node = ast.parse(text).body[0]
    if not isinstance(node, ast.FunctionDef):
        raise RuleError(f"rule {getattr(rule, '__name__', rule)} is no plain function")
    return node


@cached_by_text
def integer_names(rule: Callable[..., Any]) -> frozenset[str]:
    """Names in a rule that hold integers: its variables, and integers of its module."""
    node = tree_of(rule)
    found = {name for name, value in rule.__globals__.items() if type(value) is int}
    found -= set(rule.__code__.co_varnames)
    # A fixed point: a name that turns out to hold an integer may make others integers, so passes
    # repeat until nothing is new. Rules are short; two or three passes are enough.
    while True:
        known = len(found)
        for item in walk_tree(node):
            for used in _integer_places(item, rule):
                found |= set(_terms(used))
            if isinstance(item, ast.For) and _called(item.iter) == "range":
                found |= set(_terms(item.target))
            if isinstance(item, ast.Assign):
                for target, value in _pairs(item):
                    if is_integer(value, found, rule):
                        found |= set(_terms(target))
        if len(found) == known:
            return frozenset(found)


def is_integer(node: ast.expr, integers: set[str] | frozenset[str], rule: Callable[..., Any]) -> bool:
    """Return True if an expression is an integer, given the names that hold integers."""
    if isinstance(node, ast.Constant):
        return type(node.value) is int
    if isinstance(node, ast.Name):
        return node.id in integers
    if isinstance(node, ast.UnaryOp):
        return is_integer(node.operand, integers, rule)
    if isinstance(node, ast.IfExp):
        return is_integer(node.body, integers, rule) and is_integer(node.orelse, integers, rule)
    if isinstance(node, ast.BinOp):
        if isinstance(node.op, BITWISE):
            return True
        sides = is_integer(node.left, integers, rule) and is_integer(node.right, integers, rule)
        return sides and not isinstance(node.op, (ast.Div, ast.Pow))
    if isinstance(node, ast.Call):
        name = _called(node)
        if name in KEEPING:
            return all(is_integer(argument, integers, rule) for argument in node.args)
        called = resolve_function(name, rule)
        return name in MAKING or (called is not None and _gives_integer(called))
    return False


def _integer_places(item: ast.AST, rule: Callable[..., Any]) -> Iterator[ast.expr]:
    """Expressions that can only be integers, because of where they stand."""
    if isinstance(item, ast.Subscript):
        yield from item.slice.elts if isinstance(item.slice, ast.Tuple) else [item.slice]
    elif isinstance(item, ast.BinOp) and isinstance(item.op, BITWISE):
        yield from (item.left, item.right)
    elif isinstance(item, ast.BinOp) and isinstance(item.op, ast.FloorDiv) and isinstance(item.right, ast.Constant):
        yield from [item.left] if type(item.right.value) is int else []
    elif isinstance(item, ast.Call):
        called = resolve_function(_called(item), rule)
        if _called(item) == "range":
            yield from item.args
        elif called is not None:
            names = called.__code__.co_varnames[: called.__code__.co_argcount]
            integers = integer_names(called)
            yield from (given for name, given in zip(names, item.args, strict=False) if name in integers)


def _terms(node: ast.AST) -> Iterator[str]:
    """Names of which a sum, a product or a tuple is made; not those inside calls, subscripts and attributes."""
    if isinstance(node, ast.Name):
        yield node.id
    elif isinstance(node, ast.BinOp):
        yield from _terms(node.left)
        yield from _terms(node.right)
    elif isinstance(node, ast.UnaryOp):
        yield from _terms(node.operand)
    elif isinstance(node, ast.Tuple):
        for part in node.elts:
            yield from _terms(part)


def _pairs(item: ast.Assign) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yield pairs of target and value of an assignment, tuples taken apart."""
    for target in item.targets:
        if isinstance(target, ast.Tuple) and isinstance(item.value, ast.Tuple):
            yield from zip(target.elts, item.value.elts, strict=False)
        elif not isinstance(target, ast.Tuple):
            yield target, item.value


def _called(node: ast.AST) -> str:
    """Name of what a call calls."""
    return node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""


def resolve_global(name: str, rule: Callable[..., Any]) -> Any:
    """Return the value of a free name of a rule; None if it has none."""
    closure = dict(zip(rule.__code__.co_freevars, rule.__closure__ or (), strict=True))
    # A variable of the function around it hides a global of its name.
    return closure[name].cell_contents if name in closure else rule.__globals__.get(name)


def resolve_function(name: str, rule: Callable[..., Any]) -> Callable[..., Any] | None:
    """The plain function that a rule calls by this name; None for itself."""
    found = resolve_global(name, rule)
    return found if isinstance(found, types.FunctionType) and found is not rule else None


@cached_by_text
def _gives_integer(rule: Callable[..., Any]) -> bool:
    """Return True if every value that a function returns is an integer."""
    node = tree_of(rule)
    returned = [item.value for item in walk_tree(node) if isinstance(item, ast.Return) and item.value is not None]
    return bool(returned) and all(is_integer(value, integer_names(rule), rule) for value in returned)


@cached_by_text
def fields_read(rule: Callable[..., Any], record: str) -> frozenset[str] | None:
    """Fields that a rule may read of the record that it calls by this name; None where its text leaves it open."""
    nodes = walk_tree(tree_of(rule))
    found: set[str] = set()
    followed = 0
    for item in nodes:
        if isinstance(item, ast.Attribute) and _is(item.value, record):
            found.add(item.attr)
            followed += 1
        elif isinstance(item, ast.Call):
            for place, given in enumerate(item.args):
                if _is(given, record):
                    below = _read_below(item, place, rule)
                    if below is None:
                        return None
                    found |= below
                    followed += 1
    # Every mention of the record must be an attribute or an argument that was followed; any other
    # use may read all fields.
    return frozenset(found) if followed == sum(_is(item, record) for item in nodes) else None


def _is(node: ast.AST, name: str) -> bool:
    return isinstance(node, ast.Name) and node.id == name


def _read_below(call: ast.Call, place: int, rule: Callable[..., Any]) -> frozenset[str] | None:
    """Return the fields that a function reads of the record that a rule passes as this argument."""
    called = resolve_function(call.func.id, rule) if isinstance(call.func, ast.Name) else None
    if called is None or any(isinstance(given, ast.Starred) for given in call.args):
        return None
    names = list(inspect.signature(called).parameters)
    return fields_read(called, names[place]) if place < len(names) else None


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


@cached_by_text
def _rule_errors(rule: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(rule_errors(rule))


def check_rule(rule: Callable[..., Any]) -> None:
    """Raise a RuleError that lists every error of a rule; do nothing if it has none. Each rule is checked once."""
    errors = _rule_errors(rule)
    if errors:
        raise RuleError("\n".join(errors))
