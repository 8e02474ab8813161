"""Noise: normal numbers for all agents, of the sensors and of the outer noise of the body."""

from collections.abc import Callable
from typing import Any, NamedTuple

from airflock.core import random
from airflock.engine.plan import Plan
from airflock.engine.stages.state import Columns, FlockRows, Row
from airflock.engine.stages.words import *

OUTER = random.OUTER


class DrawFunctions(NamedTuple):
    """`draw` and `normal` as functions of the driver, each once for all callers.

    words     : draws for agents that lie at their own numbers, or for all by their numbers where
                they are sorted
    by_number : draws by their numbers, where some may have left and the others keep their order;
                None where none may
    """

    words: Callable[..., Any]
    by_number: Callable[..., Any] | None
    normal: Callable[..., Any]


Draw = DrawFunctions | None  # None: their loops stand in place of the calls


def draw(
    m: int, order: Row, step: Any, stream: int, world: Any, seed_low: Any, seed_high: Any, u0: Row, u1: Row, u2: Row,
    u3: Row,
) -> None:  # fmt: skip
    """Draw four random words of a stream per agent, into four rows; order: numbers of the agents."""
    # Philox is inlined here before LLVM sees it. Compiled alone, LLVM vectorises across its four
    # words, and the loop over agents stays scalar: 2.8 µs instead of 0.65 µs for 112 agents.
    for i in range(m):
        u0[i], u1[i], u2[i], u3[i] = random.philox(order[i], step, stream, world, seed_low, seed_high)


def fill_words(u: Columns, flock: FlockRows, whole: Any, step: Any, stream: int, m: int, drawn: Draw) -> None:
    """Draw four random words of a stream for all agents of this world.

    Until an agent leaves, each lies at its own number, and a loop that counts takes a tenth less
    than one that looks the number up. The two are functions of their own: beside the other, either
    is compiled to a slower one.
    """
    # A draw of 100 agents takes 147 ns by counting and 162 ns by looking up numbers. Both in one
    # function would compile the counting one to something slower.
    if drawn is None:
        draw(
            m, flock.number, step, stream, whole.world, whole.seed_low, whole.seed_high, u[0], u[1], u[2], u[3]
        )  # fmt: skip
    elif drawn.by_number is not None and flock.number[whole.agents - 1] != whole.agents - 1:
        call_draw(drawn.by_number, u, flock, whole, step, stream, m)
    else:
        call_draw(drawn.words, u, flock, whole, step, stream, m)


def call_draw(
    function: Callable[..., Any], u: Columns, flock: FlockRows, whole: Any, step: Any, stream: int, m: int
) -> None:
    """Call a function of the driver that draws."""
    call_rule(
        function, m=m, order=flock.number, step=step, stream=stream, world=whole.world, seed_low=whole.seed_low,
        seed_high=whole.seed_high, u0=u[0], u1=u[1], u2=u[2], u3=u[3],
    )  # fmt: skip


def normal(m: int, a: Row, b: Row, g: Row, h: Row) -> None:
    """Two normal numbers per agent of two random words each."""
    # Box and Muller: two uniform numbers give two normal ones, without a rejection that vectors
    # could not follow.
    for i in range(m):
        g[i], h[i] = random.normal_pair(a[i], b[i])


def normals(
    flock: FlockRows, rows: Columns, whole: Any, step: Any, stream: int, m: int, first: int, drawn: Draw
) -> None:
    """Four normal numbers of a stream per agent, in four rows from the first on."""
    u = flock.words
    fill_words(u, flock, whole, step, stream, m, drawn)
    # Random words are 19 % and normal numbers 16 % of a flight of 30 drones; rows are marked as
    # lying apart.
    for c in (0, 2):
        if drawn is None:
            normal(m, u[c], u[c + 1], rows[first + c], rows[first + c + 1])
        else:
            call_rule(drawn.normal, m=m, a=u[c], b=u[c + 1], g=rows[first + c], h=rows[first + c + 1])


def uniforms(flock: FlockRows, rows: Columns, whole: Any, step: Any, stream: int, m: int, drawn: Draw) -> None:
    """Four uniform numbers of a stream per agent, between 0 and 1, in four rows."""
    u = flock.words
    fill_words(u, flock, whole, step, stream, m, drawn)
    # Four loops over agents, one for each row, which compilers turn into vectors.
    for c in range(4):
        for i in range(m):
            rows[c][i] = random.uniform(u[c][i])


def noise(flock: FlockRows, whole: Any, step: int, m: int, *, plan: Plan, drawn: Draw = None) -> None:
    """Outer noise of this step; in a plane four numbers per agent serve two steps of two axes."""
    if plan.dimensions == 3:
        normals(flock, flock.outer, whole, step, OUTER, m, 0, drawn)
    # Odd steps of a plane use the second pair of numbers that the even step before them drew.
    elif step % 2 == 0:
        normals(flock, flock.outer, whole, step // 2, OUTER, m, 0, drawn)
