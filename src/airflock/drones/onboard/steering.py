"""Steering: the velocity that each phase of a mission wishes to fly, and what the limiter makes of it."""

from math import isfinite
from typing import NamedTuple

from airflock.core.agent import State
from airflock.core.maths import norm
from airflock.core.pilot import Pilot
from airflock.drones.onboard import guidance
from airflock.drones.onboard.card import Card
from airflock.drones.onboard.limiter import STILL, Velocity, limit
from airflock.drones.onboard.mission import Phase
from airflock.drones.onboard.situation import SLOW
from airflock.support.errors import AirflockError

EPSILON = 1e-6  # s; two clocks of a lock-step meet within it
Point = tuple[float, float, float]


class Moment(NamedTuple):
    """What a velocity depends on beside the own state.

    now : s of the own clock; home : above the place of the start, at the own layer
    stay : velocity that keeps it where it stopped for somebody who is not heard
    near : those who fly and are heard; navigates : whether the own position is good enough to hold a place
    """

    now: float
    phase: Phase
    home: Point | None
    stay: Velocity | None
    near: list[State]
    navigates: bool


class Steering:
    """What one drone commands.

    goal   : point that was ordered; failed : the law failed since this was last set to False
    fenced : the limiter has turned the last velocity along the fence; notes : lines for a person to read
    """

    def __init__(self, card: Card, pilot: Pilot, now: float, notes: list[str]):
        self._card, self._pilot, self._notes = card, pilot, notes
        self.goal: Point | None = None
        self.failed = self.fenced = False
        self._wish: Velocity = STILL
        self._next_law = now
        self._stands_at: Point | None = None  # where it came to stand in HOLD

    def begin(self, now: float) -> None:
        """Ask the law at once, as it is to be flown from now on."""
        self._next_law = now

    def velocity(self, own: State, at: Moment) -> Velocity:
        """What is commanded, m/s: the wish, within the limits and the fence."""
        low = -1.0 if at.phase in (Phase.ARMING, Phase.TAKEOFF) else self._card.low
        wish = self._wished(own, at)
        made = limit(wish, own, self._card.sides(own), (low, self._card.high), self._card.safety)
        self.fenced = made.fenced
        return made.velocity

    def _wished(self, own: State, at: Moment) -> Velocity:
        """What the phase wishes to fly, m/s."""
        s, phase = self._card.safety, at.phase
        if phase == Phase.HOLD and at.navigates:
            if self._stands_at is None and norm(*own[3:]) < SLOW:
                self._stands_at = own[:3]
            return STILL if self._stands_at is None else guidance.stay_at(own, self._stands_at, s)
        self._stands_at = None
        if phase in (Phase.TAKEOFF, Phase.GATHER) and at.home is not None:
            return guidance.keep(own, at.home, s)
        if phase == Phase.RETURN and at.home is not None:
            wish = guidance.homewards(own, at.home, at.near, s)
            return wish if at.stay is None else (*at.stay[:2], wish[2])
        if phase not in (Phase.FLOCK, Phase.GOTO):
            return STILL
        if at.now >= self._next_law - EPSILON:
            self._next_law = max(self._next_law + self._card.period, at.now)
            self._wish = self._law(own, at.now, self.goal if phase == Phase.GOTO else None)
        x, y, z = self._wish if at.stay is None else at.stay
        return x, y, guidance.climb(own, self._card.height, s) if self._card.flat else z

    def _law(self, own: State, now: float, goal: Point | None) -> Velocity:
        """What the law wishes, m/s; a law that fails or commands what is no velocity counts as an overload."""
        at = self._card.law_state(own)
        try:
            told = None if goal is None else self._card.law_state(State(*goal, 0.0, 0.0, 0.0))[:3]
            x, y, z = self._pilot.steer(at, now, told)
        except (AirflockError, ArithmeticError, ValueError, TypeError, IndexError) as fault:
            self.failed = True
            self._notes.append(f"the law failed: {type(fault).__name__}: {fault}")
            return STILL
        if not (isfinite(x) and isfinite(y) and isfinite(z)):
            self.failed = True
            self._notes.append(f"the law commanded {(x, y, z)}, which is not a velocity")
            return STILL
        if goal is not None:
            gx, gy, _ = guidance.make_for(own, goal, self._card.safety)
            x, y = 0.5 * (x + gx), 0.5 * (y + gy)
        return x, y, z
