"""Statements: those of a stage for one plan, by the type of their node."""

import ast
import types
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from airflock.core import walk_tree
from airflock.engine.passes.build import Builder
from airflock.engine.plan import INTEGER_NAMES
from airflock.engine.specialise.apart import LocalOwners, can_share_name, rename_local
from airflock.engine.specialise.dead import written_names
from airflock.engine.specialise.expressions import LOCAL_KINDS, STAGES, ExpressionSpecialiser
from airflock.engine.specialise.values import (
    LOAD,
    AgentLoop,
    ArrayBundle,
    LocalVector,
    Scope,
    driver_name,
    function_syntax,
    is_syntax,
    needs_no_variable,
)
from airflock.engine.stages import words
from airflock.engine.stages.records import SortedCells, WorldArrays
from airflock.engine.stages.state import SCENE_ARRAYS, FlockRows, own_row
from airflock.engine.stages.words import IdentityRow, NamedConstant

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
        """What is done once, what is done for agents, and the answer."""
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
        """What parameters of stages stand for wherever they have these names."""
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
        return {
            "plan": plan,
            "model": plan.model,
            "flock": FlockRows(take, plan.dimensions, number),
            "numbers": SimpleNamespace(**{letter: driver_name(letter, "record") for letter in plan.records} | own),
            "whole": SimpleNamespace(**{name: driver_name(name, "whole") for name in INTEGER_NAMES}),
            "scene": scene,
            "around": WorldArrays(driver_name("edges", "argument"), driver_name("spans", "argument"), scene),
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
        done = self.copied_variables(inner)
        if isinstance(last, ast.Return) and last.value is not None:
            done, answer = done + self.block(body, inner), (last.value, inner)
        else:
            done, answer = done + self.block([*body, last], inner), None
        if any(isinstance(item, ast.Return) for statement in done for item in walk_tree(statement)):
            raise scope.fault(node, f"{called.__name__} returns from within")
        return done, answer

    def copied_variables(self, inner: Scope) -> list[ast.stmt]:
        """Variables of a helper for what it is handed and binds anew."""
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
        # a lane that cannot be negative is not asked whether it counts from a row's end: else no loop is a vector's
        return _loop(target, [ast.Call(ast.Name("u64", LOAD), [each], []) for each in within], done)

    def loop_over_law(self, over: AgentLoop, node: ast.For, scope: Scope) -> list[ast.stmt]:
        """What a loop does for an agent; where laws differ, for an agent of this one."""
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
    """Whether nothing after these statements would be reached."""
    return bool(statements) and isinstance(statements[-1], (ast.Return, ast.Break, ast.Continue))


def _name(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else ""
