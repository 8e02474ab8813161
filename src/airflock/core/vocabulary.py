"""The vocabulary of the rule contract: what each kind of rule may request by the names of its arguments.

All quantities are in SI units; a difference is always neighbour minus own. The chapter of each kind
describes its part. Own, Percept and Mean are the records behind some of the names.
"""

from typing import NamedTuple

from airflock.core.body import RULES as BODY
from airflock.core.fault import RULES as FAULT
from airflock.core.metric import METRIC, METRIC_SET
from airflock.core.model import RULES as MODEL
from airflock.core.radio import RULES as RADIO
from airflock.core.sensor import RULES as SENSOR
from airflock.core.topology import RULES as TOPOLOGY

VOCABULARY: dict[str, dict[str, str]] = {
    **MODEL, **BODY, **SENSOR, **RADIO, **TOPOLOGY, **FAULT, **METRIC, **METRIC_SET,
}  # fmt: skip


class Own(NamedTuple):
    """An agent's own state as it measures it: velocity (m/s) and heading (unit vector)."""

    vx: float
    vy: float
    vz: float
    hx: float
    hy: float
    hz: float


class Percept(NamedTuple):
    """Percept of an agent beside its neighbours: time (s), offsets to the arena's centre and the goal (m), rays, noise.

    Without a goal its offset is zero. An engine binds the methods to its world and its streams; a
    drone passes a Percept of its own with a real range finder. As they stand here the world is
    empty and quiet.
    """

    time: float
    centre_x: float
    centre_y: float
    centre_z: float
    goal_x: float = 0.0
    goal_y: float = 0.0
    goal_z: float = 0.0

    def ray(self, ux: float, uy: float, uz: float, length: float) -> float:
        """Free distance (m) along the unit vector u to walls, obstacles and the scene, at most `length` (m)."""
        return length

    def cast(self, ux: float, uy: float, uz: float, length: float, radius: float) -> float:
        """Free distance (m) for a sphere of this radius (m) along the unit vector u, at most `length` (m).

        It ends at the arena's walls, its obstacles and what stands in the scene; a radius of 0 is a
        thin ray. A model that casts declares `sight(p)`, the largest length + radius (m).
        """
        return length

    def normal(self, draw: int) -> float:
        """Normal random number N(0, 1) of this agent and decision; `draw` from 0 to 255 distinguishes several."""
        return 0.0

    def uniform(self, draw: int) -> float:
        """Uniform random number between 0 and 1; it shares its words with normal(draw), so use different draws."""
        return 0.5


PERCEPT_METHODS = ("ray", "cast", "normal", "uniform")  # methods of Percept that an engine binds


class Mean(NamedTuple):
    """Means over a flock or a cluster of n agents: position (m), velocity (m/s), heading."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    hx: float
    hy: float
    hz: float
    n: float
