"""Launch: memory for many flocks, one kernel, and what it leaves behind. Nothing else."""

import hashlib
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import lru_cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.cpu import DriverResult
from airflock.engine.cuda.block_layout import BlockLayout, block_layout
from airflock.engine.cuda.cuda_builder import PAIR_ROWS
from airflock.engine.cuda.flight_kernel import ARGUMENTS, flight_text, onset_tables, presence_results
from airflock.engine.initial_rows import law_memories, metric_memories, pair_values
from airflock.engine.numba_private.cuda_compiler import first_launch, without_occupancy_warning
from airflock.engine.passes.build import sampled_columns
from airflock.engine.passes.flock import flock_rules, scratch_sizes
from airflock.engine.plan import Plan
from airflock.engine.store import load_driver
from airflock.engine.tables import WorldTables
from airflock.engine.totals import combine_sums, goal_times
from airflock.scenarios import largest_fitting
from airflock.support import DeviceError, cuda_runtime, free_gpu_memory, is_simulated, multiprocessor_count, require_gpu

MAX_MEMORY_SHARE = 0.9  # of the free memory that may be used


def layout_of(plan: Plan, agents: int, flocks: int, processors: int = 132) -> BlockLayout:
    """Layout of flocks of one plan and size."""
    whole, apart = bool(flock_rules(plan)), bool(plan.laws) or plan.topology is not None
    return block_layout(agents, flocks, processors, sequential=plan.sequential, whole_flock=whole, apart=apart)


def array_shapes(plan: Plan, rows: int, shape: BlockLayout, tables: WorldTables) -> dict[str, tuple[int, ...]]:
    """Shapes of the arrays that a launch works on, for one flock, by argument name; rows: of the table of states."""
    whole, dims, lanes = tables.integers, plan.dimensions, shape.lanes
    n, table = whole["agents"], not shape.registers
    model = max(len(getattr(memory, "_fields", ())) for memory in plan.memories)
    kept = sum(len(getattr(metric.Memory, "_fields", ())) for metric in plan.metrics)
    return {
        "starts": (2 * dims, n) if plan.given_start else (1, 1),
        "pasts": (whole["ring"], plan.in_ring, lanes) if plan.remembers else (1, 1, 1),
        "stores": (len(plan.of_pair), lanes, lanes) if plan.packets else (2 * dims + 1, 1, 1),
        "owns": (max(len(plan.columns), 1), lanes),
        "works": (rows, lanes) if table else (1, 1),
        "all_words": (4, lanes) if table else (1, 1),
        "all_mem": (max(model, 1), lanes) if table or plan.laws else (1, 1),
        "all_memory": (max(kept, 1), lanes) if table else (1, 1),
        "states": (2 * dims, n),
        "all_sums": (len(sampled_columns(plan.metrics)) + 2 + plan.absence, 2),
        "all_reached": (max(len(tables.goals), 1),),
        "all_frames": (whole["steps"] // whole["sample_every"] + 1, 3 * dims, n) if plan.record else (1, 1, 1),
        "scratches": scratch_of(plan, tables)[0],
        "all_across": (len(PAIR_ROWS), lanes, lanes) if plan.topology is not None else (1, 1, 1),
    }


def scratch_of(plan: Plan, tables: WorldTables) -> tuple[tuple[int, int], list[int]]:
    """One table that holds all scratch arrays of a flock below each other: its shape, and the first row of each."""
    found = scratch_sizes(plan, tables.row, tables.integers["agents"])
    first, width = [0], 1
    for height, breadth in (size for sizes in found for size in sizes):
        first.append(first[-1] + height)
        width = max(width, breadth)
    return (max(first[-1], 1), width), first


def needed_bytes(plan: Plan, rows: int, shape: BlockLayout, tables: WorldTables) -> int:
    """Bytes in the GPU's memory that one such flock needs, its share of the scene included."""
    numbers = sum(int(np.prod(size)) for size in array_shapes(plan, rows, shape, tables).values())
    given: list[Any] = [tables.row, tables.whole, tables.faces, tables.edges, tables.spans, tables.goals, tables.later]
    given += [tables.shapes] if len(tables.later) else []
    return numbers * plan.bits // 8 + sum(int(array.nbytes) for array in given) + 256


def lacking(plan: Plan, rows: int, tables: WorldTables, free: int) -> str | None:
    """Why one such flock does not fit into this many free bytes: what it needs and how many agents fit; or None."""
    agents, room = tables.integers["agents"], int(MAX_MEMORY_SHARE * free)

    def bytes_of(n: int) -> int:
        return needed_bytes(plan, rows, layout_of(plan, n, 1), tables.changed(agents=n))

    # Memory is computed before anything flies, with the sizes that a launch allocates, so a refusal
    # can say what fits.
    if bytes_of(agents) <= room:
        return None
    return memory_message(agents, bytes_of(agents), room, largest_fitting(agents, lambda n: bytes_of(n) <= room))


def memory_message(agents: int, bytes_: int, room: int, fitting_agents: int) -> str:
    """The one line about it."""
    return (
        f"a flock of {agents} agents needs {bytes_ / 1e9:.3g} GB of the GPU's memory and {room / 1e9:.3g} GB are free; "
        f"about {fitting_agents} agents fit"
    )


AT_ONCE = 16_384  # flocks per launch at most: enough to fill a GPU many times over, few enough to show progress


@lru_cache(maxsize=256)
def flight_driver(plan: Plan, shape: BlockLayout) -> ModuleType:
    """Driver of a plan for one layout of flocks."""
    return load_driver(flight_text(plan, shape), f"{plan.model.name}_cuda")


def fly_many(
    plan: Plan,
    jobs: Sequence[WorldTables],
    starts: Sequence[NDArray[Any]] | None = None,
    on_done: Callable[[], None] | None = None,
    shape: BlockLayout | None = None,
) -> list[DriverResult]:
    """Fly many worlds of one plan, each from its tables; results in the order of the jobs.

    starts : (component, agent) of each world where the plan needs it
    done   : called once per flight as results come in
    shape  : layout of a flock instead of the one that suits population, flock size and GPU

    Raises DeviceError where no GPU can be used, or one flock does not fit into its memory.
    """
    require_gpu(shape is not None and shape.simulated)
    groups: dict[Any, list[int]] = {}
    # One launch flies flocks of one shape; jobs are sorted into such groups and results put back in
    # their order.
    for number, tables in enumerate(jobs):
        groups.setdefault(_alike(plan, tables), []).append(number)
    flown_by: dict[int, DriverResult] = {}
    for key, members in groups.items():
        layout = shape or layout_of(plan, key[0], len(members), multiprocessor_count())
        driver = flight_driver(plan, layout)
        size = _batch(plan, driver, layout, [jobs[m] for m in members])
        for first in range(0, len(members), size):
            batch = members[first : first + size]
            given = None if starts is None else [starts[m] for m in batch]
            flown = _fly(plan, driver, layout, [jobs[m] for m in batch], given)
            for member, result in zip(batch, flown, strict=True):
                flown_by[member] = result
                if on_done:
                    on_done()
    return [flown_by[number] for number in range(len(jobs))]


def _alike(plan: Plan, tables: WorldTables) -> tuple[Any, ...]:
    """Flights with the same key go into one launch: flock size, recorded frames, goals and scene."""
    whole = tables.integers
    frames = whole["steps"] // whole["sample_every"] if plan.record else 0
    scene = hashlib.sha256(tables.shapes.tobytes() + tables.nodes.tobytes()).digest() if len(tables.nodes) else b""
    return whole["agents"], frames, len(tables.goals), len(tables.later), scene


def _batch(plan: Plan, driver: ModuleType, shape: BlockLayout, jobs: Sequence[WorldTables]) -> int:
    """Return the number of flocks for one launch; raises DeviceError if not even one fits."""
    if shape.simulated:
        return len(jobs)
    free = free_gpu_memory()
    largest = _largest(jobs)
    fault = lacking(plan, driver.ROWS, largest, free)
    if fault is not None:
        raise DeviceError(f"device = cuda: {fault}")
    return max(
        1, min(AT_ONCE, int(MAX_MEMORY_SHARE * free) // needed_bytes(plan, driver.ROWS, shape, largest), len(jobs))
    )


def _largest(jobs: Sequence[WorldTables]) -> WorldTables:
    """That of flights of one launch whose ring of past states is the longest."""
    return max(jobs, key=lambda tables: tables.integers["ring"])


def memory_error(plan: Plan, tables: WorldTables) -> str | None:
    """Why one such flock does not fit into the GPU's free memory; None if it does."""
    layout = layout_of(plan, tables.integers["agents"], 1)
    rows = 0 if layout.registers else flight_driver(plan, layout).ROWS  # making a driver's text takes a while
    return lacking(plan, rows, tables, free_gpu_memory())


def _fly(
    plan: Plan,
    driver: ModuleType,
    shape: BlockLayout,
    jobs: Sequence[WorldTables],
    starts: Sequence[NDArray[Any]] | None,
) -> list[DriverResult]:
    """One launch."""
    own = make_arguments(plan, driver, shape, jobs, starts)
    with first_launch(driver.fly):
        configure_kernel(driver.fly, len(jobs), shape.threads)(*(own[name] for name in ARGUMENTS))
    return read_results(plan, jobs, own)


def configure_kernel(kernel: Any, blocks: int, threads: int) -> Any:
    """Return a kernel for so many blocks; here they are as many as there are flocks."""
    with nullcontext() if is_simulated() else without_occupancy_warning():
        return kernel[blocks, threads]


def make_arguments(
    plan: Plan,
    driver: ModuleType,
    shape: BlockLayout,
    jobs: Sequence[WorldTables],
    starts: Sequence[NDArray[Any]] | None,
) -> dict[str, Any]:
    """All arguments of a kernel, in the GPU's memory, by name."""
    cuda, real = cuda_runtime(), jobs[0].row.dtype
    size = array_shapes(plan, driver.ROWS, shape, _largest(jobs))
    written = ("pasts", "works", "states", "all_sums", "all_frames", "scratches", "all_across")
    own: dict[str, Any] = {name: cuda.device_array((len(jobs), *size[name]), real) for name in written}
    own["all_words"] = cuda.device_array((len(jobs), *size["all_words"]), np.uint32)
    own["statuses"] = cuda.to_device(np.full(len(jobs), -1, np.int32))
    own["all_reached"] = cuda.to_device(np.full((len(jobs), *size["all_reached"]), -1.0, real))
    places = np.zeros((len(jobs), 1, 1), real) if starts is None else np.stack([np.asarray(s, real) for s in starts])
    own["starts"] = cuda.to_device(places)
    lanes = size["all_mem"][1]
    beginning = {
        "stores": pair_values(plan, size["stores"][1], size["stores"][2], real),
        "all_mem": law_memories(plan, np.zeros(lanes, int), real),
        "all_memory": metric_memories(plan, lanes, real),
    }
    for name, one in beginning.items():
        own[name] = cuda.to_device(np.repeat(one[None, : size[name][0]], len(jobs), axis=0))
    own |= {name: cuda.to_device(array) for name, array in onset_tables(plan, jobs, real).items()}
    if plan.absence:  # who is absent has no place
        for name in ("states", "all_frames"):
            own[name] = cuda.to_device(np.full((len(jobs), *size[name]), np.nan, real))
    own["owns"] = cuda.to_device(np.stack([_wide(t.own, size["owns"], real) for t in jobs]))
    if plan.laws:
        remembered = [_remembered(plan, t, size["all_mem"], real) for t in jobs]
        own["all_mem"] = cuda.to_device(np.ascontiguousarray(np.stack(remembered)))
    if not shape.registers:
        own["works"] = cuda.to_device(np.zeros((len(jobs), *size["works"]), real))
    given = {
        "rows": np.stack([t.row for t in jobs]),
        "wholes": np.stack([t.whole for t in jobs]),
        "all_faces": _padded([t.faces for t in jobs]),
        "all_edges": _padded([t.edges for t in jobs]),
        "all_spans": _padded([t.spans for t in jobs]),
        "all_goals": _padded([t.goals for t in jobs]),
        # a scene of its own for each flock where some of it appears while flying
        "all_shapes": _padded([t.shapes for t in (jobs if any(len(t.later) for t in jobs) else jobs[:1])]),
        "all_later": _padded([t.later for t in jobs], -1.0),  # a time before the start: nothing to come
        "nodes": jobs[0].nodes.reshape(-1, 6),
        "links": jobs[0].links.reshape(-1, 3),
        "scratch_rows": np.array(scratch_of(plan, jobs[0])[1], np.int64),
    }
    own |= {name: cuda.to_device(np.ascontiguousarray(array)) for name, array in given.items()}
    return own


def read_results(plan: Plan, jobs: Sequence[WorldTables], own: dict[str, Any]) -> list[DriverResult]:
    """Results of a launch, flight by flight."""
    names = ("all_sums", "states", "statuses", *(("all_frames",) if plan.record else ()))
    names += ("all_reached",) if plan.goals else ()
    left = {name: own[name].copy_to_host() for name in names}
    count = len(sampled_columns(plan.metrics))
    found = []
    for flock, tables in enumerate(jobs):
        n = tables.integers["agents"]
        exact = left["all_sums"][flock].astype(np.float64)
        sums = exact[:, 0].copy()
        # The second number of each sum is what rounding has taken from the first.
        sums[:count] -= exact[:count, 1]  # what Kahan's sum has lost so far
        values = combine_sums(plan, sums) | goal_times(
            plan, left["all_reached"][flock][: len(tables.goals)] if plan.goals else tables.goals
        )
        frames = left["all_frames"][flock][:, :, :n] if plan.record else None
        absent, samples = None, int(sums[count])
        if plan.absence:
            flown = int(sums[count + 2])
            values["present"], absent = presence_results(tables, flown)
            samples = -(-flown // tables.integers["sample_every"])
        if frames is not None and plan.stop and (not plan.absence or flown < tables.integers["steps"]):
            frames = frames[:samples]
        found.append(
            DriverResult(values, frames, left["states"][flock][:, :n].copy(), int(left["statuses"][flock]), absent)
        )
    return found


def _padded(arrays: Sequence[NDArray[Any]], fill: float = 0.0) -> NDArray[Any]:
    """Tables of several flights in one array; short ones are filled up."""
    length = max(1, *(len(array) for array in arrays))
    found = np.full((len(arrays), length, arrays[0].shape[1]), fill, arrays[0].dtype)
    for flock, array in enumerate(arrays):
        found[flock, : len(array)] = array
    return found


def _wide(own: NDArray[Any], size: tuple[int, ...], real: Any) -> NDArray[Any]:
    """Return the numbers that differ among agents, padded with those of the last agent."""
    if not len(own):
        return np.zeros(size, real)
    return np.pad(own, ((0, 0), (0, size[1] - own.shape[1])), mode="edge").astype(real)


def _remembered(plan: Plan, tables: WorldTables, size: tuple[int, ...], real: Any) -> NDArray[Any]:
    """Return the memory of laws at the start, for each lane by its law."""
    laws = _wide(tables.own, (len(plan.columns), size[1]), np.float64)[plan.columns.index(("", "law"))]
    return law_memories(plan, laws.astype(np.int64), real)[: size[0]]
