"""Pair: what an agent hears of another one, and what its law makes of it."""

import math
from typing import Any

from airflock.core import random
from airflock.core.contract import Model
from airflock.core.maths import norm
from airflock.engine.plan import Plan
from airflock.engine.stages.air import carries, unshaded
from airflock.engine.stages.receive import (
    believed,
    by_clock,
    carried,
    hear,
    newest,
    on_record,
    sending_clock,
    unheard,
    word_of,
)  # fmt: skip
from airflock.engine.stages.records import Decision, Hearer, Other, Others, Reach, Surroundings
from airflock.engine.stages.state import Flock
from airflock.engine.stages.words import (
    FAR,
    GONE,
    HALF,
    ONE,
    SIDES,
    START,
    TINY,
    ZERO,
    X,
    Y,
    Z,
    ask,
    choose,
    integer,
    real,
    reduced,
    totals,
    vector,
)  # fmt: skip
from airflock.world.edges import nearest_image

# Where an agent meets but some of whom it hears, its others are gone through twice: who is heard, and, of those whom
# it meets, what they say.
BOTH, HEAR, ADD = "both", "hear", "add"


def heard_age(me: Hearer, j: int, at: Decision, flock: Flock, *, plan: Plan) -> Any:
    """How old the data of agent j are on arrival, as the clocks of both tell, s."""
    return at.late + flock.clock[me.i] - sending_clock(j, flock, plan=plan) if plan.suffers("clock") else at.late


def group_of(j: int, others: Others, *, plan: Plan) -> Any:
    """Number of the group of agent j; -1 where it is in none."""
    return others.group[j] if plan.grouped else GONE


def kin(i: int, j: int, flock: Flock, others: Others, *, plan: Plan) -> Any:
    """Whether two agents are of one group, 1 or 0; all are where nobody asks for groups."""
    return (ONE if others.group[j] == flock.own("", "group")[i] else ZERO) if plan.grouped else ONE


def away(me: Hearer, j: int, o: Any, flock: Flock, w: Any, *, plan: Plan) -> Any:
    """True offset o of agent j, m, and the square of its length, m²."""
    axes = range(plan.dimensions)
    for a in axes:
        o[a] = flock.position[a][j] - me.true[a]
    if plan.periodic:
        for a in axes:
            o[a] = nearest_image(o[a], getattr(w, SIDES[a]))
    return sum(o[a] * o[a] for a in axes)


def as_heard(
    me: Hearer, j: int, d: Any, dv: Any, packet: Any, age: Any, at: Decision, k: Any, flock: Flock, others: Others,
    *, plan: Plan,
) -> Any:  # fmt: skip
    """Offset d (m) and relative velocity dv (m/s) of agent j by what an agent has of it, and how old that is, s."""
    axes = range(plan.dimensions)
    if plan.packets:
        age = by_clock(at.time, me.i, flock, plan=plan) - packet[2 * plan.dimensions]
        if plan.turns:
            place = believed(age, packet, k, plan=plan)
        for a in axes:
            d[a] = (place[a] if plan.turns else carried(a, age, packet, plan=plan)) - me.own[a]
            dv[a] = packet[a + plan.dimensions] - me.v[a]
    else:
        for a in axes:
            d[a] = others.heard_position[a][j] - me.own[a]
            dv[a] = others.heard_velocity[a][j] - me.v[a]
    return age


def another(me: Hearer, q: int) -> Any:
    """Whether the one at place q among the others is there, and another agent."""
    return integer(q) != me.ii if me.end is None else (integer(q) != me.ii) & (integer(q) < me.end)


def counts(
    me: Hearer, j: int, q: int, part: str, apart2: Any, other: Other, reach: Reach, packet: Any, numbers: Any,
    flock: Flock, others: Others, *, plan: Plan, model: Model,
) -> Any:  # fmt: skip
    """Whether an agent hears agent j, or meets it, as far as distances say: in range, and within the law's reach."""
    if part == ADD:
        ok = others.met[q] > HALF
    elif plan.packets:  # the newest packet is heard on, as long as its sender is in range
        ok = (apart2 <= reach.radio_) & on_record(other.age, packet, numbers, plan=plan) & another(me, q)
    elif plan.perturbed:
        ok = (apart2 <= carries(me.i, j, reach.radio_, flock, plan=plan)) & another(me, q)
    else:
        ok = (other.r2 <= reach.radio_) & another(me, q)
    if model.reach is not None and (part != HEAR or plan.grid):
        ok = ok & (other.r2 <= reach.law)
    return ok


def truly_apart(me: Hearer, j: int, part: str, o: Any, flock: Flock, w: Any, *, plan: Plan) -> Any:
    """True offset o of agent j, m, and the square of its length, m², where either is asked for; else 0."""
    if (plan.perturbed or plan.packets) and part != ADD:  # noqa: SIM108 - a helper of several lines stands alone
        apart2 = away(me, j, o, flock, w, plan=plan)
    else:
        apart2 = ZERO
    return apart2


def whether_open(
    me: Hearer, j: int, reach: Reach, at: Decision, flock: Flock, w: Any, whole: Any, around: Surroundings,
    *, plan: Plan,
) -> Any:  # fmt: skip
    """Whether nothing stands between two agents, 1 or 0, where it shades the radio."""
    if plan.shades and at.drawn is not None:
        open_way = unshaded(me.i, j, reach.radio, flock, w, whole, around, plan=plan)
    else:
        open_way = flock.clear[j] if plan.shades else ONE
    return open_way


def receive_packet(
    me: Hearer, j: int, part: str, apart2: Any, o: Any, open_way: Any, reach: Reach, at: Decision, packet: Any,
    flock: Flock, numbers: Any, whole: Any, *, plan: Plan,
) -> None:  # fmt: skip
    """Let an agent hear what agent j has sent, and put the newest of it into `packet`, where packets are kept."""
    if plan.packets and part != ADD:
        carried2 = carries(me.i, j, reach.radio, flock, plan=plan)
        known = {
            "distance": math.sqrt(apart2 + TINY), "dx": o[X], "dy": o[Y], "dz": o[Z], "talkers": me.talkers,
            "vx": flock.velocity[X][me.i], "vy": flock.velocity[Y][me.i], "vz": flock.velocity[Z][me.i],
            "clear": open_way, "step": real(at.step), "period": numbers.c.period, "fast": at.fast, "slow": at.slow,
        }  # fmt: skip
        hear(me, j, apart2, carried2, known, at, packet, flock, numbers, whole, plan=plan)
    elif plan.packets:
        newest(me.i, j, packet, flock, plan=plan)


def arrives(me: Hearer, j: int, ok: Any, part: str, apart2: Any, r: Any, at: Decision, k: Any, *, plan: Plan) -> Any:
    """Whether what counts is not lost on the way, where radio.loss says that some is."""
    if plan.lossy and not plan.packets and part != ADD:
        distance = math.sqrt(apart2 + TINY) if plan.perturbed else r
        ok = ok & (random.uniform(word_of(me, j, at)) >= unheard({"distance": distance}, k, plan=plan))
    return ok


def add_rule(
    me: Hearer, j: int, ok: Any, other: Other, total: Any, flock: Flock, others: Others,
    *, plan: Plan, model: Model, sums: tuple[tuple[int, str], ...],
) -> None:  # fmt: skip
    """Add what the neighbour rule says of a pair to the totals, if the pair counts."""
    d, dv, v, h, nh = other.d, other.dv, me.v, me.h, other.h
    t = ask(
        model.neighbour, dx=d[X], dy=d[Y], dz=d[Z], r=other.r, r2=other.r2, dvx=dv[X], dvy=dv[Y], dvz=dv[Z],
        dv=other.speed, vx=v[X], vy=v[Y], vz=v[Z], hx=h[X], hy=h[Y], hz=h[Z], nhx=nh[X], nhy=nh[Y], nhz=nh[Z],
        age=other.age, lower=ONE if integer(others.number[j]) < me.number else ZERO,
        kin=kin(me.i, j, flock, others, plan=plan), group=group_of(j, others, plan=plan), p=me.p,
    )  # fmt: skip
    for c, how in sums:
        total[c] = reduced(how, total[c], choose(ok, t[c], START[how]))


def pair(
    me: Hearer, j: int, q: int, part: str, total: Any, reach: Reach, at: Decision, flock: Flock, others: Others,
    numbers: Any, whole: Any, around: Surroundings,
    *, plan: Plan, model: Model, sums: tuple[tuple[int, str], ...], images: bool,
) -> None:  # fmt: skip
    """Agent j, at place q among the others of an agent: who is heard (part = HEAR), what it says (ADD), or both."""
    axes, k, w, v = range(plan.dimensions), numbers.k, numbers.w, me.v
    d, dv, o, nh, packet = vector(), vector(), vector(), vector(), totals()
    age = heard_age(me, j, at, flock, plan=plan)
    apart2 = truly_apart(me, j, part, o, flock, w, plan=plan)
    open_way = whether_open(me, j, reach, at, flock, w, whole, around, plan=plan)
    receive_packet(me, j, part, apart2, o, open_way, reach, at, packet, flock, numbers, whole, plan=plan)
    age = as_heard(me, j, d, dv, packet, age, at, k, flock, others, plan=plan)
    if images:
        for a in axes:
            d[a] = nearest_image(d[a], getattr(w, SIDES[a]))
    if plan.dimensions == 2:
        d[Z] = ZERO
        dv[Z] = ZERO
    r2 = sum(d[a] * d[a] for a in axes) + TINY
    r = math.sqrt(r2)
    speed = math.sqrt(sum(dv[a] * dv[a] for a in axes) + TINY)
    g = ONE / norm(v[X] + dv[X], v[Y] + dv[Y], v[Z] + dv[Z])
    for a in (X, Y, Z):
        nh[a] = g * (v[a] + dv[a])
    other = Other(d, dv, nh, r, r2, speed, age)
    if part == HEAR:
        others.square[q] = FAR  # and so it stays where an interpreted driver goes on to the next one
    ok = counts(me, j, q, part, apart2, other, reach, packet, numbers, flock, others, plan=plan, model=model)
    ok = arrives(me, j, ok, part, apart2, r, at, k, plan=plan)
    if part == HEAR:
        if plan.placed:
            for a in axes:
                others.away[a][q] = d[a]
        others.square[q] = choose(ok, r2, FAR)
    else:
        add_rule(me, j, ok, other, total, flock, others, plan=plan, model=model, sums=sums)
