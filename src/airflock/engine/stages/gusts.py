"""Gusts: the wind of one step, common to the flock."""

from typing import Any

from airflock.core import random
from airflock.engine.plan import Plan
from airflock.parts.bodies import dryden, wind

GUST = random.GUST
MORE = random.GUST + 256  # a second draw of the same step


def gusts(numbers: Any, whole: Any, step: int, gust: Any, *, plan: Plan) -> Any:
    """Advance the gusts by a step; returns the wind wx wy wz, m/s.

    gust : deviation from the mean wind (m/s) along each axis, from step to step; of Dryden
           turbulence the gust along the mean wind (m/s), and two states each across it and upwards
    """
    # All agents feel the same gust: a flock is small beside the length scales of turbulence. Hence
    # agent 0 in the counter.
    w0, w1, w2, w3 = random.draw(0, step, GUST, whole.world, whole.seed_low, whole.seed_high)
    ga, gb = random.normal_pair(w0, w1)
    gc, gd = random.normal_pair(w2, w3)
    if plan.dryden:
        w4, w5, _, _ = random.draw(0, step, MORE, whole.world, whole.seed_low, whole.seed_high)
        ge, _ = random.normal_pair(w4, w5)
        air = numbers.air
        # Exact transition and exact covariance, so that variance and spectrum do not depend on the
        # motion step.
        gust[0] = dryden.along(gust[0], ga, numbers.c.dt, air.length, air.sigma, air.airspeed)
        side = dryden.across(gust[1], gust[2], gb, gc, numbers.c.dt, air.length, air.airspeed)
        rise = dryden.across(gust[3], gust[4], gd, ge, numbers.c.dt, air.length_up, air.airspeed)
        gust[1] = side[0]
        gust[2] = side[1]
        gust[3] = rise[0]
        gust[4] = rise[1]
        beside = dryden.gust_of(side[0], side[1], air.sigma)
        # The gust is known along and across the mean wind: a rotation takes it to east and north.
        wx = numbers.a.east + air.east * gust[0] - air.north * beside
        wy = numbers.a.north + air.north * gust[0] + air.east * beside
        wz = numbers.a.up + dryden.gust_of(rise[0], rise[1], air.sigma_up)
    else:
        gust[0] = wind.gusting(gust[0], ga, numbers.c.dt, numbers.a)
        gust[1] = wind.gusting(gust[1], gb, numbers.c.dt, numbers.a)
        gust[2] = wind.gusting(gust[2], gc, numbers.c.dt, numbers.a)
        wx = numbers.a.east + gust[0]
        wy = numbers.a.north + gust[1]
        wz = numbers.a.up + gust[2]
    return wx, wy, wz
