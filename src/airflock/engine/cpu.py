"""CPU: drivers compiled, one flight flown from its start to its end, recordings measured."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.driver_state import DriverState
from airflock.engine.drivers import compile_messages, driver_of
from airflock.engine.plan import Plan
from airflock.engine.tables import WorldTables
from airflock.support import check_interrupted


@dataclass(frozen=True)
class DriverResult:
    """Result of a driver.

    values : order parameters combined over time, and the time to each goal (a list, s; nan: never)
    frames : (time, component, agent) or None
    state  : (component, agent) position and velocity at the end; status : 0, or minus the agent
             that found no room
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


def fly_on_cpu(plan: Plan, tables: WorldTables, start: NDArray[Any] | None = None, device: str = "cpu") -> DriverResult:
    """Fly one world from its tables, from step 0 to its end.

    start : (component, agent), m and m/s, where the plan asks for it
    """
    state = DriverState(plan, tables, driver_of(plan, device), start)
    status, frames = fly_steps(state, 0, state.whole("steps") + 1, plan.record)
    return DriverResult(state.values(), frames, state.motion, min(status, 0), ~state.present if plan.absence else None)


BEAT = 0.1  # s; about how long a compiled call flies until Ctrl-C and the like are heard
FIRST = 200_000  # agents times steps of the first of them; some 10 ms


def fly_steps(
    state: DriverState, first: int, last: int, record: bool, half: int = 0
) -> tuple[int, NDArray[Any] | None]:
    """Fly the steps first to last - 1 in parts of about BEAT, between which an interruption is heard.

    Returns the next step, or minus the first agent (from 1) that found no place; and, if they are
    to be recorded, the samples of these steps: (sample, component, agent).
    """
    steps, step, every = max(1, FIRST // state.agents), first, state.whole("sample_every")
    # Samples from `first` on and before `last`: both ends are rounded up, so that no cut of a
    # flight counts one twice.
    skipped, frames = -(-first // every), None
    if record:
        shape = (-(-last // every) - skipped, 3 * state.plan.dimensions, state.agents)
        frames = np.full(shape, np.nan, state.tables.row.dtype)
    with compile_messages(state.driver.advance, state.plan.model.name):
        while step < last and not state.has_ended:
            check_interrupted()
            part, begun = min(step + steps, last), time.monotonic()
            rest = None if frames is None else frames[-(-step // every) - skipped :]
            done = state.advance(step, part, half, rest)
            if done < 0:
                return done, frames
            step, half = done, 0
            steps = max(1, int(steps * min(8.0, BEAT / max(time.monotonic() - begun, 1e-6))))
    if frames is not None and state.has_ended:
        frames = frames[: -(-step // every) - skipped]
    return step, frames
