"""Specialiser: expressions, statements and whole stages, evaluated for a plan as far as it decides them.

An expression of a stage is either known while the driver is made, or syntax of the driver.
"""

import ast
import builtins
import inspect
import math
import operator
import types
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from airflock.core import walk_tree
from airflock.engine.passes.build import Builder
from airflock.engine.plan import INTEGER_NAMES
from airflock.engine.specialise.known_values import (
    LOAD,
    STORE,
    AgentLoop,
    ArrayBundle,
    LocalVector,
    Scope,
    StageCall,
    StageError,
    StageFunction,
    driver_name,
    function_syntax,
    is_syntax,
    name_kind,
    needs_no_variable,
)
from airflock.engine.specialise.local_names import (
    LocalOwners,
    can_share_name,
    read_names,
    rename_local,
    without_dead,
    written_names,
)
from airflock.engine.stages import records, words
from airflock.engine.stages.records import FlightView, SortedCells, WorldArrays
from airflock.engine.stages.state import SCENE_ARRAYS, FlockRows, own_row
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
        # Constants go by name, since a literal would be in double precision in a driver of single
        # precision.
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
        # Known operands vanish as Python would stop or go on at them; what is left is a test of the
        # driver.
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
        # Written out from left to right, as Python adds: the order of a sum decides its last bits.
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
        """Call of a rule with its arguments, in its order; other arguments on offer are never evaluated."""
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
    """Return True if a value is a class of records of numbers, which a driver makes."""
    return isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields")


TABLE_PREFIXES = {
    "u": "words",
    "packet": "store",
}  # rows of other tables than that of states, by what their names begin with
CELLS = ("starts", "whose", "packed", "flat", "count")  # what a driver calls what it has sorted
UNROLLED = (range, tuple, list, enumerate, zip)


class StatementSpecialiser(ExpressionSpecialiser):
    """Statements of one stage."""

    def __init__(self, build: Builder):
        self.build = build
        self.split: int | None = None

    def run(
        self, stage: Callable[..., Any], known: dict[str, object]
    ) -> tuple[list[ast.stmt], list[ast.stmt], ast.expr | None]:
        """Specialise a stage; returns the statements done once, those done for agents, and the answer."""
        standing = self.standing()
        text = function_syntax(stage)
        self.owners = LocalOwners(text)
        names = [a.arg for a in (*text.node.args.args, *text.node.args.kwonlyargs)]
        scope = Scope(text, {name: value for name, value in standing.items() if name in names} | known)
        done: list[ast.stmt] = []
        for statement in text.node.body:
            before, looped = len(done), self.split is not None
            done += self.statement(statement, scope)
            if self.split is not None and not looped:
                self.split = before
            if _ends(done):
                break
        last = done.pop() if done and isinstance(done[-1], ast.Return) else None
        answer = last.value if isinstance(last, ast.Return) else None
        once, body = done[: self.split], done[len(done) if self.split is None else self.split :]
        carried = written_names(body)
        first = [s for s in once if isinstance(s, ast.Assign) and _name(s.targets[0]) in carried]
        return [s for s in once if s not in first], [*first, *body], answer

    def standing(self) -> dict[str, object]:
        """Values that parameters of stages have wherever they bear these names."""
        plan = self.build.plan
        rows: dict[str, ast.Name] = {}

        def take(name: str) -> ast.Name:
            if name not in rows:
                rows[name] = driver_name(
                    name, next((kind for kind in TABLE_PREFIXES if name.rstrip("0123456789") == kind), "row")
                )
            return rows[name]

        letters = dict.fromkeys(letter for letter, _ in plan.varied)
        kinds = {letter: self.build.kind(letter, plan.records[letter]) for letter in letters}
        own = {"own": {letter: ast.Name(kind, LOAD) for letter, kind in kinds.items()}}
        number: object = driver_name("order", "number") if self.build.slots else IdentityRow()
        scene = ArrayBundle("scene", SCENE_ARRAYS)
        flight = FlightView(
            plan,
            plan.model,
            FlockRows(take, plan.dimensions, number),
            SimpleNamespace(**{letter: driver_name(letter, "record") for letter in plan.records} | own),
            SimpleNamespace(**{name: driver_name(name, "whole") for name in INTEGER_NAMES}),
            WorldArrays(driver_name("edges", "argument"), driver_name("spans", "argument"), scene),
        )
        return vars(flight) | {
            "flight": flight,
            "scene": scene,
            "cells": SortedCells(*(driver_name(name, "argument") for name in CELLS)),
            "agents": AgentLoop("n", agents=True, law=plan.law),
            "lanes": AgentLoop("m", agents=True),
            "others": AgentLoop("m", agents=False),
        }

    def block(self, statements: list[ast.stmt], scope: Scope) -> list[ast.stmt]:
        """Statements of the driver for those of a block, up to one that leaves it."""
        done: list[ast.stmt] = []
        for statement in statements:
            done += self.statement(statement, scope)
            if _ends(done):
                break
        return done

    def statement(self, node: ast.stmt, scope: Scope) -> list[ast.stmt]:
        """Statements of the driver for one of a stage."""
        if isinstance(node, ast.Assign):
            return self.assign(node, scope)
        if isinstance(node, ast.AugAssign):
            value = self.driver_syntax(node.value, scope)
            return [ast.AugAssign(self.target(node.target, scope), node.op, value)]  # type: ignore[arg-type]
        if isinstance(node, ast.For):
            return self.loop(node, scope)
        if isinstance(node, ast.If):
            test = self.value(node.test, scope)
            if not is_syntax(test):
                return self.block(node.body if test else node.orelse, scope)
            return [ast.If(test, self.block(node.body, scope), self.block(node.orelse, scope))]
        if isinstance(node, ast.While):
            test = self.driver_syntax(node.test, scope)
            return [ast.While(test, self.block(node.body, scope), [])]
        if isinstance(node, ast.Expr):
            return self.call(node.value, scope)
        if isinstance(node, ast.Return):
            return [ast.Return(None if node.value is None else self.driver_syntax(node.value, scope))]
        if isinstance(node, (ast.Break, ast.Continue)):
            return [node]
        raise scope.fault(node, f"{type(node).__name__} is not specialised")

    def call(self, node: ast.expr, scope: Scope) -> list[ast.stmt]:
        """A call that stands alone: of a helper, whose statements take its place, or of another stage."""
        if isinstance(node, ast.Constant):
            return []  # a docstring
        if isinstance(node, ast.Call):
            called = self.value(node.func, scope)
            helper = isinstance(called, types.FunctionType) and called.__module__.startswith(STAGES)
            if helper and called.__module__ != words.__name__:
                done, answer = self.inline_helper(called, node, scope)
                if answer is not None:
                    raise scope.fault(node, f"nothing takes what {called.__name__} returns")
                return done
        return [ast.Expr(self.driver_syntax(node, scope))]

    def inline_helper(
        self, called: Callable[..., Any], node: ast.Call, scope: Scope
    ) -> tuple[list[ast.stmt], tuple[ast.expr, Scope] | None]:
        """Statements of a helper in place of its call, and the expression that it returns, as the helper knows it."""
        inner = self.helper_scope(called, node, self._items(node.args, scope), scope)
        *body, last = inner.text.body
        # The result is not a variable of its own where it need not be: the caller looks at the
        # returned expression in the scope of the helper.
        done = self.copied_variables(inner)
        if isinstance(last, ast.Return) and last.value is not None:
            done, answer = done + self.block(body, inner), (last.value, inner)
        else:
            done, answer = done + self.block([*body, last], inner), None
        if any(isinstance(item, ast.Return) for statement in done for item in walk_tree(statement)):
            raise scope.fault(node, f"{called.__name__} returns from within")
        return done, answer

    def copied_variables(self, inner: Scope) -> list[ast.stmt]:
        """Make variables for the arguments that a helper assigns to."""
        done: list[ast.stmt] = []
        for name in sorted(inner.text.again & inner.known.keys()):
            value = inner.known[name]
            if is_syntax(value) or isinstance(value, (NamedConstant, float)):
                made = self.to_syntax(value, inner.text.node, inner)
                done.append(ast.Assign([self.target(ast.Name(name), inner)], made, lineno=0))
        return done

    def loop(self, node: ast.For, scope: Scope) -> list[ast.stmt]:
        """A loop: unrolled where it is known, over agents, or as it stands."""
        over = self.value(node.iter, scope)
        # Loops over axes and fields are written out, loops over agents never: what the plan fixes
        # must not cost at run time.
        if isinstance(over, UNROLLED):
            done: list[ast.stmt] = []
            for item in over:
                self.bind(node.target, item, scope)
                done += self.block(node.body, scope)
                if _ends(done):
                    raise scope.fault(node, "a loop that is unrolled is left")
            return done
        if isinstance(over, AgentLoop):
            self.split = 0 if over.agents and self.split is None else self.split
            done = self.loop_over_law(over, node, scope)
            if over.agents and self.build.is_sequential:
                return done
            if over.within is not None:
                return [self.loop_over_lanes(over, over.within, self.target(node.target, scope), done)]  # type: ignore[arg-type]
            return [_loop(self.target(node.target, scope), [ast.Name(over.bound, LOAD)], done)]
        if not is_syntax(over):
            raise scope.fault(node, f"{ast.unparse(node.iter)} is not looped over")
        return [ast.For(self.target(node.target, scope), over, self.block(node.body, scope), [], lineno=0)]

    def loop_over_lanes(
        self, over: AgentLoop, within: tuple[ast.expr, ast.expr], target: ast.Name, done: list[ast.stmt]
    ) -> ast.stmt:
        """A loop over some of the lanes."""
        lane = ast.Name(target.id, LOAD)
        if not self.build.ranges:
            first, end = within
            inside: list[ast.expr] = [ast.Compare(first, [ast.LtE()], [lane]), ast.Compare(lane, [ast.Lt()], [end])]
            return _loop(target, [ast.Name(over.bound, LOAD)], [ast.If(ast.BoolOp(ast.And(), inside), done, [])])
        # a lane that cannot be negative is not tested whether it counts from a row's end: else no
        # loop is a vector's
        return _loop(target, [ast.Call(ast.Name("u64", LOAD), [each], []) for each in within], done)

    def loop_over_law(self, over: AgentLoop, node: ast.For, scope: Scope) -> list[ast.stmt]:
        """Body of a loop for an agent; where laws differ, for an agent of this law."""
        done = self.block(node.body, scope)
        if over.law is None:
            return done
        who = ast.Subscript(driver_name(own_row("", "law"), "row"), self.driver_syntax(node.target, scope), LOAD)
        return [ast.If(ast.Compare(who, [ast.Eq()], [ast.Constant(over.law)]), done, [])]

    def assign(self, node: ast.Assign, scope: Scope) -> list[ast.stmt]:
        """An assignment; none where its name stands for what is known from then on."""
        (target,) = node.targets
        before: list[ast.stmt] = []
        if (helper := self.helper_call(node.value, scope)) is not None:
            before, answer = self.inline_helper(helper, node.value, scope)  # type: ignore[arg-type]
            if answer is None:
                raise scope.fault(node, f"{helper.__name__} returns nothing")
            value = self.value(*answer)
        else:
            value = self.made(target, node.value, scope)
        names = [_name(part) for part in (target.elts if isinstance(target, ast.Tuple) else [target])]
        parts = value if isinstance(target, ast.Tuple) and isinstance(value, (tuple, list)) else [value]
        once = all(name in scope.text.once for name in names)
        if helper is not None and isinstance(value, LocalVector):
            self._once(helper, value, self.owners.marked_name(names[0], scope.text), node, scope)
        if isinstance(value, LocalVector) or (once and all(map(needs_no_variable, parts))):
            self.bind(target, value, scope)
            return before
        made, stored = self.to_syntax(value, node, scope), self.target(target, scope)
        # A helper and its caller often use one word for one thing; then no copy is written.
        if helper is not None and isinstance(stored, ast.Name) and can_share_name(before, made, stored.id):
            return rename_local(before, made.id, stored.id)  # type: ignore[attr-defined]
        sum_ = made if isinstance(made, ast.BinOp) and isinstance(made.op, ast.Add) else None
        if sum_ is not None and isinstance(stored, ast.Name) and _name(sum_.left) == stored.id:
            return [*before, ast.AugAssign(stored, sum_.op, sum_.right)]
        return [*before, ast.Assign([stored], made, lineno=0)]

    def _once(self, helper: Any, vector: LocalVector, target: str, node: ast.Assign, scope: Scope) -> None:
        """Refuse a vector that a helper returns twice: the names of its components would be overwritten."""
        if self.owners.is_taken(vector.name, target):
            raise scope.fault(node, f"{helper.__name__} returns its vector to {target} and to another name")

    def helper_call(self, node: ast.expr, scope: Scope) -> Callable[..., Any] | None:
        """The helper of several statements that an expression calls, if it is such a call."""
        called = self.value(node.func, scope) if isinstance(node, ast.Call) else None
        if not isinstance(called, types.FunctionType) or not called.__module__.startswith(STAGES):
            return None
        if called.__module__ == words.__name__ or len(function_syntax(called).body) == 1:
            return None
        return called

    def made(self, target: ast.expr, node: ast.expr, scope: Scope) -> Any:
        """Value that is assigned; a local vector has the name of its variable."""
        if isinstance(target, ast.Tuple) and isinstance(node, ast.Tuple):
            return tuple(self.made(*pair, scope) for pair in zip(target.elts, node.elts, strict=True))
        kind = LOCAL_KINDS.get(self.value(node.func, scope)) if isinstance(node, ast.Call) and not node.args else None
        if kind is None:
            return self.value(node, scope)
        return LocalVector(self.owners.marked_name(_name(target), scope.text), kind)


def _loop(target: ast.expr, ends: list[ast.expr], body: list[ast.stmt]) -> ast.stmt:
    """A loop over a range."""
    return ast.For(target, ast.Call(ast.Name("range", LOAD), ends, []), body, [], lineno=0)


def _ends(statements: list[ast.stmt]) -> bool:
    """Return True if nothing after these statements would be reached."""
    return bool(statements) and isinstance(statements[-1], (ast.Return, ast.Break, ast.Continue))


def _name(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else ""


@dataclass(frozen=True)
class SpecialisedText:
    """Text of a stage for one plan.

    bindings : lines that bind rows, records and integers
    first    : what is done once per step
    rest     : what is done for all agents or, in a sequential update, for agent i
    answer   : what the stage returns
    """

    bindings: list[str]
    first: list[ast.stmt]
    agent_statements: list[ast.stmt]
    answer: str

    @property
    def once(self) -> list[str]:
        """Lines of what is done before anything is done for an agent."""
        return [*self.bindings, *lines_of(self.first)]

    @property
    def body(self) -> list[str]:
        """Lines of what is done for agents."""
        return lines_of(self.agent_statements)

    @property
    def lines(self) -> list[str]:
        """All of them, for a function that is no stage of its own."""
        return [*self.once, *self.body]


def lines_of(statements: list[ast.stmt]) -> list[str]:
    """Lines of statements."""
    return [line for statement in statements for line in ast.unparse(statement).splitlines()]


def specialise(build: Builder, stage: Callable[..., Any], **known: object) -> SpecialisedText:
    """Text of a stage for a builder's plan.

    known : what parameters of the stage stand for; others keep their names. What a vector is given
            is kept.
    """
    made = StatementSpecialiser(build)
    once, body, answer = made.run(stage, known)
    where = made.owners.texts[0].where
    made.owners.assign_names([*once, *body], answer, lambda told: StageError(f"{where}: {stage.__name__}: {told}"))
    kept = read_names([answer]) if answer is not None else set()
    kept |= {name for value in known.values() if isinstance(value, LocalVector) for name in value.set.values()}
    # Tests of the plan leave variables that nobody reads; a compiler would drop them, but a reader
    # of a driver and a GPU kernel's argument list would not.
    whole = without_dead([*once, *body], kept)
    first = {id(statement) for statement in once}
    parts = whole if answer is None else [*whole, answer]
    names = [node for part in parts for node in walk_tree(part) if name_kind(node)]
    for node in names:
        if name_kind(node) == "rule":
            node.id = build.source.name(node.item)  # type: ignore[attr-defined]
    return SpecialisedText(
        _bindings(build, names),
        [statement for statement in whole if id(statement) in first],
        [statement for statement in whole if id(statement) not in first],
        "0" if answer is None else ast.unparse(answer),
    )


def _bindings(build: Builder, names: list[Any]) -> list[str]:
    """Lines that bind the rows, records and integers of these names."""
    found: dict[str, list[str]] = {kind: [] for kind in ("row", "number", "record", "whole", "scene", *TABLE_PREFIXES)}
    for kind, name in dict.fromkeys((name_kind(node), node.id) for node in names):
        if kind in found:
            found[kind].append(name)
    lines = build.records(" ".join(found["record"])) + build.whole(*found["whole"]) + build.bind_rows(found["row"])
    lines += build.scene(*found["scene"])
    lines += build.order() if found["number"] else []
    return lines + [
        f"{name} = {table}[{name[len(kind) :]}]" for kind, table in TABLE_PREFIXES.items() for name in found[kind]
    ]
