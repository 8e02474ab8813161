"""Receive: which packets of the others arrive at an agent, and over two lossy links the newest that it has of each."""

import math
from collections.abc import Callable, Iterable
from typing import Any

from airflock.body import radio
from airflock.core import random, silence
from airflock.engine.plan import Plan
from airflock.engine.stages.state import Flock
from airflock.engine.stages.words import HALF, TINY, choose, integer, least, real

PACKET = random.PACKET


def first_of_four(i: int, flock: Flock) -> Any:
    """Whether agent i is the first at hand of the four receivers that share random words."""
    return (i == 0) | (flock.number[i] >> 2 != flock.number[i - 1] >> 2)


def draw(
    others: Iterable[int], flock: Flock, whole: Any, i: int, decision: int, n: int, *, plan: Plan
) -> None:  # fmt: skip
    """Random words of all that is sent to agent i and to the others of its four, in four rows, one for each of them."""
    u = flock.words
    for j in others:
        u[0][j], u[1][j], u[2][j], u[3][j] = random.philox(
            random.pair_number(flock.number[i], flock.number[j], whole.born if plan.absence else n), decision, PACKET,
            whole.world, whole.seed_low, whole.seed_high,
        )  # fmt: skip


def word(i: int, j: int, decision: int, n: int, whole: Any) -> Any:
    """Random word of what agent j sends agent i, where it draws alone."""
    w0, w1, w2, w3 = random.draw(
        random.pair_number(i, j, n), decision, PACKET, whole.world, whole.seed_low, whole.seed_high
    )
    return choose(i & 2 == 0, choose(i & 1 == 0, w0, w1), choose(i & 1 == 0, w2, w3))


def word_of(i: int, j: int, lot: Any, drawn: Callable[[int, int], Any] | None) -> Any:
    """Random word of what agent j sends agent i: of the row that was drawn for agent i, or drawn here."""
    return lot[j] if drawn is None else drawn(i, j)


def by_clock(time: Any, i: int, flock: Flock, *, plan: Plan) -> Any:
    """A time (s) as the clock of agent i tells it."""
    return time + flock.clock[i] if plan.suffers("clock") else time


def sent(decision: int, rate: Any, numbers: Any) -> Any:
    """Packets that a link of this rate (1/s) sends in a decision."""
    return integer(radio.packets(real(decision), rate, numbers.c.period))


def unheard(distance: Any, fast: Any, slow: Any, k: Any, *, plan: Plan) -> Any:
    """Probability that nothing of what one agent sends another arrives, in range."""
    return (
        radio.either(radio.lost(distance, k), _missed(distance, fast, slow, k, plan=plan))
        if plan.lossy and plan.links
        else (_missed(distance, fast, slow, k, plan=plan) if plan.links else radio.lost(distance, k))
    )


def _missed(distance: Any, fast: Any, slow: Any, k: Any, *, plan: Plan) -> Any:
    return radio.missed_few(distance, fast, slow, k) if plan.few else radio.missed(distance, fast, slow, k)


def carries(i: int, j: int, range2: Any, flock: Flock, *, plan: Plan) -> Any:
    """Square of how far packets of agent j carry to agent i, m²."""
    return least(least(range2, flock.reach_in[i]), flock.reach_out[j]) if plan.suffers("radio") else range2


def hear(
    i: int, j: int, apart2: Any, carried2: Any, fast: Any, slow: Any, lot: Any,
    drawn: Callable[[int, int], Any] | None, stamp: Any, packet: Any, flock: Flock, numbers: Any, *, plan: Plan,
) -> None:  # fmt: skip
    """Where packets are kept: `packet` is then the newest that agent i has of agent j.

    apart2, carried2 : squares of how far the two are apart, and of how far packets carry, m²
    fast, slow       : packets sent on each link; stamp : when, s
    """
    dims = plan.dimensions
    got = apart2 <= carried2
    if plan.lossy or plan.links:
        miss = unheard(math.sqrt(apart2 + TINY), fast, slow, numbers.k, plan=plan)
        got = got & (random.uniform(word_of(i, j, lot, drawn)) >= miss)
    for a in range(dims):
        packet[a] = choose(got, flock.heard_position[a][j], flock.packet[a][i, j])
        packet[a + dims] = choose(got, flock.heard_velocity[a][j], flock.packet[a + dims][i, j])
    packet[2 * dims] = choose(got, by_clock(stamp, j, flock, plan=plan), flock.packet[2 * dims][i, j])
    for c in range(2 * dims + 1):
        flock.packet[c][i, j] = packet[c]


def carried(a: int, age: Any, packet: Any, *, plan: Plan) -> Any:
    """Where the sender of a packet is believed to be, along one axis: over two links it is carried forward, m."""
    return packet[a] + packet[a + plan.dimensions] * age if plan.links else packet[a]


def on_record(age: Any, packet: Any, numbers: Any, *, plan: Plan) -> Any:
    """Whether the newest packet that an agent has of another one, of this age (s), says something.

    Over two links it does until the next one comes; where lost neighbours stop an agent, until they count as lost.
    """
    return packet[2 * plan.dimensions] > -1e8 if plan.links else silence.counts(age, numbers.silence) > HALF


def newest(i: int, j: int, packet: Any, flock: Flock, *, plan: Plan) -> None:
    """Where packets are kept: `packet` is then the newest that agent i has of agent j."""
    for c in range(2 * plan.dimensions + 1):
        packet[c] = flock.packet[c][i, j]
