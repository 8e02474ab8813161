"""Approach: how near two agents may have come since pairs were last looked at, so that most steps look at none.

A pair comes nearer by no more than what both move beside a velocity that they share. So what counts
is how fast agents are beside the drift of the flock, the mean velocity when pairs were last looked
at: a flock that flies past at 20 m/s without a change of shape has nothing to look for.
"""

import math
from collections.abc import Iterable
from typing import Any

from airflock.engine.plan import Plan
from airflock.engine.stages.measure import offset
from airflock.engine.stages.state import FlockRows
from airflock.engine.stages.words import *

# places in `held` (`passes.driver.flight` says what each is); DRIFT is the first of three
TRAVELLED, GAP, CALM, ENDED, BEGUN, DRIFT, PACE, REACH = 0, 1, 2, 3, 4, 5, 8, 9
HELD_SIZE = 10
BLOCK = 32  # lanes that loops take at a time (`passes.driver.SPAN`)
# Covers rounding of the distances themselves; a pair of agents closer than the bound by less than 1
# cm is looked at.
SLACK = 0.01  # m
# Single precision loses up to 5e-7 of the coordinate in a step. Slow changes of shape take many
# steps between two looks, and far from the origin the slack of 1 cm alone would not cover the sum.
ROUNDING = 5e-7  # how much nearer two agents come in a step by rounding in single precision, for each m from the origin


def start_drift(held: Any, flock: FlockRows, n: int, *, plan: Plan) -> None:
    """Keep the velocity with which the flock drifts, and how far from the origin agents are, m."""
    mean = vector()
    for a in range(plan.dimensions):
        mean[a] = ZERO
    far2 = ZERO
    # A flock flies together: relative to its mean velocity agents hardly approach each other.
    # Counting absolute speeds looked for pairs at 16 and 32 m/s so often that flights took 1.09 and
    # 1.07 times as long.
    for i in range(n):
        for a in range(plan.dimensions):
            mean[a] = mean[a] + flock.velocity[a][i]
        far2 = most(far2, sum(flock.position[a][i] * flock.position[a][i] for a in range(plan.dimensions)))
    for a in range(plan.dimensions):
        held[DRIFT + a] = mean[a] / most(real(n), ONE)
    held[PACE] = math.sqrt(sum(held[DRIFT + a] * held[DRIFT + a] for a in range(plan.dimensions)))
    held[REACH] = math.sqrt(far2)


def approach_bound(held: Any, fastest: Any, dt: Any) -> Any:
    """Bound how much nearer two agents may have come in a step, m.

    fastest : largest squared speed beside the drift, m²/s²
    """
    held[REACH] = held[REACH] + (held[PACE] + math.sqrt(fastest)) * dt
    # Factor 2: both agents of a pair may move towards each other at the largest speed beside the
    # drift.
    return 2.0 * math.sqrt(fastest) * dt + ROUNDING * held[REACH]


def velocity_beside_drift(i: int, a: int, held: Any, flock: FlockRows) -> Any:
    """Velocity of agent i along one axis beside the drift, m/s."""
    return flock.velocity[a][i] - held[DRIFT + a]


def nearest(lanes: Iterable[int], flock: FlockRows, numbers: Any, n: int, m: int, *, plan: Plan) -> Any:
    """Least distance of a pair, m."""
    own, d = vector(), vector()
    nn = integer(n)
    least2 = FAR
    for i in range(n):
        for a in range(plan.dimensions):
            own[a] = flock.position[a][i]
        near2 = FAR
        # One minimum only: two minima over the same squares in one loop are not vectorised. The
        # loop begins at a whole block of lanes and masks the rest, since a loop that begins at i +
        # 1 has no vector form.
        for j in lanes_between(lanes, i // BLOCK * BLOCK, m):
            r2 = offset(d, own, flock.position, j, numbers.w, plan=plan)
            near2 = least(near2, choose((integer(j) > integer(i)) & (integer(j) < nn), r2, FAR))
        least2 = least(least2, near2)
    return math.sqrt(least2)
