"""Cell grid: memory and functions of a flock that finds neighbours by cells; for many agents that see a short way.

Data that lie at random in memory (the agents of a cell, their sums) are kept in rows of one agent,
so that they cost one cache line and not one per number; slots keep them from lying far apart. What
stages keep for each other lies in memory that lasts for a flight. Where groups have laws of their
own, each law sorts the flock again, into cells of its own reach, and goes through its own agents.
Only for perception without noise, delay and loss; there it equals all pairs but for rounding and
the order of sums.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.passes.build import Builder, loop_lines
from airflock.engine.passes.flock import flock_rules
from airflock.engine.plan import Plan
from airflock.engine.specialise.known_values import StageCall, StageFunction, driver_argument
from airflock.engine.specialise.specialiser import specialise
from airflock.engine.stages import cells
from airflock.engine.stages.cells import CHUNKS, MAX_CELLS_PER_AGENT, SPARE
from airflock.engine.stages.neighbours import widest_reach
from airflock.engine.stages.neighbours_by_cells import neighbours_by_cells
from airflock.engine.stages.words import BLOCK

SORT = StageFunction("sort", ("n", "near", "most_cells", "row", "work", "cells"))
KEPT = "starts, tally, cell_of, ident, packed, flat, totals_"


def grid_memory(
    plan: Plan, agents: int, rows: Callable[[tuple[int, ...], Any], Any]
) -> tuple[tuple[NDArray[Any], ...], ...]:
    """Make the memory of the grid for n agents, as one argument or none; `rows` makes zeros on cache lines.

    starts : first place of each cell; tally : agents by chunk and cell, in one row; cell_of : of
             each agent
    packed : (place, component) states and, as an integer, the slot; flat : (component, place)
             states; ident : agents
    Between two sorts, `tally` and `ident` are scratch of the search for links by cells.
    """
    if not plan.grid:
        return ()
    real, whole = (np.float32, np.int32) if plan.bits == 32 else (np.float64, np.int64)
    components, most = 2 * plan.dimensions, MAX_CELLS_PER_AGENT * agents + SPARE
    fields = max(len(getattr(own.model.Sums, "_fields", ())) for own in plan.every)
    shapes = (
        ((most + 1,), np.int64), ((CHUNKS * most,), np.int32), ((agents,), np.int32),
        ((agents,), whole), ((agents, _width(plan)), real), ((components, agents + BLOCK), real),
        ((agents * max(1, fields),), real),
    )  # fmt: skip
    # Allocated once per flight: the system zeroes the pages of what is given back before they are
    # used again, and at every step that was part of the 203 ns of an agent-step.
    return (tuple(rows(shape, kind) for shape, kind in shapes),)


def _width(plan: Plan) -> int:
    """Numbers in the row of an agent, the last its slot: a power of two, so that none lies across two cache lines."""
    return 1 << (2 * plan.dimensions).bit_length()


def bind_lines(build: Builder) -> list[str]:
    """Lines that bind what lasts for a flight, and `whose`, the slot of the agent at each place."""
    return [f"{KEPT} = cells", f"whose = packed.view(np.int{build.plan.bits})[:, {_width(build.plan) - 1}]"]


def add_neighbours(build: Builder, sums: tuple[tuple[int, str], ...]) -> None:
    """Function `add_neighbours` over a grid; function `widest` where agents differ in how far they see."""
    called = f"widest{build.mark}(n, row, work)"
    made = specialise(
        build, neighbours_by_cells, decision=driver_argument("k_"), sort=SORT, widest=StageCall(called), sums=sums
    )  # fmt: skip
    if build.plan.varies("p"):
        wide = specialise(build, widest_reach)
        build.function(called, wide.lines, f"return {wide.answer}")
    add_sort(build)
    arguments = "k_, n, m, time, late, row, whole, work, store, words, cells"
    build.function(f"neighbours{build.mark}({arguments})", bind_lines(build), made.lines, "return 0", parallel=True)


def add_sort(build: Builder) -> None:
    """Function `add_sort`: sorts agents into about `most_cells` cells no smaller than `near` (m)."""
    if "sort" not in build.stages:
        called = "cells_of(n, near, most_cells, row, work)"
        made = specialise(build, cells.cell_box)
        build.function(called, made.lines, f"return {made.answer}")
        made = specialise(build, cells.sort_by_cells, boxed=StageCall(called))
        lines = [*bind_lines(build), *made.lines]
        build.function(f"sort({', '.join(SORT.parameters)})", lines, f"return {made.answer}", parallel=True)


def sort_lines(build: Builder, min_width: str, max_cells: str) -> list[str]:
    """Lines that sort agents into about `most` cells no smaller than `near` (m)."""
    add_sort(build)
    return [*bind_lines(build), f"sides, count = sort(n, {min_width}, {max_cells}, row, work, cells)"]


def uses_slots(plan: Plan) -> bool:
    """Return True if agents have slots: where they are sorted, or some may be absent and then lie behind the others."""
    return plan.absence or sorts_by_cells(plan)


def sorts_by_cells(plan: Plan) -> bool:
    """Return True if agents are sorted by cells: not where rules of the whole flock know them by number."""
    return plan.grid and not plan.sequential and not flock_rules(plan)


def add_rearrange(build: Builder) -> None:
    """Function rearrange: moves all agents to where they were just sorted to; sums lend their memory meanwhile."""
    # Agents numbered regardless of place make every sorted access random over tens of megabytes:
    # 199 -> 162 ns per agent-step at a million boids. Prefetching (172 ns) gains nothing once
    # agents have slots.
    rows = ["lane = table[c]", *_spread("kept[i] = lane[whose[i]]"), *_spread("lane[i] = kept[i]")]
    build.function(
        "put(n, table, kept, whose)", loop_lines("c in range(table.shape[0])", rows), "return 0", parallel=True
    )
    each = [f"put(n, {table}, kept, whose)" for table in ("work", "mem", "memory")]  # one function, compiled once
    if build.plan.lags:
        each += loop_lines("slot in range(past.shape[0])", ["put(n, past[slot], kept, whose)"])
    build.function(
        f"rearrange(n, work, {'past, ' * build.plan.lags}mem, memory, cells)",
        [*bind_lines(build), "kept = totals_[:n]", *each],
        "return 0",
    )


def _spread(line: str) -> list[str]:
    """A loop over all slots, in parts side by side."""
    part = loop_lines(f"i in range(n * part // {CHUNKS}, n * (part + 1) // {CHUNKS})", [line])
    return loop_lines(f"part in prange({CHUNKS})", part)
