"""State: where a flight stands, its memory and the driver that flies it on, with what is due on the way."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airflock.engine.drivers import compile_messages, device_of, driver_of
from airflock.engine.fault_columns import begin_fault, still_has_fault
from airflock.engine.flight_memory import DriverMemory
from airflock.engine.plan import Plan
from airflock.engine.presence import remove_agents
from airflock.engine.stages.approach import BEGUN
from airflock.engine.tables import WorldTables, world_tables
from airflock.engine.totals import combine_sums, goal_times
from airflock.scenarios import FaultOnset, Scenario


class DriverState(DriverMemory):
    """A flight as its driver flies it, step by step."""

    def compile(self) -> "DriverState":
        """Have the driver compiled; nothing is flown, and agents get no places. Returns the state."""
        marks = self.arrays["held"]
        begun, marks[BEGUN] = marks[BEGUN], 1.0
        with compile_messages(self.driver, self.plan.model.name):
            self.advance(0, 0)
        marks[BEGUN] = begun
        return self

    @classmethod
    def of(
        cls, plan: Plan, scenario: Scenario, seed: int = 0, world: int = 0, start: Any = None, device: str = "cpu"
    ) -> "DriverState":
        """State before the first step of a scenario by its plan.

        start  : positions and velocities, (component, agent) in m and m/s, where the plan asks for them
        device : cpu, or python, uncompiled
        """
        return cls(plan, world_tables(scenario, plan, seed, world), driver_of(plan, device), start)

    def copy(self) -> "DriverState":
        """The same state in memory of its own."""
        made = DriverState(self.plan, self.tables, self.driver, self.start)
        made.buffer[:] = self.buffer
        return made

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled without its driver, which another process makes, or has, of the same plan."""
        return _again, (self.plan, self.tables, device_of(self.driver), self.start, self.buffer)

    def set_onsets(self, due: tuple[FaultOnset, ...]) -> None:
        """Have these faults to come, instead of those before."""
        self.tables = replace(self.tables, due=due)

    def advance(self, first: int, last: int, half: int = 0, frames: NDArray[Any] | None = None) -> int:
        """Fly the steps first to last - 1; returns the next step, or minus the first agent (from 1) without a place.

        half   : as in `passes.driver.flight`
        frames : (sample, component, agent), filled with the samples of these steps; None keeps none

        It stops on the way where a fault is due. What is due at a step is done before it is flown or sensed.
        """
        due = sorted({onset.step for onset in self.tables.due if first <= onset.step < last}) if self.tables.due else []
        if not due:
            return self._watched(first, last, half, frames)
        step, skipped, every = first, -(-first // self.whole("sample_every")), self.whole("sample_every")
        for stop in [*(step for step in due if step > first or not half & 1), last]:
            if step < stop or stop == last:
                rest = None if frames is None else frames[-(-step // every) - skipped :]
                done = self._watched(step, stop, half, rest)
                if done != stop or stop == last:
                    return done
                step, half = stop, 0
            self._strike(stop)
        return step

    def _strike(self, step: int) -> None:
        """Let begin what is due before a step."""
        if not self.begun and self._fly(step, step, 0, None) < 0:
            return  # said when the step is flown
        for onset in self.tables.due:
            if onset.step == step and onset.leaves:
                remove_agents(self, [onset.agent] if still_has_fault(self, onset) else [])
            elif onset.step == step:
                begin_fault(self, onset)

    def _watched(self, first: int, last: int, half: int, frames: NDArray[Any] | None) -> int:
        """Fly some steps; who has come to the ground with an empty battery is put away before the next one."""
        landing, every = self.tables.ground_contact, self.whole("sample_every")
        if landing is None or first == last:
            return self._fly(first, last, half, frames)
        if not self.begun and (unplaced := self._fly(first, first, 0, None)) < 0:
            return unplaced
        step, skipped = first, -(-first // every)
        while step < last:
            if step > first or not half & 1:  # else that was done before this step was sensed
                landing.land(self)
            stop = min(last, step + landing.steps_without_landing(self))
            rest = None if frames is None else frames[-(-step // every) - skipped :]
            done = self._fly(step, stop, half, rest)
            if done != stop:
                return done
            step, half = stop, 0
        return step

    def _fly(self, first: int, last: int, half: int, frames: NDArray[Any] | None) -> int:
        """One call of the driver. An instant with fewer than two of several agents is not counted."""
        few = self.plan.absence and self.begun and self.here < min(2, self.agents)
        if few and not self.here:
            self.arrays["there"][1] += self.agents * (last - first)  # time passes
            return last
        kept = self.arrays["sums"].copy() if few else None
        done = int(self.driver.advance(*self.arguments(first, last, half, frames)))
        if kept is not None:
            self.arrays["sums"][:] = kept
        if self.plan.absence and not half & 2:
            instants = max(done - first, 0) + int(self.has_ended)  # that of a collision, too, at which the flight ends
            there = self.arrays["there"]
            there[0] += self.here * instants
            there[1] += self.agents * instants
        return done

    def values(self) -> dict[str, Any]:
        """Order parameters over the time that the sums hold, and when each goal was reached."""
        found = combine_sums(self.plan, self.arrays["sums"]) | goal_times(self.plan, self.arrays["reached"])
        if self.plan.absence:
            there, of = self.arrays["there"].tolist()
            found["present"] = there / of if of else 1.0
        return found


def _again(plan: Plan, tables: WorldTables, device: str, start: NDArray[Any], buffer: NDArray[np.uint8]) -> DriverState:
    """A state out of a pickle."""
    made = DriverState(plan, tables, driver_of(plan, device), start)
    made.buffer[:] = buffer
    return made
