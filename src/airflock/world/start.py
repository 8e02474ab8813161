"""Start: where agents are when a flight begins."""

from dataclasses import dataclass

from airflock.core import Parameters as Record, choice, norm, quantity


@dataclass(frozen=True, kw_only=True)
class Parameters(Record):
    """Agents start uniform in a region, at rest or in random directions, redrawn until pairs are far enough apart."""

    kind: str = choice(
        "arena",
        ("arena", "ball", "box", "vee", "echelon"),
        source="authors' programs: arena (Vásárhelyi et al. 2018), ball (Zapotecatl et al. 2016)",
        meaning="where agents start: anywhere in the arena, in a ball or a box about its centre (a disc or a square in "
        "a plane), or in formation: vee is a V, echelon a line (a column or a row, too) with a fixed spacing",
    )
    radius: float = quantity(
        0.5, "m", low=1e-6, high=1e6, source="Zapotecatl et al. 2016, authors' program", meaning="radius of the ball"
    )
    side: float = quantity(10.0, "m", low=1e-6, high=1e6, meaning="side of the box")
    separation: float | None = quantity(
        None,
        "m",
        low=0.0,
        high=1e4,
        source="authors' program of Vásárhelyi et al. 2018: max(3 m, 2 s · v_flock)",
        meaning="smallest distance between two agents at the start; in a ball or a box 0 by default",
    )
    spacing_x: float = quantity(
        1.524,
        "m",
        low=0.0,
        high=1e4,
        source="Dimock & Selig 2003 give none",
        meaning="formation: distance of each rank behind the one before",
    )
    spacing_y: float = quantity(
        1.9812,
        "m",
        low=-1e4,
        high=1e4,
        source="Dimock & Selig 2003 give none",
        meaning="formation: distance of each rank to the side of the one before",
    )
    spacing_z: float = quantity(
        0.0, "m", low=-1e4, high=1e4, meaning="formation: height of each rank above the one before"
    )
    jitter: float = quantity(
        0.0, "m", low=0.0, high=1e3, source="our choice", meaning="standard deviation of the places in a formation"
    )
    clearance: float = quantity(
        1.0, "m", low=0.0, high=1e3, source="our choice", meaning="free distance to what stands in the scene"
    )
    wall_clearance: float = quantity(
        0.0,
        "m",
        low=0.0,
        high=1e3,
        source="none in the authors' programs",
        meaning="free distance to walls, obstacles and the scene; not used in a formation",
    )
    speed: float = quantity(
        0.0,
        "m/s",
        low=0.0,
        high=200.0,
        source="authors' program",
        meaning="speed at the start, in random directions; in a formation straight ahead",
    )


def spread(u, low, high):
    """A uniform number u in (0, 1) as a coordinate between low and high, m."""
    return low + (high - low) * u


def heading_off(gx, gy, gz, speed):
    """Velocity (m/s) at this speed (m/s) along three normal numbers: all directions are equally likely."""
    f = speed / norm(gx, gy, gz)
    return f * gx, f * gy, f * gz


def in_vee(i, sx, sy, sz):
    """Place (m) of agent i in a V that points to x: agents behind the first by turns to both sides."""
    rank = float((i + 1) // 2)
    side = 1.0 if i % 2 == 1 else -1.0
    return -rank * sx, side * rank * sy, rank * sz


def in_echelon(i, sx, sy, sz):
    """Place (m) of agent i in a line: each one behind, aside and above of the one before."""
    rank = float(i)
    return -rank * sx, rank * sy, rank * sz


def in_ball(x, y, z, radius):
    """Return True if a position lies in the ball of this radius (m) about the origin."""
    return x * x + y * y + z * z <= radius * radius
