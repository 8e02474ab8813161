"""Turning body: constant speed, and a heading that turns towards the commanded one (Vicsek 1995; Couzin 2002)."""

import math
from dataclasses import dataclass

from airflock.core import BodyParameters, arc_cosine, choice, norm, quantity

NAME = "heading"
ACCEPTS = "heading"
INTEGRATION = "new"  # unless the key body.integration says otherwise


@dataclass(frozen=True, kw_only=True)
class Parameters(BodyParameters):
    """Speed and agility."""

    speed: float = quantity(
        3.0, "m/s", low=0.0, high=1000.0, source="Couzin et al. 2002, Table 1", meaning="speed, the same at all times"
    )
    turn: float = quantity(
        1e6, "rad/s", low=0.0, high=1e6, meaning="largest rate of turn; the default is no limit", source="our choice"
    )
    integration: str = choice(
        "new",
        ("new", "old"),
        source="Couzin et al. 2002 (new); Vicsek et al. 1995, Eq. 1 (old)",
        meaning="positions move by the velocity after or before the turn",
    )


def move(vx, vy, vz, cx, cy, cz, dt, b):
    """Velocity after dt, m/s: turn by at most b.turn dt towards the unit vector c, at constant speed.

    At rest the heading is free and becomes c. Straight backwards no side is nearer, and the heading
    is kept until noise or neighbours break the tie.
    """
    f = 1.0 / norm(vx, vy, vz)
    hx = f * vx
    hy = f * vy
    hz = f * vz
    along = hx * cx + hy * cy + hz * cz
    sx = cx - along * hx
    sy = cy - along * hy
    sz = cz - along * hz
    across = norm(sx, sy, sz)
    angle = min(arc_cosine(along), b.turn * dt)
    free = b.turn * dt >= math.pi
    k = math.sin(angle) / across
    c = math.cos(angle)
    nx = cx if free else c * hx + k * sx
    ny = cy if free else c * hy + k * sy
    nz = cz if free else c * hz + k * sz
    s = b.speed / norm(nx, ny, nz)
    return s * nx, s * ny, s * nz
