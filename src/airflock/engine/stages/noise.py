"""Noise: normal numbers for all agents, of the sensors and of the outer noise of the body."""

from typing import Any

from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages.state import Columns, Flock

OUTER = random.OUTER


def fill(u: Columns, flock: Flock, whole: Any, step: Any, stream: int, m: int) -> None:
    """Four random words of a stream per agent, in four rows."""
    for i in range(m):
        u[0][i], u[1][i], u[2][i], u[3][i] = random.philox(
            flock.number[i], step, stream, whole.world, whole.seed_low, whole.seed_high
        )


def normals(flock: Flock, rows: Columns, whole: Any, step: Any, stream: int, m: int, first: int) -> None:
    """Four normal numbers of a stream per agent, in four rows from the first on."""
    u = flock.words
    fill(u, flock, whole, step, stream, m)
    for c in (0, 2):
        for i in range(m):
            rows[first + c][i], rows[first + c + 1][i] = random.normal_pair(u[c][i], u[c + 1][i])


def uniforms(flock: Flock, rows: Columns, whole: Any, step: Any, stream: int, m: int) -> None:
    """Four uniform numbers of a stream per agent, between 0 and 1, in four rows."""
    u = flock.words
    fill(u, flock, whole, step, stream, m)
    for c in range(4):
        for i in range(m):
            rows[c][i] = random.uniform(u[c][i])


def noise(flock: Flock, whole: Any, step: int, m: int, *, plan: Plan) -> None:
    """Outer noise of this step; in a plane four numbers per agent serve two steps of two axes."""
    if plan.dimensions == 3:
        normals(flock, flock.outer, whole, step, OUTER, m, 0)
    elif step % 2 == 0:
        normals(flock, flock.outer, whole, step // 2, OUTER, m, 0)
