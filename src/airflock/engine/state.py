"""State: the arrays of one flight. What it carries from step to step lies in one buffer, so that one copy keeps it."""

import math
from collections.abc import Sequence
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.passes import grid
from airflock.engine.passes.flock import scratch_of
from airflock.engine.passes.scene import NEAR
from airflock.engine.plan import WHOLE, Plan
from airflock.engine.tables import Tables
from airflock.engine.totals import combined, goals_reached, samples, sums_of

LANES = 16  # rows are padded to whole vectors of the widest machine
LINE = 64  # bytes of a cache line: a vector that lies across two costs two loads
NEVER = -1e9  # s; time stamp of a packet that has not come
ENDED = 3  # place in `held` of the mark that the flight has ended at a collision
GAP = 1  # place in `held` of how far agents may come before pairs must be looked at again, m
BEGUN = 4  # place in `held` of the mark that agents have their places


class State:
    """Memory of one flight and the driver that flies it.

    plan, driver : what is fixed at compile time, and the functions that were made of it
    tables       : what stands in the world and does not change; numbers that may change were copied from it
    arrays       : everything that is carried from step to step, by name; views into `buffer`
    agents       : number of agents
    """

    def __init__(self, plan: Plan, tables: Tables, driver: ModuleType, start: NDArray[Any] | None = None):
        real = tables.row.dtype
        whole = dict(zip(WHOLE, tables.whole.tolist(), strict=True))
        n, dims, m = whole["agents"], plan.dimensions, lanes(whole["agents"])
        initial = {
            "held": np.zeros(5, real),
            "row": tables.row,
            "whole": tables.whole,
            "gust": np.zeros(3, real),
            "mem": beginnings(plan.model.Memory, m, real),
            "memory": memories(plan, m, real),
            **dict(zip(("values", "sums"), sums_of(plan), strict=True)),
            **_goals(tables),
            "later": tables.later,
            "shapes": tables.shapes if len(tables.later) else tables.shapes[:0],
        }
        packets = (n, 2 * dims + 1, m) if plan.links else (1, 2 * dims + 1, 1)
        empty = {
            "work": ((len(driver.ROWS), m), real),
            "past": ((whole["ring"], 2 * dims, m), real),
            "store": (packets, real),
        }
        scratch = scratch_of(plan, tables.row, n)
        kept = {name: (size, real) for parts in scratch for name, size, spare in parts if not spare}
        self.plan, self.driver, self.tables, self.agents = plan, driver, tables, n
        self.buffer, self.arrays = _one_buffer(
            {name: (array.shape, array.dtype) for name, array in initial.items()} | empty | kept
        )
        for name, array in initial.items():
            self.arrays[name][...] = array
        self.arrays["store"][:, 2 * dims] = NEVER
        self._motion = [driver.ROWS[name] for name in (*plan.axes, *(f"v{axis}" for axis in plan.axes))]
        self.start = np.zeros((2 * dims, n), real) if start is None else np.ascontiguousarray(start, real)
        # used within a step only: random words, shapes near an agent, marks of clusters, cells, and what rules of the
        # whole flock use within a call (its pages of zeros cost nothing until they are written)
        self.words, self.near = rows((4, m), np.uint32), np.zeros(NEAR, np.int64)
        self.labels = rows((2, m), np.int32 if plan.bits == 32 else np.int64)
        self.solvers = tuple(
            tuple(np.zeros(size, real) if spare else self.arrays[name] for name, size, spare in parts)
            for parts in scratch
        )
        self.cells = grid.memory(plan, n, rows)
        self.no_frames = np.zeros((1, 3 * dims, n), real)
        self._given = self._arguments()

    def _arguments(self) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """What the driver is called with before and after the frames; the arrays stay the same all flight long."""
        own, tables = self.arrays, self.tables
        before = (
            own["held"], own["row"], own["whole"], tables.faces, tables.edges, tables.spans, self.scene, self.start,
            own["work"], self.words, own["past"], own["store"], own["gust"], own["mem"], own["memory"], self.labels,
            own["values"], own["sums"],
        )  # fmt: skip
        return before, (*self.scratch, *self.cells)

    @property
    def scratch(self) -> tuple[tuple[tuple[NDArray[Any], ...], ...], ...]:
        """Scratch of the rules of the whole flock, as one last argument of a driver or none."""
        return (self.solvers,) if self.solvers else ()

    @property
    def scene(self) -> tuple[NDArray[Any], ...]:
        """What stands in the world and what is noted of it on the way, as `passes.scene` takes it."""
        own, tables = self.arrays, self.tables
        shapes = own["shapes"] if len(tables.later) else tables.shapes
        return (
            shapes, tables.nodes, tables.links, self.near, own["counts"], tables.goals, own["aim"], own["reached"],
            own["later"],
        )  # fmt: skip

    def advance(self, first: int, last: int, half: int = 0, frames: NDArray[Any] | None = None) -> int:
        """Fly the steps first to last - 1; returns the next step, or minus the first agent (from 1) without a place.

        half   : as in `passes.driver.flight`
        frames : (sample, component, agent), filled with the samples of these steps where the plan records
        """
        before, after = self._given
        return int(
            self.driver.advance(first, last, half, *before, self.no_frames if frames is None else frames, *after)
        )

    @property
    def ended(self) -> bool:
        """Whether the flight has ended at a collision."""
        return bool(self.arrays["held"][ENDED] > 0.5)

    @property
    def begun(self) -> bool:
        """Whether agents have their places."""
        return bool(self.arrays["held"][BEGUN] > 0.5)

    @property
    def finite(self) -> bool:
        """Whether the positions and velocities of all agents are finite."""
        return math.isfinite(self.arrays["work"][self._motion].sum())

    def compile(self) -> None:
        """Have the driver compiled; nothing is flown, and agents get no places."""
        marks = self.arrays["held"]
        begun, marks[BEGUN] = marks[BEGUN], 1.0
        self.advance(0, 0)
        marks[BEGUN] = begun

    def twin(self) -> "State":
        """The same state in memory of its own."""
        made = State(self.plan, self.tables, self.driver, self.start)
        made.buffer[:] = self.buffer
        return made

    def look_at_pairs(self) -> None:
        """Forget how far pairs are apart: what was changed from outside may have brought them together."""
        self.arrays["held"][GAP] = 0.0

    def whole(self, name: str) -> int:
        """An integer of this flight."""
        return int(self.arrays["whole"][WHOLE.index(name)])

    def set_whole(self, name: str, value: int) -> None:
        """Set an integer of this flight."""
        self.arrays["whole"][WHOLE.index(name)] = value

    def rows(self, names: Sequence[str]) -> NDArray[Any]:
        """Rows of the work table by name, (row, agent); agents by number. A copy.

        KeyError for a row that this plan has not.
        """
        found: NDArray[Any] = self.arrays["work"][[self.driver.ROWS[name] for name in names], : self.agents]
        return found if (slot := self.slots) is None else found[:, slot]

    def put(self, names: Sequence[str], values: NDArray[Any]) -> None:
        """Write rows of the work table, (row, agent), agents by number."""
        places = [self.driver.ROWS[name] for name in names]
        slot = np.arange(self.agents) if self.slots is None else self.slots
        self.arrays["work"][np.ix_(places, slot)] = values

    @property
    def has_slots(self) -> bool:
        """Whether the agents of a large flock lie in slots (`passes.slots`)."""
        return "order" in self.driver.ROWS

    @property
    def slots(self) -> NDArray[Any] | None:
        """Slot of each agent by number, where agents have slots."""
        if not self.has_slots:
            return None
        kind = np.int32 if self.plan.bits == 32 else np.int64
        order = self.arrays["work"][self.driver.ROWS["order"], : self.agents].view(kind)
        slots = np.empty_like(order)
        slots[order] = np.arange(self.agents)
        return slots

    @property
    def motion(self) -> NDArray[Any]:
        """Positions (m) and velocities (m/s), (component, agent)."""
        found: NDArray[Any] = self.arrays["work"][self._motion, : self.agents]
        return found if (slot := self.slots) is None else found[:, slot]

    def values(self) -> dict[str, Any]:
        """Order parameters over the time that the sums hold, and when each goal was reached."""
        return combined(self.plan, self.arrays["sums"]) | goals_reached(self.plan, self.arrays["reached"])

    def samples(self) -> int:
        """Number of samples that the sums hold."""
        return samples(self.plan, self.arrays["sums"])

    def reset_sums(self) -> None:
        """Begin the sums over time anew. What a metric remembers of each agent stays: contacts go on."""
        self.arrays["sums"][:] = sums_of(self.plan)[1]


def _one_buffer(shapes: dict[str, tuple[tuple[int, ...], Any]]) -> tuple[NDArray[np.uint8], dict[str, NDArray[Any]]]:
    """Zeros for named arrays, one after another in one buffer, each from a cache line on."""
    sizes = {name: math.prod(shape) * np.dtype(kind).itemsize for name, (shape, kind) in shapes.items()}
    places, end = {}, 0
    for name, size in sizes.items():
        places[name], end = end, end + -(-size // LINE) * LINE
    buffer = rows((end,), np.uint8)
    return buffer, {
        name: buffer[places[name] : places[name] + sizes[name]].view(kind).reshape(shape)
        for name, (shape, kind) in shapes.items()
    }


def _goals(tables: Tables) -> dict[str, NDArray[Any]]:
    """Where the flock's goal is and its number, when each was reached (s; -1: not yet), and counts of the scene."""
    real = tables.row.dtype
    aim, reached = np.zeros(4, real), np.full(len(tables.goals), -1.0, real)
    aim[:3] = tables.goals[0] if len(tables.goals) else 0.0
    return {"aim": aim, "reached": reached, "counts": np.zeros(2, np.int64)}


def lanes(agents: int) -> int:
    """Agents of a row, filled up to whole vectors."""
    return -(-agents // LANES) * LANES


def rows(shape: tuple[int, ...], kind: Any) -> NDArray[Any]:
    """Zeros whose rows begin on a cache line."""
    count = math.prod(shape) * np.dtype(kind).itemsize
    room = np.zeros(count + LINE, np.uint8)
    first = -room.ctypes.data % LINE
    found: NDArray[Any] = room[first : first + count].view(kind).reshape(shape)
    return found


def memories(plan: Plan, m: int, real: Any) -> NDArray[Any]:
    """What metrics remember of each agent, at its start: (field, lane)."""
    blocks = [beginnings(metric.Memory, m, real) for metric in plan.metrics if metric.Memory is not None]
    return np.concatenate(blocks) if blocks else np.zeros((1, m), real)


def beginnings(record: Any, m: int, real: Any) -> NDArray[Any]:
    """The defaults of a Memory for each of m lanes: (field, lane)."""
    starts = list(getattr(record, "_field_defaults", {}).values()) or [0.0]
    return np.repeat(np.array(starts, real)[:, None], m, axis=1)
