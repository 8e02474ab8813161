"""Receive: which packets of the others arrive at an agent, and where they are kept the newest that it has of each."""

from collections.abc import Iterable
from typing import Any

from airflock.core import radio, random, silence
from airflock.engine.plan import Plan
from airflock.engine.stages.air import apart
from airflock.engine.stages.meet import pair_number
from airflock.engine.stages.records import Decision, FlightView, PairLoopAgent
from airflock.engine.stages.state import FlockRows
from airflock.engine.stages.words import *

PACKET = random.PACKET
AIR = random.AIR
MORE = random.AIR + 256  # a second draw of the same pair
UNIFORM, NORMAL = ("u0", "u1", "u2", "u3"), ("g0", "g1", "g2", "g3")  # random numbers that a rule may take


def first_of_four(i: int, flock: FlockRows) -> Any:
    """Return True if agent i is the first present one of the four receivers that share random words."""
    # Where agents have left, numbers have gaps: a new group of four begins where the quotient by
    # four changes.
    return (i == 0) | (flock.number[i] >> 2 != flock.number[i - 1] >> 2)


def draw(
    others: Iterable[int], flock: FlockRows, whole: Any, i: int, decision: int, n: int, *, plan: Plan
) -> None:  # fmt: skip
    """Random words of all that is sent to agent i and to the others of its four, in four rows, one for each of them."""
    u = flock.words
    # The counter holds (receiver >> 2) * agents + sender, so that the number depends on neither
    # memory layout nor vector width: pilots, `look` and a thread of a GPU draw the same number
    # alone.
    for j in others:
        u[0][j], u[1][j], u[2][j], u[3][j] = random.philox(
            random.pair_number(flock.number[i], flock.number[j], whole.born if plan.absence else n), decision, PACKET,
            whole.world, whole.seed_low, whole.seed_high,
        )  # fmt: skip


def word(i: int, j: int, decision: int, n: int, whole: Any) -> Any:
    """Random word of what agent j sends agent i, where it draws alone."""
    # The four words of one Philox call belong to four receivers; the last two bits of the receiver
    # pick its own without a branch.
    w0, w1, w2, w3 = random.draw(
        random.pair_number(i, j, n), decision, PACKET, whole.world, whole.seed_low, whole.seed_high
    )
    return choose(i & 2 == 0, choose(i & 1 == 0, w0, w1), choose(i & 1 == 0, w2, w3))


def drawn_pair_word(me: PairLoopAgent, j: int) -> Any:
    """Random word of what agent j sends an agent: of the row that was drawn for it, or drawn here."""
    return me.words[j] if me.at.drawn is None else me.at.drawn(me.i, j)


def clock_time(time: Any, i: int, flock: FlockRows, *, plan: Plan) -> Any:
    """Return a time (s) by the clock of agent i."""
    return time + flock.clock[i] if plan.suffers("clock") else time


def sending_clock(j: int, flock: FlockRows, *, plan: Plan) -> Any:
    """Return how far the clock of agent j was ahead when it sent the data that arrive now, s."""
    return flock.sent_clock[j] if plan.late else flock.clock[j]


def sent_time(j: int, at: Decision, flock: FlockRows, *, plan: Plan) -> Any:
    """Return when agent j sent the data that arrive at a decision, by its own clock, s."""
    return at.time - at.late + sending_clock(j, flock, plan=plan) if plan.suffers("clock") else at.time - at.late


def packet_count(decision: int, rate: Any, numbers: Any) -> Any:
    """Packets that a link of this rate (1/s) sends in a decision."""
    return integer(radio.packets(real(decision), rate, numbers.c.period))


def loss_probability(about: dict[str, Any], k: Any, *, plan: Plan) -> Any:
    """Probability that nothing of what one agent sends another arrives, in range.

    about : arguments of the rules of the radio for this pair and decision
    """
    # Two independent causes of loss are one probability, so that one draw decides both.
    return (
        radio.either(radio.lost(about["distance"], k), call_rule(plan.missed, **about, k=k))
        if plan.lossy and plan.missed is not None
        else (call_rule(plan.missed, **about, k=k) if plan.missed is not None else radio.lost(about["distance"], k))
    )


def pair_numbers(me: PairLoopAgent, j: int, flight: FlightView) -> dict[str, Any]:
    """Draw the random numbers that rules of the radio take for one pair and decision, by name."""
    plan, flock, whole, at = flight.plan, flight.flock, flight.whole, me.at
    pair = pair_number(me.i, j, at.agents, flock, whole, plan=plan)
    u, g = totals(), totals()
    # Only the numbers that a rule of this radio takes are drawn: each Philox call is a cost for
    # every pair.
    if plan.rolls(UNIFORM):
        u[0], u[1], u[2], u[3] = random.draw(pair, at.step, AIR, whole.world, whole.seed_low, whole.seed_high)
    if plan.rolls(NORMAL):
        w0, w1, w2, w3 = random.draw(pair, at.step, MORE, whole.world, whole.seed_low, whole.seed_high)
        g[0], g[1] = random.normal_pair(w0, w1)
        g[2], g[3] = random.normal_pair(w2, w3)
    return {
        **{name: random.uniform(u[c]) for c, name in plan.rolls(UNIFORM)},
        **{name: g[c] for c, name in plan.rolls(NORMAL)},
    }


def update_packet(
    me: PairLoopAgent, j: int, apart2: Any, carried2: Any, about: dict[str, Any], packet: Any, flight: FlightView
) -> None:
    """Receive what agent j sends, and put the newest packet of it into `packet`, where packets are kept.

    apart2, carried2 : squared distance of the two, and squared range of packets, m²
    about            : arguments of the rules of the radio for this pair and decision
    """
    plan, flock, numbers, at, dims = flight.plan, flight.flock, flight.numbers, me.at, flight.plan.dimensions
    got = apart2 <= carried2
    if plan.draws:
        miss = loss_probability(about, numbers.k, plan=plan)
    rolled = pair_numbers(me, j, flight)
    if plan.radio.receive is not None:
        passed = call_receive(me, j, got, {**about, **rolled}, flight)
        got = got & passed
    if plan.draws:
        got = got & (random.uniform(drawn_pair_word(me, j)) >= miss)
    # One packet of a pair is under way at a time, those behind it are dropped, as on a link that
    # repeats until it is acknowledged. A queue would need rows for each place in it.
    if plan.radio.late is not None:
        queue_packet(me, j, got, {**about, **rolled}, flight)
        deliver_due(me, j, packet, flight)
    elif plan.sees:
        glimpse(me, j, got, rolled, packet, flight)
    else:
        for a in range(dims):
            packet[a] = choose(got, flock.heard_position[a][j], flock.packet[a][me.i, j])
            packet[a + dims] = choose(got, flock.heard_velocity[a][j], flock.packet[a + dims][me.i, j])
        packet[2 * dims] = choose(got, sent_time(j, at, flock, plan=plan), flock.packet[2 * dims][me.i, j])
    for c in range(2 * dims + 1):
        flock.packet[c][me.i, j] = packet[c]


def glimpse(me: PairLoopAgent, j: int, got: Any, rolled: dict[str, Any], packet: Any, flight: FlightView) -> None:
    """Put the place of agent j into `packet`, by the newest picture that shows it to agent i.

    Places are those that agent i believes in, so the error of its own position is in all of them.
    """
    at, plan, flock, numbers = me.at, flight.plan, flight.flock, flight.numbers
    dims, w = plan.dimensions, numbers.w
    then, off, expected, v, ev = vector(), vector(), vector(), vector(), vector()
    since = sent_time(me.i, at, flock, plan=plan) - flock.packet[2 * dims][me.i, j]
    # What is kept is a place in the observer's own frame at the moment of the picture, so that the
    # error of the own position is in both terms and drops out where the law takes the difference.
    for a in range(dims):
        moved = apart(flock.position[a][me.i], flock.heard_position[a][me.i], a, w, plan=plan)
        then[a] = flock.measured_position[a][me.i] - moved
        off[a] = apart(flock.heard_position[a][j], flock.heard_position[a][me.i], a, w, plan=plan)
        ev[a] = flock.packet[a + dims][me.i, j]
        expected[a] = apart(flock.packet[a][me.i, j] + ev[a] * since, then[a], a, w, plan=plan)
        v[a] = flock.measured_velocity[a][me.i]
    t = call_rule(
        plan.radio.see, **components("d", off), **components("e", expected), **components("ev", ev),
        **components("v", v), since=since, period=numbers.c.period, **rolled,
        k=numbers.k,
    )  # fmt: skip
    for a in range(dims):
        # Nothing branches: a picture that does not show the other one leaves the old packet in
        # place.
        packet[a] = choose(got, then[a] + t[a], flock.packet[a][me.i, j])
        packet[a + dims] = choose(got, t[a + 3], flock.packet[a + dims][me.i, j])
    packet[2 * dims] = choose(got, sent_time(me.i, at, flock, plan=plan), flock.packet[2 * dims][me.i, j])


def call_receive(me: PairLoopAgent, j: int, near: Any, about: dict[str, Any], flight: FlightView) -> Any:
    """Return True if a packet arrives by the radio's own rule; keeps its new Packet where the pair is in range."""
    plan, flock, numbers = flight.plan, flight.flock, flight.numbers
    age = clock_time(me.at.time, me.i, flock, plan=plan) - flock.packet[2 * plan.dimensions][me.i, j]
    if plan.radio.Packet is not None:
        # What the rule remembers of a pair changes only where the two are in range, as if it had
        # not been called elsewhere.
        kept = plan.radio.Packet(*[flock.packet[plan.pocket + c][me.i, j] for c in field_indices(plan.radio.Packet)])
        hit = call_rule(plan.radio.receive, **about, age=age, packet=kept, k=numbers.k)
        for c in field_indices(plan.radio.Packet):
            flock.packet[plan.pocket + c][me.i, j] = choose(near, hit[1][c], flock.packet[plan.pocket + c][me.i, j])
    else:
        hit = call_rule(plan.radio.receive, **about, age=age, k=numbers.k)
    return (hit[0] if plan.radio.Packet is not None else hit) > HALF


def queue_packet(me: PairLoopAgent, j: int, got: Any, about: dict[str, Any], flight: FlightView) -> None:
    """Put a packet that is not lost on its way, unless another packet of this pair is on its way already."""
    at, plan, flock, numbers = me.at, flight.plan, flight.flock, flight.numbers
    dims, first, due = plan.dimensions, plan.waiting, 2 * plan.waiting
    goes = got & (flock.packet[due][me.i, j] < HALF * GONE)
    wait = call_rule(plan.radio.late, **about, k=numbers.k)
    # The waiting packet lies in rows of its own behind the newest one; both are tables [me.i, j] that
    # the pair loop passes in vectors.
    for a in range(dims):
        flock.packet[first + a][me.i, j] = choose(goes, flock.heard_position[a][j], flock.packet[first + a][me.i, j])
        flock.packet[first + a + dims][me.i, j] = choose(
            goes, flock.heard_velocity[a][j], flock.packet[first + a + dims][me.i, j]
        )
    flock.packet[first + 2 * dims][me.i, j] = choose(
        goes, sent_time(j, at, flock, plan=plan), flock.packet[first + 2 * dims][me.i, j]
    )
    flock.packet[due][me.i, j] = choose(goes, at.time + most(wait, ZERO), flock.packet[due][me.i, j])


def deliver_due(me: PairLoopAgent, j: int, packet: Any, flight: FlightView) -> None:
    """Deliver the packet on its way if it is due by now, within half a step."""
    at, plan, flock, numbers = me.at, flight.plan, flight.flock, flight.numbers
    first, due = plan.waiting, 2 * plan.waiting
    # Half a motion step of tolerance: float32 times of send and delay do not add up exactly to a
    # step.
    come = (flock.packet[due][me.i, j] > HALF * GONE) & (flock.packet[due][me.i, j] <= at.time + HALF * numbers.c.dt)
    for c in range(plan.waiting):
        packet[c] = choose(come, flock.packet[first + c][me.i, j], flock.packet[c][me.i, j])
    flock.packet[due][me.i, j] = choose(come, GONE, flock.packet[due][me.i, j])


def extrapolated(a: int, age: Any, packet: Any, *, plan: Plan) -> Any:
    """Return the believed place of the sender of a packet along one axis, m: as sent, or carried forward.

    Writes `core.radio.forward` out: as a call, compilers add in another order, and flights change
    in their last bits.
    """
    # Written out although `core.radio.forward` says the same; see the docstring.
    return packet[a] + packet[a + plan.dimensions] * age if plan.radio.carry is radio.forward else packet[a]


def carried_by_rule(age: Any, packet: Any, k: Any, *, plan: Plan) -> Any:
    """Return the believed place of the sender of a packet by a rule of the radio, all axes at once, m."""
    return call_rule(
        plan.radio.carry, x=packet[X], y=packet[Y], z=packet[Z] if plan.dimensions == 3 else ZERO,
        vx=packet[plan.dimensions + X], vy=packet[plan.dimensions + Y],
        vz=packet[plan.dimensions + Z] if plan.dimensions == 3 else ZERO, age=age, k=k,
    )  # fmt: skip


def packet_is_valid(age: Any, packet: Any, numbers: Any, *, plan: Plan) -> Any:
    """Return True if the newest packet of another agent, of this age (s), still counts.

    Over a radio that keeps it, it does until the next one comes; where lost neighbours stop an
    agent, until they count as lost.
    """
    # At 60 % loss, counting only the packets of this decision left an agent deaf to more than half
    # of its neighbours: smallest distance 0.3 m in ten seeds; with data believed for `patience`,
    # 2.9 m.
    return (
        (packet[2 * plan.dimensions] > -1e8) & (call_rule(plan.radio.lasts, age=age, k=numbers.k) > HALF)
        if plan.radio.lasts is not None
        else packet[2 * plan.dimensions] > -1e8
        if plan.radio.keeps_packets
        else silence.counts(age, numbers.silence) > HALF
    )


def load_packet(i: int, j: int, packet: Any, flock: FlockRows, *, plan: Plan) -> None:
    """Load the newest packet that agent i has of agent j into `packet`."""
    for c in range(2 * plan.dimensions + 1):
        packet[c] = flock.packet[c][i, j]
