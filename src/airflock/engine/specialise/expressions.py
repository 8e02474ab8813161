"""Expressions of a stage: each is either known while the driver is made, or syntax of the driver."""

import ast
import builtins
import inspect
import math
import operator
import types
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from airflock.engine.specialise.apart import LocalOwners
from airflock.engine.specialise.values import (
    LOAD,
    STORE,
    ArrayBundle,
    LocalVector,
    Scope,
    StageCall,
    StageFunction,
    driver_name,
    function_syntax,
    is_syntax,
)
from airflock.engine.stages import records, words
from airflock.engine.stages.words import IdentityRow, NamedConstant, ZeroRow

# of the driver, whatever they are called with
KEPT: dict[Any, str] = {
    word: word.__name__ for word in (words.real, words.integer, words.least, words.most, words.choose, words.copy_block)
} | {words.row_index: "u64", words.repeat: "range", words.parallel: "prange"}
LOCAL_KINDS: dict[Any, str] = {word: word.__name__ for word in (words.vector, words.totals, words.aliases)}
STAGES = words.__name__.rpartition(".")[0]
OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Pow: operator.pow, ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_, ast.USub: operator.neg, ast.Not: operator.not_, ast.Eq: operator.eq,
    ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Is: operator.is_, ast.IsNot: operator.is_not, ast.In: lambda a, b: a in b,
    ast.NotIn: lambda a, b: a not in b,
}  # fmt: skip
MODULES = {math: "math", np: "np"}  # that drivers import
MISSING = object()


class ExpressionSpecialiser:
    """Values of expressions, by the type of their node."""

    owners: LocalOwners

    def value(self, node: ast.expr, scope: Scope) -> Any:
        """A known Python object, or syntax of the driver."""
        method = BY_TYPE.get(type(node))
        if method is None:
            raise scope.fault(node, f"{type(node).__name__} is not specialised")
        return method(self, node, scope)

    def driver_syntax(self, node: ast.expr, scope: Scope) -> ast.expr:
        """Syntax of the driver for an expression."""
        return self.to_syntax(self.value(node, scope), node, scope)

    def to_syntax(self, value: object, node: ast.AST, scope: Scope) -> ast.expr:
        """A value as syntax of the driver."""
        if isinstance(value, ast.expr):
            return value
        if isinstance(value, NamedConstant):
            name = ast.Name(value.spelled.lstrip("-"), LOAD)
            return ast.UnaryOp(ast.USub(), name) if value.spelled[0] == "-" else name
        if isinstance(value, ArrayBundle):
            return ast.Name(value.name, LOAD)
        if isinstance(value, float):
            return ast.Call(ast.Name("real", LOAD), [ast.Constant(value)], [])
        if isinstance(value, (bool, int, str)):
            return ast.Constant(value)
        if isinstance(value, slice):
            ends = (
                None if end is None else self.to_syntax(end, node, scope)
                for end in (value.start, value.stop, value.step)
            )
            return ast.Slice(*ends)
        if isinstance(value, (tuple, list)):
            return ast.Tuple([self.to_syntax(part, node, scope) for part in value], LOAD)
        if isinstance(value, types.BuiltinFunctionType) or value in (range, abs, min, max, int):
            return ast.Name(value.__name__, LOAD)
        if isinstance(value, types.FunctionType) and value in KEPT:
            return ast.Name(KEPT[value], LOAD)
        if isinstance(value, (types.FunctionType, type)):
            return driver_name(value.__name__, "rule", value)
        raise scope.fault(node, f"{value!r} has no text in a driver")

    def _Constant(self, node: ast.Constant, scope: Scope) -> object:
        return node.value

    def _Name(self, node: ast.Name, scope: Scope) -> object:
        if node.id in scope.known:
            return scope.known[node.id]
        if node.id in scope.text.local:
            return ast.Name(self.owners.marked_name(node.id, scope.text), LOAD)
        value = scope.text.names.get(node.id, getattr(builtins, node.id, MISSING))
        if value is MISSING:
            raise scope.fault(node, f"{node.id} is not defined")
        return value

    def _Attribute(self, node: ast.Attribute, scope: Scope) -> object:
        value = self.value(node.value, scope)
        if isinstance(value, types.ModuleType) and value in MODULES:
            return ast.Attribute(ast.Name(MODULES[value], LOAD), node.attr, LOAD)
        if is_syntax(value):
            return ast.Attribute(value, node.attr, LOAD)
        try:
            return getattr(value, node.attr)
        except AttributeError as fault:
            raise scope.fault(node, str(fault)) from None

    def _Subscript(self, node: ast.Subscript, scope: Scope) -> object:
        value, at = self.value(node.value, scope), self.value(node.slice, scope)
        if is_syntax(value):
            return ast.Subscript(value, self.to_syntax(at, node, scope), LOAD)
        if is_syntax(at) and not isinstance(value, (ZeroRow, IdentityRow)):
            raise scope.fault(node, f"{ast.unparse(node)} is asked of what is known, by what is not")
        return value[at]

    def _Slice(self, node: ast.Slice, scope: Scope) -> object:
        return slice(
            *(None if part is None else self.value(part, scope) for part in (node.lower, node.upper, node.step))
        )

    def _BinOp(self, node: ast.BinOp, scope: Scope) -> object:
        left, right = self.value(node.left, scope), self.value(node.right, scope)
        if not is_syntax(left) and not is_syntax(right):
            return OPERATORS[type(node.op)](left, right)
        return ast.BinOp(self.to_syntax(left, node, scope), node.op, self.to_syntax(right, node, scope))

    def _UnaryOp(self, node: ast.UnaryOp, scope: Scope) -> object:
        value = self.value(node.operand, scope)
        return ast.UnaryOp(node.op, value) if is_syntax(value) else OPERATORS[type(node.op)](value)

    def _Compare(self, node: ast.Compare, scope: Scope) -> object:
        values = [self.value(part, scope) for part in (node.left, *node.comparators)]
        if len(values) == 2 and isinstance(node.ops[0], (ast.Is, ast.IsNot)):
            return OPERATORS[type(node.ops[0])](*values)
        if not any(is_syntax(value) for value in values):
            pairs = zip(node.ops, values, values[1:], strict=False)
            return all(OPERATORS[type(operation)](a, b) for operation, a, b in pairs)
        left, *others = [self.to_syntax(value, node, scope) for value in values]
        return ast.Compare(left, node.ops, others)

    def _BoolOp(self, node: ast.BoolOp, scope: Scope) -> object:
        ends = isinstance(node.op, ast.Or)  # a known value that ends it
        left: list[ast.expr] = []
        value: object = not ends
        for part in node.values:
            value = self.value(part, scope)
            if is_syntax(value):
                left.append(value)  # type: ignore[arg-type]
            elif bool(value) is ends:
                if left:
                    break
                return value
        if not left:
            return value
        if not is_syntax(value) and bool(value) is ends:
            left.append(self.to_syntax(value, node, scope))
        return left[0] if len(left) == 1 else ast.BoolOp(node.op, left)

    def _IfExp(self, node: ast.IfExp, scope: Scope) -> object:
        test = self.value(node.test, scope)
        if not is_syntax(test):
            return self.value(node.body if test else node.orelse, scope)
        return ast.IfExp(test, self.driver_syntax(node.body, scope), self.driver_syntax(node.orelse, scope))

    def _Tuple(self, node: ast.Tuple, scope: Scope) -> object:
        return tuple(self._items(node.elts, scope))

    def _List(self, node: ast.List, scope: Scope) -> object:
        return self._items(node.elts, scope)

    def _items(self, nodes: Iterable[ast.expr], scope: Scope) -> list[Any]:
        found: list[Any] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                found += self.value(node.value, scope)
            else:
                found.append(self.value(node, scope))
        return found

    def _GeneratorExp(self, node: ast.GeneratorExp | ast.ListComp, scope: Scope) -> object:
        return [self.value(node.elt, inner) for inner in self.turns(node.generators, scope)]

    _ListComp = _GeneratorExp

    def _DictComp(self, node: ast.DictComp, scope: Scope) -> object:
        inner = self.turns(node.generators, scope)
        return {self.value(node.key, each): self.value(node.value, each) for each in inner}

    def turns(self, parts: list[ast.comprehension], scope: Scope) -> Iterator[Scope]:
        """Scopes of the turns of a comprehension over what is known."""
        (part,) = parts
        for item in self.value(part.iter, scope):
            inner = Scope(scope.text, dict(scope.known))
            self.bind(part.target, item, inner)
            if all(self.value(test, inner) for test in part.ifs):
                yield inner

    def _Dict(self, node: ast.Dict, scope: Scope) -> object:
        found: dict[Any, Any] = {}
        for key, value in zip(node.keys, node.values, strict=True):
            made = self.value(value, scope)
            found |= made if key is None else {self.value(key, scope): made}
        return found

    def _Call(self, node: ast.Call, scope: Scope) -> object:
        called = self.value(node.func, scope)
        if called is words.call_rule:
            return self._asked(node, scope)
        arguments = self._items(node.args, scope)
        if called is words.lanes_between:
            return replace(arguments[0], within=tuple(arguments[1:]))
        if called is sum:
            total, *terms = [self.to_syntax(term, node, scope) for term in arguments[0]]
            for term in terms:
                total = ast.BinOp(total, ast.Add(), term)
            return total
        if called is getattr and is_syntax(arguments[0]):
            return ast.Attribute(arguments[0], arguments[1], LOAD)
        if isinstance(called, StageCall):
            return ast.parse(called.text, mode="eval").body
        if isinstance(called, types.FunctionType) and called.__module__.startswith(STAGES) and called not in KEPT:
            if called.__module__ == words.__name__ and not any(is_syntax(a) for a in arguments):
                return called(*arguments)
            return self.inline_expression(called, node, arguments, scope)
        keywords = {k.arg: self.value(k.value, scope) for k in node.keywords if k.arg}
        if isinstance(called, type) and called.__module__ == records.__name__:
            return called(*arguments, **keywords)  # taken apart again wherever a field is read
        late = is_syntax(called) or isinstance(called, types.FunctionType) or _record(called)
        if not late and not any(is_syntax(a) for a in (*arguments, *keywords.values())):
            return called(*arguments, **keywords)
        return ast.Call(
            self.to_syntax(called, node, scope),
            [self.to_syntax(argument, node, scope) for argument in arguments],
            [ast.keyword(name, self.to_syntax(value, node, scope)) for name, value in keywords.items()],
        )

    def _asked(self, node: ast.Call, scope: Scope) -> ast.expr:
        """A call of a rule with what it asks for, in its order; nothing else that is offered is looked at."""
        rule = self.value(node.args[0], scope)
        offered: dict[str, Any] = {k.arg: k.value for k in node.keywords if k.arg}
        known: dict[str, Any] = {}
        for keyword in node.keywords:
            known |= self.value(keyword.value, scope) if keyword.arg is None else {}
        if isinstance(rule, StageFunction):
            taken = [
                self.driver_syntax(offered[n], scope) if n in offered else ast.Name(n, LOAD) for n in rule.parameters
            ]
            return ast.Call(ast.Name(rule.name, LOAD), taken, [])
        names = inspect.signature(rule).parameters
        for name in names:
            if name not in offered and name not in known:
                raise scope.fault(node, f"{rule.__name__} asks for {name}, which is not offered")
        handed = [
            self.to_syntax(known[n], node, scope) if n in known else self.driver_syntax(offered[n], scope)
            for n in names
        ]
        return ast.Call(driver_name(rule.__name__, "rule", rule), handed, [])

    def inline_expression(
        self, called: Callable[..., Any], node: ast.Call, arguments: list[Any], scope: Scope
    ) -> object:
        """Value of a helper that consists of one expression, in place of its call."""
        inner = self.helper_scope(called, node, arguments, scope)
        last = inner.text.body[-1]
        if len(inner.text.body) > 1 or not isinstance(last, ast.Return) or last.value is None:
            raise scope.fault(node, f"{called.__name__} is more than one expression")
        return self.value(last.value, inner)

    def helper_scope(self, called: Callable[..., Any], node: ast.Call, arguments: list[Any], scope: Scope) -> Scope:
        """Scope of a helper: what it is handed stands wherever it names it."""
        text = function_syntax(called)
        names = [a.arg for a in (*text.node.args.args, *text.node.args.kwonlyargs)]
        handed = dict(zip(names, arguments, strict=False))
        return Scope(text, handed | {k.arg: self.value(k.value, scope) for k in node.keywords if k.arg})

    def bind(self, target: ast.expr, value: Any, scope: Scope) -> None:
        """Names of a target stand for what is known from now on."""
        if isinstance(target, ast.Name):
            scope.known[target.id] = value
        elif isinstance(target, (ast.Tuple, ast.List)):
            for part, one in zip(target.elts, value, strict=True):
                self.bind(part, one, scope)
        else:
            raise scope.fault(target, f"{ast.unparse(target)} cannot be known")

    def target(self, node: ast.expr, scope: Scope) -> ast.expr:
        """Syntax of the driver for what is assigned to."""
        if isinstance(node, ast.Name):
            scope.known.pop(node.id, None)
            return ast.Name(self.owners.marked_name(node.id, scope.text), STORE)
        if isinstance(node, ast.Tuple):
            return ast.Tuple([self.target(part, scope) for part in node.elts], STORE)
        if isinstance(node, ast.Subscript):
            value, at = self.value(node.value, scope), self.value(node.slice, scope)
            if isinstance(value, LocalVector):
                return value.store(at)
            return ast.Subscript(self.to_syntax(value, node, scope), self.to_syntax(at, node, scope), STORE)
        raise scope.fault(node, f"{ast.unparse(node)} cannot be assigned to")


BY_TYPE: dict[type, Callable[..., Any]] = {
    getattr(ast, name[1:]): method
    for name, method in vars(ExpressionSpecialiser).items()
    if name[0] == "_" and name[1].isupper()
}


def _record(value: object) -> bool:
    """Whether a value is a class of records of numbers, which a driver makes."""
    return isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields")
