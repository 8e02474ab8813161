"""Steering: the velocity that each phase of a mission wishes to fly, and what the limiter makes of it."""

from math import isfinite
from typing import NamedTuple

from airflock.core import Pilot, State, norm
from airflock.drones.onboard import guidance
from airflock.drones.onboard.card import FlightCard
from airflock.drones.onboard.limiter import NO_VELOCITY, Velocity, limit_velocity
from airflock.drones.onboard.mission import MissionPhase
from airflock.drones.onboard.situation import STANDING_SPEED
from airflock.support import AirflockError

TIME_TOLERANCE = 1e-6  # s; two clocks of a lock-step meet within it
Position = tuple[float, float, float]


class SteeringInput(NamedTuple):
    """What a velocity depends on beside the own state.

    now : s of the own clock; home : above the place of the start, at the own layer
    stay : velocity that keeps it where it stopped for somebody who is not heard
    near : those who fly and are heard; navigates : whether the own position is good enough to hold a place
    """

    now: float
    phase: MissionPhase
    home: Position | None
    stay: Velocity | None
    near: list[State]
    has_navigation: bool


class PhaseVelocity:
    """What one drone commands.

    goal   : point that was ordered; failed : the law failed since this was last set to False
    fenced : the limiter has turned the last velocity along the fence; notes : lines for a person to read
    """

    def __init__(self, card: FlightCard, pilot: Pilot, now: float, notes: list[str]):
        self._card, self._pilot, self._notes = card, pilot, notes
        self.goal: Position | None = None
        self.failed = self.is_fenced = False
        self._law_velocity: Velocity = NO_VELOCITY
        self._next_decision = now
        self._hold_position: Position | None = None  # where it came to stand in HOLD

    def begin(self, now: float) -> None:
        """Ask the law at once, as it is to be flown from now on."""
        self._next_decision = now

    def velocity(self, own: State, at: SteeringInput) -> Velocity:
        """What is commanded, m/s: the wish, within the limits and the fence."""
        low = -1.0 if at.phase in (MissionPhase.ARMING, MissionPhase.TAKEOFF) else self._card.low
        wish = self._wanted_velocity(own, at)
        made = limit_velocity(wish, own, self._card.sides(own), (low, self._card.high), self._card.safety)
        self.is_fenced = made.is_fenced
        return made.velocity

    def _wanted_velocity(self, own: State, at: SteeringInput) -> Velocity:
        """What the phase wishes to fly, m/s."""
        s, phase = self._card.safety, at.phase
        if phase == MissionPhase.HOLD and at.has_navigation:
            if self._hold_position is None and norm(*own[3:]) < STANDING_SPEED:
                self._hold_position = own[:3]
            return (
                NO_VELOCITY if self._hold_position is None else guidance.velocity_to_stay(own, self._hold_position, s)
            )
        self._hold_position = None
        if phase in (MissionPhase.TAKEOFF, MissionPhase.GATHER) and at.home is not None:
            return guidance.velocity_to_hover_point(own, at.home, s)
        if phase == MissionPhase.RETURN and at.home is not None:
            wish = guidance.velocity_home(own, at.home, at.near, s)
            return wish if at.stay is None else (*at.stay[:2], wish[2])
        if phase not in (MissionPhase.FLOCK, MissionPhase.GOTO):
            return NO_VELOCITY
        if at.now >= self._next_decision - TIME_TOLERANCE:
            self._next_decision = max(self._next_decision + self._card.period, at.now)
            self._law_velocity = self._law(own, at.now, self.goal if phase == MissionPhase.GOTO else None)
        x, y, z = self._law_velocity if at.stay is None else at.stay
        return x, y, guidance.climb_rate(own, self._card.height, s) if self._card.flat else z

    def _law(self, own: State, now: float, goal: Position | None) -> Velocity:
        """What the law wishes, m/s; a law that fails or commands what is no velocity counts as an overload."""
        at = self._card.law_state(own)
        try:
            told = None if goal is None else self._card.law_state(State(*goal, 0.0, 0.0, 0.0))[:3]
            x, y, z = self._pilot.steer(at, now, told)
        except (AirflockError, ArithmeticError, ValueError, TypeError, IndexError) as fault:
            self.failed = True
            self._notes.append(f"the law failed: {type(fault).__name__}: {fault}")
            return NO_VELOCITY
        if not (isfinite(x) and isfinite(y) and isfinite(z)):
            self.failed = True
            self._notes.append(f"the law commanded {(x, y, z)}, which is not a velocity")
            return NO_VELOCITY
        if goal is not None:
            gx, gy, _ = guidance.velocity_towards(own, goal, self._card.safety)
            x, y = 0.5 * (x + gx), 0.5 * (y + gy)
        return x, y, z
