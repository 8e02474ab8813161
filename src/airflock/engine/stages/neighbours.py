"""Neighbours: sum a law's rule over all agents in range of each agent."""

import math
from collections.abc import Callable, Iterable
from typing import Any

from airflock.core import random
from airflock.core.contract import Model
from airflock.core.maths import norm
from airflock.engine.plan import Plan
from airflock.engine.stages.receive import (
    believed,
    by_clock,
    carried,
    carries,
    crowd,
    first_of_four,
    hear,
    newest,
    on_record,
    sent,
    shade,
    unheard,
    unshaded,
    word_of,
)  # fmt: skip
from airflock.engine.stages.state import Flock, numbers_of
from airflock.engine.stages.words import (
    FAR,
    GONE,
    HALF,
    LIMIT,
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
    least,
    real,
    reduced,
    totals,
    vector,
)  # fmt: skip
from airflock.world.edges import nearest_image

# Where an agent meets but some of whom it hears, its others are gone through twice: who is heard, and, of those whom
# it meets, what they say.
BOTH, HEAR, ADD = "both", "hear", "add"


def heard_age(i: int, j: int, late: float, flock: Flock, *, plan: Plan) -> Any:
    """How old the data of agent j are on arrival, as the clocks of both tell, s."""
    return late + flock.clock[i] - flock.clock[j] if plan.suffers("clock") else late


def group_of(j: int, flock: Flock, *, plan: Plan) -> Any:
    """Number of the group of agent j; -1 where it is in none."""
    return flock.own("", "group")[j] if plan.grouped else GONE


def kin(i: int, j: int, flock: Flock, *, plan: Plan) -> Any:
    """Whether two agents are of one group, 1 or 0; all are where nobody asks for groups."""
    return (ONE if flock.own("", "group")[j] == flock.own("", "group")[i] else ZERO) if plan.grouped else ONE


def oneself(i: int, own: Any, v: Any, h: Any, true: Any, flock: Flock, *, plan: Plan) -> None:
    """Where agent i believes that it is (own), how it moves (v) and heads (h), and where it is (true)."""
    axes = range(plan.dimensions)
    for a in axes:
        own[a] = flock.measured_position[a][i]
        v[a] = flock.measured_velocity[a][i]
    if plan.dimensions == 2:
        v[Z] = ZERO
    if plan.perturbed or plan.packets:
        for a in axes:
            true[a] = flock.position[a][i]
    f = ONE / norm(v[X], v[Y], v[Z])
    for a in (X, Y, Z):
        h[a] = f * v[a]


def away(j: int, true: Any, o: Any, flock: Flock, w: Any, *, plan: Plan) -> Any:
    """True offset o of agent j, m, and the square of its length, m²."""
    axes = range(plan.dimensions)
    for a in axes:
        o[a] = flock.position[a][j] - true[a]
    if plan.periodic:
        for a in axes:
            o[a] = nearest_image(o[a], getattr(w, SIDES[a]))
    return sum(o[a] * o[a] for a in axes)


def as_heard(
    i: int, j: int, own: Any, v: Any, d: Any, dv: Any, packet: Any, age: Any, time: Any, k: Any, flock: Flock,
    *, plan: Plan,
) -> Any:  # fmt: skip
    """Offset d (m) and relative velocity dv (m/s) of agent j by what agent i has of it, and how old that is, s."""
    axes = range(plan.dimensions)
    if plan.packets:
        age = by_clock(time, i, flock, plan=plan) - packet[2 * plan.dimensions]
        if plan.turns:
            at = believed(age, packet, k, plan=plan)
        for a in axes:
            d[a] = (at[a] if plan.turns else carried(a, age, packet, plan=plan)) - own[a]
            dv[a] = packet[a + plan.dimensions] - v[a]
    else:
        for a in axes:
            d[a] = flock.heard_position[a][j] - own[a]
            dv[a] = flock.heard_velocity[a][j] - v[a]
    return age


def counts(
    i: int, j: int, ii: Any, part: str, apart2: Any, r2: Any, range2: Any, near2: Any, age: Any, packet: Any,
    numbers: Any, flock: Flock, *, plan: Plan, model: Model,
) -> Any:  # fmt: skip
    """Whether agent i hears agent j, or meets it, as far as distances say: within range, and within the law's reach."""
    if part == ADD:
        ok = flock.met[j] > HALF
    elif plan.packets:  # the newest packet is heard on, as long as its sender is in range
        ok = (apart2 <= range2) & on_record(age, packet, numbers, plan=plan) & (integer(j) != ii)
    elif plan.perturbed:
        ok = (apart2 <= carries(i, j, range2, flock, plan=plan)) & (integer(j) != ii)
    else:
        ok = (r2 <= range2) & (integer(j) != ii)
    if model.reach is not None and (part != HEAR or plan.grid):
        ok = ok & (r2 <= near2)
    return ok


def neighbours(  # noqa: C901 - tests of the plan leave one way through
    agents: Iterable[int], others: Iterable[int], flock: Flock, numbers: Any, whole: Any, n: int, decision: int,
    time: float, late: float, edges: Any, spans: Any, scene: Any, words: Any, draw: Callable[[int], None] | None,
    drawn: Callable[[int, int], Any] | None, meet: Callable[[int], None],
    *, plan: Plan, model: Model, sums: tuple[tuple[int, str], ...], images: bool,
) -> None:  # fmt: skip
    """Sum the neighbour rule over all others in range of each agent, or over those that its topology lets it meet.

    late   : how old is what is heard on arrival, s
    edges, spans, scene : what stands in the world, where it shades the radio
    draw   : where packets are lost, fills the rows of `words` for agent i and the others of its four
    drawn  : instead of it, draws the random word of what agent j sends agent i; each pair is then looked at by itself,
             also for what stands between the two
    meet   : finds whom of those whom agent i hears it meets, where that is not all of them
    sums   : each field of Sums that is summed, and how it is reduced
    images : whether offsets go to the nearest image (candidates that come by cells are at theirs)
    """
    axes, k, w = range(plan.dimensions), numbers.k, numbers.w
    selective = plan.draws
    true_range = plan.perturbed  # who is in range is a matter of true distances
    # A neighbour at exactly the range or the reach counts. Squares of distances that carry the guard TINY, which only
    # double precision can tell, are compared with squares that carry it, too.
    exact = plan.bits == 64
    range_ = least(k.range, LIMIT)
    range2 = range_ * range_ + TINY if exact and not true_range else range_ * range_
    if model.reach is not None and not plan.varies("p"):
        near = least(ask(model.reach, p=numbers.p), LIMIT)
        near2 = near * near + TINY if exact else near * near
    else:
        near2 = LIMIT
    fast = sent(decision, getattr(k, plan.radio.rates[0]), numbers) if len(plan.radio.rates) > 0 else ZERO
    slow = sent(decision, getattr(k, plan.radio.rates[1]), numbers) if len(plan.radio.rates) > 1 else ZERO
    for i in agents:
        ii = integer(i)
        own_p = numbers_of(i, "p", flock, numbers, plan=plan)
        if model.reach is not None and plan.varies("p"):
            near = least(ask(model.reach, p=own_p), LIMIT)
            near2 = near * near + TINY if exact else near * near
        if selective and draw is not None:
            if plan.sequential or plan.laws:
                draw(i)
            else:
                if first_of_four(i, flock):
                    draw(i)
            lot = words[flock.number[i] & 3]
        own, v, true, h, total = vector(), vector(), vector(), vector(), totals()
        oneself(i, own, v, h, true, flock, plan=plan)
        for c, how in sums:
            total[c] = START[how]
        if plan.radio.asks("talkers"):  # noqa: SIM108 - a helper of several lines stands where it is assigned
            talkers = crowd(i, others, range_ * range_, flock, w, plan=plan)
        else:
            talkers = ZERO
        if plan.shades and drawn is None:
            shade(i, others, range_ * range_, flock, w, whole, edges, spans, scene, plan=plan)
        for part in (BOTH,) if plan.topology is None else (HEAR, ADD):
            for j in others:
                d, dv, o, nh, packet = vector(), vector(), vector(), vector(), totals()
                age = heard_age(i, j, late, flock, plan=plan)
                if (true_range or plan.packets) and part != ADD:  # noqa: SIM108 - as above
                    apart2 = away(j, true, o, flock, w, plan=plan)
                else:
                    apart2 = ZERO
                if plan.shades and drawn is not None:  # noqa: SIM108 - as above
                    open_way = unshaded(i, j, range_ * range_, flock, w, whole, edges, spans, scene, plan=plan)
                else:
                    open_way = flock.clear[j] if plan.shades else ONE
                if plan.packets and part != ADD:
                    carried2 = carries(i, j, range_ * range_, flock, plan=plan)
                    known = {
                        "distance": math.sqrt(apart2 + TINY), "dx": o[X], "dy": o[Y], "dz": o[Z], "talkers": talkers,
                        "vx": flock.velocity[X][i], "vy": flock.velocity[Y][i], "vz": flock.velocity[Z][i],
                        "clear": open_way, "step": real(decision),
                        "period": numbers.c.period, "fast": fast, "slow": slow,
                    }  # fmt: skip
                    hear(
                        i, j, apart2, carried2, known, lot, drawn, late, time, packet, flock, numbers, whole, decision,
                        n, plan=plan,
                    )  # fmt: skip
                elif plan.packets:
                    newest(i, j, packet, flock, plan=plan)
                age = as_heard(i, j, own, v, d, dv, packet, age, time, k, flock, plan=plan)
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
                if part == HEAR:
                    flock.square[j] = FAR  # and so it stays where an interpreted driver goes on to the next one
                ok = counts(
                    i, j, ii, part, apart2, r2, range2, near2, age, packet, numbers, flock, plan=plan, model=model
                )  # fmt: skip
                if plan.lossy and not plan.packets and part != ADD:
                    distance = math.sqrt(apart2 + TINY) if true_range else r
                    ok = ok & (
                        random.uniform(word_of(i, j, lot, drawn)) >= unheard({"distance": distance}, k, plan=plan)
                    )
                if part == HEAR:
                    if plan.placed:
                        for a in axes:
                            flock.away[a][j] = d[a]
                    flock.square[j] = choose(ok, r2, FAR)
                else:
                    t = ask(
                        model.neighbour, dx=d[X], dy=d[Y], dz=d[Z], r=r, r2=r2, dvx=dv[X], dvy=dv[Y], dvz=dv[Z],
                        dv=speed, vx=v[X], vy=v[Y], vz=v[Z], hx=h[X], hy=h[Y], hz=h[Z], nhx=nh[X], nhy=nh[Y], nhz=nh[Z],
                        age=age, lower=ONE if integer(j) < ii else ZERO, kin=kin(i, j, flock, plan=plan),
                        group=group_of(j, flock, plan=plan), p=own_p,
                    )  # fmt: skip
                    for c, how in sums:
                        total[c] = reduced(how, total[c], choose(ok, t[c], START[how]))
            if part == HEAR:
                meet(i)
        for c, _ in sums:
            flock.sums[c][i] = total[c]
