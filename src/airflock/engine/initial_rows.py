"""Initial rows: what agents and pairs carry before they have flown or heard anything."""

from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core.contract.own_records import beginnings_of
from airflock.engine.plan import Plan


def memories(plan: Plan, m: int, real: Any) -> NDArray[Any]:
    """What metrics remember of each agent, at its start: (field, lane)."""
    blocks = [beginning(metric.Memory, m, real) for metric in plan.metrics if metric.Memory is not None]
    return np.concatenate(blocks) if blocks else np.zeros((1, m), real)


def rows_of_metrics(plan: Plan) -> dict[tuple[str, Any], slice]:
    """Where what each metric remembers lies among what all of them do, by its name and record."""
    counts = [len(beginnings_of(metric.Memory)) for metric in plan.metrics]
    rows = (slice(end - count, end) for end, count in zip(accumulate(counts), counts, strict=True))
    return {(metric.name, metric.Memory): own for metric, own in zip(plan.metrics, rows, strict=True)}


def first_memories(plan: Plan, laws: NDArray[Any], real: Any) -> NDArray[Any]:
    """What laws remember at the start, (field, lane): of each lane what its law does; laws : number of each lane's."""
    found = [beginning(record, 1, real)[:, 0] for record in plan.memories]
    table = np.zeros((max(map(len, found)), len(found)), real)
    for law, values in enumerate(found):
        table[: len(values), law] = values
    return table[:, laws]


def beginning(record: Any, m: int, real: Any) -> NDArray[Any]:
    """The defaults of a Memory for each of m lanes: (field, lane)."""
    return np.repeat(np.array(beginnings_of(record) or (0.0,), real)[:, None], m, axis=1)


def of_pairs(plan: Plan, receivers: int, senders: int, real: Any) -> NDArray[Any]:
    """What is kept of pairs of agents that have heard nothing of each other: (number, receiver, sender)."""
    return np.tile(np.array(plan.of_pair, real)[:, None, None], (1, receivers, senders))
