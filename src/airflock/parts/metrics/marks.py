"""Quality with collisions as the authors' program of Zapotecatl et al. 2016 counts them: `metrics.count = "program"`.

Eq. 18 counts every boid with another within r_b, as `quality` does. The program goes through the
pairs i < j, marks both boids of a pair that touches, and skips the pairs of a boid i that is marked
already. So it can miss the members of a chain (never does it mark one that touches nobody), and its
answer depends on the order of the boids. The published figures were counted so. Everything else is
as in `quality`.
"""

from typing import NamedTuple

from airflock.parts.metrics.quality import (
    COURSES,
    FORMULAS,
    NEEDS,
    REPORTS,
    Agent,
    Sample,
    angle_from,
    offset_from,
    sample,
    total,
)

__all__ = [
    "COURSES",
    "FORMULAS",
    "NEEDS",
    "REPORTS",
    "VIOLATES",
    "Agent",
    "Sample",
    "Scratch",
    "Shared",
    "agent",
    "sample",
    "survey",
    "total",
    "workspace",
]

VIOLATES = {"renumbering": "the program skips the pairs of agents that it marked before"}


class Shared(NamedTuple):
    """1.0 if the program marks an agent as colliding."""

    collides: float


class Scratch(NamedTuple):
    """Marks while the pairs are gone through, in one row."""

    mark: tuple[int, int]


def workspace(n, q, wing):
    """One mark for each agent."""
    return Scratch(mark=(1, n))


def survey(n, x, y, z, q, work, shared):
    """Mark the agents in the order of the program's loop over pairs."""
    # The authors' program skips pairs of a boid that is marked already. It matters where a quarter
    # collides: 0.553 by this count, 0.547 by Eq. 18, more than the spread of 15 flights. The order
    # of boids decides, hence a rule of the whole flock.
    mark = work.mark
    for i in range(n):
        mark[0][i] = 0.0
    for i in range(n):
        if mark[0][i] < 0.5:
            touches = 0.0
            for j in range(i + 1, n):
                dx = x[j] - x[i]
                dy = y[j] - y[i]
                dz = z[j] - z[i]
                hit = 1.0 if dx * dx + dy * dy + dz * dz < q.r_b * q.r_b else 0.0
                mark[0][j] = max(mark[0][j], hit)
                touches = max(touches, hit)
            mark[0][i] = touches
    for i in range(n):
        shared.collides[i] = mark[0][i]


def agent(x, y, z, hx, hy, hz, shared, mean, q):
    """Terms of Eqs 14, 17, 18, 21 and 22 for one agent, as in `quality`."""
    offset = offset_from(x, y, z, mean)
    angle = angle_from(hx, hy, hz, mean)
    free = 1.0 - shared.collides
    return Agent(offset, angle, shared.collides, free * offset, free * angle)
