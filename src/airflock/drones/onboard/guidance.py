"""Guidance of what is no flocking: up to a layer, to a point, home past neighbours. Velocities in m/s, plain rules."""

from collections.abc import Iterable

from airflock.core import State, braking_curve, clamp, norm, shorten
from airflock.drones.onboard.limiter import Velocity
from airflock.drones.onboard.safety import SafetyLimits

HEIGHT_GAIN = 1.0  # 1/s; our choice: a metre off is a metre per second
KEEP_GAIN = 0.5  # 1/s; and half as fast back to a point that is kept
PASSING_SHARE = 0.8  # of the distance of two layers: farther above each other, two drones pass
PUSH_GAIN = 1.0  # 1/s; half a spring: a metre too near pushes with a metre per second


def climb_rate(own: State, height: float, safety: SafetyLimits) -> float:
    """Vertical velocity towards a height (m)."""
    return float(clamp(HEIGHT_GAIN * (height - own.z), -safety.climb_max, safety.climb_max))


def velocity_to_hover_point(own: State, point: tuple[float, float, float], safety: SafetyLimits) -> Velocity:
    """Velocity that keeps a point of the ground plan while climbing to its height."""
    vx, vy, _ = shorten(KEEP_GAIN * (point[0] - own.x), KEEP_GAIN * (point[1] - own.y), 0.0, 1.0)
    return vx, vy, climb_rate(own, point[2], safety)


def velocity_to_stay(own: State, point: tuple[float, float, float], safety: SafetyLimits) -> Velocity:
    """Velocity back to a point where the drone came to stand, height and all."""
    dx, dy, dz = point[0] - own.x, point[1] - own.y, point[2] - own.z
    vx, vy, _ = shorten(KEEP_GAIN * dx, KEEP_GAIN * dy, 0.0, 1.0)
    return vx, vy, float(clamp(KEEP_GAIN * dz, -safety.climb_max, safety.climb_max))


def velocity_towards(own: State, point: tuple[float, float, float], safety: SafetyLimits) -> Velocity:
    """Velocity towards a point of the ground plan, with which one can still stop there."""
    dx, dy = point[0] - own.x, point[1] - own.y
    far = norm(dx, dy, 0.0)
    k = min(braking_curve(far, safety.brake, safety.brake_gain), safety.speed_max) / far
    return k * dx, k * dy, 0.0


def velocity_from_neighbours(own: State, neighbours: Iterable[State], safety: SafetyLimits) -> Velocity:
    """Velocity along the ground plan away from all neighbours within s.yield_range that are on no other layer."""
    x = y = 0.0
    for other in neighbours:
        dx, dy, dz = own.x - other.x, own.y - other.y, own.z - other.z
        if abs(dz) > PASSING_SHARE * safety.layer:
            continue
        near = PUSH_GAIN * max(safety.yield_range - norm(dx, dy, dz), 0.0) / norm(dx, dy, 0.0)
        x, y = x + near * dx, y + near * dy
    vx, vy, _ = shorten(x, y, 0.0, safety.speed_max)
    return vx, vy, 0.0


def velocity_home(
    own: State, home: tuple[float, float, float], neighbours: Iterable[State], safety: SafetyLimits
) -> Velocity:
    """Velocity home on the own layer, past neighbours."""
    gx, gy, _ = velocity_towards(own, home, safety)
    px, py, _ = velocity_from_neighbours(own, neighbours, safety)
    return gx + px, gy + py, climb_rate(own, home[2], safety)
