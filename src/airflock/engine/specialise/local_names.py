"""Local names: no local of a helper overwrites a value that a stage, or another helper, still reads; dead ones go.

A helper's statements take the place of its call, so that its locals lie beside the stage's. While
statements are made, a local of a helper is spelled with a mark of the helper (`near@2`), which no
name of Python can have. In the end each has its own name, unless one would then read what another
has written: that one gets the helper's name as a suffix.
"""

import ast
import re
from collections.abc import Callable, Iterable
from typing import Any

from airflock.core import walk_tree
from airflock.engine.specialise.known_values import FunctionSyntax, name_kind

TABLES = frozenset({"work", "row", "whole", "words", "store", "scene", "scratch"})  # what bindings of a driver read
MARK = re.compile(r"@(\d+)")
LastWriters = dict[str, set[str]]  # of each name in the driver, who may have written it last: locals with their marks


class LocalOwners:
    """Owners of the locals of a stage: the stage itself, or a helper by its number."""

    def __init__(self, stage: FunctionSyntax):
        self.texts = [stage]
        self.returned: dict[str, str] = {}

    def marked_name(self, name: str, text: FunctionSyntax) -> str:
        """A local as it is spelled while statements are made: the stage's as it is, a helper's with its mark."""
        if text not in self.texts:
            self.texts.append(text)
        number = self.texts.index(text)
        return f"{name}@{number}" if number else name

    def is_taken(self, vector: str, target: str) -> bool:
        """Return True if a vector that a helper returns has another name in its caller, which it would overwrite."""
        return self.returned.setdefault(vector, target) != target

    def assign_names(
        self, statements: list[ast.stmt], answer: ast.expr | None, make_error: Callable[[str], Exception]
    ) -> None:
        """Give each marked local a name of the driver.

        Raises what `fault` makes of a local of the stage that has a name which the driver itself
        binds.
        """
        parts: list[ast.AST] = [*statements, *([] if answer is None else [answer])]
        names = [item for part in parts for item in walk_tree(part) if isinstance(item, ast.Name)]
        bound = {item.id for item in names if name_kind(item) not in (None, "rule")} | TABLES
        # A helper's statements stand in place of its call; a local that the driver binds itself
        # would silently overwrite it.
        clash = sorted(bound.intersection(item.id for item in names if isinstance(item.ctx, ast.Store)))
        if clash:
            raise make_error(f"{clash[0]} is what the driver itself calls here; give the local another name")
        marked = dict.fromkeys(item.id for item in names if MARK.search(item.id))
        found = {name: MARK.sub("", name) for name in marked}
        taken = {item.id for item in names if item.id not in marked} | set(found.values())
        for name in marked:
            if found[name] in bound:
                found[name] = self._free(name, taken)
        # One name at a time gets its owner behind it, and the walk begins again: renaming one local
        # may settle several clashes, and short names stay short.
        while overwritten := _Order(found).overwritten(statements, answer):
            name = max(overwritten, key=lambda each: int((MARK.findall(each) or ["0"])[-1]))
            found[name] = self._free(name, taken)
        for item in names:
            item.id = found.get(item.id, item.id)

    def _free(self, marked: str, taken: set[str]) -> str:
        """A name for a marked local that no other has."""
        name = f"{MARK.sub('', marked)}_{self.texts[int(MARK.findall(marked)[-1])].node.name}"
        while name in taken:
            name += "_"
        taken.add(name)
        return name


class _Order:
    """A walk through statements in their order, which keeps the possible last writers of each shared name."""

    def __init__(self, found: dict[str, str]):
        self.found = found
        self.shared = {*found.values()}
        self.clash: set[str] = set()
        self.left: list[LastWriters] = []
        self.names: dict[int, tuple[list[str], list[str]]] = {}  # of a node, by its identity

    def overwritten(self, statements: list[ast.stmt], answer: ast.expr | None) -> set[str]:
        """Locals of one name of which one would be read where another has been written; nothing if there are none."""
        if self.found:
            written: LastWriters = {}
            self._block(statements, written)
            self._read(answer, written)
        return self.clash

    def _block(self, statements: Iterable[ast.stmt], written: LastWriters) -> None:
        for statement in statements:
            if isinstance(statement, (ast.For, ast.While)):
                self._loop(statement, written)
            elif isinstance(statement, ast.If):
                self._read(statement.test, written)
                other = {name: {*who} for name, who in written.items()}
                self._block(statement.body, written)
                self._block(statement.orelse, other)
                _join(written, other)
            elif isinstance(statement, (ast.Break, ast.Continue)):
                self.left.append({name: {*who} for name, who in written.items()})
            else:
                self._read(statement, written)
                self._write(statement, written)

    def _loop(self, loop: ast.For | ast.While, written: LastWriters) -> None:
        """A loop, done never, once, or again after itself."""
        outside, self.left = self.left, []
        # Twice, as the second turn reads what the first has written; a third would find nothing
        # new.
        for _ in range(2):
            again = {name: {*who} for name, who in written.items()}
            if isinstance(loop, ast.For):
                self._read(loop.iter, again)
                self._write(loop.target, again)
            else:
                self._read(loop.test, again)
            self._block(loop.body, again)
            for state in (again, *self.left):
                _join(written, state)
        self.left = outside

    def _read(self, node: ast.AST | None, written: LastWriters) -> None:
        for name in () if node is None else self._names(node)[0]:
            others = written.get(self.found.get(name, name), set()) - {name}
            self.clash |= {*others, name} if others else set()

    def _write(self, node: ast.AST, written: LastWriters) -> None:
        for name in self._names(node)[1]:
            written[self.found.get(name, name)] = {name}

    def _names(self, node: ast.AST) -> tuple[list[str], list[str]]:
        """Return the names that a statement or an expression reads, and the shared names that it writes; found once."""
        if id(node) not in self.names:
            items = walk_tree(node)
            named = [item for item in items if isinstance(item, ast.Name)]
            reads = [item.id for item in named if isinstance(item.ctx, ast.Load)]
            reads += [item.target.id for item in items if _adds(item)]  # type: ignore[attr-defined]
            written = [item.id for item in named if isinstance(item.ctx, ast.Store)]
            self.names[id(node)] = reads, [name for name in written if self.found.get(name, name) in self.shared]
        return self.names[id(node)]


def _adds(node: ast.AST) -> bool:
    """Return True if a statement reads the name that it assigns to."""
    return isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name)


def _join(written: LastWriters, other: LastWriters) -> None:
    """After either of two ways."""
    for name, who in other.items():
        written.setdefault(name, set()).update(who)


def can_share_name(statements: list[ast.stmt], marked: Any, name: str) -> bool:
    """Return True if the result of a helper can have the name that its caller gives it.

    So it is where both use one word, and the helper reads nothing else by that name, but to begin
    with.
    """
    if not isinstance(marked, ast.Name) or MARK.sub("", marked.id) != MARK.sub("", name):
        return False
    rest = [s for s in statements if not _copies(s, marked.id, name)]
    return all(item.id != name for s in rest for item in walk_tree(s) if isinstance(item, ast.Name))


def rename_local(statements: list[ast.stmt], old: str, new: str) -> list[ast.stmt]:
    """The statements with another name for a local, but those that would then do nothing."""
    for statement in statements:
        for item in walk_tree(statement):
            if isinstance(item, ast.Name) and item.id == old:
                item.id = new
    return [statement for statement in statements if not _copies(statement, new, new)]


def _copies(statement: ast.stmt, to: str, name: str) -> bool:
    """Return True if a statement only copies one name to another."""
    if not isinstance(statement, ast.Assign) or len(statement.targets) > 1:
        return False
    names = [node.id for node in (*statement.targets, statement.value) if isinstance(node, ast.Name)]
    return names == [to, name]


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

    What a stage calls to set a variable has no other effect; a call that has one stands alone, or
    sets several.

    kept : names that are read elsewhere
    """
    # A variable may be read only by a statement that is itself dead, so passes go on until one
    # removes nothing.
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
