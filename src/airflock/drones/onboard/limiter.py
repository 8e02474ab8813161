"""The limiter: the last gate that every velocity passes before it goes to the autopilot.

Whatever a law, a mission or a bug asks for: finite, not too fast, not too far from the own velocity, within heights,
and never faster towards the fence or an obstacle than it can still stop.
"""

from collections.abc import Iterable
from math import isfinite
from typing import NamedTuple

from airflock.core.agent import State
from airflock.core.maths import braking_curve, clamp, norm, shorten
from airflock.drones.onboard.safety import Safety

Velocity = tuple[float, float, float]
STILL: Velocity = (0.0, 0.0, 0.0)


class Limited(NamedTuple):
    """A velocity that may be flown (m/s), and whether the fence or an obstacle turned it."""

    velocity: Velocity
    fenced: bool


def limit(
    wish: Velocity,
    own: State,
    surfaces: Iterable[tuple[float, float, float, float]],
    heights: tuple[float, float],
    s: Safety,
) -> Limited:
    """The velocity nearest to a wish that may be flown.

    own      : state as measured; surfaces: distance (m, negative beyond) and inward unit normal of the fence's sides
               and of obstacles; heights: lowest and highest, m
    """
    if not all(map(isfinite, wish)):
        wish = STILL
    vx, vy, _ = shorten(wish[0], wish[1], 0.0, s.speed_max)
    vz = clamp(wish[2], -s.climb_max, s.climb_max)
    # As far ahead of the own velocity as the drone can follow until the next setpoint, so that nothing is lost.
    dx, dy, dz = shorten(vx - own.vx, vy - own.vy, vz - own.vz, s.accel * (s.response + s.tick))
    vx, vy, vz = own.vx + dx, own.vy + dy, own.vz + dz
    fenced = False
    walls = list(surfaces)
    for _ in range(2):  # a corner: what one side turns, another may have to turn again
        for distance, nx, ny, nz in walls:
            outward = -(vx * nx + vy * ny + vz * nz)
            if outward <= 0.0:
                continue
            lag = max(-(own.vx * nx + own.vy * ny + own.vz * nz), 0.0) * s.response  # flown before it slows down
            most = braking_curve(distance - s.soft_margin - lag, s.brake, s.brake_gain)
            if outward > most:
                k = outward - most
                vx, vy, vz, fenced = vx + k * nx, vy + k * ny, vz + k * nz, True
    for distance, nx, ny, nz in walls:
        if -(vx * nx + vy * ny + vz * nz) > braking_curve(distance, s.brake, s.brake_gain) + 1e-9:
            vx, vy, vz, fenced = 0.0, 0.0, 0.0, True  # sides that contradict each other: stop
    low, high = heights
    vz = clamp(
        vz,
        -braking_curve(own.z - low, s.brake, s.brake_gain),
        braking_curve(high - own.z, s.brake, s.brake_gain),
    )
    speed = norm(vx, vy, 0.0)
    k = min(1.0, s.speed_max / speed)
    return Limited((k * vx, k * vy, clamp(vz, -s.climb_max, s.climb_max)), fenced)
