"""What one agent perceives beside its neighbours: a map that answers, and random numbers of its own."""

from collections.abc import Iterable
from typing import Protocol, Self

from airflock.core import random
from airflock.core.agent import State
from airflock.core.vocabulary import Percept

Vector = tuple[float, float, float]
STILL: Vector = (0.0, 0.0, 0.0)


class WorldMap(Protocol):
    """What a pilot asks of the world: `world.place.Place` answers from a map."""

    def beside(self, own: State, other: State, /) -> State:
        """State of another agent at its image nearest to own: itself wherever space is not periodic."""

    def surfaces(self, x: float, y: float, z: float, /) -> Iterable[tuple[float, float, float, float]]:
        """Distance (m) and unit normal of every wall and obstacle."""

    def ray(self, x: float, y: float, z: float, ux: float, uy: float, uz: float, length: float, /) -> float:
        """Free distance of a thin ray, m."""

    def cast(
        self, x: float, y: float, z: float, ux: float, uy: float, uz: float, length: float, radius: float, /
    ) -> float:  # fmt: skip
        """Free distance of a sphere, m."""

    def is_blocked(self, x: float, y: float, z: float, to_x: float, to_y: float, to_z: float, /) -> bool:
        """Whether an obstacle or the scene stands between two places, m."""


class BoundPercept(Percept):
    """What one agent perceives at one decision, bound to a map of the world and to its own random numbers."""

    place: WorldMap
    at: State
    random_key: tuple[int, int, int]
    rays: int

    @classmethod
    def of(
        cls,
        place: WorldMap,
        own: State,
        time: float,
        goal: Vector | None = None,
        asker: tuple[int, int, int] = (0, 0, 0),
    ) -> Self:
        """Percept at a position; goal: where it is (m), if there is one; asker: seed, number of decision and agent."""
        offset = STILL if goal is None else (goal[0] - own.x, goal[1] - own.y, goal[2] - own.z)
        found = cls(time, -own.x, -own.y, -own.z, *offset)
        found.place, found.at, found.random_key, found.rays = place, own, asker, 0
        return found

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance along the unit vector u, at most length, m."""
        return self.place.ray(*self.at[:3], ux, uy, uz, length)

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance of a sphere of this radius along the unit vector u, at most length, m; counted in `rays`."""
        self.rays += 1
        return self.place.cast(*self.at[:3], ux, uy, uz, length, radius)

    def normal(self, draw: int) -> float:
        """Normal random number of this agent and decision."""
        words = random.random_words(self.random_key[0], random.MODEL, 0, *self.random_key[1:], draw)
        return float(random.normal_pair(words[0], words[1])[0])

    def uniform(self, draw: int) -> float:
        """Uniform random number of this agent and decision."""
        words = random.random_words(self.random_key[0], random.MODEL, 0, *self.random_key[1:], draw)
        return float(random.uniform(words[0]))
