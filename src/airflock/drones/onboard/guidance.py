"""Guidance of what is no flocking: up to a layer, to a point, home past neighbours. Velocities in m/s, plain rules."""

from collections.abc import Iterable

from airflock.core.agent import State
from airflock.core.maths import braking_curve, clamp, norm, shorten
from airflock.drones.onboard.limiter import Velocity
from airflock.drones.onboard.safety import Safety

HEIGHT_GAIN = 1.0  # 1/s; our choice: a metre off is a metre per second
KEEP_GAIN = 0.5  # 1/s; and half as fast back to a point that is kept
APART = 0.8  # of the distance of two layers: farther above each other, two drones pass
PUSH = 1.0  # 1/s; half a spring: a metre too near pushes with a metre per second


def climb(own: State, height: float, s: Safety) -> float:
    """Vertical velocity towards a height (m)."""
    return float(clamp(HEIGHT_GAIN * (height - own.z), -s.climb_max, s.climb_max))


def keep(own: State, point: tuple[float, float, float], s: Safety) -> Velocity:
    """Velocity that keeps a point of the ground plan while climbing to its height."""
    vx, vy, _ = shorten(KEEP_GAIN * (point[0] - own.x), KEEP_GAIN * (point[1] - own.y), 0.0, 1.0)
    return vx, vy, climb(own, point[2], s)


def stay_at(own: State, point: tuple[float, float, float], s: Safety) -> Velocity:
    """Velocity back to a point where the drone came to stand, height and all."""
    dx, dy, dz = point[0] - own.x, point[1] - own.y, point[2] - own.z
    vx, vy, _ = shorten(KEEP_GAIN * dx, KEEP_GAIN * dy, 0.0, 1.0)
    return vx, vy, float(clamp(KEEP_GAIN * dz, -s.climb_max, s.climb_max))


def make_for(own: State, point: tuple[float, float, float], s: Safety) -> Velocity:
    """Velocity towards a point of the ground plan, with which one can still stop there."""
    dx, dy = point[0] - own.x, point[1] - own.y
    far = norm(dx, dy, 0.0)
    k = min(braking_curve(far, s.brake, s.brake_gain), s.speed_max) / far
    return k * dx, k * dy, 0.0


def push(own: State, neighbours: Iterable[State], s: Safety) -> Velocity:
    """Velocity along the ground plan away from all neighbours within s.yield_range that are on no other layer."""
    x = y = 0.0
    for other in neighbours:
        dx, dy, dz = own.x - other.x, own.y - other.y, own.z - other.z
        if abs(dz) > APART * s.layer:
            continue
        near = PUSH * max(s.yield_range - norm(dx, dy, dz), 0.0) / norm(dx, dy, 0.0)
        x, y = x + near * dx, y + near * dy
    vx, vy, _ = shorten(x, y, 0.0, s.speed_max)
    return vx, vy, 0.0


def homewards(own: State, home: tuple[float, float, float], neighbours: Iterable[State], s: Safety) -> Velocity:
    """Velocity home on the own layer, past neighbours."""
    gx, gy, _ = make_for(own, home, s)
    px, py, _ = push(own, neighbours, s)
    return gx + px, gy + py, climb(own, home[2], s)
