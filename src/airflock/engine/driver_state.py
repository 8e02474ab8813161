"""Driver state: the memory of a flight, the driver that flies it on, and its handover to another driver."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.absence_and_faults import begin_fault, fault_memory_rows, remove_agents, still_has_fault
from airflock.engine.drivers import compile_messages, device_of, driver_of, is_compiled
from airflock.engine.initial_rows import law_memories, metric_memory_rows
from airflock.engine.layout import aligned_zeros, buffer_layout
from airflock.engine.passes import grid
from airflock.engine.passes.flock import scratch_arrays
from airflock.engine.passes.grid import sorts_by_cells
from airflock.engine.plan import INTEGER_NAMES, Plan
from airflock.engine.stages.approach import BEGUN, ENDED, GAP
from airflock.engine.stages.state import fault_row, own_row
from airflock.engine.store import compile_by_process
from airflock.engine.tables import WorldTables, world_tables
from airflock.engine.totals import combine_sums, goal_times
from airflock.scenarios import FaultOnset, Scenario
from airflock.world import FAR_AWAY

# Memory: named arrays; all that lasts from step to step lies in one buffer, so that one copy keeps
# it.

AGENTS, RING = INTEGER_NAMES.index("agents"), INTEGER_NAMES.index("ring")


class DriverState:
    """Memory of one flight, and the driver that reads and writes it, step by step.

    plan, driver : what is fixed at compile time, and the functions that were made of it
    tables       : what stands in the world and does not change; numbers that may change were copied
                   from it
    arrays       : everything that is carried from step to step, by name; views into `buffer`
    agents       : number of agents
    """

    def __init__(self, plan: Plan, tables: WorldTables, driver: ModuleType, start: NDArray[Any] | None = None):
        real = tables.row.dtype
        agents, ring = int(tables.whole[AGENTS]), int(tables.whole[RING])
        scratch = scratch_arrays(plan, tables.row, agents)
        kept = tuple((name, size) for parts in scratch for name, size, spare in parts if not spare)
        counts = (len(driver.ROWS), agents, ring, len(tables.goals), len(tables.later), tables.shapes.shape)
        layout = buffer_layout(plan, real, *counts, kept)
        self.plan, self.driver, self.tables, self.agents = plan, driver, tables, agents
        self.buffer, self.arrays = layout.new_buffer()
        own = self.arrays
        own["row"][:], own["whole"][:] = tables.row, tables.whole
        for c, axis in enumerate(plan.axes):  # a driver that fills up vectors may go on where one that does not began
            own["work"][driver.ROWS[axis], agents:] = FAR_AWAY
            own["past"][:, c, agents:] = FAR_AWAY
        for name, begin in plan.beginnings.items():
            if name in driver.ROWS:
                own["work"][driver.ROWS[name]] = begin
        if len(tables.goals):
            own["aim"][:3] = tables.goals[0]
        self.fill_varied()
        if plan.laws:  # of one law they stand in the layout
            own["mem"][:] = law_memories(plan, self.laws, real)
        if len(tables.later):
            own["later"][:], own["shapes"][:] = tables.later, tables.shapes
        self._motion = [driver.ROWS[name] for name in plan.motion]
        components = plan.dimensions
        self.start = np.zeros((2 * components, 0), real) if start is None else np.ascontiguousarray(start, real)
        self.no_frames = np.zeros((0, 3 * components, agents), real)
        self.solved = tuple(name for name, _ in kept)  # arrays that rules of the whole flock go on from
        # what is used within a call only: its pages of zeros cost nothing until they are written
        self.solvers = tuple(
            tuple(np.zeros(size, real) if spare else own[name] for name, size, spare in parts) for parts in scratch
        )
        self.cells = grid.grid_memory(plan, agents, aligned_zeros)
        self._given = self._arrays()

    def arguments(self, first: int, last: int, half: int = 0, frames: NDArray[Any] | None = None) -> tuple[Any, ...]:
        """Return the arguments of the driver."""
        before, after = self._given
        return first, last, half, *before, self.no_frames if frames is None else frames, *after

    def _arrays(self) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Arguments before and after the frames; they stay the same all flight long."""
        own, tables = self.arrays, self.tables
        before = (
            own["held"], own["row"], own["whole"], tables.faces, tables.edges, tables.spans, self.scene, self.start,
            own["work"], own["words"], own["past"], own["store"], own["gust"], own["mem"], own["memory"], own["labels"],
            own["values"], own["sums"],
        )  # fmt: skip
        return before, (*self.scratch, *self.cells)

    @property
    def scratch(self) -> tuple[tuple[tuple[NDArray[Any], ...], ...], ...]:
        """Scratch of the rules of the whole flock, as one last argument of a driver or none."""
        return (self.solvers,) if self.solvers else ()

    @property
    def scene(self) -> tuple[NDArray[Any], ...]:
        """Return the arrays of the scene and of the notes on it, in the order of `stages.scene`."""
        own, tables = self.arrays, self.tables
        shapes = own["shapes"] if len(tables.later) else tables.shapes
        return (
            shapes, tables.nodes, tables.links, own["near"], own["counts"], tables.goals, own["aim"], own["reached"],
            own["later"],
        )  # fmt: skip

    @property
    def has_ended(self) -> bool:
        """Return True if the flight has ended at a collision."""
        return bool(self.arrays["held"][ENDED] > 0.5)

    @property
    def begun(self) -> bool:
        """Return True if agents have their places."""
        return bool(self.arrays["held"][BEGUN] > 0.5)

    @property
    def here(self) -> int:
        """How many agents are there."""
        return int(self.arrays["whole"][AGENTS])

    @property
    def present(self) -> NDArray[np.bool_]:
        """Of each agent whether it is there."""
        slots = self.slots
        return np.ones(self.agents, bool) if slots is None else slots < self.here

    @property
    def dt(self) -> float:
        """Motion step as the driver reads it, s."""
        return float(self.arrays["row"][self.plan.spans["c"]][self.plan.records["c"].index("dt")])

    def fill_varied(self) -> None:
        """Write the numbers that differ among agents, each to its agent."""
        slots = self.slots if self.begun else None
        for (letter, name), values in zip(self.plan.columns, self.tables.own, strict=True):
            row = self.driver.ROWS.get(own_row(letter, name))
            if row is not None:
                lane = self.arrays["work"][row]
                lane[: self.agents][slice(None) if slots is None else slots] = values
                lane[self.agents :] = values[0]

    @property
    def laws(self) -> NDArray[np.int64]:
        """Which of the plan's laws the agent in each lane flies by."""
        row = self.driver.ROWS.get("law")
        work = self.arrays["work"]
        return np.zeros(work.shape[1], np.int64) if row is None else work[row].astype(np.int64)

    @property
    def is_finite(self) -> bool:
        """Return True if the positions and velocities of all agents are finite."""
        # as bytes: `all` of so few takes three times as long
        return not any(0 in np.isfinite(run, finite).tobytes() for run, finite in self._moving)

    @cached_property
    def _moving(self) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        """Rows of motion as runs of memory, mostly one, each with room for what is found of it."""
        together = np.split(self._motion, np.flatnonzero(np.diff(self._motion) != 1) + 1)
        runs = [self.arrays["work"][rows[0] : rows[-1] + 1].reshape(-1) for rows in together]
        return [(run, np.zeros(run.shape, bool)) for run in runs]

    def reset_pair_distances(self) -> None:
        """Forget how far pairs are apart: what was changed from outside may have brought them together."""
        self.arrays["held"][GAP] = 0.0

    def whole(self, name: str) -> int:
        """An integer of this flight."""
        return int(self.arrays["whole"][INTEGER_NAMES.index(name)])

    def set_integer(self, name: str, value: int) -> None:
        """Set an integer of this flight."""
        self.arrays["whole"][INTEGER_NAMES.index(name)] = value

    def rows(self, names: Sequence[str]) -> NDArray[Any]:
        """Rows of the work table by name, (row, agent); agents by number. A copy.

        KeyError for a row that this plan has not.
        """
        found: NDArray[Any] = self.arrays["work"][[self.driver.ROWS[name] for name in names], : self.agents]
        return found if (slot := self.slots) is None else found[:, slot]

    def set_rows(self, names: Sequence[str], values: NDArray[Any]) -> None:
        """Write rows of the work table, (row, agent), agents by number."""
        places = [self.driver.ROWS[name] for name in names]
        if (slot := self.slots) is None:
            self.arrays["work"][places, : self.agents] = values
        else:
            self.arrays["work"][np.ix_(places, slot)] = values

    @property
    def has_slots(self) -> bool:
        """Return True if agents lie in slots (`passes.slots`): those of a large flock, and where some may be absent."""
        return "order" in self.driver.ROWS

    @property
    def order(self) -> NDArray[Any]:
        """Number of the agent in each slot, where agents have slots; writes through."""
        kind = np.int32 if self.plan.bits == 32 else np.int64
        found: NDArray[Any] = self.arrays["work"][self.driver.ROWS["order"], : self.agents].view(kind)
        return found

    @property
    def slots(self) -> NDArray[Any] | None:
        """Slot of each agent by number, where agents have slots."""
        if not self.has_slots:
            return None
        order = self.order
        slots = np.empty_like(order)
        slots[order] = np.arange(self.agents)
        return slots

    @property
    def motion(self) -> NDArray[Any]:
        """Positions (m) and velocities (m/s), (component, agent); nan of those who are absent."""
        found: NDArray[Any] = self.arrays["work"][self._motion, : self.agents]
        if self.begun:
            found[:, self.here :] = np.nan
        return found if (slot := self.slots) is None else found[:, slot]

    def compile(self) -> "DriverState":
        """Have the driver compiled; nothing is flown, and agents get no places. Returns the state."""
        marks = self.arrays["held"]
        begun, marks[BEGUN] = marks[BEGUN], 1.0
        with compile_messages(self.driver.advance, self.plan.model.name):
            self.advance(0, 0)
        marks[BEGUN] = begun
        return self

    def compile_in_background(self) -> "DriverState":
        """Have another process compile the driver, and load it; for a thread that may wait. Returns the state.

        Where no process can be started, or it fails for any reason, this thread compiles and says
        what is wrong.
        """
        if not is_compiled(self.driver):
            compile_by_process(self.driver, tuple(map(self.driver.advance.typeof_pyval, self.arguments(0, 0))))
        return self.compile()

    @classmethod
    def of(
        cls, plan: Plan, scenario: Scenario, seed: int = 0, world: int = 0, start: Any = None, device: str = "cpu"
    ) -> "DriverState":
        """State before the first step of a scenario by its plan.

        start  : positions and velocities, (component, agent) in m and m/s, where the plan asks for
                 them
        device : cpu, or python, uncompiled
        """
        return cls(plan, world_tables(scenario, plan, seed, world), driver_of(plan, device), start)

    def copy(self) -> "DriverState":
        """Return a copy of the state in its own memory."""
        made = DriverState(self.plan, self.tables, self.driver, self.start)
        made.buffer[:] = self.buffer
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled without its driver, which another process makes, or has, of the same plan."""
        return _again, (self.plan, self.tables, device_of(self.driver), self.start, self.buffer)

    def set_onsets(self, due: tuple[FaultOnset, ...]) -> None:
        """Have these faults to come, instead of those before."""
        self.tables = replace(self.tables, due=due)

    def advance(self, first: int, last: int, half: int = 0, frames: NDArray[Any] | None = None) -> int:
        """Fly the steps first to last - 1; returns the next step, or minus the first agent (from 1) without a place.

        half   : as in `passes.driver.flight`
        frames : (sample, component, agent), filled with the samples of these steps; None keeps none

        It stops on the way where a fault is due. What is due at a step is done before it is flown
        or sensed.
        """
        due = {onset.step for onset in self.tables.due if first <= onset.step < last}
        landing, every = self.tables.ground_contact if first < last else None, self.whole("sample_every")
        if (due or landing) and not self.begun and (unplaced := self._fly(first, first, 0, None)) < 0:
            return unplaced
        step, skipped = first, -(-first // every)
        while True:
            if step > first or not half & 1:  # else that was done before this step was sensed
                for onset in self.tables.due if step in due else ():
                    if onset.step == step and not onset.leaves:
                        begin_fault(self, onset)
                    elif onset.step == step and still_has_fault(self, onset):
                        remove_agents(self, [onset.agent])
                if landing:  # who has come to the ground with an empty battery is put away
                    landing.land(self)
            stop = min([last, *(coming for coming in due if coming > step)])
            stop = min(stop, step + landing.steps_without_landing(self)) if landing else stop
            rest = None if frames is None else frames[-(-step // every) - skipped :]
            done = self._fly(step, stop, half if step == first else 0, rest)
            if done != stop or stop == last:
                return done
            step = stop

    def _fly(self, first: int, last: int, half: int, frames: NDArray[Any] | None) -> int:
        """One call of the driver. An instant with fewer than two of several agents is not counted."""
        few = self.plan.absence and self.begun and self.here < min(2, self.agents)
        if few and not self.here:
            self.arrays["there"][1] += self.agents * (last - first)  # time passes
            return last
        kept = self.arrays["sums"].copy() if few else None
        done = int(self.driver.advance(*self.arguments(first, last, half, frames)))
        if kept is not None:
            self.arrays["sums"][:] = kept
        if self.plan.absence and not half & 2:
            instants = max(done - first, 0) + int(self.has_ended)  # that of a collision, too, at which the flight ends
            there = self.arrays["there"]
            there[0] += self.here * instants
            there[1] += self.agents * instants
        return done

    def values(self) -> dict[str, Any]:
        """Order parameters over the time that the sums hold, and when each goal was reached."""
        found = combine_sums(self.plan, self.arrays["sums"]) | goal_times(self.plan, self.arrays["reached"])
        if self.plan.absence:
            there, of = self.arrays["there"].tolist()
            found["present"] = there / of if of else 1.0
        return found


def _again(plan: Plan, tables: WorldTables, device: str, start: NDArray[Any], buffer: NDArray[np.uint8]) -> DriverState:
    """A state out of a pickle."""
    made = DriverState(plan, tables, driver_of(plan, device), start)
    made.buffer[:] = buffer
    return made


def hand_over(old: DriverState, new: DriverState, step: int) -> None:
    """Fill `new`, of the same agents and dimensions, with what `old` holds before `step`.

    Rows that only the new plan has are filled from what they stand for: a measured position from
    the true one, what a fault may repeat from what was believed or heard last. What is under way by
    radio stays under way. Sums over time start again, what metrics remember of each agent goes on.
    Pairs are looked at again (`held` is new): the new numbers may call a distance a collision that
    the old did not.
    """
    # Rows are matched by name whether or not the plan is the same: one path instead of two.
    lanes = _lanes(old, new)
    _rows(old, new, lanes)
    new.arrays["past"][...] = _under_way(old, new, step, lanes)
    if new.plan.dryden == old.plan.dryden:
        new.arrays["gust"][:] = old.arrays["gust"]
    if old.plan.packets and new.plan.packets:
        kept = None if old.plan.radio == new.plan.radio else 2 * new.plan.dimensions + 1  # another radio starts again
        new.arrays["store"][:kept] = old.arrays["store"][:kept, lanes[: old.agents]][..., lanes]
    _remembered(old, new, lanes)
    if np.array_equal(old.tables.shapes, new.tables.shapes) and old.arrays["later"].shape == new.arrays["later"].shape:
        for name in ("counts", "later", "shapes"):
            new.arrays[name][...] = old.arrays[name]
    if old.plan.goals and new.plan.goals and old.arrays["reached"].shape == new.arrays["reached"].shape:
        for name in ("aim", "reached"):
            new.arrays[name][...] = old.arrays[name]
    if new.plan.own:  # all set out again to new points
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

    A driver that sorts agents by cells may find them in any order; the others have them in the
    order of their numbers.
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
        if name in other:  # another body or sensor starts with an empty memory
            continue
        stand = [
            name,
            *repeated.get(name, ()),
            *([name[1:]] if name[0] in "mh" and name[1:] in new.plan.motion else []),
            *([f"c{name[-1]}"] if name.startswith("obeyed_") else []),
        ]
        source = next((row for row in stand if row in had), None)
        if source is not None:
            work[place] = before[had[source]][lanes]
    if new.has_slots and "order" not in had:
        new.order[:] = np.arange(new.agents)


def _memories(old: DriverState, new: DriverState, lanes: NDArray[np.int64]) -> None:
    """Carry the memories of laws over; under a law with another Memory an agent starts from the initial one."""
    laws, real = new.laws, new.arrays["mem"].dtype
    new.arrays["mem"][:] = law_memories(new.plan, laws, real)
    before, now = old.plan.memories, new.plan.memories
    keeps = np.array([[one is other and one is not None for one in before] for other in now])
    kept, count = keeps[laws, old.laws[lanes]], min(len(old.arrays["mem"]), len(new.arrays["mem"]))
    new.arrays["mem"][:count, kept] = old.arrays["mem"][:count, lanes[kept]]


def _goes_on(row: str, old: Plan, new: Plan) -> bool:
    """Return True if a row of what a body or a sensor remembers means the same in both plans."""
    return old.body == new.body if row.startswith("body") else old.senses and old.sensor == new.sensor


def _under_way(old: DriverState, new: DriverState, step: int, lanes: NDArray[np.int64]) -> NDArray[Any]:
    """The ring of past states for the delay of the new plan, (slot, component, lane).

    Decision k hears slot k modulo the ring, the states of step k * decide_every - delay. With a
    shorter delay newer states replace what was under way in time; with a longer one the last packet
    is heard again meanwhile. Beside states lie the faults by which they were sent; where none are
    kept yet, those of now stand in.
    """
    past, every = old.arrays["past"][..., lanes], old.whole("decide_every")
    made = np.empty_like(new.arrays["past"])
    made[:, new.plan.command_in_ring :] = _waiting(old, new, step, lanes)
    motion, work = len(new.plan.motion), new.arrays["work"]
    for c, kind, what in new.plan.sent_faults:
        made[:, c] = work[new.driver.ROWS[fault_row(kind, what)]]
    had = {(kind, what): c for c, kind, what in old.plan.sent_faults}
    same = {c: had[kind, what] for c, kind, what in new.plan.sent_faults if (kind, what) in had}
    if not old.plan.late or every != new.whole("decide_every"):
        made[:, :motion] = work[[new.driver.ROWS[name] for name in new.plan.motion]]
        return made
    coming, newest = -(-step // every), (step - 1 + old.whole("delay")) // every
    # Packets under way stay under way: the ring is indexed again for the new delay.
    for k in range(coming, coming + len(made)):
        slot = past[max(0, min(k, newest)) % len(past)]
        made[k % len(made), :motion] = slot[:motion]
        made[k % len(made), list(same)] = slot[list(same.values())]
    return made


def _waiting(old: DriverState, new: DriverState, step: int, lanes: NDArray[np.int64]) -> NDArray[Any]:
    """Commands in the ring of the new plan, (slot, axis, lane): those that wait go on waiting, as the new delay says.

    With a longer delay the oldest one is followed meanwhile; where none waited, the command of now.
    """
    size, first, had = len(new.arrays["past"]), old.plan.command_in_ring, len(old.arrays["past"])
    made = np.empty((size, new.plan.dimensions * new.plan.lags, len(lanes)), new.arrays["past"].dtype)
    if not new.plan.lags:
        return made
    every, newest = old.whole("decide_every"), (step - 1) // old.whole("decide_every")
    if not old.plan.lags or every != new.whole("decide_every"):
        made[:] = old.arrays["work"][[old.driver.ROWS[f"c{axis}"] for axis in old.plan.axes]][:, lanes]
        return made
    for k in range(newest - size + 1, newest + 1):
        made[k % size] = old.arrays["past"][max(k, newest - had + 1) % had, first:, lanes].T
    return made


def _remembered(old: DriverState, new: DriverState, lanes: NDArray[np.int64]) -> None:
    """Carry over the memories of the metrics that both plans have."""
    before = metric_memory_rows(old.plan)
    for metric, rows in metric_memory_rows(new.plan).items():
        if metric in before:
            new.arrays["memory"][rows] = old.arrays["memory"][before[metric]][:, lanes]


def _solved(old: DriverState, new: DriverState) -> list[str]:
    """Carry over the workspace of rules of the whole flock if the wings are unchanged; otherwise solve again."""
    wing = new.plan.spans["wing"]
    if old.plan != new.plan or not np.array_equal(old.arrays["row"][wing], new.arrays["row"][wing]):
        return []
    scratch = scratch_arrays(new.plan, new.tables.row, new.agents)
    return [name for parts in scratch for name, _, spare in parts if not spare]
