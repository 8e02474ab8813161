"""Vision: an agent sees the others instead of hearing them, as bearings and distances with errors.

What is seen is an offset from the observer. So errors of its own position do not come between the
two, and nobody's own position, true or pretended, matters. A camera shows no velocity: it is
estimated from one picture to the next by a fading-memory filter (Morrison 1969), whose gains follow
from the time since the last picture and from one time.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

from airflock.core import PacketParameters, forward, quantity

OURS = "our choice: cameras on all sides of a drone"
TURN = math.pi
NEAR = 1e-6  # m; below, a line of sight has no direction
EARLY = 1e-4  # s; what is as old as `hold` up to this still counts


@dataclass(frozen=True, kw_only=True)
class Parameters(PacketParameters):
    """Cameras that know the direction to a neighbour well, and its distance less well, by its size in the picture."""

    delay: float = quantity(
        0.1,
        "s",
        low=0.0,
        high=30.0,
        source=OURS,
        usual=(0.0, 1.0),
        meaning="age of a picture once it has been processed",
    )
    range: float = quantity(
        30.0, "m", low=0.0, high=1e8, source=OURS, meaning="largest distance at which a neighbour is seen"
    )
    field: float = quantity(
        2.0 * TURN, "rad", low=0.0, high=2.0 * TURN, source=OURS, meaning="horizontal angle of view, about the heading"
    )
    field_up: float = quantity(
        TURN, "rad", low=0.0, high=TURN, source=OURS, meaning="vertical angle of view, about the horizon"
    )
    bearing_sd: float = quantity(
        0.03,
        "rad",
        low=0.0,
        high=0.5,
        source=OURS,
        meaning="standard deviation of directions, along each of two axes",
    )
    range_sd: float = quantity(
        0.1, "1", low=0.0, high=1.0, source=OURS, meaning="standard deviation of the distance, as a share of it"
    )
    missed: float = quantity(
        0.1, "1", low=0.0, high=1.0, source=OURS, meaning="share of pictures in which a neighbour in view is not found"
    )
    smoothing: float = quantity(
        0.5, "s", low=0.001, high=60.0, source=OURS, meaning="time over which pictures are averaged, for a velocity"
    )
    hold: float = quantity(
        2.0,
        "s",
        low=0.0,
        high=1e4,
        source=OURS,
        meaning="how long a neighbour is remembered after it was last seen",
    )
    still: float = quantity(
        0.2,
        "m/s",
        low=0.0,
        high=100.0,
        source=OURS,
        meaning="speed below which an agent keeps looking in its last direction",
    )


class Packet(NamedTuple):
    """Line of sight of the observer of a pair, a horizontal unit vector; east before it has flown."""

    look_x: float = 1.0
    look_y: float = 0.0


def receive(dx, dy, dz, vx, vy, clear, u0, packet, k):
    """1.0 if a neighbour at this offset (m) is found in a picture, else 0.0; and where the observer looks."""
    speed = math.sqrt(vx * vx + vy * vy)
    turns = speed > k.still
    look_x = vx / max(speed, 1e-9) if turns else packet.look_x
    look_y = vy / max(speed, 1e-9) if turns else packet.look_y
    aside = math.atan2(abs(look_x * dy - look_y * dx), look_x * dx + look_y * dy)
    above = math.atan2(abs(dz), math.sqrt(dx * dx + dy * dy))
    inside = aside <= 0.5 * k.field and above <= 0.5 * k.field_up
    found = inside and clear > 0.5 and u0 >= k.missed
    return 1.0 if found else 0.0, Packet(look_x, look_y)


def gains(since, smoothing):
    """Shares of a surprise that correct a position (1) and a velocity (1/s), this long (s) after the last picture."""
    # A fading-memory filter of first order: one number for a pair. A Kalman filter would keep four
    # more for gains that become constant within a second.
    kept = math.exp(-max(since, 0.0) / smoothing)
    return 1.0 - kept * kept, (1.0 - kept) * (1.0 - kept) / max(since, 1e-6)


def see(dx, dy, dz, ex, ey, ez, evx, evy, evz, vx, vy, vz, since, g0, g1, g2, k):
    """Offset (m) and velocity (m/s) at which a neighbour is believed after a picture.

    Of two axes across the line of sight the first is horizontal. Who is seen for the first time, or
    again after `hold`, is believed to fly as the observer does; so is everybody after the
    observer's clock was put back.
    """
    level = math.sqrt(dx * dx + dy * dy)
    r = math.sqrt(level * level + dz * dz)
    ax = -dy / max(level, NEAR) if level > NEAR else 1.0
    ay = dx / max(level, NEAR) if level > NEAR else 0.0
    ux = dx / max(r, NEAR)
    uy = dy / max(r, NEAR)
    uz = dz / max(r, NEAR)
    size = math.exp(k.range_sd * g2 - 0.5 * k.range_sd * k.range_sd)
    one = r * k.bearing_sd * g0
    two = r * k.bearing_sd * g1
    mx = size * (dx + one * ax - two * uz * ay)
    my = size * (dy + one * ay + two * uz * ax)
    mz = size * (dz + two * (ux * ay - uy * ax))
    anew = (since > k.hold + EARLY) | (since < 0.0)
    g, h = gains(since, k.smoothing)
    x = mx if anew else ex + g * (mx - ex)
    y = my if anew else ey + g * (my - ey)
    z = mz if anew else ez + g * (mz - ez)
    wx = vx if anew else evx + h * (mx - ex)
    wy = vy if anew else evy + h * (my - ey)
    wz = vz if anew else evz + h * (mz - ez)
    return x, y, z, wx, wy, wz


def lasts(age, k):
    """1.0 while a neighbour that was last seen so long ago (s) is believed in."""
    return 1.0 if age <= k.delay + k.hold + EARLY else 0.0


carry = forward
