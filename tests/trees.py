"""Syntax trees of drivers, normalised, so that two ways to write the same driver are the same tree.

Normalised are the names of locals (by first use), the numbers of rows (by their names), the place of pure bindings
(`x = work[3]`, records, integers of a world: sorted, on top), locals that are a constant (`vz = ZERO`), what is
computed and never read (dropped, on all sides), and arguments of functions of one agent (`*_of`) that their bodies do
not read. The stages `noise` and `gusts` stand where they are called.
"""

import ast
import copy
import hashlib

from airflock.core.law import walk_tree

TURNS = ("snapshot", "perceive", "receive", "neighbours", "boundaries", "decide", "move", "overrule")
STAGES = (
    *TURNS, *(f"{name}_of" for name in TURNS), "begin", "excursion", "tune", "meet", "aim_", "glide_", "appear_",
    "measure_sample", "measure_collision", "nearest", "draw", "normal", "wander", "err", "keep",
    "near_sample", "near_collision", "clusters_correlation", "clusters_groups",
    "clusters_swarms", "advance", "measure_frames", "turns",
)  # fmt: skip


def functions(text, rows):
    """Function definitions of a driver's text by name, normalised; of other statements, those that bind a name."""
    found = {}
    tree = _by_name(ast.parse(text), rows)
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            found[node.name] = node
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            found[node.targets[0].id] = node
    parts = {name: found.pop(name) for name in ("noise", "gusts") if isinstance(found.get(name), ast.FunctionDef)}
    read_by = {}
    for name, node in found.items():
        if not isinstance(node, ast.FunctionDef):
            continue
        node.body = _alive(_without_constants(_with_parts(node.body, parts)))
        if name.endswith("_of"):
            arguments = [a.arg for a in node.args.args]
            kept = sorted(a for a in arguments if a in _read(node.body))
            read_by[name] = [arguments.index(a) for a in kept]
            node.args.args = [ast.arg(a) for a in kept]
        for call in walk_tree(node):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") in read_by:
                call.args = [call.args[k] for k in read_by[call.func.id]]
        node.body = _alive(node.body)
        lift = _Lift()
        node = lift.visit(node)
        node.body = [lift.found[key] for key in sorted(lift.found)] + node.body
        own = {n.id for n in walk_tree(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
        found[name] = _Locals(own - {a.arg for a in node.args.args}).visit(node)
    return found


def reached(found, first="fly"):
    """Those that a function needs, in any number of steps."""
    done, new = set(), {first}
    while new:
        done |= new
        new = {n.id for x in new for n in walk_tree(found[x]) if isinstance(n, ast.Name)} & found.keys() - done
    return {name: found[name] for name in done}


def shown(node):
    """A tree as text, without what is empty: `ast.dump` writes that in one Python and not in the other."""
    if isinstance(node, list):
        return f"[{' '.join(map(shown, node))}]"
    if not isinstance(node, ast.AST):
        return repr(node)
    given = [(name, value) for name, value in ast.iter_fields(node) if value is not None and value != []]
    return f"({type(node).__name__} {' '.join(f'{name}={shown(value)}' for name, value in given)})"


def digests(text, rows):
    """Digest of the normalised tree of each stage in a driver's text."""
    found = functions(text, rows)
    return {name: hashlib.sha256(shown(found[name]).encode()).hexdigest()[:12] for name in STAGES if name in found}


def _by_name(tree, rows):
    """The tree with rows by name."""
    names = {number: name for name, number in reversed(rows.items())}
    for node in walk_tree(tree):
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == "work":
            if _number(node.slice) is not None:
                node.slice = ast.Constant(names[_number(node.slice) % len(rows)])
            elif isinstance(node.slice, ast.Tuple) and _number(node.slice.elts[0]) is not None:
                node.slice.elts[0] = ast.Constant(names[_number(node.slice.elts[0]) % len(rows)])
    return tree


def _number(node):
    """A number as it is written, with its sign; None where it is none."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        found = _number(node.operand)
        return None if found is None else -found
    return node.value if isinstance(node, ast.Constant) else None


def _with_parts(statements, parts):
    """Statements with those of other stages in place of their calls."""
    done = []
    for statement in statements:
        value = getattr(statement, "value", None)
        part = parts.get(getattr(getattr(value, "func", None), "id", "")) if isinstance(value, ast.Call) else None
        if part is None:
            done.append(statement)
            continue
        *body, last = copy.deepcopy(part.body)
        assert isinstance(last, ast.Return)
        done += [s for s in body if ast.unparse(s) != "wide_vectors()"]
        if isinstance(statement, ast.Assign):
            assert ast.unparse(statement.targets[0]) == ast.unparse(last.value)
    return done


def _without_constants(statements):
    """Statements with a named constant in place of each local that is bound to nothing but that constant."""
    nodes = [node for statement in statements for node in walk_tree(statement)]
    stored = [node.id for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    found = {}
    for node in nodes:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            found.setdefault(node.targets[0].id, []).append(getattr(node.value, "id", ""))
    alone = {name: to[0] for name, to in found.items() if to[0].isupper() and to == [to[0]] * stored.count(name)}
    for node in nodes:
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            node.id = alone.get(node.id, node.id)
    return statements


def _read(statements):
    return {n.id for s in statements for n in walk_tree(s) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}


def _alive(statements):
    """Statements without what is computed and never read."""
    while True:
        found = _Dead(_read(statements))
        statements = [s for s in (found.visit(s) for s in statements) if s is not None]
        if not found.dropped:
            return statements


class _Statements(ast.NodeTransformer):
    """Goes through statements, and into no expression."""

    def generic_visit(self, node):
        return node if isinstance(node, (ast.expr, ast.expr_context)) else super().generic_visit(node)


class _Dead(_Statements):
    def __init__(self, read):
        self.read, self.dropped = read, False

    def visit_Assign(self, node):
        if len(node.targets) == 1 and isinstance(node.targets[0], ast.Name) and node.targets[0].id not in self.read:
            self.dropped = True
            return None
        return node

    def visit_AugAssign(self, node):
        if isinstance(node.target, ast.Name) and node.target.id not in self.read:
            self.dropped = True
            return None
        return node

    def visit_For(self, node):
        self.generic_visit(node)
        return node if node.body else None

    visit_If = visit_For


class _Lift(_Statements):
    """Takes pure bindings out, wherever they stand."""

    def __init__(self):
        self.found = {}

    def visit_Assign(self, node):
        if _binds(node):
            self.found[shown(node.value) + ast.unparse(node)] = node
            return None
        return node


def _binds(node):
    if not isinstance(node.targets[0], ast.Name):
        return False
    value = node.value
    if isinstance(value, ast.Subscript) and isinstance(value.value, ast.Name) and isinstance(value.slice, ast.Constant):
        return value.value.id in ("work", "whole", "words", "scene")
    return (
        isinstance(value, ast.Call)
        and len(value.args) > 0
        and all(ast.unparse(argument).startswith("row[") for argument in value.args)
    )


class _Locals(ast.NodeTransformer):
    """Locals by the order in which they are first used."""

    def __init__(self, own):
        self.own, self.seen = own, {}

    def visit_Assign(self, node):
        node.value = self.visit(node.value)
        node.targets = [self.visit(t) for t in node.targets]
        return node

    def visit_Name(self, node):
        if node.id in self.own:
            node.id = self.seen.setdefault(node.id, f"local{len(self.seen)}")
        return node
