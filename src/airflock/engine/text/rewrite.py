"""Rewrite: the tree of one rule as a driver holds it.

Free names are bound, float literals are cast to `real`, choices become constants and leave one
branch, vectors are written out, and what the rule calls is named as the driver names it.
"""

import ast
import builtins
import math
import types
from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import TYPE_CHECKING, Any

from airflock.core import component_names, law, resolve_global, walk_tree
from airflock.support import RuleError

if TYPE_CHECKING:
    from airflock.engine.text.generate import DriverSource


class VectorUnroller(ast.NodeTransformer):
    """A rewriter that writes out the vectors of one rule.

    vectors : for each record name its vectors, with how many components each has
    """

    def __init__(self, rule: Callable[..., Any], vectors: Mapping[str, Mapping[str, int]]):
        self.rule, self.vectors = rule, vectors

    def size(self, node: ast.AST) -> int:
        """Return the number of components of the vector that an expression names; 0 if it names none."""
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            return self.vectors.get(node.value.id, {}).get(node.attr, 0)
        return 0

    def components(self, node: ast.Attribute) -> list[ast.expr]:
        """Components of a vector, one after another."""
        return [ast.Attribute(node.value, name, ast.Load()) for name in component_names(node.attr, self.size(node))]

    def counts(self, node: ast.Call) -> bool:
        """Return True if a call is the length of a vector."""
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
        """Return the values of the target of a loop over components, turn by turn; None for any other loop."""
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
    """Return True if a loop may be left early, skip the rest of a turn, or do something at its end."""
    return bool(node.orelse) or any(isinstance(item, (ast.Break, ast.Continue)) for item in walk_tree(node))


GIVEN = law.ALLOWED_CALLS | {law.CAST_NAME, *law.RENAMED_BUILTINS.values()}  # what every driver has
NO_CHOICES: Mapping[str, str] = {}


def law_suffix(law: int | None) -> str:
    """Return the suffix of names of one law of several in a driver."""
    return f"_{law}" if law else ""


class RuleRewriter(VectorUnroller):
    """Bind the free names of one rule and cast its literals; arguments that are chosen become constants."""

    def __init__(self, rule: Callable[..., Any], source: "DriverSource", chosen: Mapping[str, str]):
        super().__init__(rule, source.vectors)
        self.source, self.chosen = source, chosen
        self.local = set(rule.__code__.co_varnames) - set(chosen)

    def _choice(self, node: ast.Attribute) -> Any:
        """Return the choice or the usual number that a field of a record is; None if it is neither."""
        record = node.value.id if isinstance(node.value, ast.Name) else ""
        return self.source.constants.get(record, {}).get(node.attr)

    def _real(self, node: ast.expr) -> ast.expr:
        return ast.Call(ast.Name("real", ast.Load()), [node], [])

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        return self._real(node) if type(node.value) is float else node

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.expr:
        if self.source.allow_builtins:
            return node
        place = law.place_of(self.rule, node.lineno - 1)
        raise RuleError(
            f"{place}: rule {self.rule.__name__} makes a text; it does not compile; the device python flies it"
        )

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        if isinstance(node.value, ast.Name):
            if node.value.id == "math" and isinstance(getattr(math, node.attr, None), float):
                return self._real(ast.Constant(getattr(math, node.attr)))
            value = self._choice(node)
            if value is not None:
                return ast.Constant(value) if isinstance(value, str) else self._real(ast.Constant(value))
            if self.size(node):
                return ast.Tuple([self.visit(part) for part in self.components(node)], ast.Load())
        self.generic_visit(node)
        return node

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        self.generic_visit(node)
        sides = [node.left, *node.comparators]
        if all(isinstance(s, ast.Constant) and isinstance(s.value, str) for s in sides) and len(sides) == 2:
            equal = node.left.value == node.comparators[0].value  # type: ignore[attr-defined]
            return ast.Constant(equal if isinstance(node.ops[0], ast.Eq) else not equal)
        return node

    def visit_IfExp(self, node: ast.IfExp) -> ast.expr:
        node.test = self.visit(node.test)
        if isinstance(node.test, ast.Constant):
            kept: ast.expr = self.visit(node.body if node.test.value else node.orelse)
            return kept
        node.body = self.visit(node.body)
        node.orelse = self.visit(node.orelse)
        return node

    def visit_If(self, node: ast.If) -> Any:
        node.test = self.visit(node.test)
        if isinstance(node.test, ast.Constant):
            kept: list[ast.stmt] = []
            for statement in node.body if node.test.value else node.orelse:
                found = self.visit(statement)
                kept += found if isinstance(found, list) else [found]
            return kept or ast.Pass()
        self.generic_visit(node)
        return node

    def visit_Call(self, node: ast.Call) -> ast.expr:
        if self.counts(node):
            return ast.Constant(self.size(node.args[0]))
        self._hand_on(node)
        self.generic_visit(node)
        method = node.func
        if isinstance(method, ast.Attribute) and isinstance(method.value, ast.Name) and method.value.id == "percept":
            node.func = ast.Name(
                f"percept_{method.attr}{law_suffix(self.source.law)}", ast.Load()
            )  # bound by the driver
            node.args.insert(0, method.value)
        if isinstance(node.func, ast.Name) and node.func.id == "float":
            node.func.id = "real"
        if isinstance(node.func, ast.Name) and node.func.id in ("min", "max"):
            name = ast.Name("least" if node.func.id == "min" else "most", ast.Load())
            folded = node.args[0]
            for argument in node.args[1:]:
                folded = ast.Call(name, [folded, argument], [])
            return folded
        return node

    def _hand_on(self, node: ast.Call) -> None:
        """Name all arguments of a call; a plain function that is handed a choice is called by its text for this one."""
        called = resolve_global(node.func.id, self.rule) if isinstance(node.func, ast.Name) else None
        if isinstance(called, types.FunctionType) and not node.keywords:  # a driver knows no defaults
            usual = called.__defaults__ or ()
            missing = called.__code__.co_argcount - len(node.args)
            node.args += [ast.Constant(value) for value in usual[max(0, len(usual) - missing) :]] if missing > 0 else []
        texts = [self._text(argument) for argument in node.args]
        if isinstance(called, types.FunctionType) and any(text is not None for text in texts):
            names = called.__code__.co_varnames
            chosen = {name: text for name, text in zip(names, texts, strict=False) if text is not None}
            node.func = ast.Name(self.source.name(called, chosen), ast.Load())
            node.args = [argument for argument, text in zip(node.args, texts, strict=True) if text is None]

    def _text(self, node: ast.expr) -> str | None:
        """The choice that an expression is, if it is one."""
        value: object = None
        if isinstance(node, ast.Constant):
            value = node.value
        elif isinstance(node, ast.Name):
            value = self.chosen.get(node.id)
        elif isinstance(node, ast.Attribute):
            value = self._choice(node)
        return value if isinstance(value, str) else None

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        if (part := self.component(node)) is not None:
            return self.visit(part)  # type: ignore[no-any-return]
        self.generic_visit(node)
        inner = node.value
        if isinstance(inner, ast.Subscript) and isinstance(inner.value, (ast.Name, ast.Attribute)):  # a[i][j] → a[i, j]
            pair = ast.Tuple([inner.slice, node.slice], ast.Load())
            return ast.Subscript(inner.value, pair, node.ctx)
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self.local:
            return node
        if node.id in self.chosen:
            if isinstance(node.ctx, ast.Store):
                raise RuleError(
                    f"{self.rule.__code__.co_filename}: rule {self.rule.__name__} sets {node.id}, a choice that it is "
                    "handed; give the variable another name"
                )
            return ast.Constant(self.chosen[node.id])
        if node.id in GIVEN or node.id in self.source.names() or node.id.startswith("percept_"):
            return node
        value = resolve_global(node.id, self.rule)
        # Global constants are inlined, real ones in the precision of the driver; bool first, as it
        # is an int in Python.
        if isinstance(value, bool):
            return ast.Constant(value)
        if isinstance(value, float):
            return self._real(ast.Constant(value))
        if isinstance(value, int):
            return ast.Constant(value)
        if isinstance(value, types.FunctionType) or (isinstance(value, type) and issubclass(value, tuple)):
            return ast.Name(self.source.name(value), node.ctx)
        if isinstance(value, types.ModuleType) or (self.source.allow_builtins and hasattr(builtins, node.id)):
            return node
        why = (
            "; it does not compile; the device python flies it" if hasattr(builtins, node.id) else "; it is not defined"
        )
        if value is not None:
            why = f"; write math.{node.id}" if callable(value) and hasattr(math, node.id) else ""
        raise RuleError(
            f"{law.place_of(self.rule, node.lineno - 1)}: rule {self.rule.__name__} uses {node.id}, which is neither a "
            f"number, a plain function nor a NamedTuple{why}"
        )
