"""Silence: an agent stops while a neighbour that it has lost could be near."""

import math
from collections.abc import Iterable
from typing import Any

from airflock.core import silence
from airflock.engine.plan import Plan
from airflock.engine.stages.receive import clock_time
from airflock.engine.stages.state import FlockRows
from airflock.engine.stages.words import *
from airflock.world import nearest_image


def stop(agents: Iterable[int], flock: FlockRows, numbers: Any, n: int, time: float, *, plan: Plan) -> None:
    """Let stand still who has lost somebody that could be near by now."""
    axes, w, c = range(plan.dimensions), numbers.w, flock.command
    for i in agents:
        somebody, now = ZERO, clock_time(time, i, flock, plan=plan)
        # Over everybody the agent has ever heard: the newest packet and its age say how far the
        # other one can have flown.
        for j in range(n):
            d = vector()
            for a in axes:
                d[a] = flock.packet[a][i, j] - flock.measured_position[a][i]
            if plan.periodic:
                for a in axes:
                    d[a] = nearest_image(d[a], getattr(w, HALF_SIZES[a]))
            distance = math.sqrt(sum(d[a] * d[a] for a in axes) + TINY)
            age = now - flock.packet[2 * plan.dimensions][i, j]
            near = silence.could_be_near(distance, age, numbers.silence)
            somebody = most(somebody, choose(integer(j) == integer(i), ZERO, near))
        at, o = flock.stop_position, vector()
        for a in axes:
            # Commanding zero velocity is not standing still: a body with the noise of the paper
            # drifts 2.4 m along each axis in 15 s. So an agent that stopped returns to where it
            # stopped.
            at[a][i] = choose(flock.stopped[i] > HALF, at[a][i], flock.measured_position[a][i])
            o[a] = at[a][i] - flock.measured_position[a][i]
        # Without the pause an agent went on in the one decision in which it heard all, and crept 1
        # to 2 m at a time: two at 5 m came to 3 m. Pauses of 0, 0.4 and 1 s gave medians of 5.3,
        # 5.8 and 6.8 m.
        until = silence.stands_until(somebody, now, flock.stands_until[i], numbers.silence)
        stands = choose(now < until, ONE, ZERO)
        flock.stands_until[i], flock.stopped[i] = until, stands
        v = silence.back(o[X], o[Y], o[Z], numbers.silence)
        for a in axes:
            c[a][i] = choose(stands > HALF, v[a], c[a][i])
