"""Flown: a fleet that has flown on the real clock, as recordings take it, and what that cost the computer."""

import hashlib
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from airflock.drones.onboard.mission import Phase
from airflock.fleets.live import NEVER, Life, Plan
from airflock.fleets.starting import lift_of

ABSENT = (math.nan,) * 15  # a row of a drone that has dropped out


class Load(NamedTuple):
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


class Flown:
    """A fleet that has flown on the real clock; recorded like one in lock-step."""

    def __init__(self, plan: Plan, lives: Sequence[Life], load: Load):
        self.scenario, self.card, self.seed, self.faults = plan.scenario, plan.card, plan.seed, plan.faults
        self.load = load
        count = len(plan.card.members)
        self._nodes, self._crafts = lives[1 : 1 + count], lives[1 + count :]
        self.log = sorted((t - plan.clock[0], who, note) for life in lives[1:] for t, who, note in life.notes)

    @property
    def lift(self) -> float:
        """Height (m) above the site at which the law counts zero."""
        return lift_of(self.card)

    def _frames(self) -> int:
        return min(len(life.rows) for life in self._crafts)

    def array(self) -> NDArray[np.float64]:
        """(time, agent, 15): true position and velocity, setpoint, own position and velocity as the node knows them.

        Of drones that have dropped out nan, as in the recording of a simulation.
        """
        frames = [
            [
                ABSENT if _gone(craft, k) else (*craft.rows[k], *_at(node.rows, k, 0, (0.0,) * 9))
                for craft, node in self._pairs()
            ]
            for k in range(self._frames())
        ]
        return np.array(frames, float)

    def ages(self) -> NDArray[np.float64]:
        """(time, receiver, sender): s since the state that a node has of another one held; nan: it has none."""
        never = [NEVER] * len(self.card.members)
        stamps = np.array(
            [
                [never if _gone(craft, k) else _at(node.rows, k, 1, never) for craft, node in self._pairs()]
                for k in range(self._frames())
            ]
        )
        times = self.card.period * np.arange(len(stamps))
        return np.where(stamps > 0.1 * NEVER, times[:, None, None] - stamps, np.nan)

    def _pairs(self) -> Any:
        return zip(self._crafts, self._nodes, strict=True)

    def digest(self) -> str:
        """SHA-256 of all that was flown."""
        return hashlib.sha256(self.array().tobytes()).hexdigest()

    def phases(self) -> list[Phase]:
        """Phase in which every node ended."""
        return [life.phase for life in self._nodes]


def _at(rows: Sequence[Any], k: int, part: int, none: Any) -> Any:
    """What a node said at period k; where it has died, what it said last."""
    return rows[min(k, len(rows) - 1)][part] if rows else none


def _gone(craft: Life, k: int) -> bool:
    """Whether a vehicle has dropped out by period k."""
    return bool(math.isnan(craft.rows[k][0]))
