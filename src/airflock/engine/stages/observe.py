"""Observe: what a policy outside of the flight gets of each agent, as rows: what it measures, hears and is free of."""

from collections.abc import Iterable
from typing import Any

from airflock.engine.plan import Plan
from airflock.engine.stages.decide import goal_offset
from airflock.engine.stages.meet import free_distance
from airflock.engine.stages.percept import height_above_middle
from airflock.engine.stages.records import FlightView
from airflock.engine.stages.state import FlockRows
from airflock.engine.stages.words import FAR, HALF, ONE, ZERO, X, Y, Z, choose, integer, least, row_index, totals

RAY_LENGTH = 100.0  # m; our choice: some ten seconds of a fast drone


def free_way(i: int, ux: float, uy: float, uz: float, flight: FlightView) -> Any:
    """Return how far the way of agent i along the unit vector u is free, at most RAY_LENGTH, m."""
    plan, corners = flight.plan, flight.whole.corners
    x, w, edges = flight.flock.measured_position, flight.numbers.w, flight.around.edges
    z = height_above_middle(x[Z][i], edges, corners, plan=plan)
    walls = plan.ray(x[X][i], x[Y][i], z, ux, uy, uz, w.half_x, w.half_y, w.half_z, edges, corners)
    free = least(RAY_LENGTH, walls)
    way = free_distance(x[X][i], x[Y][i], x[Z][i], ux, uy, uz, free, flight)
    return way


def keep_nearest(i: int, others: Iterable[int], flock: FlockRows, first: int, *, plan: Plan) -> None:
    """Keep the nearest that agent i has heard, and meets, from column `first` on; zeros where there are fewer."""
    count, dims = plan.observe[0], plan.dimensions
    best, who = totals(), totals()
    for s in range(count):
        best[s] = FAR
        who[s] = integer(0)
    # The least so far stay sorted in registers: a newcomer moves past all that are farther. Few
    # come nearer than the last, so the test before is nearly always one that is foreseen.
    for j in others:
        square = flock.square[j] if plan.topology is None else choose(flock.met[j] > HALF, flock.square[j], FAR)
        if square < best[count - 1]:
            one = integer(j)
            for s in range(count):
                nearer = square < best[s]
                farther = choose(nearer, best[s], square)
                behind = choose(nearer, who[s], one)
                best[s] = least(square, best[s])
                who[s] = choose(nearer, one, who[s])
                square = farther
                one = behind
    for s in range(count):
        there = best[s] < HALF * FAR
        k = row_index(who[s])
        column = first + s * (2 * dims + 2)
        for a in range(dims):
            flock.seen[column + a][i] = choose(there, flock.away[a][k], ZERO)
            flock.seen[column + dims + a][i] = choose(there, flock.closing[a][k], ZERO)
        flock.seen[column + 2 * dims][i] = choose(there, flock.heard_age[k], ZERO)
        flock.seen[column + 2 * dims + 1][i] = choose(there, ONE, ZERO)


def observe(i: int, others: Iterable[int], flight: FlightView) -> None:
    """Fill the rows of what agent i observes, in the order of `Plan.observed`."""
    plan, flock = flight.plan, flight.flock
    for a in range(plan.dimensions):
        flock.seen[plan.observed["velocity"][a]][i] = flock.measured_velocity[a][i]
    for a, column in enumerate(plan.observed["goal"]):
        flock.seen[column][i] = goal_offset(i, a, flight)
    for column, (ux, uy, uz) in zip(plan.observed["free"], plan.ray_directions, strict=True):
        flock.seen[column][i] = free_way(i, ux, uy, uz, flight)
    if plan.observe[0]:
        keep_nearest(i, others, flock, plan.observed["neighbours"][0], plan=plan)
