"""Gusts: the wind of one step, common to the flock."""

from typing import Any

from airflock.body import wind
from airflock.core import random

GUST = random.GUST


def gusts(numbers: Any, whole: Any, step: int, gust: Any) -> Any:
    """Advance the gusts by a step; returns the wind wx wy wz, m/s.

    gust : deviation from the mean wind (m/s) along each axis, from step to step
    """
    w0, w1, w2, w3 = random.draw(0, step, GUST, whole.world, whole.seed_low, whole.seed_high)
    ga, gb = random.normal_pair(w0, w1)
    gc, gd = random.normal_pair(w2, w3)
    gust[0] = wind.gusting(gust[0], ga, numbers.c.dt, numbers.a)
    gust[1] = wind.gusting(gust[1], gb, numbers.c.dt, numbers.a)
    gust[2] = wind.gusting(gust[2], gc, numbers.c.dt, numbers.a)
    wx = numbers.a.east + gust[0]
    wy = numbers.a.north + gust[1]
    wz = numbers.a.up + gust[2]
    return wx, wy, wz
