"""Presence: who of a flock is there. Those who are absent lie behind the others in memory, and nobody looks there.

A driver flies the first n agents of its tables. So whoever leaves is put behind them, with all rows, packets and
memories, and n is one less: he is met, heard, felt, measured and counted by nobody, and no loop has a test for it. An
instant is then that of a smaller flock, as it is in a recording with gaps (`cpu.measure_frames`).
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.fault_columns import fault_memory_rows
from airflock.engine.initial_rows import law_memories, metric_memories, pair_values
from airflock.world import FAR_AWAY

if TYPE_CHECKING:
    from airflock.engine.state import DriverState


def remove_agents(state: "DriverState", agents: list[int]) -> None:
    """Let agents be absent from now on; those who are so already stay so."""
    slots, here = _slots(state), state.here
    gone = sorted(slots[agent] for agent in agents if slots[agent] < here)
    if not gone:
        return
    kept = [lane for lane in range(here) if lane not in set(gone)]
    _put(state, [*kept, *gone, *range(here, state.agents)])
    _set(state, len(kept))


def add_agent(state: "DriverState", agent: int, position: list[float], velocity: list[float]) -> None:
    """Let an absent agent be there from now on, as agents are at the start: known to all, with sound sensors."""
    here, order = state.here, state.order.tolist()
    lane = order.index(agent)
    before = sum(other < agent for other in order[:here])  # agents stay in the order of their numbers
    _put(state, [*range(before), lane, *(k for k in range(before, state.agents) if k != lane)])
    _set(state, here + 1)
    work, rows = state.arrays["work"], state.driver.ROWS
    motion = dict(zip(state.plan.motion, [*position, *velocity], strict=True))
    for name, value in motion.items():
        for prefix in ("", "m", "h", "before_", "from_"):
            if prefix + name in rows:
                work[rows[prefix + name], before] = value
    for name, (_, true) in fault_memory_rows(state.plan).items():
        if name in rows:
            work[rows[name], before] = motion[true]
    state.arrays["past"][:, :, before] = 0.0  # by no fault
    state.arrays["past"][:, : len(motion), before] = list(motion.values())
    state.reset_pair_distances()


def _slots(state: "DriverState") -> list[int]:
    slots = state.slots
    assert slots is not None  # a plan with absence has them
    found: list[int] = slots.tolist()
    return found


def _set(state: "DriverState", here: int) -> None:
    """So many are there; the lanes of the others are blank, and far away."""
    state.set_integer("agents", here)
    plan, work, rows = state.plan, state.arrays["work"], state.driver.ROWS
    lanes = slice(here, state.agents)
    order = work[rows["order"], lanes].copy()
    work[:, lanes] = 0.0
    work[rows["order"], lanes] = order
    for name, begin in plan.beginnings.items():
        if name in rows:
            work[rows[name], lanes] = begin
    state.arrays["past"][:, :, lanes] = 0.0
    for c, axis in enumerate(plan.axes):
        work[rows[axis], lanes] = FAR_AWAY
        state.arrays["past"][:, c, lanes] = FAR_AWAY
    if plan.packets:
        store, count = state.arrays["store"], state.agents - here
        store[:, lanes] = pair_values(plan, count, store.shape[2], work.dtype)
        store[:, :, lanes] = pair_values(plan, store.shape[1], count, work.dtype)
    count, real = state.agents - here, work.dtype
    state.arrays["memory"][:, lanes] = metric_memories(plan, count, real)
    for name in state.solved:  # what rules of the whole flock go on from is found anew
        state.arrays[name][...] = 0.0
    state.fill_varied()
    state.arrays["mem"][:, lanes] = law_memories(plan, state.laws[lanes], real)


def _put(state: "DriverState", places: list[int]) -> None:
    """Put into lane k what lies in lane places[k]."""
    at: NDArray[np.int64] = np.array(places)
    arrays: dict[str, Any] = state.arrays
    for name in ("work", "past", "mem", "memory"):
        arrays[name][..., : state.agents] = arrays[name][..., at]
    if state.plan.packets:
        arrays["store"][...] = arrays["store"][:, at]
        arrays["store"][..., : state.agents] = arrays["store"][..., at]
