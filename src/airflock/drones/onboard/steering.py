"""Steering: the limiter, the guidance to points, and the velocity that each phase of a mission commands."""

from collections import deque
from collections.abc import Iterable
from math import isfinite
from typing import NamedTuple

from airflock.core import Pilot, State, braking_curve, clamp, norm, shorten
from airflock.drones.onboard.card import FlightCard, SafetyLimits
from airflock.drones.onboard.mission import MissionPhase
from airflock.drones.onboard.situation import STANDING_SPEED
from airflock.support import AirflockError

Velocity = tuple[float, float, float]
NO_VELOCITY: Velocity = (0.0, 0.0, 0.0)


class LimitedVelocity(NamedTuple):
    """A velocity within the limits (m/s), and whether the fence or an obstacle turned it."""

    velocity: Velocity
    is_fenced: bool


def limit_velocity(
    wanted_velocity: Velocity,
    own: State,
    surfaces: Iterable[tuple[float, float, float, float]],
    heights: tuple[float, float],
    safety: SafetyLimits,
) -> LimitedVelocity:
    """Return the velocity nearest to the wanted one that respects all limits.

    own      : state as measured
    surfaces : distance (m, negative beyond) and inward unit normal of the fence's sides and of
               obstacles
    heights  : lowest and highest, m
    """
    # The limiter trusts nobody, laws included: nan would pass every comparison below.
    if not all(map(isfinite, wanted_velocity)):
        wanted_velocity = NO_VELOCITY
    vx, vy, _ = shorten(wanted_velocity[0], wanted_velocity[1], 0.0, safety.speed_max)
    vz = clamp(wanted_velocity[2], -safety.climb_max, safety.climb_max)
    # As far ahead of the own velocity as the drone can follow until the next setpoint, so that
    # nothing is lost.
    answers = safety.delay + safety.response
    dx, dy, dz = shorten(vx - own.vx, vy - own.vy, vz - own.vz, safety.accel * (answers + safety.tick))
    vx, vy, vz = own.vx + dx, own.vy + dy, own.vz + dz
    fenced = False
    walls = list(surfaces)
    for _ in range(2):  # a corner: what one side turns, another may have to turn again
        # Each side allows the outward speed from which the drone can still brake before the soft
        # margin. Only the component across the side is cut, so that a drone slides along it.
        for distance, nx, ny, nz in walls:
            outward = -(vx * nx + vy * ny + vz * nz)
            if outward <= 0.0:
                continue
            lag = max(-(own.vx * nx + own.vy * ny + own.vz * nz), 0.0) * answers  # flown before it slows down
            most = braking_curve(distance - safety.soft_margin - lag, safety.brake, safety.brake_gain)
            if outward > most:
                k = outward - most
                vx, vy, vz, fenced = vx + k * nx, vy + k * ny, vz + k * nz, True
    # In a sharp corner two passes need not converge; a drone that stops is safe.
    for distance, nx, ny, nz in walls:
        if -(vx * nx + vy * ny + vz * nz) > braking_curve(distance, safety.brake, safety.brake_gain) + 1e-9:
            vx, vy, vz, fenced = 0.0, 0.0, 0.0, True  # sides that contradict each other: stop
    low, high = heights
    # Heights are kept like walls, but without the soft margin.
    vz = clamp(
        vz,
        -braking_curve(own.z - low, safety.brake, safety.brake_gain),
        braking_curve(high - own.z, safety.brake, safety.brake_gain),
    )
    speed = norm(vx, vy, 0.0)
    # Sliding along several sides may have added speed.
    k = min(1.0, safety.speed_max / speed)
    return LimitedVelocity((k * vx, k * vy, clamp(vz, -safety.climb_max, safety.climb_max)), fenced)


HEIGHT_GAIN = 1.0  # 1/s; our choice: a metre off is a metre per second
KEEP_GAIN = 0.5  # 1/s; and half as fast back to a point that is kept
PASSING_SHARE = 0.8  # of the distance of two layers: farther above each other, two drones pass
PUSH_GAIN = 1.0  # 1/s; half a spring: a metre too near pushes with a metre per second


def climb_rate(own: State, height: float, safety: SafetyLimits, gain: float = HEIGHT_GAIN) -> float:
    """Return the vertical velocity towards a height (m) by a gain, 1/s."""
    return float(clamp(gain * (height - own.z), -safety.climb_max, safety.climb_max))


def velocity_to_hover_point(
    own: State, point: tuple[float, float, float], safety: SafetyLimits, gain: float = HEIGHT_GAIN
) -> Velocity:
    """Return the velocity that keeps a point of the ground plan, and goes to its height by a gain, 1/s."""
    vx, vy, _ = shorten(KEEP_GAIN * (point[0] - own.x), KEEP_GAIN * (point[1] - own.y), 0.0, 1.0)
    return vx, vy, climb_rate(own, point[2], safety, gain)


def velocity_towards(own: State, point: tuple[float, float, float], safety: SafetyLimits) -> Velocity:
    """Return the velocity towards a point of the ground plan, slow enough to stop there."""
    dx, dy = point[0] - own.x, point[1] - own.y
    far = norm(dx, dy, 0.0)
    k = min(braking_curve(far, safety.brake, safety.brake_gain), safety.speed_max) / far
    return k * dx, k * dy, 0.0


def velocity_from_neighbours(own: State, neighbours: Iterable[State], safety: SafetyLimits) -> Velocity:
    """Return the velocity along the ground plan away from all neighbours within s.yield_range in the own layer."""
    x = y = 0.0
    for other in neighbours:
        dx, dy, dz = own.x - other.x, own.y - other.y, own.z - other.z
        # Drones on the way home keep their layers, so those in other layers pass above or below.
        if abs(dz) > PASSING_SHARE * safety.layer:
            continue
        near = PUSH_GAIN * max(safety.yield_range - norm(dx, dy, dz), 0.0) / norm(dx, dy, 0.0)
        x, y = x + near * dx, y + near * dy
    vx, vy, _ = shorten(x, y, 0.0, safety.speed_max)
    return vx, vy, 0.0


def velocity_home(
    own: State, home: tuple[float, float, float], neighbours: Iterable[State], safety: SafetyLimits
) -> Velocity:
    """Return the velocity home in the own layer, past neighbours."""
    gx, gy, _ = velocity_towards(own, home, safety)
    px, py, _ = velocity_from_neighbours(own, neighbours, safety)
    return gx + px, gy + py, climb_rate(own, home[2], safety)


RESPONSE_TIME = 10.0  # s; our choice: over which own velocities are compared with those that the card promises
MIN_RESPONSE_ERROR = 0.3  # m/s; our choice: below it nothing was commanded that would tell
SLOWER_WINS = 0.7  # of the squared error; our choice: noise and gusts leave it at 0.8 or more


class PredictedVelocity:
    """Horizontal velocity of a drone with a dead time, a lag and a largest acceleration, and how far it is off.

    The mean error is left out: it is wind, which delays nothing.
    """

    def __init__(self, delay: float, response: float, accel: float, own: State):
        self._delay, self._response, self._accel = delay, response, accel
        self._vx, self._vy, self._mean_x, self._mean_y = own.vx, own.vy, 0.0, 0.0
        self.squared_error = 0.0  # m²/s²

    def step(self, own: State, commands: Iterable[tuple[float, Velocity]], now: float, dt: float) -> None:
        """Fly for dt (s) by the newest command (time, velocity) that is due, and compare with the own velocity."""
        for cx, cy, _ in [velocity for at, velocity in commands if at <= now - self._delay][-1:]:
            k = dt / self._response
            dx, dy, _ = shorten(k * (cx - self._vx), k * (cy - self._vy), 0.0, self._accel * dt)
            self._vx, self._vy = self._vx + dx, self._vy + dy
        k, ex, ey = min(dt / RESPONSE_TIME, 1.0), own.vx - self._vx, own.vy - self._vy
        self._mean_x += k * (ex - self._mean_x)
        self._mean_y += k * (ey - self._mean_y)
        self.squared_error += k * ((ex - self._mean_x) ** 2 + (ey - self._mean_y) ** 2 - self.squared_error)


class ResponseWatch:
    """Comparison of own velocities with own commands: is the drone as quick as its card says?

    Two drones are flown along by the same commands, one as the card says and one half as quick. On
    a real autopilot whose card said 1.0 s and 6 m/s², a flock passed a hovering drone at 1.35 m:
    nothing on board had looked.
    """

    def __init__(self, safety: SafetyLimits):
        self._safety, self._since, self._last, self._is_reported = safety, 0.0, 0.0, False
        self._commands: deque[tuple[float, Velocity]] = deque()
        self._drones: list[PredictedVelocity] = []

    def reset(self) -> None:
        """Forget all: the drone does not fly the law."""
        self._drones.clear()
        self._commands.clear()

    def slower(self, own: State, command: Velocity, now: float) -> str:
        """Take the own velocity and the command of now; return one line once the drone is slower than its card."""
        s = self._safety
        if not self._drones:
            self._since = self._last = now
            half = s.delay + 0.5 * s.response, 1.5 * s.response, 0.5 * s.accel
            self._drones = [PredictedVelocity(*promised, own) for promised in ((s.delay, s.response, s.accel), half)]
        for drone in self._drones:
            drone.step(own, self._commands, now, min(now - self._last, 0.5 * s.response))
        self._last = now
        self._commands.append((now, command))
        while self._commands[0][0] < now - 2.0 * (s.delay + s.response):
            self._commands.popleft()
        error, other = (drone.squared_error for drone in self._drones)
        watched = now - self._since > 2.0 * RESPONSE_TIME and error > MIN_RESPONSE_ERROR**2
        if self._is_reported or not watched or other > SLOWER_WINS * error:
            return ""
        self._is_reported = True
        return (
            f"the drone answers later than the card says ({s.delay:g} s, then {s.response:g} s at most {s.accel:g} "
            f"m/s^2): {error**0.5:.1f} m/s off, and {other**0.5:.1f} m/s off one that is half as quick; its distances "
            "to stop are too short: prepare a card of its response, or raise its limits"
        )


TIME_TOLERANCE = 1e-6  # s; two clocks of a lock-step meet within it
Position = tuple[float, float, float]


class SteeringInput(NamedTuple):
    """Inputs of a velocity beside the own state.

    now            : s of the own clock
    home           : point above the place of the start, in the own layer
    stay           : velocity that keeps it where it stopped for a lost neighbour
    near           : states of the members that fly and are heard
    has_navigation : the own position is good enough to hold a place
    """

    now: float
    phase: MissionPhase
    home: Position | None
    stay: Velocity | None
    near: list[State]
    has_navigation: bool


class PhaseVelocity:
    """Velocity commands of one drone.

    goal      : point of a GOTO order
    failed    : the law has failed since this was last set to False
    is_fenced : the limiter has turned the last velocity along the fence
    notes     : lines for a person to read
    """

    def __init__(self, card: FlightCard, pilot: Pilot, now: float, notes: list[str]):
        self._card, self._pilot, self._notes = card, pilot, notes
        self.goal: Position | None = None
        self.failed = self.is_fenced = False
        self._law_velocity: Velocity = NO_VELOCITY
        self._next_decision = now
        self._hold_position: Position | None = None  # where it came to stand in HOLD
        self._response = ResponseWatch(card.safety)

    def begin(self, now: float) -> None:
        """Call the law at the next tick: the phase begins to fly it."""
        self._next_decision = now

    def velocity(self, own: State, at: SteeringInput) -> Velocity:
        """Return the commanded velocity, m/s: the wanted one within the limits and the fence."""
        # While it takes off it is still below the lowest height of the fence, which must not lift
        # it at full speed.
        low = -1.0 if at.phase in (MissionPhase.ARMING, MissionPhase.TAKEOFF) else self._card.low
        wish = self._wanted_velocity(own, at)
        limited = limit_velocity(wish, own, self._card.sides(own), (low, self._card.high), self._card.safety)
        self.is_fenced = limited.is_fenced
        if at.phase not in (MissionPhase.FLOCK, MissionPhase.GOTO):
            self._response.reset()
        elif slower := self._response.slower(own, limited.velocity, at.now):
            self._notes.append(slower)
        return limited.velocity

    def _wanted_velocity(self, own: State, at: SteeringInput) -> Velocity:
        """Return the velocity of the phase before the limiter, m/s."""
        s, phase = self._card.safety, at.phase
        if phase == MissionPhase.HOLD and at.has_navigation:
            # First brake, then keep the place where it stopped: going back to where HOLD began
            # would swing.
            if self._hold_position is None and norm(*own[3:]) < STANDING_SPEED:
                self._hold_position = own[:3]
            if self._hold_position is None:
                return NO_VELOCITY
            return velocity_to_hover_point(own, self._hold_position, s, KEEP_GAIN)
        self._hold_position = None
        if phase in (MissionPhase.TAKEOFF, MissionPhase.GATHER) and at.home is not None:
            return velocity_to_hover_point(own, at.home, s)
        if phase == MissionPhase.RETURN and at.home is not None:
            wish = velocity_home(own, at.home, at.near, s)
            return wish if at.stay is None else (*at.stay[:2], wish[2])
        if phase not in (MissionPhase.FLOCK, MissionPhase.GOTO):
            return NO_VELOCITY
        # The law decides once a period, as in the simulation; between two decisions its last
        # velocity is flown.
        if at.now >= self._next_decision - TIME_TOLERANCE:
            self._next_decision = max(self._next_decision + self._card.period, at.now)
            self._law_velocity = self._law(own, at.now, self.goal if phase == MissionPhase.GOTO else None)
        x, y, z = self._law_velocity if at.stay is None else at.stay
        return x, y, climb_rate(own, self._card.height, s) if self._card.flat else z

    def _law(self, own: State, now: float, goal: Position | None) -> Velocity:
        """Return the velocity of the law, m/s; an exception or a value that is no velocity counts as an overload."""
        at = self._card.law_state(own)
        try:
            goal_position = None if goal is None else self._card.law_state(State(*goal, 0.0, 0.0, 0.0))[:3]
            x, y, z = self._pilot.steer(at, now, goal_position)
        except (AirflockError, ArithmeticError, ValueError, TypeError, IndexError) as error:
            self.failed = True
            self._notes.append(f"the law failed: {type(error).__name__}: {error}")
            return NO_VELOCITY
        if not (isfinite(x) and isfinite(y) and isfinite(z)):
            self.failed = True
            self._notes.append(f"the law commanded {(x, y, z)}, which is not a velocity")
            return NO_VELOCITY
        # Half the way to the goal, half the law: the flock stays together while it goes.
        if goal is not None:
            gx, gy, _ = velocity_towards(own, goal, self._card.safety)
            x, y = 0.5 * (x + gx), 0.5 * (y + gy)
        return x, y, z
