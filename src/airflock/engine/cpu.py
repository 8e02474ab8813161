"""CPU: memory for one flight, one compiled call, many flights side by side in threads. Nothing else."""

import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine import interpreted
from airflock.engine.passes import grid
from airflock.engine.passes.build import columns
from airflock.engine.passes.driver import flight, replay
from airflock.engine.passes.flock import scratch
from airflock.engine.passes.scene import NEAR
from airflock.engine.plan import WHOLE, Plan
from airflock.engine.store import load_driver
from airflock.engine.tables import Tables
from airflock.errors import RuleError

LANES = 16  # rows are padded to whole vectors of the widest machine
LINE = 64  # bytes of a cache line: a vector that lies across two costs two loads


@dataclass(frozen=True)
class Flown:
    """What a driver leaves behind.

    values : order parameters combined over time, and the time to each goal (a list, s; nan: never)
    frames : (time, component, agent) or None
    state  : (component, agent) position and velocity at the end; status : 0, or minus the agent that found no room
    """

    values: dict[str, Any]
    frames: NDArray[Any] | None
    state: NDArray[Any]
    status: int


@cache
def flight_driver(plan: Plan) -> ModuleType:
    """Compiled driver of a plan."""
    return load_driver(flight(plan), plan.model.name)


@cache
def replay_driver(plan: Plan) -> ModuleType:
    """Compiled driver that measures recordings."""
    return load_driver(replay(plan), "recordings")


def driver_of(plan: Plan, device: str = "cpu") -> ModuleType:
    """Driver of a plan: compiled, or with device = python its text as plain Python."""
    return interpreted.flight_driver(plan) if device == "python" else flight_driver(plan)


def fly(plan: Plan, tables: Tables, start: NDArray[Any] | None = None, device: str = "cpu") -> Flown:
    """Fly one world from its tables; `start` is (component, agent) where the plan asks for it."""
    driver = driver_of(plan, device)
    real = tables.row.dtype
    whole = dict(zip(WHOLE, tables.whole.tolist(), strict=True))
    n, dims = whole["agents"], plan.dimensions
    m = -(-n // LANES) * LANES
    work, words, gust = _rows((driver.ROWS, m), real), _rows((4, m), np.uint32), np.zeros(3, real)
    past = _rows((whole["ring"], 2 * dims, m), real)
    store = np.zeros((n, 2 * dims + 1, m), real) if plan.links else np.zeros((1, 2 * dims + 1, 1), real)
    store[:, 2 * dims] = -1e9
    memory = _memory(plan, m, real)
    mem = _starts(plan.model.Memory, m, real)
    labels = _rows((2, m), np.int32 if plan.bits == 32 else np.int64)
    values, sums = _sums(plan)
    frames = np.zeros((whole["steps"] // whole["sample_every"] + 1, 3 * dims, n), real) if plan.record else None
    scene = _scene(tables)
    with compiling(plan.model.name) if device == "cpu" else nullcontext():
        status = driver.fly(
            tables.row, tables.whole, tables.faces, tables.edges, tables.spans, scene,
            np.zeros((2 * dims, n), real) if start is None else np.ascontiguousarray(start, real),
            work, words, past, store, gust, mem, memory, labels, values, sums,
            np.zeros((1, 3 * dims, n), real) if frames is None else frames, *scratch(plan, tables.row, n),
            *grid.memory(plan, n, _rows),
        )  # fmt: skip
    if frames is not None and plan.stop:
        frames = frames[: int(sums[len(columns(plan.metrics))])]
    return Flown(combined(plan, sums) | goals_reached(plan, scene[7]), frames, work[: 2 * dims, :n].copy(), int(status))


@contextmanager
def compiling(model: str) -> Iterator[None]:
    """Turn what the compiler says of a rule into one line. Raises RuleError."""
    from numba.core.errors import NumbaError

    try:
        yield
    except NumbaError as fault:
        lines = [line.strip() for line in str(fault).splitlines()]
        said = next((line for line in lines if line and not line.startswith(("Failed in", "During", "File"))), "")
        raise RuleError(f"model {model}: a rule does not compile, though plain Python takes it: {said}") from fault


def measure_frames(
    plan: Plan, tables: Tables, frames: NDArray[Any], period: float = 0.0, device: str = "cpu"
) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """Score frames (time, component, agent), period s apart: combined values, and the values of every instant."""
    driver = interpreted.replay_driver(plan) if device == "python" else replay_driver(plan)
    real = tables.row.dtype
    m = -(-frames.shape[2] // LANES) * LANES
    values, sums = _sums(plan)
    scene = _scene(tables)
    series = np.full((frames.shape[0], len(values)), np.nan)
    driver.measure_frames(
        tables.row, tables.whole, tables.edges, tables.spans, scene, _rows((driver.ROWS, m), real),
        _memory(plan, m, real), _rows((2, m), np.int32 if plan.bits == 32 else np.int64), values, sums,
        np.ascontiguousarray(frames, real), series, real.type(period),
        *scratch(plan, tables.row, frames.shape[2]),
    )  # fmt: skip
    return combined(plan, sums) | goals_reached(plan, scene[7]), series


def _rows(shape: tuple[int, ...], kind: Any) -> NDArray[Any]:
    """Zeros whose rows begin on a cache line."""
    count = math.prod(shape) * np.dtype(kind).itemsize
    room = np.zeros(count + LINE, np.uint8)
    first = -room.ctypes.data % LINE
    rows: NDArray[Any] = room[first : first + count].view(kind).reshape(shape)
    return rows


def _scene(tables: Tables) -> tuple[NDArray[Any], ...]:
    """What stands in the world and what is noted of it on the way, as `passes.scene` takes it."""
    real = tables.row.dtype
    aim, reached = np.zeros(4, real), np.full(len(tables.goals), -1.0, real)
    aim[:3] = tables.goals[0] if len(tables.goals) else 0.0
    near, counts = np.zeros(NEAR, np.int64), np.zeros(2, np.int64)
    later, shapes = tables.later.copy(), tables.shapes.copy() if len(tables.later) else tables.shapes
    return shapes, tables.nodes, tables.links, near, counts, tables.goals, aim, reached, later


def goals_reached(plan: Plan, reached: NDArray[Any]) -> dict[str, Any]:
    """When each goal was reached, s (nan: never), and how many were."""
    if not plan.goals:
        return {}
    times = [float(t) if t >= 0.0 else math.nan for t in reached]
    return {"goals_reached": float(sum(t == t for t in times)), "goals": float(len(times)), "time_to_goal": times}


def _memory(plan: Plan, m: int, real: Any) -> NDArray[Any]:
    blocks = [_starts(metric.Memory, m, real) for metric in plan.metrics if metric.Memory is not None]
    return np.concatenate(blocks) if blocks else np.zeros((1, m), real)


def _starts(record: Any, m: int, real: Any) -> NDArray[Any]:
    starts = list(getattr(record, "_field_defaults", {}).values()) or [0.0]
    return np.repeat(np.array(starts, real)[:, None], m, axis=1)


def _sums(plan: Plan) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    start = {"min": 1e30, "max": -1e30}
    found = [start.get(how, 0.0) for _, how, _ in columns(plan.metrics)]
    return np.zeros(len(found)), np.array([*found, 0.0, 0.0])


def combined(plan: Plan, sums: NDArray[np.float64]) -> dict[str, float]:
    """Named order parameters from the sums over time."""
    found = columns(plan.metrics)
    counts = {"sample": sums[len(found)], "collision": sums[len(found) + 1]}
    over_time = {
        name: float(sums[c] / max(counts[when], 1.0) if how == "mean" else sums[c])
        for c, (name, how, when) in enumerate(found)
    }
    named: dict[str, float] = {}
    for metric in plan.metrics:
        own = {name: over_time[name] for name in metric.Sample._fields}  # type: ignore[attr-defined]
        named |= metric.total(own) if metric.total else own
    return named


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_threads(
    jobs: Sequence[Callable[[], Any]], threads: int | None = None, done: Callable[[], None] | None = None
) -> Iterator[Any]:
    """Results of jobs in their order, computed by several threads (compiled flights release the interpreter).

    `done` is called after each. Ctrl-C waits only for the flights in the air.
    """
    workers = max(1, min(threads or cores(), len(jobs)))
    if workers == 1:
        for job in jobs:
            yield job()
            if done:
                done()
        return
    with ThreadPoolExecutor(workers) as pool:
        futures: list[Future[Any]] = [pool.submit(job) for job in jobs]
        waiting = set(futures)
        try:
            for future in futures:
                while not future.done():
                    ready, waiting = wait(waiting, timeout=0.2, return_when=FIRST_COMPLETED)
                    for _ in ready:
                        if done:
                            done()
                yield future.result()
            if done:
                for _ in waiting:
                    done()
        finally:
            for future in futures:
                future.cancel()
