"""Layout: where the arrays of a flight lie in its one buffer, and what they hold before it."""

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.engine.initial_rows import law_memories, metric_memories, pair_values
from airflock.engine.plan import INTEGER_NAMES, Plan
from airflock.engine.stages.approach import HELD_SIZE
from airflock.engine.stages.decide import MAX_GATHERED
from airflock.engine.totals import initial_sums

LANES = 16  # rows are padded to whole vectors of the widest machine
# NumPy aligns to 16 bytes; aligning to a cache line takes a flight from 66.3 to 63.5 ms.
CACHE_LINE = 64  # bytes of a cache line: a vector that lies across two costs two loads


class BufferLayout(NamedTuple):
    """Where the arrays of a state lie in its buffer, and what they hold before a flight.

    places : name, first byte, shape and kind of each array, each from a cache line on
    """

    places: tuple[tuple[str, int, tuple[int, ...], Any], ...]
    initial_bytes: NDArray[np.uint8]

    def new_buffer(self) -> tuple[NDArray[np.uint8], dict[str, NDArray[Any]]]:
        """A new buffer as it is before a flight, and its arrays by name."""
        buffer = align(np.empty, len(self.initial_bytes))
        buffer[:] = self.initial_bytes
        arrays = {name: np.ndarray(shape, kind, buffer, place) for name, place, shape, kind in self.places}
        return buffer, arrays


@lru_cache(maxsize=64)
def buffer_layout(
    plan: Plan,
    real: Any,
    count: int,
    agents: int,
    ring: int,
    goals: int,
    later: int,
    shapes: tuple[int, int],
    kept: tuple[Any, ...],
) -> BufferLayout:
    """Layout of the states of a plan with so many rows, agents, past states, goals and shapes."""
    m = lane_count(agents)
    label = np.int32 if plan.bits == 32 else np.int64
    pairs = (agents, m) if plan.packets else (1, 1)
    values, sums = initial_sums(plan)
    beginnings = {
        "mem": law_memories(plan, np.zeros(m, int), real), "memory": metric_memories(plan, m, real),
        "values": values, "sums": sums,
        "store": pair_values(plan, *pairs, real), "reached": np.full(goals, -1.0, real),
    }  # fmt: skip
    columns = sum(map(len, plan.records.values()))
    gusts = (5 if plan.dryden else 3,)
    shaped: dict[str, tuple[tuple[int, ...], Any]] = {
        "held": ((HELD_SIZE,), real),
        "row": ((columns,), real),
        "whole": ((len(INTEGER_NAMES),), np.int64),
        "gust": (gusts, real),
        "aim": ((4,), real),
        "counts": ((2,), np.int64),
        "later": ((later, 8), real),
        "shapes": ((shapes[0] if later else 0, shapes[1]), real),
        "words": ((4, m), np.uint32),
        "near": ((MAX_GATHERED,), np.int64),
        "labels": ((2, m), label),
        "there": ((2,), np.float64),
    }
    shaped |= {name: (array.shape, array.dtype) for name, array in beginnings.items()}
    shaped |= {name: (size, real) for name, size in kept}
    # last, since faults and agents that differ add to them: what lies before lies to their first
    # rows as ever
    shaped |= {"work": ((count, m), real), "past": ((ring, plan.in_ring, m), real)}
    places, end = [], 0
    for name, (shape, kind) in shaped.items():
        places.append((name, end, shape, np.dtype(kind)))
        end += -(-math.prod(shape) * np.dtype(kind).itemsize // CACHE_LINE) * CACHE_LINE
    layout = BufferLayout(tuple(places), np.zeros(end, np.uint8))
    buffer, arrays = layout.new_buffer()
    for name, array in beginnings.items():
        arrays[name][...] = array
    return BufferLayout(layout.places, buffer.copy())


def lane_count(agents: int) -> int:
    """Agents of a row, filled up to whole vectors."""
    return -(-agents // LANES) * LANES


def aligned_zeros(shape: tuple[int, ...], kind: Any) -> NDArray[Any]:
    """Zeros that begin on a cache line."""
    found: NDArray[Any] = align(np.zeros, math.prod(shape) * np.dtype(kind).itemsize).view(kind).reshape(shape)
    return found


def align(make: Callable[..., NDArray[Any]], size: int) -> NDArray[Any]:
    """So many bytes, as `make` makes them, from a cache line on."""
    room = make(size + CACHE_LINE, np.uint8)
    first = -room.__array_interface__["data"][0] % CACHE_LINE
    found: NDArray[Any] = room[first : first + size]
    return found
