"""Pace: how many motion steps are due at each frame of a page."""

MAX_CATCH_UP = 0.25  # s of real time that are given up at most, rather than flown in one leap


class PageClock:
    """Steps that are due, at a speed in flight seconds per second.

    dt    : motion step of the flight, s
    speed : times real time
    """

    def __init__(self, dt: float, speed: float = 1.0):
        self.dt, self.speed, self._owed_steps = dt, speed, 0.0

    def due(self, elapsed: float) -> int:
        """Whole steps due after `elapsed` s of real time; the rest is owed to the next call.

        Of a page that was held up for longer than a quarter of a second only so much is caught up.
        """
        self._owed_steps += min(max(elapsed, 0.0), MAX_CATCH_UP) * self.speed / self.dt
        steps = int(self._owed_steps + 1e-9)
        self._owed_steps -= steps
        return steps
