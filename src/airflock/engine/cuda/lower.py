"""Lower: the text of a stage, written as loops over agents, as what one thread of a block does.

The passes of `engine.passes` are the only text of a stage. Here its syntax tree is changed:

* `for i in range(n)`: the thread's own agent where states lie in registers (row `x[i]` → register `x_i`), else every
  so-manieth agent. Totals that the loop carries (`a += ...`, `a = least(a, ...)`) are reduced over the block before
  they are next read.
* `for j in range(m)` within it: shared by the threads of one agent, unrolled; `x[j]` → the shared table.
* `mem[c, i]`, `memory[c, i]`, `values[c]`: registers.
"""

import ast
import re

from airflock.core import walk_tree
from airflock.engine.cuda.rows import (
    AgentNumbers,
    AllAgentsLoop,
    DropBindings,
    HalvesToShifts,
    LoweringContext,
    OtherRows,
    OwnRegisters,
    PairRows,
    parse_lines,
)
from airflock.engine.cuda.shape import UNROLL
from airflock.engine.replace import ReplacementError
from airflock.engine.specialise.dead import read_names, written_names
from airflock.engine.stages.words import REDUCTION_START

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
    """Whether only the first thread runs a statement, so that no barrier may stand in it."""
    return isinstance(statement, ast.If) and ast.unparse(statement.test) == "tid == 0"


def _by_law(statement: ast.If) -> bool:
    """Whether only the agents of one law run a statement: one thread serves each of them."""
    return ast.unparse(statement.test).startswith("law[i] == ")


def _target(loop: ast.For) -> str:
    return loop.target.id if isinstance(loop.target, ast.Name) else ""


def used_names(statements: list[ast.stmt]) -> tuple[set[str], set[str]]:
    """Names that statements read, those among them that they add to, and names that they write."""
    sums = [item.target for s in statements for item in walk_tree(s) if isinstance(item, ast.AugAssign)]
    return read_names(statements) | written_names(sums), written_names(statements)
