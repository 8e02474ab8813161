"""Initial rows: what agents and pairs carry before they have flown or heard anything."""

from itertools import accumulate
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.core import initial_values
from airflock.engine.plan import Plan


def metric_memories(plan: Plan, m: int, real: Any) -> NDArray[Any]:
    """Return the initial memories of metrics, (field, lane)."""
    blocks = [memory_defaults(metric.Memory, m, real) for metric in plan.metrics if metric.Memory is not None]
    return np.concatenate(blocks) if blocks else np.zeros((1, m), real)


def metric_memory_rows(plan: Plan) -> dict[tuple[str, Any], slice]:
    """Where what each metric remembers lies among what all of them do, by its name and record."""
    counts = [len(initial_values(metric.Memory)) for metric in plan.metrics]
    rows = (slice(end - count, end) for end, count in zip(accumulate(counts), counts, strict=True))
    return {(metric.name, metric.Memory): own for metric, own in zip(plan.metrics, rows, strict=True)}


def law_memories(plan: Plan, laws: NDArray[Any], real: Any) -> NDArray[Any]:
    """Return the initial memories of laws, (field, lane), each lane by its law; laws : law of each lane."""
    found = [memory_defaults(record, 1, real)[:, 0] for record in plan.memories]
    table = np.zeros((max(map(len, found)), len(found)), real)
    for law, values in enumerate(found):
        table[: len(values), law] = values
    return table[:, laws]


def memory_defaults(record: Any, m: int, real: Any) -> NDArray[Any]:
    """The defaults of a Memory for each of m lanes: (field, lane)."""
    return np.repeat(np.array(initial_values(record) or (0.0,), real)[:, None], m, axis=1)


def pair_values(plan: Plan, receivers: int, senders: int, real: Any) -> NDArray[Any]:
    """Return the record of pairs that have heard nothing of each other: (number, receiver, sender)."""
    return np.tile(np.array(plan.of_pair, real)[:, None, None], (1, receivers, senders))
