"""Unrolled: vectors of parameters in a rule's text become their components, and loops over them one turn after another.

`p.weights[1]` becomes `p.weights_1`, `len(p.weights)` a number. A loop whose index picks components, and one over the
vector itself, is written out; where it may be left early it stays a loop over a tuple.
"""

import ast
from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Any

from airflock.core import component_names, walk_tree
from airflock.support import RuleError


class VectorUnroller(ast.NodeTransformer):
    """What is known of vectors in one rule.

    vectors : for each record name its vectors, with how many components each has
    """

    def __init__(self, rule: Callable[..., Any], vectors: Mapping[str, Mapping[str, int]]):
        self.rule, self.vectors = rule, vectors

    def size(self, node: ast.AST) -> int:
        """How many components the vector has that an expression names; 0 where it names none."""
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            return self.vectors.get(node.value.id, {}).get(node.attr, 0)
        return 0

    def components(self, node: ast.Attribute) -> list[ast.expr]:
        """Components of a vector, one after another."""
        return [ast.Attribute(node.value, name, ast.Load()) for name in component_names(node.attr, self.size(node))]

    def counts(self, node: ast.Call) -> bool:
        """Whether a call asks for the number of components of a vector."""
        called = node.func.id if isinstance(node.func, ast.Name) else ""
        return called == "len" and len(node.args) == 1 and bool(self.size(node.args[0]))

    def component(self, node: ast.Subscript) -> ast.expr | None:
        """The component that is picked by a known number; None for anything else. Raises RuleError beyond the last."""
        size, at = self.size(node.value), self._whole(node.slice)
        if not size or at is None:
            return None
        if not -size <= at < size:
            code = self.rule.__code__
            line = code.co_firstlineno + node.lineno - 1
            raise RuleError(
                f"{code.co_filename}:{line}: rule {self.rule.__name__}: {ast.unparse(node)} asks for component {at} of "
                f"{size}"
            )
        return self.components(node.value)[at]  # type: ignore[arg-type]

    def visit_For(self, node: ast.For) -> Any:
        """Write out a loop over the components of a vector."""
        turns = self._turns(node)
        if turns is None or not isinstance(node.target, ast.Name) or _left(node):
            self.generic_visit(node)
            return node
        done: list[ast.stmt] = []
        for turn in turns:
            bound = ast.Assign([ast.Name(node.target.id, ast.Store())], deepcopy(turn), lineno=node.lineno)
            body = [bound, *deepcopy(node.body)] if isinstance(turn, ast.Attribute) else deepcopy(node.body)
            for statement in body:
                if isinstance(turn, ast.Constant):
                    statement = _Put(node.target.id, turn.value).visit(statement)
                found = self.visit(statement)
                done += found if isinstance(found, list) else [found]
        return done or ast.Pass()

    def _turns(self, node: ast.For) -> list[ast.expr] | None:
        """What the target of a loop over components stands for, turn by turn; None for any other loop."""
        if self.size(node.iter):
            return self.components(node.iter)  # type: ignore[arg-type]
        called = node.iter.func if isinstance(node.iter, ast.Call) else None
        if not isinstance(called, ast.Name) or called.id != "range" or not isinstance(node.target, ast.Name):
            return None
        index = node.target.id
        picks = [item for item in walk_tree(node) if isinstance(item, ast.Subscript) and self.size(item.value)]
        if not any(_reads(item.slice, index) for item in picks) or _sets(node.body, index):
            return None
        ends = [self._whole(argument) for argument in node.iter.args]  # type: ignore[attr-defined]
        if any(end is None for end in ends):
            return None
        return [ast.Constant(turn) for turn in range(*ends)]  # type: ignore[arg-type]

    def _whole(self, node: ast.expr) -> int | None:
        """Value of an expression of whole numbers, where it is known."""
        if isinstance(node, ast.Constant):
            return node.value if type(node.value) is int else None
        if isinstance(node, ast.Call):
            return self.size(node.args[0]) if self.counts(node) else None
        if isinstance(node, ast.Name) and node.id not in self.rule.__code__.co_varnames:
            value = self.rule.__globals__.get(node.id)
            return value if type(value) is int else None
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            inner = self._whole(node.operand)
            return None if inner is None else -inner
        if isinstance(node, ast.BinOp) and isinstance(node.op, (ast.Add, ast.Sub)):
            left, right = self._whole(node.left), self._whole(node.right)
            if left is None or right is None:
                return None
            return left + right if isinstance(node.op, ast.Add) else left - right
        return None


class _Put(ast.NodeTransformer):
    """Put a number in place of a name."""

    def __init__(self, name: str, value: Any):
        self.name, self.value = name, value

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return ast.copy_location(ast.Constant(self.value), node) if node.id == self.name else node


def _reads(node: ast.AST, name: str) -> bool:
    return any(isinstance(item, ast.Name) and item.id == name for item in walk_tree(node))


def _sets(statements: list[ast.stmt], name: str) -> bool:
    named = (item for s in statements for item in walk_tree(s) if isinstance(item, ast.Name) and item.id == name)
    return any(isinstance(item.ctx, ast.Store) for item in named)


def _left(node: ast.For) -> bool:
    """Whether a loop may be left early, skip the rest of a turn, or do something at its end."""
    return bool(node.orelse) or any(isinstance(item, (ast.Break, ast.Continue)) for item in walk_tree(node))
