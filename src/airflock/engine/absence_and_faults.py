"""Absent agents, empty batteries that have come down, and faults that begin or change between two steps.

A driver flies the first n agents of its tables. An agent that leaves is put behind them, with all
rows, packets and memories, and n is one less: nobody meets, hears, feels, measures or counts it,
and no loop has a test for it. An instant is then that of a smaller flock, as in a recording with
gaps (`measuring.measure_frames`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import DISTURBED_STATES, Body, Fault, choices, first_command, number_names
from airflock.engine.initial_rows import law_memories, metric_memories, pair_values
from airflock.engine.plan import Plan
from airflock.engine.stages.state import fault_memory_row, fault_row
from airflock.scenarios import FaultOnset, Scenario
from airflock.world import FAR_AWAY

if TYPE_CHECKING:
    from airflock.engine.driver_state import DriverState

# Fault columns: written when a fault begins or changes. What a rule may repeat of the state that it
# disturbs is no such column: decisions keep it (`stages.faults.mislead`).


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
    """Return True if an agent still has the fault by which it is to leave: who has joined again since has none."""
    slot = leaving.agent if state.slots is None else int(state.slots[leaving.agent])
    work, rows = state.arrays["work"], state.driver.ROWS
    onset, lasts = (rows.get(fault_row(leaving.kind, name)) for name in ("onset", "lasts"))
    if onset is None or lasts is None:
        return True  # of a kind that does nothing else it keeps nothing
    return bool(work[lasts, slot] > 0.0 and work[onset, slot] == _began(state, leaving._replace(step=leaving.begin)))


def replace_faults(state: "DriverState", due: Sequence[FaultOnset]) -> None:
    """Replace the list of faults. Running faults take the new numbers and end; removed ones stop."""
    # A change of the scenario replaces the list of faults: running ones take the new numbers,
    # removed ones end.
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
        fault_memory_row(kind.name, state_kind, what): (("m" if state_kind == "believed" else "h") + what[3:], what[3:])
        for kind in plan.faults
        for state_kind in DISTURBED_STATES
        for what in kind.kept(state_kind)
    }


def _began(state: "DriverState", onset: FaultOnset) -> Any:
    """When a fault began, s, as its column holds it."""
    real = state.arrays["work"].dtype.type
    return real(onset.step) * real(state.dt)


def _write(state: "DriverState", kind: Fault, slot: int, values: Mapping[str, Any]) -> None:
    work, rows = state.arrays["work"], state.driver.ROWS
    for name, value in values.items():
        row = rows.get(fault_row(kind.name, name))
        if row is not None:
            work[row, slot] = value


def remove_agents(state: "DriverState", agents: list[int]) -> None:
    """Make agents absent from now on; those that are absent already stay so."""
    # Absent agents lie behind the others, so no loop has a test. A mask would have to be respected
    # by every pair loop, mean, cluster and later metric; one that forgot it would count the absent
    # agents.
    slots, here = _slots(state), state.here
    gone = sorted(slots[agent] for agent in agents if slots[agent] < here)
    if not gone:
        return
    kept = [lane for lane in range(here) if lane not in set(gone)]
    _put(state, [*kept, *gone, *range(here, state.agents)])
    _set(state, len(kept))


def add_agent(state: "DriverState", agent: int, position: list[float], velocity: list[float]) -> None:
    """Bring an absent agent back in the state of a start: known to all others, with sensors without errors."""
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
    if state.plan.lags:  # until its first decision is due it flies on as it came
        command = first_command(state.plan.model.command, velocity)
        state.arrays["past"][:, state.plan.command_in_ring :, before] = command
        work[[rows[f"obeyed_{axis}"] for axis in state.plan.axes], before] = command
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
    for name in state.solved:  # what rules of the whole flock start from is solved again
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


# Agents on the ground with an empty battery. Bodies state how long their batteries last at least
# (`endures`), so a flight is watched step by step only while an agent falls. An agent is put away
# before the first step at which it is empty and on the ground, whatever the cuts.

SURE = 0.5  # share of the time that batteries last at least after which they are looked at again: drivers round


@dataclass(frozen=True)
class GroundContact:
    """Finds the agents that have landed.

    ground  : its height, m
    body    : the rules; numbers : those of each agent, as drivers read them; wing : of all
    """

    ground: float
    body: Body
    numbers: tuple[Any, ...]
    wing: Any

    def battery_times(self, state: "DriverState") -> dict[int, float]:
        """Of each agent that is there how long its battery lasts at least, s."""
        names = self.body.Memory._fields  # type: ignore[union-attr]
        rows = state.rows([f"body{c}" for c in range(len(names))]).astype(float).T.tolist()
        return {
            agent: self.body.lasts(memory=self.body.Memory(*rows[agent]), b=self.numbers[agent], wing=self.wing)  # type: ignore[misc]
            for agent in state.present.nonzero()[0].tolist()
        }

    def land(self, state: "DriverState") -> None:
        """Remove agents that are on the ground with an empty battery."""
        empty = [agent for agent, lasts in self.battery_times(state).items() if lasts <= 0.0]
        if empty:
            height = state.rows(["z"])[0]
            remove_agents(state, [agent for agent in empty if height[agent] <= self.ground])

    def steps_without_landing(self, state: "DriverState") -> int:
        """For how many steps nobody can land, at least; 1 while somebody falls."""
        lasts = self.battery_times(state).values()
        return max(1, int(SURE * min(lasts, default=0.0) / state.dt))


def ground_contact(scenario: Scenario, seed: int, real: Any) -> GroundContact | None:
    """Return the record of agents that can land; None where none can. real : type of the driver's numbers."""
    if not scenario.can_land or scenario.ground is None:
        return None
    body = scenario.body.numbers
    same = {name: float(real(getattr(body, name) or 0.0)) for name in number_names(type(body))}
    own = {
        name: [float(real(value)) for value in scenario.agent_values("b", name, seed)]
        for letter, name in scenario.varied
        if letter == "b"
    }
    numbers = tuple(
        SimpleNamespace(**choices(body), **(same | {name: values[agent] for name, values in own.items()}))
        for agent in range(scenario.agents)
    )
    return GroundContact(scenario.ground, scenario.body.rule, numbers, scenario.wing)
