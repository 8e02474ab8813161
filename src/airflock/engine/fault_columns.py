"""Fault columns: what is written when a fault begins."""

from typing import TYPE_CHECKING, Any

from airflock.engine.plan import Plan
from airflock.engine.stages.state import fault_row
from airflock.scenarios.onsets import Onset

if TYPE_CHECKING:
    from airflock.engine.state import State


def strike(state: "State", onset: Onset) -> None:
    """Write the columns of a fault that begins. An agent that is absent is hit by nothing."""
    slot = onset.agent if state.slots is None else int(state.slots[onset.agent])
    if slot >= state.here:
        return
    plan: Plan = state.plan
    kind = next((kind for kind in plan.faults if kind.name == onset.kind), None)
    if kind is None:
        return
    work, rows = state.arrays["work"], state.driver.ROWS
    real, dt = work.dtype.type, state.dt
    values: dict[str, Any] = {"onset": real(onset.step) * real(dt), "lasts": onset.lasts}
    values |= dict(zip(kind.fields, onset.numbers, strict=True))
    values |= {name: work[rows[name[3:]], slot] for name in kind.onset if name[3:] in rows}
    for name, value in values.items():
        row = rows.get(fault_row(kind.name, name))
        if row is not None:
            work[row, slot] = value
