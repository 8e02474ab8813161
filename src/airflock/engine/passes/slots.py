"""Slots: the agents of a large flock lie in memory beside those they meet, and are put there again from time to time.

Slot i holds agent `order[i]`; loops over agents run over slots, and whatever depends on who an agent is (its random
numbers, its place in a recording) asks `order`. Agents are numbered without regard to where they fly: by number, the
sort into cells and the sums on their way back go at random over all memory, and a large flock costs more per agent than
a small one. Of the numbers of an agent none depends on its slot; sums over the flock are taken in the order of slots.
"""

from airflock.engine.passes.build import Builder, loop_lines
from airflock.engine.passes.flock import flock_rules
from airflock.engine.passes.grid import bind_lines
from airflock.engine.plan import Plan
from airflock.engine.stages.cells import CHUNKS


def uses_slots(plan: Plan) -> bool:
    """Whether agents have slots: where they are sorted, and where some may be absent, who lie behind the others."""
    return plan.absence or sorts_by_cells(plan)


def sorts_by_cells(plan: Plan) -> bool:
    """Whether agents are put beside those they meet: not where rules of the whole flock know them by number."""
    return plan.grid and not plan.sequential and not flock_rules(plan)


def add_rearrange(build: Builder) -> None:
    """Function rearrange: moves all agents to where they were just sorted to; sums lend their memory meanwhile."""
    rows = ["lane = table[c]", *_spread("kept[i] = lane[whose[i]]"), *_spread("lane[i] = kept[i]")]
    build.function(
        "put(n, table, kept, whose)", loop_lines("c in range(table.shape[0])", rows), "return 0", parallel=True
    )
    each = [f"put(n, {table}, kept, whose)" for table in ("work", "mem", "memory")]  # one function, compiled once
    build.function(
        "rearrange(n, work, mem, memory, cells)", [*bind_lines(build), "kept = totals_[:n]", *each], "return 0"
    )


def _spread(line: str) -> list[str]:
    """A loop over all slots, in parts side by side."""
    part = loop_lines(f"i in range(n * part // {CHUNKS}, n * (part + 1) // {CHUNKS})", [line])
    return loop_lines(f"part in prange({CHUNKS})", part)
