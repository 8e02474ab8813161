"""Air: what the true places of agents say of their packets: how far they carry, how many talk, what shades them."""

import math
from collections.abc import Iterable
from typing import Any

from airflock.engine.plan import Plan
from airflock.engine.stages.meet import free_distance
from airflock.engine.stages.records import FlightView
from airflock.engine.stages.state import FlockRows
from airflock.engine.stages.words import *
from airflock.world import nearest_image


def squared_range(i: int, j: int, range2: Any, flock: FlockRows, *, plan: Plan) -> Any:
    """Square of how far packets of agent j carry to agent i, m²; who is seen need not send."""
    return (
        range2
        if not plan.suffers("radio")
        else least(range2, flock.reach_in[i])
        if plan.sees
        else least(least(range2, flock.reach_in[i]), flock.reach_out[j])
    )


def apart(there: Any, here: Any, a: int, w: Any, *, plan: Plan) -> Any:
    """Offset between two coordinates along one axis, to the nearest image, m."""
    return nearest_image(there - here, getattr(w, HALF_SIZES[a])) if plan.periodic else there - here


def talkers_in_range(i: int, others: Iterable[int], range2: Any, flock: FlockRows, w: Any, *, plan: Plan) -> Any:
    """Count the other agents that are truly within the range of the radio of agent i."""
    talkers = ZERO
    # Counted over true places and before the pair loop, as a radio that shares its channel needs
    # the number for every pair.
    for j in others:
        o = vector()
        for a in range(plan.dimensions):
            o[a] = apart(flock.position[a][j], flock.position[a][i], a, w, plan=plan)
        audible = sum(o[a] * o[a] for a in range(plan.dimensions)) <= range2
        talkers = talkers + choose(audible & (integer(j) != integer(i)), ONE, ZERO)
    return talkers


def fill_clear(i: int, others: Iterable[int], range2: Any, flight: FlightView) -> None:
    """Fill the row `clear`: 1 where nothing stands between the true places of agent i and another one."""
    # A cast branches; its answers go to a row first, so that the pair loop itself stays one of
    # vectors.
    for j in others:
        open_way = is_clear(i, j, range2, flight)
        flight.flock.clear[j] = open_way


def is_clear(i: int, j: int, range2: Any, flight: FlightView) -> Any:
    """Return 1 if nothing stands between the true places of two agents in range of each other, else 0."""
    plan, x = flight.plan, flight.flock.position
    open_way = ONE
    o = vector()
    for a in range(plan.dimensions):
        o[a] = apart(x[a][j], x[a][i], a, flight.numbers.w, plan=plan)
    apart2 = sum(o[a] * o[a] for a in range(plan.dimensions))
    # A cast is dear: only pairs in range of each other are cast at.
    if (apart2 <= range2) & (integer(j) != integer(i)):
        r = math.sqrt(apart2 + TINY)
        ux = o[X] / r
        uy = o[Y] / r
        uz = o[Z] / r
        free = free_distance(x[X][i], x[Y][i], x[Z][i], ux, uy, uz, r, flight)
        open_way = ZERO if free < r else ONE
    return open_way
