"""Builder for a GPU: collects the stages that the passes write and turns each into a device function of one thread."""

import ast
import builtins
import re
from collections.abc import Iterable
from dataclasses import dataclass
from textwrap import indent
from typing import Any

from airflock.core import Metric
from airflock.engine.cuda.block_layout import BlockLayout
from airflock.engine.cuda.lowering import (
    LoweringContext,
    SecondForms,
    lower_statements,
    parse_lines,
    reciprocal_name,
    used_names,
    with_reciprocals,
)
from airflock.engine.passes.build import JIT_DECORATOR, Builder, branch_lines, inline_lines, loop_lines
from airflock.engine.plan import Plan, field_names
from airflock.engine.primitives import DECLARED, NARROW
from airflock.engine.replace import checked_replace
from airflock.engine.specialise.known_values import LocalVector, driver_argument
from airflock.engine.specialise.specialiser import specialise
from airflock.engine.stages.clusters import call_member, mean_from_sums
from airflock.engine.stages.measure import add_terms, clear_totals, record_of_totals, reductions
from airflock.engine.stages.records import FlightView
from airflock.engine.stages.words import (
    HALF,
    REDUCTION_START,
    ZERO,
    call_rule,
    components,
    real,
    reduce_term,
    totals,
    vector,
)
from airflock.engine.text.rewrite import law_suffix
from airflock.world import nearest_image

# Clusters: all agents of a block check at once whether they are linked to the growing cluster.
# A cluster grows from its first agent, one hop per round, until a round adds none. Where states lie in registers each
# thread keeps the links of its agent as bits, so that a round reads a few words; else a round looks at all pairs.

VALID = "np.uint32(FULL) if n >= 32 * part + 32 else (np.uint32((1 << max(n - 32 * part, 0)) - 1))"


def cluster_lines(build: Builder, metric: Metric) -> list[str]:
    """Lines that sum the cluster rule of one metric over all clusters."""
    registers = build.shape.registers  # type: ignore[attr-defined]
    build.bind_rows(["mine", "earlier", "joins"])
    totals_of = {"total": LocalVector("u", "totals"), "record": metric.Cluster}
    lines = specialise(build, clear_totals, metric=metric, **totals_of).lines
    lines += loop_lines("i in range(n)", ["mine[i] = ZERO; earlier[i] = ZERO; joins[i] = ZERO"])
    lines += _links(build, metric) if registers else []
    grow = _grow_by_masks() if registers else _grow_by_pairs(build, metric)
    made = specialise(
        build,
        grown,
        mine=driver_argument("mine"),
        size=driver_argument("size"),
        mean=driver_argument("mean"),
        metric=metric,
    )
    body = [*grow, *made.lines, f"t = {made.answer}"]
    body += specialise(build, add_terms, t=driver_argument("t"), metric=metric, **totals_of).lines
    body += loop_lines("i in range(n)", ["earlier[i] = most(earlier[i], mine[i])"])
    body += ["done += size", "cuda.syncthreads()"]
    lines += ["done = integer(0)", "while done < n:", *[f"    {line}" for line in body]]
    return [*lines, f"clusters = {specialise(build, record_of_totals, **totals_of).answer}", "return clusters"]


def _offset(build: Builder, other: str) -> list[str]:
    """Squared distance of agent i to another, by its text."""
    axes, nearest = build.plan.axes, build.source.name(nearest_image) if build.plan.periodic else ""
    lines = [f"d_{a} = {other.format(a=a, c=c)} - own_{a}" for c, a in enumerate(axes)]
    lines += [f"d_{a} = {nearest}(d_{a}, w.half_{a})" for a in axes if nearest]
    return [*lines, f"r2 = {' + '.join(f'd_{a} * d_{a}' for a in axes)} + TINY"]


def _linked(build: Builder, metric: Metric) -> tuple[list[str], str]:
    root = ["r = math.sqrt(r2)"] if build.rule_asks(metric.linked, "linked", "r") else []
    return root, build.call(metric.linked, "linked", {}, metric.name)  # type: ignore[arg-type]


def _links(build: Builder, metric: Metric) -> list[str]:
    """Links of the own agent as bits, word by word; the threads of an agent share the words."""
    root, link = _linked(build, metric)
    eight = []
    for bit in range(8):
        eight += [*_offset(build, "truth[other, {c}]"), *root]
        eight += [f"eight = np.uint32(eight | (np.uint32({1 << bit}) if {link} else np.uint32(0)))"]
        eight += ["other = np.uint32(other + np.uint32(1))"]
    word = ["bits = np.uint32(0); other = np.uint32(32 * part)"]
    word += loop_lines(
        "e in range(4)", ["eight = np.uint32(0)", *eight, "bits = np.uint32(bits | (eight << np.uint32(8 * e)))"]
    )
    word += [f"links_[part] = np.uint32(bits & ({VALID}))"]
    lines = [f"own_{a} = {a}_i" for a in build.plan.axes] + loop_lines("part in range(sub, WORDS, PER_AGENT)", word)
    return [
        *lines,
        *loop_lines("part in range(tid, WORDS, THREADS)", ["seen[part] = np.uint32(0)"]),
        "cuda.syncthreads()",
    ]


def _grow_by_masks() -> list[str]:
    """One cluster, from the first agent that no earlier one holds."""
    # A round is a bitwise and of the own links with the members found so far: 32 agents in one
    # instruction.
    find = [f"left = np.uint32(~seen[part] & ({VALID}))"]
    find += branch_lines("(first < 0) and (left != np.uint32(0))", ["first = integer(32 * part + cuda.ffs(left) - 1)"])
    put = ["grown[part] = np.uint32(1) << np.uint32(first & 31) if part == (first >> 5) else np.uint32(0)"]
    touch = ["touched = np.uint32(0)"]
    touch += loop_lines(
        "part in range(sub, WORDS, PER_AGENT)", ["touched = np.uint32(touched | (links_[part] & grown[part]))"]
    )
    touch += ["hit = integer(1) if touched != np.uint32(0) else integer(0)"]
    growth = ["hit = integer(0)", *branch_lines("(i < n) and (mine_i + earlier_i < HALF)", touch)]
    growth += ["hit = integer(group_max(hit, tid))"]
    growth += ["fresh = integer(cuda.syncthreads_count(hit if sub == 0 else integer(0)))"]
    join = [
        "mine_i = ONE",
        *branch_lines("sub == 0", ["cuda.atomic.or_(grown, i >> 5, np.uint32(1) << np.uint32(i & 31))"]),
    ]
    growth += [*branch_lines("hit != 0", join), "size = integer(size + fresh)", "cuda.syncthreads()"]
    growth += ["growing = (fresh > 0) and (done + size < n)"]
    return [
        "first = integer(-1)", *loop_lines("part in range(WORDS)", find), "mine_i = ONE if i == first else ZERO",
        *loop_lines("part in range(tid, WORDS, THREADS)", put), "size = integer(1); growing = done + size < n",
        "cuda.syncthreads()", *["while growing:", *[f"    {line}" for line in growth]],
        *loop_lines("part in range(tid, WORDS, THREADS)", ["seen[part] = np.uint32(seen[part] | grown[part])"]),
    ]  # fmt: skip


def _grow_by_pairs(build: Builder, metric: Metric) -> list[str]:
    """Lines that grow one cluster by all pairs of rows of the table."""
    axes = build.plan.axes
    root, link = _linked(build, metric)
    pair = [*_offset(build, "{a}[j]"), *root, f"hit = most(hit, (ONE if {link} & (mine[j] > HALF) else ZERO))"]
    meet = [f"own_{a} = {a}[i]" for a in axes] + ["hit = ZERO", *loop_lines("j in range(m)", pair)]
    meet += ["joins[i] = hit if mine[i] + earlier[i] < HALF else ZERO", "fresh += joins[i]"]
    growth = ["fresh = ZERO", *loop_lines("i in range(n)", meet), "size = integer(size + integer(fresh))"]
    growth += loop_lines("i in range(n)", ["mine[i] = most(mine[i], joins[i])"])
    growth += ["cuda.syncthreads()", "growing = (fresh > HALF) and (done + size < n)"]
    return [
        "first = FAR",
        *loop_lines("i in range(n)", ["first = least(first, (real(i) if earlier[i] < HALF else FAR))"]),
        "size = integer(1); growing = done + size < n and first < FAR",
        *loop_lines("i in range(n)", ["mine[i] = ONE if real(i) == first else ZERO"]),
        "cuda.syncthreads()",
        *["while growing:", *[f"    {line}" for line in growth]],
    ]


def grown(mine: Any, size: Any, mean: Any, flight: FlightView, n: int, *, metric: Metric) -> Any:
    """Call the cluster rule for the agents that `mine` marks with 1; mean : over the flock."""
    plan, flock, axes, h = flight.plan, flight.flock, range(flight.plan.dimensions), flight.flock.heading
    s, cx, cv, ch = vector(), vector(), vector(), vector()
    for a in axes:
        s[a] = ZERO
    hh = ZERO
    # Each thread adds its own agent, times one or zero; the lowering reduces the sums over the
    # block.
    for i in range(n):
        for a in axes:
            s[a] = s[a] + mine[i] * h[a][i]
        hh += mine[i] * sum(h[a][i] * h[a][i] for a in axes)
    if metric.member is not None:
        for total in (cx, cv, ch):
            for a in axes:
                total[a] = ZERO
        for i in range(n):
            for total, row in ((cx, flock.position), (cv, flock.velocity), (ch, h)):
                for a in axes:
                    total[a] = total[a] + mine[i] * row[a][i]
    own_mean = mean_from_sums(size, cx, cv, ch, mean, plan=plan, metric=metric)
    k = totals()
    if metric.member is not None:
        clear_totals(k, metric.Member, metric)
        for i in range(n):
            t = call_member(i, own_mean, flight, metric=metric)
            for c, way in enumerate(reductions(metric.Member, metric)):
                k[c] = reduce_term(way, k[c], t[c] if mine[i] > HALF else REDUCTION_START[way])
    members = record_of_totals(metric.Member, k) if metric.member is not None else None
    return call_rule(
        metric.cluster, n=real(size), **components("h", s), hh=hh, members=members, mean=own_mean,
        q=flight.numbers.q,
    )  # fmt: skip


# The primitives are text of the driver: the arithmetic of `core.random`, and sums over the threads of a block.
# Integers are those of every other engine, bit by bit. Logarithm, sine and cosine are the hardware's in single
# precision and agree to rounding. The simulator's forms of the sums go through shared memory: it has no shuffles.
HEAD = (
    """\"\"\"Generated by airflock from the rules of {label}; do not edit.\"\"\"
import math
from collections import namedtuple

import numpy as np
from numba import cuda{library}

real = np.float{bits}
integer = np.int32
LANES = {lanes}
PER_AGENT = {per_agent}
THREADS = {threads}
WARPS = {warps}
WORDS = {words}
FULL = 0xFFFFFFFF
JIT = dict()
INLINE = dict()
INNER = dict()
"""
    + DECLARED
    + """


def njit(fastmath=True, **options):
    return {njit}


@njit()
def least(a, b):
    return min(a, b)


@njit()
def most(a, b):
    return max(a, b)


@njit()
def choose(test, a, b):
    return a if test else b


@njit()
def inverse_root(a):
    return {root}


@njit(fastmath=False)
def add_exactly(total, lost, value):
    # Kahan's sum, without fastmath: the sums of a flight lose nothing to single precision
    y = value - lost
    t = total + y
    return t, (t - total) - y
"""
)

NORMAL = """
@njit()
def normal_pair(a, b):
    radius = math.sqrt(max(real(-2.0) * math.log(uniform(a)), real(0.0)))
    g = real(np.int32(u32(b) << u32(2))) * real(0.7853981633974483 / 2147483648.0)
    s = math.sin(g); c = math.cos(g)
    radius = -radius if (b & u32(0x80000000)) != u32(0) else radius
    swap = (b & u32(0x40000000)) != u32(0)
    return radius * (s if swap else c), radius * (c if swap else s)
"""

SHUFFLED = """
@njit()
def {scope}_{how}(value, tid):
    {steps}
    return value
"""
SIMULATED_WARP = """
@njit()
def warp_{how}(value, tid):
    return value
"""
SIMULATED_GROUP = """
@njit()
def group_{how}(value, tid):
    exchange = cuda.shared.array(THREADS, real)
    exchange[tid] = value
    cuda.syncthreads()
    first = tid - tid % PER_AGENT
    total = exchange[first]
    for q in range(1, PER_AGENT):
        total = {combined}
    cuda.syncthreads()
    return total
"""
LANE = """
@njit()
def from_thread(value, q, tid):
    return cuda.shfl_sync(FULL, value, ((tid & 31) // PER_AGENT) * PER_AGENT + q)
"""
SIMULATED_LANE = """
@njit()
def from_thread(value, q, tid):
    exchange = cuda.shared.array(THREADS, real)
    exchange[tid] = value
    cuda.syncthreads()
    found = exchange[tid - tid % PER_AGENT + q]
    cuda.syncthreads()
    return found
"""
TWO = {"sum": "{a} + {b}", "min": "min({a}, {b})", "max": "max({a}, {b})"}


def primitives_text(label: str, bits: int, shape: BlockLayout) -> str:
    """Text of constants and primitives."""
    text = HEAD.format(
        label=label, bits=bits, lanes=shape.lanes, per_agent=shape.per_agent, threads=shape.threads,
        warps=shape.warps, words=shape.words,
        root="libdevice.rsqrtf(a)" if bits == 32 and not shape.simulated else "ONE / math.sqrt(a)",
        library="" if shape.simulated else "\nfrom numba.cuda import libdevice",
        njit="lambda function: function" if shape.simulated else "cuda.jit(device=True, fastmath=fastmath)",
    )  # fmt: skip
    parts = [text, NARROW, NORMAL, SIMULATED_LANE if shape.simulated else LANE]
    for how, form in TWO.items():
        if shape.simulated:
            parts += [SIMULATED_WARP.format(how=how)]
            parts += [SIMULATED_GROUP.format(how=how, combined=form.format(a="total", b="exchange[first + q]"))]
        else:
            parts += [_shuffled("warp", how, form, 32), _shuffled("group", how, form, shape.per_agent)]
    return "".join(parts)


def _shuffled(scope: str, how: str, form: str, width: int) -> str:
    """Butterfly over `width` neighbouring threads: all of them end with the same bits."""
    steps, distance = [], width // 2
    while distance:
        steps += [f"value = {form.format(a='value', b=f'cuda.shfl_xor_sync(FULL, value, {distance})')}"]
        distance //= 2
    return SHUFFLED.format(scope=scope, how=how, steps="\n    ".join(steps) or "pass")


STAGES = (
    "snapshot", "perceive", "tune", "neighbours", "boundaries", "flock", "decide", "stop", "overrule", "move", "aim_",
    "glide_", "appear_", "measure_", "first_command", "queue", "obey",
)  # fmt: skip
# Stages that a kernel has within others: in `move`, so that registers carry them over; in
# `neighbours`, whose rows of one agent they read and write.
WITHIN = {"noise": "move", "gusts": "move", "meet": "neighbours"}
PAIR_ROWS = ("away0", "away1", "away2", "square", "hidden", "fade", "met", "heap", "weak")  # rows over the others
MAX_TOTALS = 24  # totals that one stage reduces at once, at most


@dataclass(frozen=True)
class DeviceStage:
    """One stage as a device function.

    arguments : names that it takes from the kernel; registers among them
    results   : registers and values that it returns
    """

    name: str
    arguments: tuple[str, ...]
    results: tuple[str, ...]

    def call(self, **renamed: str) -> str:
        """Statement that calls it; `given` renames what the kernel calls otherwise."""
        call = f"{self.name}({', '.join(renamed.get(name, name) for name in self.arguments)})"
        return f"{', '.join(self.results)} = {call}" if self.results else call


class CudaBuilder(Builder):
    """Takes the same calls as the builder of a CPU driver; `function` lowers what is a stage."""

    pairs_two_agents = False
    drops_unread_sums = False  # threads exchange their parts, which counts as being read
    apart = False
    ranges = False
    draws_per_pair = True
    can_use_drift = False
    puts_rare_rows_last = False

    def __init__(self, plan: Plan, shape: BlockLayout):
        super().__init__(plan.built(grid=False))
        self.shape = shape
        self.stages: dict[str, DeviceStage] = {}
        self.letters: set[str] = set()
        self.bound: set[str] = set()
        self.names: set[str] = set()  # of every row, also of those that share another's
        self.across: dict[str, int] = {}
        self.within: dict[str, tuple[list[str], set[str], set[str]]] = {}
        self.forms = SecondForms(self.source.blocks, JIT_DECORATOR)
        self.reciprocals: dict[tuple[str, str], None] = {}  # of numbers, that the kernel takes once
        self.slots = plan.absence
        self.order()
        self.head = primitives_text(plan.model.name, plan.bits, shape)
        self.plain = {node.name for node in parse_lines(self.head) if isinstance(node, ast.FunctionDef)} | {
            "four_low",
            "four_high",
        }

    def bind_rows(self, names: Iterable[str]) -> list[str]:
        """Rows are registers, or bound by the stage."""
        for name in names:
            if name in PAIR_ROWS:
                self.across.setdefault(name, len(self.across))
                continue
            self.row(name)
            self.bound.add(name)
            self.names.add(name)
        return []

    def order(self) -> list[str]:
        """Numbers of agents are one more row, where those who are absent lie behind the others."""
        return self.bind_rows(["order"]) if self.slots else []

    def records(self, letters: str) -> list[str]:
        """Records of numbers are read once, by the kernel."""
        self.letters |= set(letters.split())
        super().records(letters)  # declares the kinds
        return []

    def whole(self, *names: str) -> list[str]:
        """Integers of this world are read once, by the kernel."""
        return []

    @property
    def is_sequential(self) -> bool:
        """Never: a kernel takes one agent after another by its own loop."""
        return False

    def stage(
        self, name: str, arguments: str, lines: list[str], body: list[str], answer: str = "0", apart: bool = False
    ) -> None:
        """One stage of a step."""
        self.function(f"{name}({arguments})", lines, body, f"return {answer}")

    def function(self, head: str, *bodies: Iterable[str] | str, parallel: bool = False, once: bool = False) -> None:
        """Add a device function: a stage lowered to one thread, any other function as it is."""
        name = head.partition("(")[0]
        lines: list[str] = []
        for body in bodies:
            lines += [body] if isinstance(body, str) else list(body)
        if name in WITHIN:
            self.within[name] = lines, set(self.letters), set(self.bound)
        elif name.startswith(STAGES):
            self._stage(name, lines)
            self.letters, self.bound = set(), set()
        else:
            self.plain.add(name)
            self.functions.append(f"{JIT_DECORATOR}\ndef {head}:\n" + indent("\n".join(lines), "    "))

    def once(self, lines: Iterable[str]) -> list[str]:
        """Lines that one thread of the block runs."""
        return ["cuda.syncthreads()", *branch_lines("tid == 0", lines), "cuda.syncthreads()"]

    def clusters(self, metric: Metric) -> list[str]:
        """Clusters are found by all threads of a block together."""
        return cluster_lines(self, metric)

    def module_names(self) -> set[str]:
        """Names of the driver module."""
        constants = {
            t.id for s in parse_lines(self.head) if isinstance(s, ast.Assign) for t in s.targets if hasattr(t, "id")
        }
        here = self.source.names() | self.forms.names | self.plain | {stage.name for stage in self.stages.values()}
        return constants | here | set(dir(builtins)) | {"math", "np", "cuda"}

    def same(self, name: str) -> str:
        """The name under which a row is kept: unperturbed perception shares the rows of the truth."""
        number = self.row(name)
        return next(known for known, other in self.rows.items() if other == number)

    def columns(self) -> dict[str, tuple[str, int]]:
        """Shared tables: `truth`, what agents are, and `said`, what the others hear; by row."""
        plan = self.plan
        found = {a: ("truth", c) for c, a in enumerate(plan.axes)}
        table = "said" if plan.late or plan.suffers("sense", "tell") else "truth"
        found |= {f"h{name}": (table, c) for c, name in enumerate(plan.motion)}
        more = ["group"] * plan.uses_groups + ["order"] * plan.absence
        first = 1 + max(c for table, c in found.values() if table == "truth")
        found |= {name: ("truth", first + c) for c, name in enumerate(more)}
        clocks = ["clock", *["sent_clock"] * plan.late]
        tuned = ["reach_out", "reach_in"] * bool(plan.suffers("radio")) + clocks * bool(plan.suffers("clock"))
        return found | {name: ("tuned", c) for c, name in enumerate(tuned)}

    def kind(self, letter: str, fields: tuple[str, ...]) -> str:
        """Name of the record of numbers behind a letter; a kernel reads those of all laws."""
        law = letter.removeprefix("p")
        if letter != "p" and law.isdigit():
            return self.source.record(f"PP{law_suffix(int(law))}", field_names(fields))
        return super().kind(letter, fields)

    def named(self, letter: str) -> str:
        """Name of a record of numbers in the kernel; each law of the flock has its own p."""
        return f"row_p{self.plan.law}" if letter == "p" and self.plan.law else f"row_{letter}"

    def cells(self) -> tuple[str, ...]:
        """Lines around a pair loop that runs over cells; none where it runs over all pairs."""
        return ()

    def prepare_stage(self, name: str, lines: list[str]) -> list[str]:
        """Text of a stage before it is lowered."""
        if name in ("snapshot", "first_command", "queue", "obey") or (name == "perceive" and self.plan.late):
            return checked_replace(lines, "ring[", "past[")
        if name.startswith("measure_") and any("j in range(m)" in line for line in lines):
            return checked_replace(lines, " & (integer(j) < nn)", "")  # its pair loops end with the last agent
        shared = self.shape.registers and self.shape.per_agent > 1
        return shared_noise(lines) if self.draws_two_steps(name) and shared else lines

    def draws_two_steps(self, name: str) -> bool:
        """Return True if a stage draws the outer noise of two steps at once: in a plane four words are two steps."""
        plan = self.plan
        return name == "move" and plan.dimensions == 2 and self.rule_asks(plan.body.move, "move", "gx", "gy", "gz")

    def _stage(self, name: str, lines: list[str]) -> None:
        of_all = name.removesuffix(self.mark)  # each law has such a stage
        lines = self._with_parts(of_all, lines)
        rows = self.names | {"u0", "u1", "u2", "u3"}
        statements = parse_lines(self.prepare_stage(name, lines))
        turn = self.plan.sequential and of_all in ("neighbours", "boundaries", "decide", "move")
        context = LoweringContext(self.shape, rows, self.columns(), turn=turn, carried=name == "move")
        context.cells, context.across = self.cells(), self.across
        context.exact = name.startswith("measure_") or bool(
            self.across
        )  # no row says which agents one beyond the last met
        context.alone = name == "appear_" or (name == "aim_" and self.plan.is_shepherd)
        body = lower_statements(statements, context)
        body = [_Renamed(self).visit(s) for s in body]
        body, numbers = with_reciprocals(self.forms, body, {self.named(letter) for letter in self.plan.records})
        self.source.blocks += self.forms.made
        self.forms.made.clear()
        if name == "move":  # which runs at every step: the kernel takes the reciprocals once
            self.reciprocals |= dict.fromkeys(numbers)
        else:
            body = [*parse_lines(reciprocal_lines(numbers)), *body]
        self._add(name, body, context.rows)

    def _with_parts(self, stage: str, lines: list[str]) -> list[str]:
        """Lines of a stage with those that it holds in place of their calls, such as the noise in `move`."""
        for name, (part, letters, bound) in self.within.items():
            if WITHIN[name] == stage:
                lines = inline_lines([line for text in lines for line in text.splitlines()], name, part)
                self.letters, self.bound = self.letters | letters, self.bound | bound
        return lines

    def _add(self, name: str, body: list[ast.stmt], rows: set[str]) -> None:
        """The device function of lowered statements."""
        last = body[-1] if body else None
        results = []
        if isinstance(last, ast.Return):
            body.pop()
            if last.value is not None and not isinstance(last.value, ast.Constant):
                body += parse_lines(f"answer = {ast.unparse(last.value)}")
                results = ["answer"]
        read, stored = used_names(body)
        registers = {
            r for r in read | stored if r.endswith("_i") and (r[:-2] in rows or re.match(r"(mem|kept)\d+_i", r))
        }
        values = sorted((s for s in stored if re.fullmatch(r"value\d+", s)), key=lambda s: int(s[5:]))
        results = [*sorted(registers & stored), *values, *results]
        free = (read - stored - self.module_names()) | registers
        tables = [] if self.shape.registers else sorted(self.bound_rows(read))
        lines = [f"{row} = work[{self.row(row)}]" for row in tables]
        free = (free - set(tables)) | ({"work"} if tables else set())
        order = tuple(sorted(free))
        text = [*lines, *(line for s in body for line in ast.unparse(s).splitlines())]
        # Threads of the last stage may still read the table of parts that this one writes.
        if "reduced" in read:
            text = ["cuda.syncthreads()", *text]
        if results:
            text += [f"return {', '.join(results)}"]
        self.functions.append(
            f"{JIT_DECORATOR}\ndef {name}({', '.join(order)}):\n" + indent("\n".join(text or ["pass"]), "    ")
        )
        self.stages[name] = DeviceStage(name, order, tuple(results))

    def bound_rows(self, read: set[str]) -> set[str]:
        """Rows of the table that a stage takes by name."""
        return {name for name in read if name in self.bound or (name == "order" and self.slots)}


def shared_noise(lines: list[str]) -> list[str]:
    """The threads of an agent draw the noise of different steps, and hand it round when its step comes (in a plane)."""
    lines = checked_replace(lines, "if step % 2 == 0:", "if step % (2 * PER_AGENT) == 0:")
    lines = checked_replace(lines, " step // 2,", " step // 2 + sub,")
    for number in (2, 3):
        (line,) = (line for line in lines if line.endswith(f" if step % 2 == 0 else g{number}"))
        name = line.partition(" = ")[0]
        handed = f"{line}\n{name}[i] = from_thread({name}[i], (step // 2) % PER_AGENT, tid)"
        lines = checked_replace(lines, line, handed)
    return lines


def reciprocal_lines(numbers: Iterable[tuple[str, str]]) -> list[str]:
    """Lines that take the reciprocals of numbers (record, field)."""
    return [f"{reciprocal_name(f'{record}.{field}')} = ONE / {record}.{field}" for record, field in numbers]


class _Renamed(ast.NodeTransformer):
    """Records under the kernel's names (p → row_p), rows that share another's under its name."""

    def __init__(self, build: CudaBuilder):
        self.build = build
        self.letters = set(build.letters)

    def visit_Name(self, node: ast.Name) -> ast.expr:
        if node.id in self.letters:
            node.id = self.build.named(node.id)
        elif node.id.endswith("_i") and node.id[:-2] in self.build.names:
            node.id = f"{self.build.same(node.id[:-2])}_i"
        return node
