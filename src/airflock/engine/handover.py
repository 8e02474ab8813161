"""Handover: the state of a flight handed to another driver, by the names of its rows, so that the flight goes on."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.fault_columns import fault_memory_rows
from airflock.engine.initial_rows import law_memories, metric_memory_rows
from airflock.engine.passes.flock import scratch_arrays
from airflock.engine.passes.grid import sorts_by_cells
from airflock.engine.plan import Plan
from airflock.engine.stages.approach import BEGUN
from airflock.engine.stages.state import fault_row
from airflock.engine.state import DriverState


def hand_over(old: DriverState, new: DriverState, step: int) -> None:
    """Fill `new`, of the same agents and dimensions, with what `old` holds before `step`.

    Rows that only the new plan has are filled from what they stand for: a measured position from the true one, what a
    fault may repeat from what was believed or heard last. What is under way by radio stays under way. Sums over time
    begin anew, what metrics remember of each agent goes on. Pairs are looked at again (`held` is new): the new numbers
    may call a distance a collision that the old did not.
    """
    lanes = _lanes(old, new)
    _rows(old, new, lanes)
    new.arrays["past"][...] = _under_way(old, new, step, lanes)
    if new.plan.dryden == old.plan.dryden:
        new.arrays["gust"][:] = old.arrays["gust"]
    if old.plan.packets and new.plan.packets:
        kept = None if old.plan.radio == new.plan.radio else 2 * new.plan.dimensions + 1  # another radio begins anew
        new.arrays["store"][:kept] = old.arrays["store"][:kept, lanes[: old.agents]][..., lanes]
    _remembered(old, new, lanes)
    if np.array_equal(old.tables.shapes, new.tables.shapes) and old.arrays["later"].shape == new.arrays["later"].shape:
        for name in ("counts", "later", "shapes"):
            new.arrays[name][...] = old.arrays[name]
    if old.plan.goals and new.plan.goals and old.arrays["reached"].shape == new.arrays["reached"].shape:
        for name in ("aim", "reached"):
            new.arrays[name][...] = old.arrays[name]
    if new.plan.own:  # to new points all set out anew
        new.arrays["aim"][3] = -1.0
        if old.plan.own and np.array_equal(old.tables.goals, new.tables.goals):
            new.arrays["aim"][:] = old.arrays["aim"]
    for name in _solved(old, new):
        new.arrays[name][...] = old.arrays[name]
    new.arrays["held"][BEGUN] = old.arrays["held"][BEGUN]
    new.set_integer("agents", old.here)
    new.fill_varied()
    _memories(old, new, lanes)


def _lanes(old: DriverState, new: DriverState) -> NDArray[np.int64]:
    """Of each lane of the new driver the lane that it takes over; agents that are absent come last.

    A driver that sorts agents by cells may find them in any order; the others have them in the order of their numbers.
    """
    found = np.arange(new.arrays["work"].shape[1])
    if old.slots is not None and not sorts_by_cells(new.plan):
        there = np.argsort(~old.present, kind="stable")
        found[: old.agents] = old.slots[there]
    return found


def _rows(old: DriverState, new: DriverState, lanes: NDArray[np.int64]) -> None:
    """Rows of the work table, whole lanes."""
    work, before, had = new.arrays["work"], old.arrays["work"], old.driver.ROWS
    repeated = fault_memory_rows(new.plan)
    other = {name for name in new.plan.beginnings if not _goes_on(name, old.plan, new.plan)}
    for name, place in new.driver.ROWS.items():
        if name in other:  # another body or sensor begins to remember anew
            continue
        stand = [
            name,
            *repeated.get(name, ()),
            *([name[1:]] if name[0] in "mh" and name[1:] in new.plan.motion else []),
        ]
        source = next((row for row in stand if row in had), None)
        if source is not None:
            work[place] = before[had[source]][lanes]
    if new.has_slots and "order" not in had:
        new.order[:] = np.arange(new.agents)


def _memories(old: DriverState, new: DriverState, lanes: NDArray[np.int64]) -> None:
    """What laws remember of each agent; by a law with another Memory an agent begins anew."""
    laws, real = new.laws, new.arrays["mem"].dtype
    new.arrays["mem"][:] = law_memories(new.plan, laws, real)
    before, now = old.plan.memories, new.plan.memories
    keeps = np.array([[one is other and one is not None for one in before] for other in now])
    kept, count = keeps[laws, old.laws[lanes]], min(len(old.arrays["mem"]), len(new.arrays["mem"]))
    new.arrays["mem"][:count, kept] = old.arrays["mem"][:count, lanes[kept]]


def _goes_on(row: str, old: Plan, new: Plan) -> bool:
    """Whether a row of what a body or a sensor remembers means the same in both plans."""
    return old.body == new.body if row.startswith("body") else old.senses and old.sensor == new.sensor


def _under_way(old: DriverState, new: DriverState, step: int, lanes: NDArray[np.int64]) -> NDArray[Any]:
    """The ring of past states for the delay of the new plan, (slot, component, lane).

    Decision k hears slot k modulo the ring, the states of step k * decide_every - delay. With a shorter delay newer
    states replace what was under way in time; with a longer one the last packet is heard again meanwhile. Beside states
    lie the faults by which they were sent; where none are kept yet, those of now stand in.
    """
    past, every = old.arrays["past"][..., lanes], old.whole("decide_every")
    made = np.empty_like(new.arrays["past"])
    motion, work = len(new.plan.motion), new.arrays["work"]
    for c, kind, what in new.plan.sent_faults:
        made[:, c] = work[new.driver.ROWS[fault_row(kind, what)]]
    had = {(kind, what): c for c, kind, what in old.plan.sent_faults}
    same = {c: had[kind, what] for c, kind, what in new.plan.sent_faults if (kind, what) in had}
    if not old.plan.late or every != new.whole("decide_every"):
        made[:, :motion] = work[[new.driver.ROWS[name] for name in new.plan.motion]]
        return made
    coming, newest = -(-step // every), (step - 1 + old.whole("delay")) // every
    for k in range(coming, coming + len(made)):
        slot = past[max(0, min(k, newest)) % len(past)]
        made[k % len(made), :motion] = slot[:motion]
        made[k % len(made), list(same)] = slot[list(same.values())]
    return made


def _remembered(old: DriverState, new: DriverState, lanes: NDArray[np.int64]) -> None:
    """What metrics of both plans remember of each agent."""
    before = metric_memory_rows(old.plan)
    for metric, rows in metric_memory_rows(new.plan).items():
        if metric in before:
            new.arrays["memory"][rows] = old.arrays["memory"][before[metric]][:, lanes]


def _solved(old: DriverState, new: DriverState) -> list[str]:
    """What rules of the whole flock carry from call to call, where wings are what they were; else it is found anew."""
    wing = new.plan.spans["wing"]
    if old.plan != new.plan or not np.array_equal(old.arrays["row"][wing], new.arrays["row"][wing]):
        return []
    scratch = scratch_arrays(new.plan, new.tables.row, new.agents)
    return [name for parts in scratch for name, _, spare in parts if not spare]
