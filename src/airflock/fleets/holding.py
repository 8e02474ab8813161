"""Holding a place: what an autopilot does where it hovers or lands by itself."""

import math

from airflock.core import State, shorten

STANDING_SPEED = 0.5  # m/s; our choice: slower than this it has come to stand, and holds that place
POSITION_GAIN = 0.5  # 1/s; our choice, about half of PX4's MPC_XY_P: a metre off is half a metre a second back
MAX_RETURN_SPEED = 1.0  # m/s; our choice


class HoldPosition:
    """The place that is held, from when the drone has come to stand there."""

    def __init__(self) -> None:
        self._held_position: tuple[float, float] | None = None

    def release(self) -> None:
        """Hold no place any more."""
        self._held_position = None

    def velocity(self, at: State | None, up: float) -> tuple[float, float, float]:
        """Velocity (m/s) that brakes, and then goes back to the place; `up` is kept.

        at : where the drone is by its own navigation; None where that stands still: then it only brakes
        """
        if at is not None and self._held_position is None and math.hypot(at.vx, at.vy) < STANDING_SPEED:
            self._held_position = at.x, at.y
        if at is None or self._held_position is None:
            return 0.0, 0.0, up
        vx, vy, _ = shorten(
            POSITION_GAIN * (self._held_position[0] - at.x),
            POSITION_GAIN * (self._held_position[1] - at.y),
            0.0,
            MAX_RETURN_SPEED,
        )
        return vx, vy, up
