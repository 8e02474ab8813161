"""Memory of a flight: named arrays. What it carries from step to step lies in one buffer, so that one copy keeps it."""

from collections.abc import Sequence
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.initial_rows import law_memories
from airflock.engine.layout import aligned_zeros, buffer_layout
from airflock.engine.passes import grid
from airflock.engine.passes.flock import scratch_arrays
from airflock.engine.plan import INTEGER_NAMES, Plan
from airflock.engine.stages.approach import BEGUN, ENDED, GAP
from airflock.engine.stages.state import own_row
from airflock.engine.tables import WorldTables
from airflock.world import FAR_AWAY

AGENTS, RING = INTEGER_NAMES.index("agents"), INTEGER_NAMES.index("ring")


class DriverMemory:
    """Memory of one flight, and the driver that reads and writes it.

    plan, driver : what is fixed at compile time, and the functions that were made of it
    tables       : what stands in the world and does not change; numbers that may change were copied from it
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
        """What the driver is called with."""
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
        """What stands in the world and what is noted of it on the way, as `stages.scene` takes it."""
        own, tables = self.arrays, self.tables
        shapes = own["shapes"] if len(tables.later) else tables.shapes
        return (
            shapes, tables.nodes, tables.links, own["near"], own["counts"], tables.goals, own["aim"], own["reached"],
            own["later"],
        )  # fmt: skip

    @property
    def has_ended(self) -> bool:
        """Whether the flight has ended at a collision."""
        return bool(self.arrays["held"][ENDED] > 0.5)

    @property
    def begun(self) -> bool:
        """Whether agents have their places."""
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
        """Whether the positions and velocities of all agents are finite."""
        # as bytes: `all` of so few takes three times as long
        return not any(0 in np.isfinite(run, told).tobytes() for run, told in self._moving)

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
        slot = np.arange(self.agents) if self.slots is None else self.slots
        self.arrays["work"][np.ix_(places, slot)] = values

    @property
    def has_slots(self) -> bool:
        """Whether agents lie in slots (`passes.slots`): those of a large flock, and where some may be absent."""
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
