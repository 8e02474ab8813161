"""Measuring: order parameters of frames that are known, flown or recorded, by the very stages of a flight."""

from dataclasses import replace
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine import interpreted
from airflock.engine.driver_state import DriverState
from airflock.engine.drivers import compile_messages
from airflock.engine.passes.build import sampled_columns
from airflock.engine.passes.driver import replay
from airflock.engine.plan import Plan, plan_of
from airflock.engine.store import load_driver
from airflock.engine.tables import WorldTables, world_tables
from airflock.scenarios import Scenario

READ = ("q", "w")  # letters of the numbers of order parameters, and of the arena


@cache
def replay_driver(plan: Plan) -> ModuleType:
    """Compiled driver that measures recordings."""
    return load_driver(replay(plan), "recordings")


def measure_frames(
    scenario: Scenario,
    frames: NDArray[Any],
    period: float,
    *,
    precision: int = 64,
    every: tuple[int, int] = (1, 1),
    present: NDArray[np.bool_] | None = None,
    device: str = "cpu",
) -> tuple[dict[str, Any], dict[str, NDArray[np.float64]]]:
    """Score frames (time, component, agent), period s apart: values over all time, and of every instant by name.

    every   : instants from sample to sample, and from one look at collisions to the next
    present : (time, agent), whether an agent is there at all; by default all are. An instant counts
              with those who are there, one with fewer than two of several does not (nan); what a
              metric remembers of an agent waits for it
    """
    plan = plan_of(scenario, precision=precision)
    steps = {"sample_every": every[0], "collide_every": every[1]}
    numbers = world_tables(scenario, plan, 0).changed(agents=frames.shape[2], **steps)
    values, series = score_tables(plan, numbers, frames, period, device, present)
    names = (name for name, _, _ in sampled_columns(plan.metrics))
    return values, dict(zip(names, series.T, strict=True))


def score_tables(
    plan: Plan,
    tables: WorldTables,
    frames: NDArray[Any],
    period: float = 0.0,
    device: str = "cpu",
    present: NDArray[np.bool_] | None = None,
) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """Score frames from the numbers of a world; the values of every instant as (time, value)."""
    plan, tables = shared_plan(plan, tables)
    driver = interpreted.replay_driver(plan) if device == "python" else replay_driver(plan)
    real = tables.row.dtype
    state = DriverState(plan, tables, driver)
    own = state.arrays
    series = np.full((frames.shape[0], len(own["values"])), np.nan)

    def measure(first: int, part: NDArray[Any]) -> None:
        with compile_messages(driver.measure_frames, plan.model.name):
            driver.measure_frames(
                first, tables.row, own["whole"], tables.edges, tables.spans, state.scene, own["work"], own["memory"],
                own["labels"], own["values"], own["sums"], np.ascontiguousarray(part, real), series, real.type(period),
                *state.scratch, *state.cells,
            )  # fmt: skip

    if present is None or present.all():
        measure(0, frames)
        return state.values(), series
    remembered = own["memory"][:, : frames.shape[2]].copy()
    looked = [driver.ROWS[name] for name in (f"before_{axis}" for axis in plan.axes) if name in driver.ROWS]
    before, known = np.zeros((len(looked), frames.shape[2]), real), np.zeros(frames.shape[2], bool)
    for first, last in _runs(present):
        there = np.flatnonzero(present[first])
        if len(there) >= min(2, frames.shape[2]):
            lanes = slice(0, len(there))
            state.set_integer("agents", len(there))
            own["memory"][:, lanes] = remembered[:, there]
            # who was away has come no way that anybody saw
            own["work"][looked, lanes] = np.where(known, before, frames[first, : len(looked)])[:, there]
            measure(first, frames[first:last][:, :, there])
            remembered[:, there], before[:, there] = own["memory"][:, lanes], own["work"][looked, lanes]
        known = present[first] if len(there) >= min(2, frames.shape[2]) else np.zeros_like(known)
    return state.values(), series


def shared_plan(plan: Plan, tables: WorldTables) -> tuple[Plan, WorldTables]:
    """Reorder numbers so that those of order parameters come first: one driver then measures flights of all laws.

    Of a law it would tell only how many numbers stand before those of the arena.
    """
    found = dict(plan.numbers)
    order = sorted(found, key=lambda letter: (letter not in READ, letter))
    places = [place for letter in order for place in range(plan.spans[letter].start, plan.spans[letter].stop)]
    numbers = tuple((letter, found[letter]) for letter in order)
    return replace(plan, numbers=numbers), replace(tables, row=np.ascontiguousarray(tables.row[places]))


def _runs(present: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last instant (exclusive) of each stretch in which the same agents are there."""
    changes = np.flatnonzero((present[1:] != present[:-1]).any(axis=1)) + 1
    borders = [0, *changes.tolist(), len(present)]
    return list(zip(borders[:-1], borders[1:], strict=True))
