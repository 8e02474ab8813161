"""Rows of agents, as the text of a stage names them, in the hands of one thread: registers and shared tables."""

import ast
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from airflock.engine.cuda.shape import BlockLayout
from airflock.engine.replace import ReplacementError

PER_AGENT_TABLES = {"mem": "mem", "memory": "kept"}  # second index is the agent


@dataclass
class LoweringContext:
    """What lowering has to know.

    shape    : layout of a flock
    rows     : names that stand for rows of the work table
    columns  : row → (shared table, column) for rows that other agents read
    turn     : one agent i at a time, for all threads
    carried  : totals stay with each thread instead of being reduced over the block
    cells    : lines around a pair loop over cells, from outside in, instead of one loop over all pairs
    exact    : an unrolled pair loop meets nobody beyond the last agent (who would be far away)
    alone    : loops that keep one agent of all (the farthest, say) are run in full by every thread
    across   : rows over the others that each agent has to itself, and their places in the table that holds them
    """

    shape: BlockLayout
    rows: set[str]
    columns: dict[str, tuple[str, int]]
    turn: bool = False
    carried: bool = False
    alone: bool = False
    exact: bool = False
    cells: tuple[str, ...] = ()
    across: Mapping[str, int] = field(default_factory=dict)


def parse_lines(lines: Iterable[str] | str) -> list[ast.stmt]:
    """Statements of a text."""
    return ast.parse(lines if isinstance(lines, str) else "\n".join(lines)).body


class DropBindings(ast.NodeTransformer):
    """Drops statements that only take a row or a part of a tuple of arrays: the kernel holds them by name."""

    def __init__(self, context: LoweringContext):
        self.known = ("words", "scene") if context.shape.registers else ("scene",)

    def visit_Assign(self, node: ast.Assign) -> ast.stmt | None:
        """An assignment."""
        source = node.value.value if isinstance(node.value, ast.Subscript) else None
        return None if isinstance(source, ast.Name) and source.id in self.known else node


class HalvesToShifts(ast.NodeTransformer):
    """Remainders and quotients of the step by two, which is never negative: a bit and a shift."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        """A sum, product and so on."""
        self.generic_visit(node)
        counted = isinstance(node.left, ast.Name) and node.left.id == "step"
        if counted and isinstance(node.right, ast.Constant) and node.right.value == 2:
            if isinstance(node.op, ast.Mod):
                return ast.BinOp(node.left, ast.BitAnd(), ast.Constant(1))
            if isinstance(node.op, ast.FloorDiv):
                return ast.BinOp(node.left, ast.RShift(), ast.Constant(1))
        return node


class AgentNumbers(ast.NodeTransformer):
    """Numbers of agents, which a table of reals holds, as whole numbers."""

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """An element of a row or table."""
        self.generic_visit(node)
        if isinstance(node.value, ast.Name) and node.value.id == "order":
            return ast.Call(ast.Name("integer", ast.Load()), [node], [])
        return node


class PairRows(ast.NodeTransformer):
    """Rows over the others that each agent has to itself: `square[j]` of agent i lies at across[c, i, j]."""

    def __init__(self, context: LoweringContext):
        self.places = context.across

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """An element of a row or table."""
        if isinstance(node.value, ast.Name) and node.value.id in self.places:
            self.generic_visit(node.slice)
            place = [ast.Constant(self.places[node.value.id]), ast.Name("i", ast.Load()), node.slice]
            return ast.Subscript(ast.Name("across", ast.Load()), ast.Tuple(place, ast.Load()), node.ctx)
        self.generic_visit(node)
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """A name. Raises ReplacementError for a variable that is called as a row is."""
        if node.id not in self.places:
            return node
        if isinstance(node.ctx, ast.Store):
            raise ReplacementError(f"{node.id}: a variable of a stage has the name of a row over the others")
        return ast.parse(f"across[{self.places[node.id]}, i]", mode="eval").body


class OtherRows(ast.NodeTransformer):
    """Rows of another agent: columns of the shared tables."""

    def __init__(self, context: LoweringContext):
        self.context = context

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """An element of a row or table."""
        self.generic_visit(node)
        if isinstance(node.value, ast.Name) and isinstance(node.slice, ast.Name) and node.slice.id == "j":
            name = node.value.id
            if name in self.context.columns and self.context.shape.registers:
                table, column = self.context.columns[name]
                pair = ast.Tuple([ast.Name("j", ast.Load()), ast.Constant(column)], ast.Load())
                return ast.Subscript(ast.Name(table, ast.Load()), pair, node.ctx)
            if name not in self.context.rows and name not in self.context.across:
                return ast.Name(f"{name}_j", node.ctx)  # known of this pair alone
        return node


class AllAgentsLoop(ast.NodeTransformer):
    """A loop over all agents in the shared table, for a thread that looks at them one after another."""

    def __init__(self, context: LoweringContext):
        self.context = context

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """An element of a row or table."""
        if isinstance(node.value, ast.Name) and isinstance(node.slice, ast.Name) and node.slice.id == "i":
            table, column = self.context.columns[node.value.id]
            pair = ast.Tuple([ast.Name("every", ast.Load()), ast.Constant(column)], ast.Load())
            return ast.Subscript(ast.Name(table, ast.Load()), pair, node.ctx)
        self.generic_visit(node)
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """A name."""
        return ast.Name("every", node.ctx) if node.id == "i" else node


class OwnRegisters(ast.NodeTransformer):
    """Rows of the own agent: registers."""

    def __init__(self, context: LoweringContext):
        self.context = context

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        """An element of a row or table."""
        self.generic_visit(node)
        if not isinstance(node.value, ast.Name):
            return node
        name, place = node.value.id, node.slice
        if name == "values" and isinstance(place, ast.Constant):
            return ast.Name(f"value{place.value!s}", node.ctx)
        if not self.context.shape.registers:
            return node
        if isinstance(place, ast.Name) and place.id == "i" and name in self.context.rows:
            return ast.Name(f"{name}_i", node.ctx)
        if name in PER_AGENT_TABLES and isinstance(place, ast.Tuple) and isinstance(place.elts[0], ast.Constant):
            return ast.Name(f"{PER_AGENT_TABLES[name]}{place.elts[0].value!s}_i", node.ctx)
        return node

    def visit_Assign(self, node: ast.Assign) -> ast.stmt:
        """An assignment."""
        # a row under another name: gx_ = g0 if step % 2 == 0 else g2
        carried = self.context.shape.registers and self.context.carried
        if carried and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            value = node.value
            parts = [value.body, value.orelse] if isinstance(value, ast.IfExp) else [value]
            if all(isinstance(part, ast.Name) and part.id in self.context.rows for part in parts):
                for part in (*parts, node.targets[0]):
                    self.context.rows.add(part.id)  # type: ignore[attr-defined]
                    part.id += "_i"  # type: ignore[attr-defined]
                return node
        self.generic_visit(node)
        return node
