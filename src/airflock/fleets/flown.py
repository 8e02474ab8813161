"""Flown: a fleet that has flown on the real clock, as recordings take it, and what that cost the computer."""

import hashlib
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.drones import MissionPhase
from airflock.fleets.live import NEVER_HEARD, RealtimePlan, TaskResult
from airflock.fleets.starting import law_zero_height

ABSENT_ROW = (math.nan,) * 15  # a row of a drone that has dropped out


class ComputerLoad(NamedTuple):
    """What a fleet on the real clock cost, and how late it was.

    cores : processor time of all per second; nodes, vehicles: of these (with the ether), where they are processes
    ticks, late, worst : of all nodes: how many, how many late by more than half a period, by how much at most (s)
    others : load of this computer (processes that want a processor, one minute) when the flight ended
    """

    cores: float
    nodes: float | None
    vehicles: float | None
    ticks: int
    late: int
    worst: float
    others: float


class RealtimeFleet:
    """A fleet that has flown on the real clock; recorded like one in lock-step."""

    def __init__(self, plan: RealtimePlan, lives: Sequence[TaskResult], load: ComputerLoad):
        self.scenario, self.card, self.seed, self.faults = plan.scenario, plan.card, plan.seed, plan.faults
        self.load = load
        count = len(plan.card.members)
        self._nodes, self._vehicles = lives[1 : 1 + count], lives[1 + count :]
        self.log = sorted((t - plan.clock[0], who, note) for life in lives[1:] for t, who, note in life.notes)

    @property
    def law_zero_height(self) -> float:
        """Height (m) above the site at which the law counts zero."""
        return law_zero_height(self.card)

    def _frame_count(self) -> int:
        return min(len(life.rows) for life in self._vehicles)

    def array(self) -> NDArray[np.float64]:
        """(time, agent, 15): true position and velocity, setpoint, own position and velocity as the node knows them.

        Of drones that have dropped out nan, as in the recording of a simulation.
        """
        frames = [
            [
                ABSENT_ROW
                if _has_dropped_out(craft, k)
                else (*craft.rows[k], *_row_part_at(node.rows, k, 0, (0.0,) * 9))
                for craft, node in self._pairs()
            ]
            for k in range(self._frame_count())
        ]
        return np.array(frames, float)

    def packet_ages(self) -> NDArray[np.float64]:
        """(time, receiver, sender): s since the state that a node has of another one held; nan: it has none."""
        never = [NEVER_HEARD] * len(self.card.members)
        stamps = np.array(
            [
                [
                    never if _has_dropped_out(craft, k) else _row_part_at(node.rows, k, 1, never)
                    for craft, node in self._pairs()
                ]
                for k in range(self._frame_count())
            ]
        )
        times = self.card.period * np.arange(len(stamps))
        return np.where(stamps > 0.1 * NEVER_HEARD, times[:, None, None] - stamps, np.nan)

    def _pairs(self) -> Any:
        return zip(self._vehicles, self._nodes, strict=True)

    def digest(self) -> str:
        """SHA-256 of all that was flown."""
        return hashlib.sha256(self.array().tobytes()).hexdigest()

    def phases(self) -> list[MissionPhase]:
        """Phase in which every node ended."""
        return [life.phase for life in self._nodes]


def _row_part_at(rows: Sequence[Any], k: int, part: int, none: Any) -> Any:
    """What a node said at period k; where it has died, what it said last."""
    return rows[min(k, len(rows) - 1)][part] if rows else none


def _has_dropped_out(craft: TaskResult, k: int) -> bool:
    """Whether a vehicle has dropped out by period k."""
    return bool(math.isnan(craft.rows[k][0]))
