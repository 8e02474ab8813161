"""The limiter: the last gate that every velocity passes before it goes to the autopilot.

Whatever a law, a mission or a bug asks for: finite, not too fast, not too far from the own velocity, within heights,
and never faster towards the fence or an obstacle than it can still stop.
"""

from collections.abc import Iterable
from math import isfinite
from typing import NamedTuple

from airflock.core import State, braking_curve, clamp, norm, shorten
from airflock.drones.onboard.safety import SafetyLimits

Velocity = tuple[float, float, float]
NO_VELOCITY: Velocity = (0.0, 0.0, 0.0)


class LimitedVelocity(NamedTuple):
    """A velocity that may be flown (m/s), and whether the fence or an obstacle turned it."""

    velocity: Velocity
    is_fenced: bool


def limit_velocity(
    wanted_velocity: Velocity,
    own: State,
    surfaces: Iterable[tuple[float, float, float, float]],
    heights: tuple[float, float],
    safety: SafetyLimits,
) -> LimitedVelocity:
    """The velocity nearest to a wish that may be flown.

    own      : state as measured; surfaces: distance (m, negative beyond) and inward unit normal of the fence's sides
               and of obstacles; heights: lowest and highest, m
    """
    if not all(map(isfinite, wanted_velocity)):
        wanted_velocity = NO_VELOCITY
    vx, vy, _ = shorten(wanted_velocity[0], wanted_velocity[1], 0.0, safety.speed_max)
    vz = clamp(wanted_velocity[2], -safety.climb_max, safety.climb_max)
    # As far ahead of the own velocity as the drone can follow until the next setpoint, so that nothing is lost.
    dx, dy, dz = shorten(vx - own.vx, vy - own.vy, vz - own.vz, safety.accel * (safety.response + safety.tick))
    vx, vy, vz = own.vx + dx, own.vy + dy, own.vz + dz
    fenced = False
    walls = list(surfaces)
    for _ in range(2):  # a corner: what one side turns, another may have to turn again
        for distance, nx, ny, nz in walls:
            outward = -(vx * nx + vy * ny + vz * nz)
            if outward <= 0.0:
                continue
            lag = max(-(own.vx * nx + own.vy * ny + own.vz * nz), 0.0) * safety.response  # flown before it slows down
            most = braking_curve(distance - safety.soft_margin - lag, safety.brake, safety.brake_gain)
            if outward > most:
                k = outward - most
                vx, vy, vz, fenced = vx + k * nx, vy + k * ny, vz + k * nz, True
    for distance, nx, ny, nz in walls:
        if -(vx * nx + vy * ny + vz * nz) > braking_curve(distance, safety.brake, safety.brake_gain) + 1e-9:
            vx, vy, vz, fenced = 0.0, 0.0, 0.0, True  # sides that contradict each other: stop
    low, high = heights
    vz = clamp(
        vz,
        -braking_curve(own.z - low, safety.brake, safety.brake_gain),
        braking_curve(high - own.z, safety.brake, safety.brake_gain),
    )
    speed = norm(vx, vy, 0.0)
    k = min(1.0, safety.speed_max / speed)
    return LimitedVelocity((k * vx, k * vy, clamp(vz, -safety.climb_max, safety.climb_max)), fenced)
