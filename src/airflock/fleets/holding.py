"""Holding a place: what an autopilot does where it hovers or lands by itself."""

import math

from airflock.core.agent import State
from airflock.core.maths import shorten

STOOD = 0.5  # m/s; our choice: slower than this it has come to stand, and holds that place
GAIN = 0.5  # 1/s; our choice, about half of PX4's MPC_XY_P: a metre off is half a metre a second back
MOST = 1.0  # m/s; our choice


class Holding:
    """The place that is held, from when the drone has come to stand there."""

    def __init__(self) -> None:
        self._place: tuple[float, float] | None = None

    def leave(self) -> None:
        """Hold no place any more."""
        self._place = None

    def velocity(self, at: State | None, up: float) -> tuple[float, float, float]:
        """Velocity (m/s) that brakes, and then goes back to the place; `up` is kept.

        at : where the drone is by its own navigation; None where that stands still: then it only brakes
        """
        if at is not None and self._place is None and math.hypot(at.vx, at.vy) < STOOD:
            self._place = at.x, at.y
        if at is None or self._place is None:
            return 0.0, 0.0, up
        vx, vy, _ = shorten(GAIN * (self._place[0] - at.x), GAIN * (self._place[1] - at.y), 0.0, MOST)
        return vx, vy, up
