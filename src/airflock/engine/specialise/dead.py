"""Dead: drop what a stage computes and nobody reads."""

import ast
from collections.abc import Iterable

from airflock.core import walk_tree


def read_names(nodes: Iterable[ast.AST]) -> set[str]:
    """Names that are read."""
    return _names(nodes, ast.Load)


def written_names(nodes: Iterable[ast.AST]) -> set[str]:
    """Names that are written."""
    return _names(nodes, ast.Store)


def _names(nodes: Iterable[ast.AST], context: type[ast.expr_context]) -> set[str]:
    found = (item for node in nodes for item in walk_tree(node) if isinstance(item, ast.Name))
    return {item.id for item in found if isinstance(item.ctx, context)}


def without_dead(statements: list[ast.stmt], kept: set[str]) -> list[ast.stmt]:
    """Statements without variables that nobody reads, and without loops and branches that nothing is left of.

    What a stage calls to set a variable has no other effect; a call that has one stands alone, or sets several.

    kept : names that are read elsewhere
    """
    while True:
        needed, count = read_names(statements) | kept, [0]
        statements = _without(statements, needed, count)
        if not count[0]:
            return statements


def _without(statements: list[ast.stmt], needed: set[str], count: list[int]) -> list[ast.stmt]:
    left = []
    for statement in statements:
        if isinstance(statement, ast.Assign):
            (target,) = statement.targets
            dead = isinstance(target, ast.Name) and target.id not in needed
        elif isinstance(statement, ast.AugAssign):  # reads but itself
            dead = isinstance(statement.target, ast.Name) and statement.target.id not in needed
        elif isinstance(statement, (ast.For, ast.If)):
            statement.body = _without(statement.body, needed, count)
            statement.orelse = _without(statement.orelse, needed, count)
            dead = not statement.body and not statement.orelse
        elif isinstance(statement, ast.While):
            statement.body = _without(statement.body, needed, count)
            dead = False
        else:
            dead = False
        count[0] += dead
        if not dead:
            left.append(statement)
    return left
