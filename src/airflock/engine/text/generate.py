"""From plain rules to the text of one driver module.

The text of each rule is copied, global constants are inlined, float literals are cast to `real`,
choices of a parameter record become constants, and every plain function that a rule calls comes
along; one that is handed a choice comes in a text of its own for each. The engine writes the loops
around it (`passes`); the result is one file that depends on nothing but Numba.
"""

import ast
import inspect
from collections.abc import Callable, Mapping
from copy import copy
from typing import Any

from airflock.core import law, random as random_streams, tree_of, walk_tree
from airflock.engine.text.rewrite import NO_CHOICES, RuleRewriter
from airflock.support import to_identifier

# A solver is called from several places and would be compiled as often: minutes instead of seconds.
ALONE = '@njit(fastmath=True, error_model="numpy", nogil=True, **INNER)'
NONE: Mapping[str, Mapping[str, int]] = {}
INLINED = '@njit(inline="always", **JIT)'


class DriverSource:
    """Collects functions and records, each once, as text in the order in which they are needed.

    decorator : line put above each function
    constants : for each record name (p, b, q, ...) its choices and usual numbers, inlined as
                constants
    vectors   : for each record name its vectors, with how many components each has
    shorter   : general rules → those that do the same in this driver, in less; they have the names
                of the general ones
    rows      : fields of each record that is made of a row of numbers, by its name
    lenient   : whether rules may call what only plain Python has, such as breakpoint() and print()
    """

    allow_builtins = False

    def __init__(
        self,
        decorator: str,
        constants: Mapping[str, Mapping[str, str | float]],
        vectors: Mapping[str, Mapping[str, int]] = NONE,
        shorter: Mapping[Any, Any] | None = None,
    ):
        self.shorter = shorter or {}
        self.decorator = decorator
        self.constants = constants
        self.vectors = vectors
        self.law = 0
        self.blocks: list[str] = []
        self.rows: dict[str, tuple[str, ...]] = {}
        self._names: dict[Any, str] = {}
        self._taken: set[str] = set()
        self._originals: dict[str, Any] = {}
        self._apart = False

    def of(
        self, law: int, constants: Mapping[str, Mapping[str, str | float]], vectors: Mapping[str, Mapping[str, int]]
    ) -> "DriverSource":
        """Return a source that writes into this text for another law of the flock, with records of its own."""
        other = copy(self)
        other.constants, other.vectors, other.law = constants, vectors, law
        return other

    def name(self, item: Any, chosen: Mapping[str, str] = NO_CHOICES) -> str:
        """Name in the driver of a plain function or a NamedTuple class; adds its text on first use.

        chosen : arguments of the function that are choices, by name; they become constants of its
                 text
        """
        key = (item, *chosen.items()) if chosen else item
        # Two laws share the texts of rules, except of those that read their own parameters or
        # percept.
        if self.law and inspect.isfunction(item) and {"p", "percept"} & set(item.__code__.co_varnames):
            key = (self.law, key)
        if key in self._names:
            return self._names[key]
        drawn = inspect.isfunction(item) and item.__module__ == random_streams.__name__
        if drawn and item.__name__ in random_streams.PRIMITIVES:
            return str(item.__name__)  # bound by the device
        # A law of the package is laws/NAME/law.py: its folder names it.
        module = str(getattr(item, "__module__", "")).removesuffix(".law").rpartition(".")[2].strip("_")
        said = [text for text in chosen.values() if text.isidentifier()]
        name = base = to_identifier("_".join([module, item.__name__, *said]))
        count = 1
        while name in self._taken:
            count += 1
            name = f"{base}{count}"
        self._names[key] = name
        self._taken.add(name)
        item = self.shorter.get(item, item)
        if not chosen:
            self._originals[name] = item
        if isinstance(item, type):
            self.blocks.append(f"{name} = namedtuple({name!r}, {list(getattr(item, '_fields', ()))!r})")
        else:
            self.blocks.append(self._function(random_streams.COMPILED.get(item, item), name, chosen))
        return name

    def names(self) -> set[str]:
        """Names in the driver of all that has come so far."""
        return self._taken

    def originals(self) -> dict[str, Any]:
        """Return the copied originals by their names in the driver: plain functions and NamedTuple classes."""
        return dict(self._originals)

    def solver(self, rule: Callable[..., Any]) -> str:
        """Name of an array-valued rule: its loops are its own, so neither it nor what it calls is inlined as text."""
        self._apart = True
        name = self.name(rule)
        self._apart = False
        return name

    def record(self, name: str, fields: tuple[str, ...]) -> str:
        """A record of numbers under a name of its own (the columns of a parameter row)."""
        if name not in self._taken:
            self._names[name] = name
            self._taken.add(name)
            self.rows[name] = fields
            self.blocks.append(f"{name} = namedtuple({name!r}, {list(fields)!r})")
        return name

    def _function(self, rule: Callable[..., Any], name: str, chosen: Mapping[str, str]) -> str:
        # Texts are written for each driver anew: keeping them saved 5 to 14 of the 30 ms of a text,
        # which nobody sees beside a compiler.
        law.check_rule(rule)
        node = tree_of(rule)
        node.name = name
        node.returns = None
        node.args.defaults = []
        node.args.args = [argument for argument in node.args.args if argument.arg not in chosen]
        for argument in node.args.args:
            argument.annotation = None
        if isinstance(node.body[0], ast.Expr) and isinstance(node.body[0].value, ast.Constant):
            node.body.pop(0)
        rewritten = RuleRewriter(rule, self, chosen).visit(node)
        _end_at_return(rewritten)
        # A loop inside a rule must be inlined before LLVM sees it: compiled on its own it is
        # unrolled and vectorised across its few scalars, and the loop over agents around it no
        # longer is (philox: 4 times slower).
        loops = any(isinstance(item, (ast.For, ast.While)) for item in walk_tree(node))
        decorator = INLINED if loops and self.decorator and not self._apart else self.decorator
        # Deep loops, and rules with scratch, are compiled once on their own: inlined at each call
        # they took minutes.
        if self._apart and (_depth(node) > 2 or "work" in {argument.arg for argument in node.args.args}):
            decorator = ALONE
        return f"{decorator}\n{ast.unparse(rewritten)}"


def _depth(node: ast.AST) -> int:
    """Return the depth of nested loops of a function."""
    inner = max((_depth(child) for child in ast.iter_child_nodes(node)), default=0)
    return inner + isinstance(node, (ast.For, ast.While))


def _end_at_return(node: ast.FunctionDef) -> None:
    """Drop what a choice has made unreachable, so that nothing in it counts as read."""
    ends = [k for k, statement in enumerate(node.body) if isinstance(statement, ast.Return)]
    del node.body[ends[0] + 1 if ends else len(node.body) :]
