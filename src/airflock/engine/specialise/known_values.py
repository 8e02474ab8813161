"""Values that an expression of a stage can have while its driver is made, besides ordinary Python objects."""

import ast
import linecache
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any

from airflock.core import walk_tree
from airflock.engine.stages.words import ZERO, ZERO_ROW

LOAD, STORE = ast.Load(), ast.Store()


class StageError(Exception):
    """A stage uses what the specialiser does not know; names file and line."""


@dataclass(frozen=True)
class AgentLoop:
    """A loop over all agents (`agents`, `lanes`: in turn the one agent that is due) or over the others of one.

    law    : the loop is only over those who fly by this law
    within : and over those from one lane up to another
    """

    bound: str
    agents: bool
    law: int | None = None
    within: tuple[ast.expr, ast.expr] | None = None


@dataclass(frozen=True)
class StageCall:
    """Another stage that a stage is handed: the driver's call of it, whatever differs from call to call."""

    text: str


@dataclass(frozen=True)
class StageFunction:
    """Another stage as a function of the driver; arguments that a call leaves out go by their own names."""

    name: str
    parameters: tuple[str, ...]


class ArrayBundle:
    """A tuple of arrays: it is handed on whole under its own name, and its parts are bound to names of theirs."""

    def __init__(self, name: str, parts: tuple[str, ...]):
        self.name = name
        self.__dict__ |= {part: driver_name(part, name) for part in parts}


@dataclass
class LocalVector:
    """A local vector, totals or aliases: one variable of the driver for each component that is set."""

    name: str
    kind: str
    set: dict[int, str] = field(default_factory=dict)

    def store(self, at: int) -> ast.Name:
        """The variable of a component that is set."""
        spelled = {"vector": "{0}_{1}", "aliases": "{0}{1}_", "totals": "{0}_{2}"}[self.kind]
        return ast.Name(self.set.setdefault(at, spelled.format(self.name, "xyz"[at : at + 1], at)), STORE)

    def __getitem__(self, at: int) -> object:
        if at in self.set:
            return ast.Name(self.set[at], LOAD)
        return ZERO_ROW if self.kind == "aliases" else ZERO


def driver_argument(name: str) -> ast.Name:
    """A parameter of a stage under the name that the driver's function has for it."""
    return ast.Name(name, LOAD)


def driver_name(name: str, kind: str, item: object = None) -> ast.Name:
    """A name that the driver binds for a stage.

    kind : row, number, record, whole or scene; argument, of the driver's function; or rule, the
           plain function or class `item`, which is named at the end
    """
    made = ast.Name(name, LOAD)
    made.kind, made.item = kind, item  # type: ignore[attr-defined]
    return made


def name_kind(value: object) -> str | None:
    """Which kind of name a driver binds for a stage this is, if it is one."""
    return getattr(value, "kind", None) if isinstance(value, ast.Name) else None


@dataclass(frozen=True)
class FunctionSyntax:
    """Syntax of a stage or of a helper.

    local : names that it binds, parameters among them
    once  : those that it binds in one place only
    again : parameters that it assigns to
    """

    node: ast.FunctionDef
    local: frozenset[str]
    once: frozenset[str]
    again: frozenset[str]
    names: dict[str, Any]
    where: str

    @cached_property
    def body(self) -> list[ast.stmt]:
        """Its statements, without a docstring."""
        return self.node.body[1:] if ast.get_docstring(self.node) is not None else self.node.body


@cache
def _module(path: str) -> dict[tuple[str, int], ast.FunctionDef]:
    """Functions of a file of stages by name and line: the whole file is read at once, as it has little else."""
    found = ast.parse("".join(linecache.getlines(path))).body
    return {(node.name, node.lineno): node for node in found if isinstance(node, ast.FunctionDef)}


@cache
def function_syntax(function: Callable[..., Any]) -> FunctionSyntax:
    """Syntax of a function of a module, read once."""
    code = function.__code__
    node = _module(code.co_filename)[code.co_name, code.co_firstlineno]
    loops = [item for item in walk_tree(node) if isinstance(item, ast.comprehension)]
    # Names of a comprehension live in it alone and are no locals of the stage.
    inner = {id(name) for loop in loops for name in walk_tree(loop.target)}
    bound = Counter(
        item.id
        for item in walk_tree(node)
        if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store) and id(item) not in inner
    )
    parameters = {a.arg for a in (*node.args.args, *node.args.kwonlyargs)}
    once = frozenset(name for name, count in bound.items() if count == 1 and name not in parameters)
    again = frozenset(bound) & parameters
    return FunctionSyntax(
        node, frozenset(bound) | parameters, once, again, function.__globals__, function.__code__.co_filename
    )


@dataclass
class Scope:
    """Values of the names of a stage, or of a helper in it."""

    text: FunctionSyntax
    known: dict[str, object] = field(default_factory=dict)

    def fault(self, node: ast.AST, message: str) -> StageError:
        """An error that names the line of the stage."""
        line = getattr(node, "lineno", self.text.node.lineno)
        return StageError(f"{self.text.where}:{line}: {self.text.node.name}: {message}")


def is_syntax(value: object) -> bool:
    """Return True if a value is syntax of the driver."""
    return isinstance(value, ast.expr)


def needs_no_variable(value: object) -> bool:
    """Return True if a local of this value needs no variable: it is known, or a name that the driver binds anyway."""
    return not is_syntax(value) or name_kind(value) not in (None, "rule")
