"""Individuals on a GPU: faults that begin on the way, and agents that drop out, between two steps of a kernel.

Who, when and how is drawn beforehand, as on a CPU (`scenarios.onsets`), and handed over as a table. Whoever leaves is
put behind the others (`engine.presence`): his neighbours by number move up by one, with all that they carry, and n is
one less. So no stage has a test for those who are absent.
"""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.cuda.build import CudaBuilder
from airflock.engine.cuda.start import agent_loop, own_row, table_widths
from airflock.engine.passes.build import branch_lines, loop_lines
from airflock.engine.passes.flock import flock_rules
from airflock.engine.plan import Plan
from airflock.engine.stages.state import fault_row
from airflock.engine.tables import WorldTables

STEP, KIND, AGENT, LEAVES = range(4)  # columns of the table of whole numbers; that of reals: how long, then numbers


def onset_tables(plan: Plan, jobs: Sequence[WorldTables], real: Any) -> dict[str, NDArray[Any]]:
    """Tables of what begins in each flock, by argument name; a step that never comes where there is no more."""
    kinds = {kind.name: number for number, kind in enumerate(plan.faults)}
    found = [[onset for onset in tables.due if onset.kind in kinds] for tables in jobs]
    most, width = max(map(len, found), default=0), max((len(kind.fields) for kind in plan.faults), default=0)
    whole = np.full((len(jobs), max(most, 1), 4), -1, np.int64)
    hits = np.zeros((len(jobs), max(most, 1), 1 + width), real)
    for flock, onsets in enumerate(found):
        for place, onset in enumerate(onsets):
            whole[flock, place] = onset.step, kinds[onset.kind], onset.agent, int(onset.leaves)
            hits[flock, place, : 1 + len(onset.numbers)] = onset.lasts, *onset.numbers
    return {"all_due": whole, "all_hits": hits}


def presence_results(tables: WorldTables, flown: int) -> tuple[float, NDArray[np.bool_]]:
    """Share of agents and instants at which an agent was there, and who is absent at the end.

    flown : the last step that was flown
    """
    n = tables.integers["agents"]
    gone: dict[int, int] = {}
    for onset in tables.due:
        if onset.leaves and onset.step <= flown:
            gone.setdefault(onset.agent, onset.step)
    there = n * (flown + 1) - sum(flown + 1 - step for step in gone.values())
    return there / (n * (flown + 1)), np.array([agent in gone for agent in range(n)])


def begin_fault_lines(build: CudaBuilder) -> list[str]:
    """Lines that let begin what is due before a step."""
    if not build.plan.faults:
        return []
    number = f"integer({own_row(build, 'order')})" if build.slots else "i"
    hit: list[str] = []
    for place, kind in enumerate(build.plan.faults):
        written = {"onset": "time", "lasts": "hits[begun, 0]"}
        written |= {name: f"hits[begun, {1 + c}]" for c, name in enumerate(kind.fields)}
        known = {name: name.removeprefix("at_") for name in kind.onset_names}
        written |= {name: own_row(build, row) for name, row in known.items() if row in build.names}
        rows = {name: fault_row(kind.name, name) for name in written}
        lines = [
            f"{own_row(build, rows[name])} = {said}" for name, said in written.items() if rows[name] in build.names
        ]
        hit += branch_lines(f"due[begun, {KIND}] == {place}", lines) if lines else []
    here = branch_lines(f"{number} == due[begun, {AGENT}]", hit or ["pass"])
    body = agent_loop(build, here)
    if build.slots:
        body = [
            *branch_lines(f"due[begun, {LEAVES}] == 0", body),
            *branch_lines(f"due[begun, {LEAVES}] != 0", _leave(build)),
        ]
    body += ["begun = integer(begun + 1)"]
    test = f"begun < due.shape[0] and due[begun, {STEP}] == step"
    return [f"while {test}:", *[f"    {line}" for text in body for line in text.splitlines()]]


def _leave(build: CudaBuilder) -> list[str]:
    """Lines that put an agent behind the others."""
    plan, registers = build.plan, build.shape.registers
    find = branch_lines(f"integer({own_row(build, 'order')}) == due[begun, {AGENT}]", ["found[0] = i"])
    lines = [
        "cuda.syncthreads()",
        *branch_lines("tid == 0", ["found[0] = -1"]),
        "cuda.syncthreads()",
        *agent_loop(build, find),
    ]
    lines += ["cuda.syncthreads()", "gone = integer(found[0])", "last = integer(n - 1)"]
    up = _in_registers(build) if registers else _in_tables()
    up += _shifted("past", "slots * past.shape[1]", "e // past.shape[1], e % past.shape[1], {c}") if plan.late else []
    if plan.packets:
        up += [*_shifted("store", "store.shape[0] * LANES", "e // LANES, e % LANES, {c}"), "cuda.syncthreads()"]
        up += _shifted("store", "store.shape[0] * LANES", "e // LANES, {c}, e % LANES")
    if registers:
        for table, width in table_widths(build).items():
            blank = [f"{table}[last, {c}] = {'AWAY' if c < len(plan.axes) else 'ZERO'}" for c in range(width)]
            up += branch_lines("tid == 0", blank)
    if flock_rules(plan):  # what rules of the whole flock go on from is found anew
        up += loop_lines(
            "e in range(tid, room.shape[0], THREADS)", loop_lines("c in range(room.shape[1])", ["room[e, c] = ZERO"])
        )
    up += ["n = last", *["m = n"] * bool(build.across), "cuda.syncthreads()"]
    return [*lines, *branch_lines("gone >= 0", up)]


def _in_registers(build: CudaBuilder) -> list[str]:
    """Each thread takes over what the same thread of the next agent carries; the last one keeps who has left."""
    carried = {name for stage in build.stages.values() for name in (*stage.arguments, *stage.results)}
    carried = {name for name in carried if name.endswith("_i") and not re.fullmatch(r"u[0-3]_i", name)}
    lines = []
    for name in sorted(carried | {own_row(build, "order")}):
        lines += [f"moved_up[tid] = {name}", "cuda.syncthreads()"]
        lines += branch_lines("gone <= i < last", [f"{name} = moved_up[tid + PER_AGENT]"])
        lines += branch_lines("i == last", [f"{name} = moved_up[gone * PER_AGENT + sub]"])
        lines += ["cuda.syncthreads()"]
    return lines


def _in_tables() -> list[str]:
    """The same of rows of tables, each by one thread."""
    lines = []
    for table in ("work", "mem", "memory"):
        lines += _shifted(table, f"{table}.shape[0]", "e, {c}")
    return [*lines, "cuda.syncthreads()"]


def _shifted(table: str, rows: str, place: str) -> list[str]:
    """Lines that move up all entries behind one of each row; that one goes to the last place."""
    at = [f"{table}[{place.format(c=c)}]" for c in ("gone", "c", "c + 1", "last")]
    body = [f"kept = {at[0]}", *loop_lines("c in range(gone, last)", [f"{at[1]} = {at[2]}"]), f"{at[3]} = kept"]
    return loop_lines(f"e in range(tid, {rows}, THREADS)", body)
