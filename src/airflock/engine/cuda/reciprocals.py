"""Reciprocals: divisions by a root, or by a number of the scenario, as products with what is known of it already.

A GPU has few units for roots and quotients: one result per thread in eight cycles. A root r and 1/r are one such
operation if taken together (r = r2 · 1/r), and the reciprocal of a parameter is the same for all pairs. So rules that
divide by an argument get a second form, which takes its reciprocal too: `f(..., r, ...)` with `x / r` in it becomes
`f_per(..., r, ..., per_r)` with `x * per_r`. It is called wherever all reciprocals are at hand; results agree to
rounding. The rules themselves stay as they are.
"""

import ast
from collections.abc import Callable, Iterable
from copy import deepcopy

from airflock.core import walk_tree
from airflock.engine.specialise.dead import written_names

PREFIX = "per_"


class SecondForms:
    """Second forms of rules, made on demand from the text of a driver.

    `made` holds their text in order of need until a driver takes it, `names` the names of all.

    A key says whose reciprocal a form takes: "r", an argument, or "p.tau", a field of an argument.
    """

    def __init__(self, blocks: list[str], decorator: str):
        self.blocks, self.decorator = blocks, decorator
        self.made: list[str] = []
        self.names: set[str] = set()
        self._keys: dict[str, list[str] | None] = {}
        self._rules: dict[str, ast.FunctionDef] = {}
        self._read = 0

    def rule(self, name: str) -> ast.FunctionDef | None:
        """A rule of the driver by its name."""
        for block in self.blocks[self._read :]:
            node = ast.parse(block).body[0]
            if isinstance(node, ast.FunctionDef):
                self._rules[node.name] = node
        self._read = len(self.blocks)
        return self._rules.get(name)

    def keys(self, name: str) -> list[str] | None:
        """Reciprocals that the second form of a rule takes after its arguments; None if it has no such form."""
        if name not in self._keys:
            self._keys[name] = None
            rule = self.rule(name)
            if rule is not None:
                self._make(rule)
        return self._keys[name]

    def _make(self, rule: ast.FunctionDef) -> None:
        given = {argument.arg for argument in rule.args.args} - written_names([rule])

        def known(expression: ast.expr) -> str | None:
            text = ast.unparse(expression)
            return text if text.partition(".")[0] in given and text.replace(".", "", 1).isidentifier() else None

        node = deepcopy(rule)
        change = DivisionsToProducts(self, known)
        node.body = [change.visit(statement) for statement in node.body]
        root = single_root(rule)
        if root is not None:
            node.body = [ast.Return(ast.Call(ast.Name("inverse_root", ast.Load()), [root], []))]
        elif not change.changed:
            return
        node.name = f"{rule.name}_per"
        node.decorator_list = []
        node.args.args += [ast.arg(reciprocal_name(key)) for key in change.found]
        self._keys[rule.name] = list(change.found) if root is None else None
        self.names.add(node.name)
        self.made.append(f"{self.decorator}\n{ast.unparse(ast.fix_missing_locations(node))}")

    def is_root(self, name: str) -> bool:
        """Whether a rule is nothing but a root; its second form is the reciprocal."""
        rule = self.rule(name)
        if rule is None or single_root(rule) is None:
            return False
        self.keys(name)
        return True


class DivisionsToProducts(ast.NodeTransformer):
    """Divisions by what is known as products; known: the key of an expression whose reciprocal can be had, or None."""

    def __init__(self, forms: SecondForms, known: Callable[[ast.expr], str | None]):
        self.forms, self.known = forms, known
        self.found: dict[str, None] = {}
        self.changed = False

    def reciprocal(self, key: str) -> ast.expr:
        """The reciprocal of a key, noted as needed."""
        self.found[key] = None
        return ast.Name(reciprocal_name(key), ast.Load())

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """A quotient becomes a product."""
        self.generic_visit(node)
        if not isinstance(node.op, ast.Div):
            return node
        key = self.known(node.right)
        if key is not None:
            self.changed = True
            return ast.BinOp(node.left, ast.Mult(), self.reciprocal(key))
        call = node.right
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and self.forms.is_root(call.func.id):
            self.changed = True
            inverse = ast.Call(ast.Name(f"{call.func.id}_per", ast.Load()), call.args, [])
            return ast.BinOp(node.left, ast.Mult(), inverse)
        return node

    def visit_Call(self, node: ast.Call) -> ast.expr:
        """A rule that divides by its arguments is called in its second form."""
        self.generic_visit(node)
        if not isinstance(node.func, ast.Name):
            return node
        rule, keys = self.forms.rule(node.func.id), self.forms.keys(node.func.id)
        if rule is None or keys is None or len(node.args) != len(rule.args.args):
            return node
        place = {argument.arg: node.args[k] for k, argument in enumerate(rule.args.args)}
        wanted = []
        for key in keys:
            owner, _, field = key.partition(".")
            given = place[owner]
            wanted.append(self.known(ast.Attribute(given, field, ast.Load()) if field else given))
        if None in wanted:
            return node
        self.changed = True
        return ast.Call(
            ast.Name(f"{node.func.id}_per", ast.Load()),
            [*node.args, *(self.reciprocal(key) for key in wanted if key is not None)],
            [],
        )


class RootsToReciprocals(ast.NodeTransformer):
    """x = sqrt(s) as per_x = 1 / sqrt(s), x = s · per_x, for the names that are asked for; s is never zero."""

    def __init__(self, names: Iterable[str]):
        self.names = set(names)

    def visit_Assign(self, node: ast.Assign) -> ast.stmt | list[ast.stmt]:
        """An assignment."""
        name = root_name(node)
        if name is None or name not in self.names:
            return node
        square = ast.unparse(node.value.args[0])  # type: ignore[attr-defined]
        text = f"square_{name} = {square}\n{reciprocal_name(name)} = inverse_root(square_{name})\n"
        return ast.parse(f"{text}{name} = square_{name} * {reciprocal_name(name)}").body


def with_reciprocals(
    forms: SecondForms, body: list[ast.stmt], records: set[str]
) -> tuple[list[ast.stmt], list[tuple[str, str]]]:
    """A stage with products for divisions, and the numbers (record, field) whose reciprocals it takes.

    records : names of the records of numbers that the stage reads
    """
    roots = {name for s in body for item in walk_tree(s) if (name := root_name(item)) is not None}
    roots -= {name for s in body for item in walk_tree(s) for name in otherwise_assigned(item)}

    def known(expression: ast.expr) -> str | None:
        text = ast.unparse(expression)
        owner, dot, field = text.partition(".")
        return text if (owner in records and field.isidentifier()) or (text in roots and not dot) else None

    change = DivisionsToProducts(forms, known)
    changed: list[ast.stmt] = [change.visit(statement) for statement in body]
    rewrite = RootsToReciprocals(key for key in change.found if key in roots)
    done: list[ast.stmt] = []
    for statement in changed:
        found = rewrite.visit(statement)
        done += found if isinstance(found, list) else [found]
    numbers = [(key.partition(".")[0], key.partition(".")[2]) for key in change.found if "." in key]
    return [ast.fix_missing_locations(s) for s in done], numbers


def reciprocal_name(key: str) -> str:
    """Name of the reciprocal of a key."""
    return PREFIX + key.replace(".", "_")


def single_root(rule: ast.FunctionDef) -> ast.expr | None:
    """What a rule takes the root of, if it does nothing else."""
    last = rule.body[-1]
    if len(rule.body) != 1 or not isinstance(last, ast.Return) or not isinstance(last.value, ast.Call):
        return None
    return last.value.args[0] if ast.unparse(last.value.func) == "math.sqrt" else None


def otherwise_assigned(node: ast.AST) -> set[str]:
    """Names that a statement stores, if it does not assign the root of a square: their reciprocal is not at hand."""
    if not isinstance(node, (ast.Assign, ast.AugAssign, ast.For)) or root_name(node) is not None:
        return set()
    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
    return {item.id for target in targets for item in walk_tree(target) if isinstance(item, ast.Name)}


def root_name(node: ast.AST) -> str | None:
    """Name that is assigned the root of a square that the passes keep above zero (+ TINY)."""
    if not isinstance(node, ast.Assign) or not isinstance(node.targets[0], ast.Name):
        return None
    value = node.value
    if not isinstance(value, ast.Call) or ast.unparse(value.func) != "math.sqrt":
        return None
    square = ast.unparse(value.args[0])
    return node.targets[0].id if square == "r2" or square.endswith("+ TINY") else None
