"""Pair: an agent hears another one, and its law turns that into terms of its sums."""

import math
from typing import Any

from airflock.core import norm, random
from airflock.engine.plan import Plan
from airflock.engine.stages.air import is_clear, squared_range
from airflock.engine.stages.receive import (
    carried_by_rule,
    clock_time,
    drawn_pair_word,
    extrapolated,
    load_packet,
    loss_probability,
    packet_is_valid,
    sending_clock,
    update_packet,
)  # fmt: skip
from airflock.engine.stages.records import CandidateRows, FlightView, NeighbourEstimate, PairLoopAgent
from airflock.engine.stages.state import FlockRows
from airflock.engine.stages.words import *
from airflock.world import nearest_image

# Where a topology chooses, the pair loop runs twice: first to find the agents that are heard, then
# to add the terms of those that are met. An observer looks at what the law has received already.
HEAR_AND_ADD, HEAR, ADD, LOOK = "both", "hear", "add", "look"
Sums = tuple[tuple[int, str], ...]  # each field of Sums that is summed, and how it is reduced


def heard_age(me: PairLoopAgent, j: int, flock: FlockRows, *, plan: Plan) -> Any:
    """Return the age of the data of agent j on arrival, by the clocks of both, s."""
    return me.at.late + flock.clock[me.i] - sending_clock(j, flock, plan=plan) if plan.suffers("clock") else me.at.late


def group_of(j: int, others: CandidateRows, *, plan: Plan) -> Any:
    """Number of the group of agent j; -1 where it is in none."""
    return others.group[j] if plan.uses_groups else GONE


def same_group(i: int, j: int, flock: FlockRows, others: CandidateRows, *, plan: Plan) -> Any:
    """Return 1 if two agents are of one group, else 0; always 1 where no rule uses groups."""
    # A rule sees of groups only two words, `kin` and `group`: what a group means is the business of
    # the law.
    return (ONE if others.group[j] == flock.own("", "group")[i] else ZERO) if plan.uses_groups else ONE


def true_offset(me: PairLoopAgent, j: int, o: Any, flight: FlightView) -> Any:
    """Fill the true offset o of agent j, m, and return its squared length, m²."""
    axes = range(flight.plan.dimensions)
    # Two loops over the axes, one after the other: they are written out, and the second stands only
    # in a periodic box.
    for a in axes:
        o[a] = flight.flock.position[a][j] - me.true[a]
    if flight.plan.periodic:
        for a in axes:
            o[a] = nearest_image(o[a], getattr(flight.numbers.w, HALF_SIZES[a]))
    return sum(o[a] * o[a] for a in axes)


def as_heard(me: PairLoopAgent, j: int, d: Any, dv: Any, packet: Any, age: Any, flight: FlightView) -> Any:
    """Offset d (m) and relative velocity dv (m/s) of agent j by what an agent has of it, and how old that is, s."""
    plan, flock, axes = flight.plan, flight.flock, range(flight.plan.dimensions)
    if plan.packets:
        age = clock_time(me.at.time, me.i, flock, plan=plan) - packet[2 * plan.dimensions]
        # The usual radios write their coordinate out axis by axis: as a call of a rule the compiler
        # adds in another order, and flights over links would lose their last bits.
        if plan.turns:
            place = carried_by_rule(age, packet, flight.numbers.k, plan=plan)
        for a in axes:
            d[a] = (place[a] if plan.turns else extrapolated(a, age, packet, plan=plan)) - me.own[a]
            dv[a] = packet[a + plan.dimensions] - me.v[a]
    else:
        for a in axes:
            d[a] = me.others.heard_position[a][j] - me.own[a]
            dv[a] = me.others.heard_velocity[a][j] - me.v[a]
    return age


def is_other(me: PairLoopAgent, q: int) -> Any:
    """Return True if place q among the others holds an agent, and not the agent itself."""
    return integer(q) != me.ii if me.end is None else (integer(q) != me.ii) & (integer(q) < me.end)


def pair_counts(
    me: PairLoopAgent, j: int, q: int, part: str, apart2: Any, other: NeighbourEstimate, packet: Any, flight: FlightView
) -> Any:
    """Return True if agent j counts by distance: in radio range (or met), and within the law's reach."""
    plan, reach = flight.plan, me.reach
    # Range of the radio (true distance) first, the law's own reach (believed distance) last;
    # exactly on the edge counts.
    if part == ADD:
        ok = me.others.met[q] > HALF
    elif plan.packets:  # the newest packet is heard on, as long as its sender is in range
        ok = (apart2 <= reach.radio_) & packet_is_valid(other.age, packet, flight.numbers, plan=plan) & is_other(me, q)
    elif plan.perturbed:
        ok = (apart2 <= squared_range(me.i, j, reach.radio_, flight.flock, plan=plan)) & is_other(me, q)
    else:
        ok = (other.r2 <= reach.radio_) & is_other(me, q)
    if flight.model.reach is not None and part != LOOK and (part != HEAR or plan.grid):
        ok = ok & (other.r2 <= reach.law)
    return ok


def true_offset_if_asked(me: PairLoopAgent, j: int, part: str, o: Any, flight: FlightView) -> Any:
    """Fill the true offset o of agent j, m, and return its squared length, m², where rules need it; else return 0."""
    # Without delay, sensor errors or packets the believed offset is the true one; a second
    # subtraction would cost every pair.
    if (flight.plan.perturbed or flight.plan.packets) and part != ADD:  # noqa: SIM108 - a helper of several lines stands alone
        apart2 = true_offset(me, j, o, flight)
    else:
        apart2 = ZERO
    return apart2


def is_clear_between(me: PairLoopAgent, j: int, flight: FlightView) -> Any:
    """Return 1 if nothing that shades the radio stands between two agents, else 0."""
    if flight.plan.shades and me.at.drawn is not None:
        # A GPU has no row per agent for this: a table of all pairs would not fit, so each pair is
        # cast inside the loop.
        open_way = is_clear(me.i, j, me.reach.radio, flight)
    else:
        open_way = flight.flock.clear[j] if flight.plan.shades else ONE
    return open_way


def receive_packet(
    me: PairLoopAgent, j: int, part: str, apart2: Any, o: Any, open_way: Any, packet: Any, flight: FlightView
) -> None:
    """Let an agent hear what agent j has sent, and put the newest of it into `packet`, where packets are kept."""
    plan, flock, at = flight.plan, flight.flock, me.at
    if plan.packets and part not in (ADD, LOOK):
        # Everything that a rule of the radio may take is offered by name; a driver computes only
        # the arguments of its rule.
        carried2 = squared_range(me.i, j, me.reach.radio, flock, plan=plan)
        known = {
            "distance": math.sqrt(apart2 + TINY), **components("d", o), "talkers": me.talkers,
            **row_components("v", flock.velocity, me.i),
            "clear": open_way, "step": real(at.step), "period": flight.numbers.c.period,
            "fast": at.fast, "slow": at.slow,
        }  # fmt: skip
        update_packet(me, j, apart2, carried2, known, packet, flight)
    elif plan.packets:
        load_packet(me.i, j, packet, flock, plan=plan)


def packet_arrives(me: PairLoopAgent, j: int, ok: Any, part: str, apart2: Any, r: Any, flight: FlightView) -> Any:
    """Return True if a pair that counts also receives its packet, by the loss of the radio."""
    plan = flight.plan
    if plan.lossy and not plan.packets and part != ADD:
        # One uniform number against one probability decides loss and both links: three draws a
        # pair, real powers and rows written and read again made two lossy links ten times as dear
        # as an ideal radio; this way 1.7 times.
        distance = math.sqrt(apart2 + TINY) if plan.perturbed else r
        ok = ok & (
            random.uniform(drawn_pair_word(me, j))
            >= loss_probability({"distance": distance}, flight.numbers.k, plan=plan)
        )
    return ok


def add_rule(
    me: PairLoopAgent, j: int, ok: Any, other: NeighbourEstimate, total: Any, flight: FlightView, *, sums: Sums
) -> None:
    """Add what the neighbour rule says of a pair to the totals, if the pair counts."""
    plan, others = flight.plan, me.others
    t = call_rule(
        flight.model.neighbour, **components("d", other.d), r=other.r, r2=other.r2, **components("dv", other.dv),
        dv=other.speed, **components("v", me.v), **components("h", me.h), **components("nh", other.h),
        age=other.age, lower=ONE if integer(others.number[j]) < me.number else ZERO,
        kin=same_group(me.i, j, flight.flock, others, plan=plan), group=group_of(j, others, plan=plan), p=me.p,
    )  # fmt: skip
    # The rule is called for every pair, and choose() drops what does not count: a branch would end
    # the vector loop.
    for c, how in sums:
        total[c] = reduce_term(how, total[c], choose(ok, t[c], REDUCTION_START[how]))


def pair(
    me: PairLoopAgent, j: int, q: int, part: str, total: Any, flight: FlightView, *, sums: Sums, images: bool
) -> None:
    """Agent j, at place q among the others of an agent: who is heard (part = HEAR), what it says (ADD), or both."""
    plan, others, axes, v = flight.plan, me.others, range(flight.plan.dimensions), me.v
    d, dv, o, nh, packet = vector(), vector(), vector(), vector(), totals()
    # The order is that of the physics: what is truly in range, whether a packet arrives, what is
    # believed of its sender, and only then what the law makes of that. All in one loop, so that
    # nothing between goes through memory.
    age = heard_age(me, j, flight.flock, plan=plan)
    apart2 = true_offset_if_asked(me, j, part, o, flight)
    open_way = is_clear_between(me, j, flight)
    receive_packet(me, j, part, apart2, o, open_way, packet, flight)
    age = as_heard(me, j, d, dv, packet, age, flight)
    # Candidates that come by cells are at their nearest image already; all pairs find it here, once
    # for the offset.
    if images:
        for a in axes:
            d[a] = nearest_image(d[a], getattr(flight.numbers.w, HALF_SIZES[a]))
    if plan.dimensions == 2:
        d[Z] = ZERO
        dv[Z] = ZERO
    # TINY keeps the length above zero: rules divide by it.
    r2 = sum(d[a] * d[a] for a in axes) + TINY
    r = math.sqrt(r2)
    speed = math.sqrt(sum(dv[a] * dv[a] for a in axes) + TINY)
    g = ONE / norm(v[X] + dv[X], v[Y] + dv[Y], v[Z] + dv[Z])
    for a in (X, Y, Z):
        nh[a] = g * (v[a] + dv[a])
    other = NeighbourEstimate(d, dv, nh, r, r2, speed, age)
    if part in (HEAR, LOOK):
        # Where a topology chooses, pairs are visited twice: a rule that ranks neighbours must know
        # all before it adds one.
        others.square[q] = FAR  # and so it stays where an interpreted driver goes on to the next one
    ok = pair_counts(me, j, q, part, apart2, other, packet, flight)
    ok = packet_arrives(me, j, ok, part, apart2, r, flight)
    if part in (HEAR, LOOK):
        if plan.placed or plan.observes:
            for a in axes:
                others.away[a][q] = d[a]
        if plan.observes:
            for a in axes:
                flight.flock.closing[a][j] = dv[a]
            flight.flock.heard_age[j] = age
        others.square[q] = choose(ok, r2, FAR)
    else:
        add_rule(me, j, ok, other, total, flight, sums=sums)
