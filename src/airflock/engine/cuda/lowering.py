"""Lower: the text of a stage, written as loops over agents, as what one thread of a block does.

The passes of `engine.passes` are the only text of a stage. Here its syntax tree is changed:

* `for i in range(n)`: the thread's own agent where states lie in registers (row `x[i]` → register `x_i`), else every
  so-manieth agent. Totals that the loop carries (`a += ...`, `a = least(a, ...)`) are reduced over
  the block before they are next read.
* `for j in range(m)` within it: shared by the threads of one agent, unrolled; `x[j]` → the shared table.
* `mem[c, i]`, `memory[c, i]`, `values[c]`: registers.
"""

import ast
import re
from collections.abc import Callable, Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field

from airflock.core import walk_tree
from airflock.engine.cuda.block_layout import UNROLL, BlockLayout
from airflock.engine.replace import ReplacementError
from airflock.engine.specialise.local_names import read_names, written_names
from airflock.engine.stages.words import REDUCTION_START

PER_AGENT_TABLES = {"mem": "mem", "memory": "kept"}  # second index is the agent


@dataclass
class LoweringContext:
    """Settings of the lowering of one stage.

    shape    : layout of a flock
    rows     : names that stand for rows of the work table
    columns  : row → (shared table, column) for rows that other agents read
    turn     : one agent i at a time, for all threads
    carried  : totals stay with each thread instead of being reduced over the block
    cells    : lines around a pair loop over cells, from outside in, instead of one loop over all
               pairs
    exact    : an unrolled pair loop stops at the last agent (those beyond would be far away)
    alone    : loops that keep one agent of all (the farthest, say) are run in full by every thread
    across   : rows over the others that each agent has to itself, and their places in the table
               that holds them
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


NEUTRAL = {how: start.spelled for how, start in REDUCTION_START.items()}
TOTAL = {"sum": "{a} += {b}", "min": "{a} = least({a}, {b})", "max": "{a} = most({a}, {b})"}


def lower_statements(statements: list[ast.stmt], context: LoweringContext) -> list[ast.stmt]:
    """Statements of a stage as one thread runs them."""
    kept = [DropBindings(context).visit(HalvesToShifts().visit(s)) for s in statements]
    done = _Totals(context).run([AgentNumbers().visit(s) for s in kept if s is not None])
    return [ast.fix_missing_locations(PairRows(context).visit(s)) for s in done]


class _Totals:
    """Walks statements in order; totals over agents wait, and are reduced together when one of them is read."""

    def __init__(self, context: LoweringContext):
        self.context = context
        self.waiting: dict[str, str] = {}
        self.count = 0

    def run(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """Lowered statements; totals that nothing reads are reduced at the end."""
        return [*self.walk(statements), *self.flush()]

    def walk(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """Lowered statements of one block."""
        done: list[ast.stmt] = []
        for statement in statements:
            agents = _over_agents(statement)
            if self.waiting and (_of_one_thread(statement) or read_names([statement]) & set(self.waiting)):
                done += self.flush()
            if agents is not None:
                done += self.agents(agents)
            elif isinstance(statement, (ast.For, ast.While, ast.If)):
                if isinstance(statement, ast.If):
                    statement.test = OwnRegisters(self.context).visit(statement.test)
                statement.body = [*self.walk(statement.body), *self.flush()]
                statement.orelse = self.walk(statement.orelse) if statement.orelse else []
                done.append(statement)
            else:
                done.append(OwnRegisters(self.context).visit(statement))
        return [ast.fix_missing_locations(s) for s in done]

    def agents(self, loop: ast.For) -> list[ast.stmt]:
        """A loop over agents."""
        context, shape = self.context, self.context.shape
        if context.alone and any(isinstance(s, ast.If) for s in loop.body):
            return [AllAgentsLoop(context).visit(loop)] if shape.registers else [loop]
        totals = carried_totals(loop.body)
        paired = any(isinstance(s, ast.For) and _target(s) == "j" for s in walk_tree(loop))
        body = _Pairs(context).walk(loop.body)
        body = [OwnRegisters(context).visit(s) for s in body]
        if not context.carried:
            self.waiting |= totals
        if context.turn:
            return body
        # One thread per agent wherever a flock is larger than a warp: threads that share pairs cost
        # more than they save. A layout whose threads reach a sum in different turns is refused: on
        # a card they wait for ever, which the simulator does not show.
        if shape.registers:
            if not paired:
                masked = parse_lines(f"{t} = {t} if sub == 0 else {NEUTRAL[totals[t]]}" for t in totals)
                rest = masked if shape.per_agent > 1 and not context.carried else []
                test = ast.Compare(ast.Name("i", ast.Load()), [ast.Lt()], [ast.Name("n", ast.Load())])
                return [ast.If(test, body, []), *rest]
            own = parse_lines(f"{t} = {t} if (i < n) and (sub == 0) else {NEUTRAL[totals[t]]}" for t in totals)
            return [*body, *own]
        first, stride = ("tid // PER_AGENT", "THREADS // PER_AGENT") if paired else ("tid", "THREADS")
        loop.iter = ast.parse(f"range({first}, n, {stride})", mode="eval").body
        loop.body = body
        if not paired:
            return [loop]
        # rows that a pair loop reads or writes belong to other threads before and after it
        own = parse_lines(f"{t} = {t} if sub == 0 else {NEUTRAL[totals[t]]}" for t in totals)
        return [*parse_lines("cuda.syncthreads()"), loop, *parse_lines("cuda.syncthreads()"), *own]

    def flush(self) -> list[ast.stmt]:
        """Reduce all waiting totals over the block, so that every thread holds them."""
        if not self.waiting:
            return []
        # Totals wait and are reduced together when one is read: each reduction costs a barrier for
        # the whole block.
        shape, names = self.context.shape, list(self.waiting)
        lane, side = ("tid & 31", "tid >> 5") if not shape.simulated else ("0", "tid")
        side_ = self.count % 2  # one half is read while the other is written
        first = [f"{name} = warp_{self.waiting[name]}({name}, tid)" for name in names]
        put = [f"reduced[{side_}, {side}, {c}] = {name}" for c, name in enumerate(names)]
        get = [f"{name} = reduced[{side_}, 0, {c}]" for c, name in enumerate(names)]
        turn = [TOTAL[self.waiting[n]].format(a=n, b=f"reduced[{side_}, part, {c}]") for c, n in enumerate(names)]
        text = [*first, f"if {lane} == 0:", *(f"    {line}" for line in put), "cuda.syncthreads()", *get]
        if shape.warps > 1:
            text += ["for part in range(1, WARPS):", *(f"    {line}" for line in turn)]
        self.waiting = {}
        self.count += 1
        return parse_lines(text)


class _Pairs:
    """Loops over the other agents j, within the loop over agents."""

    def __init__(self, context: LoweringContext):
        self.context = context

    def walk(self, statements: list[ast.stmt]) -> list[ast.stmt]:
        """Statements with their pair loops shared and unrolled."""
        done: list[ast.stmt] = []
        for statement in statements:
            if isinstance(statement, ast.For) and _target(statement) == "j":
                done += self.pairs(statement)
            elif isinstance(statement, ast.Expr) and self.context.shape.per_agent > 1:  # one call for all its threads
                alone = ast.If(ast.parse("sub == 0", mode="eval").body, [statement], [])
                done += [*parse_lines("cuda.syncthreads()"), alone, *parse_lines("cuda.syncthreads()")]
            elif isinstance(statement, ast.If) and _by_law(statement):
                statement.body = self.walk(statement.body)
                done.append(statement)
            else:
                done.append(statement)
        return done

    def pairs(self, loop: ast.For) -> list[ast.stmt]:
        """One pair loop: each thread of an agent takes every so-manieth partner, then all add up."""
        context, shape = self.context, self.context.shape
        totals = carried_totals(loop.body)
        body = [OtherRows(context).visit(s) for s in loop.body]
        after = parse_lines(f"{t} = group_{how}({t}, tid)" for t, how in totals.items()) if shape.per_agent > 1 else []
        if not shape.registers:
            loop.iter = ast.parse("range(sub, n, PER_AGENT)", mode="eval").body
            loop.body = body
            return [loop, *after]
        text = "\n".join(ast.unparse(ast.fix_missing_locations(s)) for s in body)
        if context.cells:
            depth, around = "", []
            for line in context.cells:
                around.append(depth + line)
                depth += "    " if line.startswith("for ") else ""
            inner = ["j = starts[line + first]", "stop = starts[line + last]", "while j < stop:"]
            inner += [*(f"    {line}" for line in _by_fours(text)), "    j = np.uint32(j + np.uint32(1))"]
            return parse_lines([*around, *(f"{depth}{line}" for line in inner)])
        step = "j = np.uint32(j + np.uint32(PER_AGENT))"
        # Unrolled by hand: two pairs a turn hide the wait for the shared table, four cost registers
        # and were slower.
        turns = max(1, min(UNROLL, shape.lanes // shape.per_agent))
        once = [f"    {line}" for line in [*text.splitlines(), step]]
        loops = ["j = np.uint32(sub)", "while j < np.uint32(n):", *(once * turns)]
        if context.exact and turns > 1:
            ahead = (turns - 1) * shape.per_agent
            loops[1] = f"while np.uint32(j + np.uint32({ahead})) < np.uint32(n):"
            loops += ["while j < np.uint32(n):", *once]
        return [*parse_lines(loops), *after]


def _by_fours(text: str) -> list[str]:
    """Lines that read the columns of a candidate four at a time."""
    read = set(re.findall(r"sorted_\[j, (\d)\]", text))
    if not read:
        raise ReplacementError(f"nothing is read of a candidate in:\n{text}")
    first = [
        f"{', '.join(f'near_{c}' for c in columns)} = {load}(sorted_, j)"
        for load, columns in (("four_low", "0123"), ("four_high", "4567"))
        if read & set(columns)
    ]
    return [*first, *re.sub(r"sorted_\[j, (\d)\]", r"near_\1", text).splitlines()]


def carried_totals(body: list[ast.stmt]) -> dict[str, str]:
    """Scalars that a loop carries from turn to turn, and how: sum, min or max."""
    found: dict[str, str] = {}
    stored: set[str] = set()
    # A scalar is carried if its first use in the loop adds to itself; one that is assigned before
    # belongs to the turn.
    for statement in body:
        if isinstance(statement, ast.AugAssign) and isinstance(statement.target, ast.Name):
            if statement.target.id not in stored:
                found[statement.target.id] = "sum"
        elif isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            name, value = statement.targets[0].id, statement.value
            call = value.func.id if isinstance(value, ast.Call) and isinstance(value.func, ast.Name) else ""
            itself = call in ("least", "most") and isinstance(value.args[0], ast.Name) and value.args[0].id == name  # type: ignore[attr-defined]
            if itself and name not in stored:
                found[name] = "min" if call == "least" else "max"
            elif not itself:
                stored.add(name)
    return found


def _over_agents(statement: ast.stmt) -> ast.For | None:
    """The statement, if it is a loop over all agents."""
    return statement if isinstance(statement, ast.For) and _target(statement) == "i" else None


def _of_one_thread(statement: ast.stmt) -> bool:
    """Return True if only the first thread runs a statement, so that no barrier may stand in it."""
    return isinstance(statement, ast.If) and ast.unparse(statement.test) == "tid == 0"


def _by_law(statement: ast.If) -> bool:
    """Return True if only the agents of one law run a statement: one thread serves each of them."""
    return ast.unparse(statement.test).startswith("law[i] == ")


def _target(loop: ast.For) -> str:
    return loop.target.id if isinstance(loop.target, ast.Name) else ""


def used_names(statements: list[ast.stmt]) -> tuple[set[str], set[str]]:
    """Names that statements read, those among them that they add to, and names that they write."""
    sums = [item.target for s in statements for item in walk_tree(s) if isinstance(item, ast.AugAssign)]
    return read_names(statements) | written_names(sums), written_names(statements)


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
            # Set before the form is made: a rule that calls itself would otherwise never end.
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
        """Return True if a rule is nothing but a root; its second form is the reciprocal."""
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
    """Rewrites x = sqrt(s) as per_x = 1 / sqrt(s), x = s · per_x, for these names; s is never zero."""

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
    # A name that is a root in one place and something else in another is left alone: its reciprocal
    # was stale once.
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
    """Return the argument of the root if a rule is nothing but a root, else None."""
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
