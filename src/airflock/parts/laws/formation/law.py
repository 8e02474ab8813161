"""Formation: every drone flies to a point of its own and keeps its distance, for displays of many drones. Ours.

Kidger's second wish ("a master node that assigns different goals to each boid"). The goals of all
drones are under way for the same time (`world.goals.glide`); towards its own a drone flies as fast
as a braking curve allows. Neighbours push it away like half a spring and pull its velocity towards
theirs where a braking curve would be exceeded: rules of Vásárhelyi et al. 2018, with ranges below
the distance of two points. Obstacles and drones that hover push, and to one side, so that nobody
waits behind them.
"""

from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import Parameters as Record, braking_curve, braking_distance, excess, norm, quantity, shorten

COMMAND = "velocity"
VIOLATES = {
    "mirror": "obstacles are passed on one side, so that nobody waits behind them (turn)",
    "lone agent": "without a goal a drone stays where it is",
}
OURS = "our choice, for drones that stand 3 m apart"


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Gains for flying to a point, and for keeping drones apart."""

    v_max: float = quantity(6.0, "m/s", low=0.1, high=100.0, source=OURS, meaning="largest commanded speed")
    p_goal: float = quantity(1.0, "1/s", low=0.01, high=10.0, source=OURS, meaning="gain of the braking curve")
    a_goal: float = quantity(
        2.0, "m/s^2", low=0.01, high=50.0, source=OURS, meaning="deceleration of the braking curve"
    )
    r0_rep: float = quantity(2.4, "m", low=0.0, high=100.0, source=OURS, meaning="repulsion range")
    p_rep: float = quantity(2.5, "1/s", low=0.0, high=20.0, source=OURS, meaning="repulsion gain")
    r0_frict: float = quantity(
        1.2,
        "m",
        low=0.0,
        high=100.0,
        source=OURS,
        meaning="distance at which two drones that approach each other must have stopped",
    )
    c_frict: float = quantity(0.8, "1", low=0.0, high=10.0, source=OURS, meaning="coefficient of alignment")
    r0_wall: float = quantity(2.0, "m", low=0.0, high=100.0, source=OURS, meaning="range of obstacles")
    p_wall: float = quantity(2.5, "1/s", low=0.0, high=20.0, source=OURS, meaning="gain of obstacles")
    turn: float = quantity(
        0.7, "1", low=-10.0, high=10.0, source=OURS, meaning="sideways push, as a share of the push from obstacles"
    )


class Sums(NamedTuple):
    """Repulsion and alignment, m/s."""

    x: float
    y: float
    z: float


class Walls(NamedTuple):
    """Push of obstacles, m/s."""

    x: float
    y: float
    z: float


def reach(p):
    """Farthest neighbour that matters, m: two that fly at full speed towards each other can still stop."""
    return max(p.r0_rep, p.r0_frict + 2.0 * p.v_max * p.v_max / p.a_goal + p.a_goal / (p.p_goal * p.p_goal))


def wall_reach(p):
    """Distance beyond which an obstacle says nothing, m: a drone at full speed can still stop."""
    return p.r0_wall + braking_distance(p.v_max, p.a_goal, p.p_goal)


def preferred_speed(p):
    """Speed on a long way, m/s."""
    return p.v_max


def interaction_range(p):
    """Drones nearer than this belong together, m."""
    return 2.0 * p.r0_rep


def neighbour(dx, dy, dz, r, dvx, dvy, dvz, dv, p):
    """Repulsion and alignment from one neighbour (Vásárhelyi et al. 2018, Eqs 2-6), m/s."""
    away = -p.p_rep * max(p.r0_rep - r, 0.0) / r
    closing = max(-(dx * dvx + dy * dvy + dz * dvz) / (r * dv), 0.0)
    align = p.c_frict * closing * excess(dv, braking_curve(r - p.r0_frict, p.a_goal, p.p_goal))
    return Sums(away * dx + align * dvx, away * dy + align * dvy, away * dz + align * dvz)


def boundary(distance, nx, ny, nz, vx, vy, vz, p):
    """Push from one surface, away and to one side, m/s: near it, and where it is neared faster than one can brake."""
    closing = -(vx * nx + vy * ny + vz * nz)
    brake = max(closing - braking_curve(distance - 0.5 * p.r0_wall, p.a_goal, p.p_goal), 0.0)
    k = p.p_wall * max(p.r0_wall - distance, 0.0) + brake
    return Walls(k * (nx - p.turn * ny), k * (ny + p.turn * nx), k * nz)


def decide(sums, walls, percept, p):
    """Desired velocity, m/s: to the own point, off the neighbours and off obstacles."""
    d = norm(percept.goal_x, percept.goal_y, percept.goal_z)
    k = min(braking_curve(d, p.a_goal, p.p_goal), p.v_max) / d
    return shorten(
        k * percept.goal_x + sums.x + walls.x,
        k * percept.goal_y + sums.y + walls.y,
        k * percept.goal_z + sums.z + walls.z,
        p.v_max,
    )
