"""Fault columns: what is written when a fault begins, and when others come into force while it lasts.

What a rule may repeat of the state that it disturbs is no such column: decisions keep it (`stages.faults.mislead`).
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from airflock.core import DISTURBED_STATES, Fault
from airflock.engine.plan import Plan
from airflock.engine.stages.state import fault_memory_row, fault_row
from airflock.scenarios import FaultOnset

if TYPE_CHECKING:
    from airflock.engine.state import DriverState


def begin_fault(state: "DriverState", onset: FaultOnset) -> None:
    """Write the columns of a fault that begins. An agent that is absent is hit by nothing."""
    slot = onset.agent if state.slots is None else int(state.slots[onset.agent])
    if slot >= state.here:
        return
    plan: Plan = state.plan
    kind = next((kind for kind in plan.faults if kind.name == onset.kind), None)
    if kind is None:
        return
    work, rows = state.arrays["work"], state.driver.ROWS
    values: dict[str, Any] = {"onset": _began(state, onset), "lasts": onset.lasts}
    values |= dict(zip(kind.fields, onset.numbers, strict=True))
    values |= {name: work[rows[name[3:]], slot] for name in kind.onset_names if name[3:] in rows}
    _write(state, kind, slot, values)


def still_has_fault(state: "DriverState", leaving: FaultOnset) -> bool:
    """Whether an agent still has the fault by which it is to leave: who has joined again since has none."""
    slot = leaving.agent if state.slots is None else int(state.slots[leaving.agent])
    work, rows = state.arrays["work"], state.driver.ROWS
    onset, lasts = (rows.get(fault_row(leaving.kind, name)) for name in ("onset", "lasts"))
    if onset is None or lasts is None:
        return True  # of a kind that does nothing else it keeps nothing
    return bool(work[lasts, slot] > 0.0 and work[onset, slot] == _began(state, leaving._replace(step=leaving.begin)))


def replace_faults(state: "DriverState", due: Sequence[FaultOnset]) -> None:
    """Go on with these faults: what has begun has their numbers and their end, and ends where it is none of them."""
    slots = range(state.agents) if state.slots is None else state.slots.tolist()
    agents = {lane: agent for agent, lane in enumerate(slots)}
    work, rows = state.arrays["work"], state.driver.ROWS
    for kind in state.plan.faults:
        named = {(o.agent, float(_began(state, o))): o for o in due if o.kind == kind.name and not o.leaves}
        onset, lasts = (rows.get(fault_row(kind.name, name)) for name in ("onset", "lasts"))
        if onset is None or lasts is None:
            continue
        for lane in range(state.here):
            if work[lasts, lane] > 0.0:
                found = named.get((agents[lane], float(work[onset, lane])))
                numbers = dict(zip(kind.fields, found.numbers, strict=True)) if found else {}
                _write(state, kind, lane, {"lasts": found.lasts if found else 0.0, **numbers})


def fault_memory_rows(plan: Plan) -> dict[str, tuple[str, str]]:
    """Rows of what rules of faults may repeat: each with the row of that state now and of the true one."""
    return {
        fault_memory_row(kind.name, asked, what): (("m" if asked == "believed" else "h") + what[3:], what[3:])
        for kind in plan.faults
        for asked in DISTURBED_STATES
        for what in kind.kept(asked)
    }


def _began(state: "DriverState", onset: FaultOnset) -> Any:
    """When a fault began, s, as its column tells it."""
    real = state.arrays["work"].dtype.type
    return real(onset.step) * real(state.dt)


def _write(state: "DriverState", kind: Fault, slot: int, values: Mapping[str, Any]) -> None:
    work, rows = state.arrays["work"], state.driver.ROWS
    for name, value in values.items():
        row = rows.get(fault_row(kind.name, name))
        if row is not None:
            work[row, slot] = value
