"""From plain rules to the text of one driver module.

The text of each rule is copied, global constants are inlined, float literals are cast to `real`, choices of a parameter
record become constants, and every plain function that a rule calls comes along; one that is handed a choice comes in a
text of its own for each. The engine writes the loops around it (`passes`); the result is one file that depends on
nothing but Numba.
"""

import ast
import builtins
import inspect
import math
import types
from collections.abc import Callable, Mapping
from copy import copy
from typing import Any

from airflock.core import random as random_streams
from airflock.errors import RuleError
from airflock.rules import law
from airflock.rules.copies import Copies, Notes
from airflock.rules.integers import tree_of
from airflock.rules.nodes import walk
from airflock.rules.unrolled import Unrolled
from airflock.spelling import as_name

# A solver is called from several places and would be compiled as often: minutes instead of seconds.
ALONE = '@njit(fastmath=True, error_model="numpy", nogil=True, **INNER)'
GIVEN = law.ALLOWED_CALLS | {law.TAKEN, *law.RESERVED.values()}  # what every driver has
NOTHING: Mapping[str, str] = {}
NONE: Mapping[str, Mapping[str, int]] = {}
COPIES = Copies()  # of this process
INLINED = '@njit(inline="always", **JIT)'


class Source:
    """Collects functions and records, each once, as text in the order in which they are needed.

    decorator : line put above each function
    constants : for each record name (p, b, q, ...) its choices and usual numbers, inlined as constants
    vectors   : for each record name its vectors, with how many components each has
    rows      : fields of each record that is made of a row of numbers, by its name
    lenient   : whether rules may call what only plain Python has, such as breakpoint() and print()
    """

    lenient = False

    def __init__(
        self,
        decorator: str,
        constants: Mapping[str, Mapping[str, str | float]],
        vectors: Mapping[str, Mapping[str, int]] = NONE,
    ):
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
    ) -> "Source":
        """The same text, for rules of another law of the flock: what they read of its records is its own."""
        other = copy(self)
        other.constants, other.vectors, other.law = constants, vectors, law
        return other

    def name(self, item: Any, chosen: Mapping[str, str] = NOTHING) -> str:
        """Name in the driver of a plain function or a NamedTuple class; adds its text on first use.

        chosen : arguments of the function that are choices, by name; they become constants of its text
        """
        key = (item, *chosen.items()) if chosen else item
        if self.law and inspect.isfunction(item) and {"p", "percept"} & set(item.__code__.co_varnames):
            key = (self.law, key)
        if key in self._names:
            return self._names[key]
        drawn = inspect.isfunction(item) and item.__module__ == random_streams.__name__
        if drawn and item.__name__ in random_streams.PRIMITIVES:
            return str(item.__name__)  # bound by the device
        module = str(getattr(item, "__module__", "")).rpartition(".")[2].strip("_")
        said = [text for text in chosen.values() if text.isidentifier()]
        name = base = as_name("_".join([module, item.__name__, *said]))
        count = 1
        while name in self._taken:
            count += 1
            name = f"{base}{count}"
        self._names[key] = name
        self._taken.add(name)
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
        """What was copied, by its name in the driver: plain functions and NamedTuple classes of their authors."""
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
        law.check(rule)
        notes = Notes(rule, self)
        of = rule, name, *chosen.items(), self.decorator, self.law, self.lenient, self._apart
        text = COPIES.text(of, notes)
        if text is None:
            text = self._copied(rule, name, chosen, notes)
            COPIES.keep(of, notes, text)
        return text

    def _copied(self, rule: Callable[..., Any], name: str, chosen: Mapping[str, str], notes: Notes) -> str:
        node = tree_of(rule)
        node.name = name
        node.returns = None
        node.args.defaults = []
        node.args.args = [argument for argument in node.args.args if argument.arg not in chosen]
        for argument in node.args.args:
            argument.annotation = None
        if isinstance(node.body[0], ast.Expr) and isinstance(node.body[0].value, ast.Constant):
            node.body.pop(0)
        rewritten = _Rewrite(rule, self, chosen, notes).visit(node)
        _end_at_return(rewritten)
        # A loop inside a rule must be inlined before LLVM sees it: compiled on its own it is unrolled and vectorised
        # across its few scalars, and the loop over agents around it no longer is (philox: 4 times slower).
        loops = any(isinstance(item, (ast.For, ast.While)) for item in walk(node))
        decorator = INLINED if loops and self.decorator and not self._apart else self.decorator
        if self._apart and (_depth(node) > 2 or "work" in {argument.arg for argument in node.args.args}):
            decorator = ALONE
        return f"{decorator}\n{ast.unparse(rewritten)}"


def law_mark(law: int | None) -> str:
    """What names of a driver end in that are of one law of several."""
    return f"_{law}" if law else ""


def _depth(node: ast.AST) -> int:
    """How many loops of a function lie inside each other."""
    inner = max((_depth(child) for child in ast.iter_child_nodes(node)), default=0)
    return inner + isinstance(node, (ast.For, ast.While))


class _Rewrite(Unrolled):
    """Bind the free names of one rule and cast its literals; arguments that are chosen become constants."""

    def __init__(self, rule: Callable[..., Any], source: Source, chosen: Mapping[str, str], notes: Notes):
        self.rule = rule
        self.source = source
        self.chosen = chosen
        self.notes = notes
        self.local = set(rule.__code__.co_varnames) - set(chosen)
        super().__init__(rule, source.vectors)

    def size(self, node: ast.AST) -> int:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            return self.notes.size(node.value.id, node.attr)
        return 0

    def _real(self, node: ast.expr) -> ast.expr:
        return ast.Call(ast.Name("real", ast.Load()), [node], [])

    def visit_Constant(self, node: ast.Constant) -> ast.expr:
        return self._real(node) if type(node.value) is float else node

    def visit_Attribute(self, node: ast.Attribute) -> ast.expr:
        if isinstance(node.value, ast.Name):
            if node.value.id == "math" and isinstance(getattr(math, node.attr, None), float):
                return self._real(ast.Constant(getattr(math, node.attr)))
            value = self.notes.choice(node.value.id, node.attr)
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
            node.func = ast.Name(f"percept_{method.attr}{law_mark(self.source.law)}", ast.Load())  # bound by the driver
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
        called = self.notes.free(node.func.id) if isinstance(node.func, ast.Name) else None
        if isinstance(called, types.FunctionType) and not node.keywords:  # a driver knows no defaults
            usual = called.__defaults__ or ()
            missing = called.__code__.co_argcount - len(node.args)
            node.args += [ast.Constant(value) for value in usual[max(0, len(usual) - missing) :]] if missing > 0 else []
        texts = [self._text(argument) for argument in node.args]
        if isinstance(called, types.FunctionType) and any(text is not None for text in texts):
            names = called.__code__.co_varnames
            chosen = {name: text for name, text in zip(names, texts, strict=False) if text is not None}
            node.func = ast.Name(self.notes.name(called, chosen), ast.Load())
            node.args = [argument for argument, text in zip(node.args, texts, strict=True) if text is None]

    def _text(self, node: ast.expr) -> str | None:
        """The choice that an expression is, if it is one."""
        value: object = None
        if isinstance(node, ast.Constant):
            value = node.value
        elif isinstance(node, ast.Name):
            value = self.chosen.get(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            value = self.notes.choice(node.value.id, node.attr)
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
        value = self.notes.free(node.id)
        if isinstance(value, bool):
            return ast.Constant(value)
        if isinstance(value, float):
            return self._real(ast.Constant(value))
        if isinstance(value, int):
            return ast.Constant(value)
        if isinstance(value, types.FunctionType) or (isinstance(value, type) and issubclass(value, tuple)):
            return ast.Name(self.notes.name(value, NOTHING), node.ctx)
        if isinstance(value, types.ModuleType) or (self.source.lenient and hasattr(builtins, node.id)):
            return node
        why = "it does not compile; the device python flies it" if hasattr(builtins, node.id) else "it is not defined"
        raise RuleError(
            f"{self.rule.__code__.co_filename}: rule {self.rule.__name__} uses {node.id}, which is neither a number, "
            "a plain function nor a NamedTuple" + (f"; {why}" if value is None else "")
        )


def _end_at_return(node: ast.FunctionDef) -> None:
    """Drop what a choice has made unreachable, so that nothing in it counts as read."""
    ends = [k for k, statement in enumerate(node.body) if isinstance(statement, ast.Return)]
    del node.body[ends[0] + 1 if ends else len(node.body) :]
