"""Pair: what an agent hears of another one, and what its law makes of it."""

import math
from collections.abc import Callable
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
    unheard,
    word_of,
)  # fmt: skip
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


def heard_age(i: int, j: int, late: float, flock: Flock, *, plan: Plan) -> Any:
    """How old the data of agent j are on arrival, as the clocks of both tell, s."""
    return late + flock.clock[i] - flock.clock[j] if plan.suffers("clock") else late


def group_of(j: int, flock: Flock, *, plan: Plan) -> Any:
    """Number of the group of agent j; -1 where it is in none."""
    return flock.own("", "group")[j] if plan.grouped else GONE


def kin(i: int, j: int, flock: Flock, *, plan: Plan) -> Any:
    """Whether two agents are of one group, 1 or 0; all are where nobody asks for groups."""
    return (ONE if flock.own("", "group")[j] == flock.own("", "group")[i] else ZERO) if plan.grouped else ONE


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


def truly_apart(j: int, part: str, true: Any, o: Any, flock: Flock, w: Any, *, plan: Plan) -> Any:
    """True offset o of agent j, m, and the square of its length, m², where either is asked for; else 0."""
    if (plan.perturbed or plan.packets) and part != ADD:  # noqa: SIM108 - a helper of several lines stands alone
        apart2 = away(j, true, o, flock, w, plan=plan)
    else:
        apart2 = ZERO
    return apart2


def whether_open(
    i: int, j: int, range2: Any, flock: Flock, w: Any, whole: Any, edges: Any, spans: Any, scene: Any,
    drawn: Callable[[int, int], Any] | None, *, plan: Plan,
) -> Any:  # fmt: skip
    """Whether nothing stands between two agents, 1 or 0, where it shades the radio."""
    if plan.shades and drawn is not None:  # noqa: SIM108 - as above
        open_way = unshaded(i, j, range2, flock, w, whole, edges, spans, scene, plan=plan)
    else:
        open_way = flock.clear[j] if plan.shades else ONE
    return open_way


def receive_packet(
    i: int, j: int, part: str, apart2: Any, o: Any, open_way: Any, talkers: Any, fast: Any, slow: Any, range2: Any,
    lot: Any, drawn: Callable[[int, int], Any] | None, late: Any, time: Any, packet: Any, flock: Flock, numbers: Any,
    whole: Any, decision: int, n: int, *, plan: Plan,
) -> None:  # fmt: skip
    """Let agent i hear what agent j has sent, and put the newest of it into `packet`, where packets are kept."""
    if plan.packets and part != ADD:
        carried2 = carries(i, j, range2, flock, plan=plan)
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


def arrives(
    i: int, j: int, ok: Any, part: str, apart2: Any, r: Any, lot: Any, drawn: Callable[[int, int], Any] | None, k: Any,
    *, plan: Plan,
) -> Any:  # fmt: skip
    """Whether what counts is not lost on the way, where radio.loss says that some is."""
    if plan.lossy and not plan.packets and part != ADD:
        distance = math.sqrt(apart2 + TINY) if plan.perturbed else r
        ok = ok & (random.uniform(word_of(i, j, lot, drawn)) >= unheard({"distance": distance}, k, plan=plan))
    return ok


def add_rule(
    i: int, j: int, ii: Any, ok: Any, d: Any, dv: Any, nh: Any, v: Any, h: Any, r: Any, r2: Any, speed: Any, age: Any,
    total: Any, own_p: Any, flock: Flock, *, plan: Plan, model: Model, sums: tuple[tuple[int, str], ...],
) -> None:  # fmt: skip
    """Add what the neighbour rule says of a pair to the totals, if the pair counts."""
    t = ask(
        model.neighbour, dx=d[X], dy=d[Y], dz=d[Z], r=r, r2=r2, dvx=dv[X], dvy=dv[Y], dvz=dv[Z],
        dv=speed, vx=v[X], vy=v[Y], vz=v[Z], hx=h[X], hy=h[Y], hz=h[Z], nhx=nh[X], nhy=nh[Y], nhz=nh[Z],
        age=age, lower=ONE if integer(j) < ii else ZERO, kin=kin(i, j, flock, plan=plan),
        group=group_of(j, flock, plan=plan), p=own_p,
    )  # fmt: skip
    for c, how in sums:
        total[c] = reduced(how, total[c], choose(ok, t[c], START[how]))


def pair(
    i: int, j: int, ii: Any, part: str, own: Any, v: Any, true: Any, h: Any, total: Any, own_p: Any, talkers: Any,
    fast: Any, slow: Any, range_: Any, range2: Any, near2: Any, lot: Any, drawn: Callable[[int, int], Any] | None,
    late: Any, time: Any, flock: Flock, numbers: Any, whole: Any, edges: Any, spans: Any, scene: Any, decision: int,
    n: int, *, plan: Plan, model: Model, sums: tuple[tuple[int, str], ...], images: bool,
) -> None:  # fmt: skip
    """One other agent j of agent i: who is heard (part = HEAR), what it says (ADD), or both."""
    axes, k, w = range(plan.dimensions), numbers.k, numbers.w
    d, dv, o, nh, packet = vector(), vector(), vector(), vector(), totals()
    age = heard_age(i, j, late, flock, plan=plan)
    apart2 = truly_apart(j, part, true, o, flock, w, plan=plan)
    open_way = whether_open(i, j, range_ * range_, flock, w, whole, edges, spans, scene, drawn, plan=plan)
    receive_packet(
        i, j, part, apart2, o, open_way, talkers, fast, slow, range_ * range_, lot, drawn, late, time, packet, flock,
        numbers, whole, decision, n, plan=plan,
    )  # fmt: skip
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
    ok = counts(i, j, ii, part, apart2, r2, range2, near2, age, packet, numbers, flock, plan=plan, model=model)
    ok = arrives(i, j, ok, part, apart2, r, lot, drawn, k, plan=plan)
    if part == HEAR:
        if plan.placed:
            for a in axes:
                flock.away[a][j] = d[a]
        flock.square[j] = choose(ok, r2, FAR)
    else:
        add_rule(
            i, j, ii, ok, d, dv, nh, v, h, r, r2, speed, age, total, own_p, flock, plan=plan, model=model, sums=sums
        )  # fmt: skip
