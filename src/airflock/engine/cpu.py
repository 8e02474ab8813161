"""CPU: drivers compiled, one flight flown from its start to its end, recordings measured."""

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine import interpreted
from airflock.engine.passes.driver import flight, replay
from airflock.engine.plan import Plan
from airflock.engine.state import State
from airflock.engine.store import load_driver
from airflock.engine.tables import Tables
from airflock.errors import RuleError
from airflock.threads import heed


@dataclass(frozen=True)
class Flown:
    """What a driver leaves behind.

    values : order parameters combined over time, and the time to each goal (a list, s; nan: never)
    frames : (time, component, agent) or None
    state  : (component, agent) position and velocity at the end; status : 0, or minus the agent that found no room
    absent : of each agent whether it is absent at the end; None where nobody can be
    """

    values: dict[str, Any]
    frames: NDArray[Any] | None
    state: NDArray[Any]
    status: int
    absent: NDArray[np.bool_] | None = None

    @property
    def present(self) -> Any:
        """Of each agent whether it is there at the end; True where all are."""
        return True if self.absent is None else ~self.absent


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


def is_loaded(driver: ModuleType) -> bool:
    """Whether a driver flies at once: it has been compiled or read in this process, or is interpreted."""
    return bool(getattr(driver.advance, "overloads", True))


def is_compiled(driver: ModuleType) -> bool:
    """Whether a driver flies without being compiled first: in this process, or from what an earlier one has kept."""
    return is_loaded(driver) or any(Path(driver.advance.stats.cache_path).glob("*.nbi"))


def fly(plan: Plan, tables: Tables, start: NDArray[Any] | None = None, device: str = "cpu") -> Flown:
    """Fly one world from its tables, from step 0 to its end.

    start : (component, agent), m and m/s, where the plan asks for it
    """
    state = State(plan, tables, driver_of(plan, device), start)
    steps, every = state.whole("steps"), state.whole("sample_every")
    frames = (
        np.full((steps // every + 1, 3 * plan.dimensions, state.agents), np.nan, tables.row.dtype)
        if plan.record
        else None
    )
    with flying(state):
        status = advance(state, 0, steps + 1, frames)
    if frames is not None and state.ended:
        frames = frames[: -(-status // every)]
    return Flown(state.values(), frames, state.motion, min(status, 0), ~state.present if plan.absence else None)


BEAT = 0.1  # s; about how long a compiled call flies until Ctrl-C and the like are heard
FIRST = 200_000  # agents times steps of the first of them; some 10 ms


def advance(state: State, first: int, last: int, frames: NDArray[Any] | None = None, half: int = 0) -> int:
    """Fly the steps first to last - 1 in parts of about BEAT, between which an interruption is heard.

    frames : (sample, component, agent) for all samples of these steps, or None
    Returns the next step, or minus the first agent (from 1) that found no place.
    """
    steps, step, every = max(1, FIRST // state.agents), first, state.whole("sample_every")
    skipped = -(-first // every)
    while step < last and not state.ended:
        heed()
        part, begun = min(step + steps, last), time.monotonic()
        rest = None if frames is None else frames[-(-step // every) - skipped :]
        done = state.advance(step, part, half, rest)
        if done < 0:
            return done
        step, half = done, 0
        steps = max(1, int(steps * min(8.0, BEAT / max(time.monotonic() - begun, 1e-6))))
    return step


def flying(state: State) -> AbstractContextManager[None]:
    """Around calls of a state's driver: `compiling`, if it has to be compiled first."""
    return nullcontext() if is_loaded(state.driver) else compiling(state.plan.model.name)


@contextmanager
def compiling(model: str) -> Iterator[None]:
    """Turn what the compiler says of a rule into one line; an interruption is heard after each of its passes.

    Raises RuleError, GivenUp.
    """
    from numba.core.errors import NumbaError
    from numba.core.event import install_listener

    from airflock.engine.heeding import Heeding

    try:
        with install_listener("numba:run_pass", Heeding()):
            yield
    except NumbaError as fault:
        lines = [line.strip() for line in str(fault).splitlines()]
        said = next((line for line in lines if line and not line.startswith(("Failed in", "During", "File"))), "")
        raise RuleError(f"model {model}: a rule does not compile, though plain Python takes it: {said}") from fault


def measure_frames(
    plan: Plan,
    tables: Tables,
    frames: NDArray[Any],
    period: float = 0.0,
    device: str = "cpu",
    present: NDArray[np.bool_] | None = None,
) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """Score frames (time, component, agent), period s apart: combined values, and the values of every instant.

    present : (time, agent), whether an agent is there at all; by default all are. An instant counts with those who are
              there, one with fewer than two of several does not (nan); what a metric remembers of an agent waits for it
    """
    driver = interpreted.replay_driver(plan) if device == "python" else replay_driver(plan)
    real = tables.row.dtype
    state = State(plan, tables, driver)
    own = state.arrays
    series = np.full((frames.shape[0], len(own["values"])), np.nan)

    def measured(first: int, part: NDArray[Any]) -> None:
        driver.measure_frames(
            first, tables.row, own["whole"], tables.edges, tables.spans, state.scene, own["work"], own["memory"],
            own["labels"], own["values"], own["sums"], np.ascontiguousarray(part, real), series, real.type(period),
            *state.scratch,
        )  # fmt: skip

    if present is None or present.all():
        measured(0, frames)
        return state.values(), series
    remembered = own["memory"][:, : frames.shape[2]].copy()
    for first, last in _runs(present):
        there = np.flatnonzero(present[first])
        if len(there) >= min(2, frames.shape[2]):
            state.set_whole("agents", len(there))
            own["memory"][:, : len(there)] = remembered[:, there]
            measured(first, frames[first:last][:, :, there])
            remembered[:, there] = own["memory"][:, : len(there)]
    return state.values(), series


def _runs(present: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last instant (exclusive) of each stretch in which the same agents are there."""
    changes = np.flatnonzero((present[1:] != present[:-1]).any(axis=1)) + 1
    borders = [0, *changes.tolist(), len(present)]
    return list(zip(borders[:-1], borders[1:], strict=True))
