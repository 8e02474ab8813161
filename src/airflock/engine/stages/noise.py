"""Noise: normal numbers for all agents, of the sensors and of the outer noise of the body."""

from collections.abc import Callable
from typing import Any, NamedTuple

from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages.state import Columns, Flock, Row
from airflock.engine.stages.words import ask

OUTER = random.OUTER


class Drawn(NamedTuple):
    """`draw` and `normal` as functions of the driver, each once, whoever asks."""

    words: Callable[..., Any]
    normal: Callable[..., Any]


Draw = Drawn | None  # None: their loops stand where they are asked for


def draw(
    n: int, m: int, order: Row, step: Any, stream: int, world: Any, seed_low: Any, seed_high: Any, u0: Row, u1: Row,
    u2: Row, u3: Row, *, leave: bool,
) -> None:  # fmt: skip
    """Four random words of a stream per agent, in four rows.

    order : numbers of the agents
    leave : whether some may have left, of whose numbers the others keep the order; until then each lies at its own
            number, and a loop that counts takes a tenth less than one that looks the number up
    """
    if leave and order[n - 1] == n - 1:
        for i in range(m):
            u0[i], u1[i], u2[i], u3[i] = random.philox(i, step, stream, world, seed_low, seed_high)
    else:
        for i in range(m):
            u0[i], u1[i], u2[i], u3[i] = random.philox(order[i], step, stream, world, seed_low, seed_high)


def fill(u: Columns, flock: Flock, whole: Any, step: Any, stream: int, m: int, drawn: Draw) -> None:
    """The same of this world."""
    if drawn is None:
        for i in range(m):
            u[0][i], u[1][i], u[2][i], u[3][i] = random.philox(
                flock.number[i], step, stream, whole.world, whole.seed_low, whole.seed_high
            )
    else:
        ask(
            drawn.words, n=whole.agents, m=m, order=flock.number, step=step, stream=stream, world=whole.world,
            seed_low=whole.seed_low, seed_high=whole.seed_high, u0=u[0], u1=u[1], u2=u[2], u3=u[3],
        )  # fmt: skip


def normal(m: int, a: Row, b: Row, g: Row, h: Row) -> None:
    """Two normal numbers per agent of two random words each."""
    for i in range(m):
        g[i], h[i] = random.normal_pair(a[i], b[i])


def normals(flock: Flock, rows: Columns, whole: Any, step: Any, stream: int, m: int, first: int, drawn: Draw) -> None:
    """Four normal numbers of a stream per agent, in four rows from the first on."""
    u = flock.words
    fill(u, flock, whole, step, stream, m, drawn)
    for c in (0, 2):
        if drawn is None:
            normal(m, u[c], u[c + 1], rows[first + c], rows[first + c + 1])
        else:
            ask(drawn.normal, m=m, a=u[c], b=u[c + 1], g=rows[first + c], h=rows[first + c + 1])


def uniforms(flock: Flock, rows: Columns, whole: Any, step: Any, stream: int, m: int, drawn: Draw) -> None:
    """Four uniform numbers of a stream per agent, between 0 and 1, in four rows."""
    u = flock.words
    fill(u, flock, whole, step, stream, m, drawn)
    for c in range(4):
        for i in range(m):
            rows[c][i] = random.uniform(u[c][i])


def noise(flock: Flock, whole: Any, step: int, m: int, *, plan: Plan, drawn: Draw = None) -> None:
    """Outer noise of this step; in a plane four numbers per agent serve two steps of two axes."""
    if plan.dimensions == 3:
        normals(flock, flock.outer, whole, step, OUTER, m, 0, drawn)
    elif step % 2 == 0:
        normals(flock, flock.outer, whole, step // 2, OUTER, m, 0, drawn)
