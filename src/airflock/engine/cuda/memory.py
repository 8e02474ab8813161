"""Memory: how much of a GPU's memory the flocks of one launch need, and how many agents fit."""

from typing import Any

import numpy as np

from airflock.engine.cuda.build import PAIR_ROWS
from airflock.engine.cuda.shape import BlockLayout, block_layout
from airflock.engine.passes.build import sampled_columns
from airflock.engine.passes.flock import flock_rules, scratch_sizes
from airflock.engine.plan import Plan
from airflock.engine.tables import WorldTables
from airflock.scenarios import largest_fitting

MAX_MEMORY_SHARE = 0.9  # of the free memory that may be used


def layout_of(plan: Plan, agents: int, flocks: int, processors: int = 132) -> BlockLayout:
    """Layout of flocks of one plan and size."""
    whole, apart = bool(flock_rules(plan)), bool(plan.laws) or plan.topology is not None
    return block_layout(agents, flocks, processors, sequential=plan.sequential, whole_flock=whole, apart=apart)


def array_shapes(plan: Plan, rows: int, shape: BlockLayout, tables: WorldTables) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays that a launch works on, for one flock, by argument name; rows: of the table of states."""
    whole, dims, lanes = tables.integers, plan.dimensions, shape.lanes
    n, table = whole["agents"], not shape.registers
    model = max(len(getattr(memory, "_fields", ())) for memory in plan.memories)
    kept = sum(len(getattr(metric.Memory, "_fields", ())) for metric in plan.metrics)
    return {
        "starts": (2 * dims, n) if plan.given_start else (1, 1),
        "pasts": (whole["ring"], plan.in_ring, lanes) if plan.late else (1, 1, 1),
        "stores": (len(plan.of_pair), lanes, lanes) if plan.packets else (2 * dims + 1, 1, 1),
        "owns": (max(len(plan.columns), 1), lanes),
        "works": (rows, lanes) if table else (1, 1),
        "all_words": (4, lanes) if table else (1, 1),
        "all_mem": (max(model, 1), lanes) if table or plan.laws else (1, 1),
        "all_memory": (max(kept, 1), lanes) if table else (1, 1),
        "states": (2 * dims, n),
        "all_sums": (len(sampled_columns(plan.metrics)) + 2 + plan.absence, 2),
        "all_reached": (max(len(tables.goals), 1),),
        "all_frames": (whole["steps"] // whole["sample_every"] + 1, 3 * dims, n) if plan.record else (1, 1, 1),
        "scratches": scratch_of(plan, tables)[0],
        "all_across": (len(PAIR_ROWS), lanes, lanes) if plan.topology is not None else (1, 1, 1),
    }


def scratch_of(plan: Plan, tables: WorldTables) -> tuple[tuple[int, int], list[int]]:
    """One table that holds all scratch arrays of a flock below each other: its shape, and the first row of each."""
    found = scratch_sizes(plan, tables.row, tables.integers["agents"])
    first, width = [0], 1
    for height, breadth in (size for sizes in found for size in sizes):
        first.append(first[-1] + height)
        width = max(width, breadth)
    return (max(first[-1], 1), width), first


def needed_bytes(plan: Plan, rows: int, shape: BlockLayout, tables: WorldTables) -> int:
    """Bytes in the GPU's memory that one such flock needs, its share of the scene included."""
    numbers = sum(int(np.prod(size)) for size in array_shapes(plan, rows, shape, tables).values())
    given: list[Any] = [tables.row, tables.whole, tables.faces, tables.edges, tables.spans, tables.goals, tables.later]
    given += [tables.shapes] if len(tables.later) else []
    return numbers * plan.bits // 8 + sum(int(array.nbytes) for array in given) + 256


def lacking(plan: Plan, rows: int, tables: WorldTables, free: int) -> str | None:
    """Why one such flock does not fit into this many free bytes: what it needs and how many agents fit; or None."""
    agents, room = tables.integers["agents"], int(MAX_MEMORY_SHARE * free)

    def bytes_of(n: int) -> int:
        return needed_bytes(plan, rows, layout_of(plan, n, 1), tables.changed(agents=n))

    if bytes_of(agents) <= room:
        return None
    return memory_message(agents, bytes_of(agents), room, largest_fitting(agents, lambda n: bytes_of(n) <= room))


def memory_message(agents: int, bytes_: int, room: int, fitting_agents: int) -> str:
    """The one line about it."""
    return (
        f"a flock of {agents} agents needs {bytes_ / 1e9:.3g} GB of the GPU's memory and {room / 1e9:.3g} GB are free; "
        f"about {fitting_agents} agents fit"
    )
