"""Presence: who of a flock is there. Those who are absent lie behind the others in memory, and nobody looks there.

A driver flies the first n agents of its tables. So whoever leaves is put behind them, with all rows, packets and
memories, and n is one less: he is met, heard, felt, measured and counted by nobody, and no loop has a test for it. An
instant is then that of a smaller flock, as it is in a recording with gaps (`cpu.measure_frames`).
"""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.fault_columns import kept_rows
from airflock.engine.initial_rows import first_memories, memories, of_pairs
from airflock.world.scenes.tree import AWAY

if TYPE_CHECKING:
    from airflock.engine.state import State


def leave(state: "State", agents: list[int]) -> None:
    """Let agents be absent from now on; those who are so already stay so."""
    slots, here = _slots(state), state.here
    gone = sorted(slots[agent] for agent in agents if slots[agent] < here)
    if not gone:
        return
    kept = [lane for lane in range(here) if lane not in set(gone)]
    _put(state, [*kept, *gone, *range(here, state.agents)])
    _set(state, len(kept))


def join(state: "State", agent: int, position: list[float], velocity: list[float]) -> None:
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
    for name, (_, true) in kept_rows(state.plan).items():
        if name in rows:
            work[rows[name], before] = motion[true]
    state.arrays["past"][:, :, before] = 0.0  # by no fault
    state.arrays["past"][:, : len(motion), before] = list(motion.values())
    state.look_at_pairs()


def _slots(state: "State") -> list[int]:
    slots = state.slots
    assert slots is not None  # a plan with absence has them
    found: list[int] = slots.tolist()
    return found


def _set(state: "State", here: int) -> None:
    """So many are there; the lanes of the others are blank, and far away."""
    state.set_whole("agents", here)
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
        work[rows[axis], lanes] = AWAY
        state.arrays["past"][:, c, lanes] = AWAY
    if plan.packets:
        store, count = state.arrays["store"], state.agents - here
        store[:, lanes] = of_pairs(plan, count, store.shape[2], work.dtype)
        store[:, :, lanes] = of_pairs(plan, store.shape[1], count, work.dtype)
    count, real = state.agents - here, work.dtype
    state.arrays["memory"][:, lanes] = memories(plan, count, real)
    for name in state.solved:  # what rules of the whole flock go on from is found anew
        state.arrays[name][...] = 0.0
    state.fill_own()
    state.arrays["mem"][:, lanes] = first_memories(plan, state.laws[lanes], real)


def _put(state: "State", places: list[int]) -> None:
    """Put into lane k what lies in lane places[k]."""
    at: NDArray[np.int64] = np.array(places)
    arrays: dict[str, Any] = state.arrays
    for name in ("work", "past", "mem", "memory"):
        arrays[name][..., : state.agents] = arrays[name][..., at]
    if state.plan.packets:
        arrays["store"][...] = arrays["store"][:, at]
        arrays["store"][..., : state.agents] = arrays["store"][..., at]
