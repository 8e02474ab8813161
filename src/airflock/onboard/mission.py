"""The mission: phases of a flight, and the table of what leads from one to another. Pure: facts in, a row out.

Rows are tried in the order of the table; the first transition whose event holds wins. Rows without a target change
what is flown, not the phase, and hide nothing below them. The pilot and the autopilot outrank everything (row 1).
"""

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from airflock.mavlink.orders import CALL_OFF, Do
from airflock.onboard.safety import Safety


class Phase(IntEnum):
    """Where a drone is in its mission; the number travels in its packets."""

    BOOT = 0
    READY = 1  # waits for what is missing
    CLEARED = 2  # nothing is missing; waits for the operator
    ARMING = 3
    TAKEOFF = 4
    GATHER = 5
    FLOCK = 6
    GOTO = 7
    HOLD = 8
    RETURN = 9
    LAND = 10
    MANUAL = 11  # the pilot or the autopilot has it
    DONE = 12
    FAULT = 13


FLY = frozenset({Phase.TAKEOFF, Phase.GATHER, Phase.FLOCK, Phase.GOTO, Phase.HOLD, Phase.RETURN})
FLOCKING = frozenset({Phase.FLOCK, Phase.GOTO})
AIR = FLY | {Phase.LAND, Phase.MANUAL}
STANDING = frozenset({Phase.HOLD, Phase.RETURN, Phase.MANUAL})  # they do not fly with the flock


class Facts(NamedTuple):
    """What is known at one tick. As they stand here a drone flies well and nobody asks for anything.

    *_for : for how long something has held, s
    order : of the operator, taken at this tick
    """

    mode_ours: bool = True  # the autopilot obeys our setpoints
    mode_land: bool = False  # it lands by itself
    armed: bool = True
    landed: bool = False
    healthy: bool = True
    order: Do | None = None
    killed: bool = False  # the operator confirmed a kill
    resume: bool = False  # RESUME was ordered and not yet followed
    held: bool = False  # HOLD was ordered: only an order ends it
    position_bad_for: float = 0.0
    gnss_bad_for: float = 0.0
    battery_critical: bool = False
    battery_home: bool = False  # just enough is left for the way home
    outside_for: float = 0.0
    near_fence: bool = False
    lost_near: bool = False
    deaf_for: float = 0.0
    few_for: float = 0.0
    clock_bad_for: float = 0.0
    operator_lost: bool = False
    overload: bool = False
    overloads: int = 0
    present: bool = True  # card, key and autopilot are there and fit
    fault: str = ""  # what can never fit
    misses: tuple[str, ...] = ()
    due: bool = False  # START was ordered, and the own turn has come
    streamed_for: float = 0.0
    phase_for: float = 0.0
    at_layer: bool = False
    climbing: bool = True
    neighbour_near: bool = False
    gathered: bool = False
    time_over: bool = False
    joined: bool = False
    calm_for: float = 0.0
    at_home: bool = False
    before: Phase = Phase.FLOCK  # where HOLD came from

    @property
    def navigates(self) -> bool:
        """Whether the drone knows where it is."""
        return self.position_bad_for == 0.0 and self.gnss_bad_for == 0.0


class Row(NamedTuple):
    """One row: its number, the phases that it is tried in, the event in words, whether it holds, and the target.

    to : the next phase; None: the phase stays, and what is flown changes as `event` says
    """

    number: str
    phases: frozenset[Phase]
    event: str
    holds: Callable[[Facts, Safety], bool]
    to: Phase | None


class Step(NamedTuple):
    """What one look at the table gives: the row that fires, the next phase, and rows that change what is flown."""

    row: Row | None
    to: Phase
    effects: frozenset[str]


def _of(*phases: Phase) -> frozenset[Phase]:
    return frozenset(phases)


P = Phase
BEFORE_RETURN = _of(P.TAKEOFF, P.GATHER, P.FLOCK, P.GOTO)

TABLE: tuple[Row, ...] = (
    Row("1", FLY, "the autopilot's mode is not ours, or it is disarmed",
        lambda f, s: not f.mode_ours or not f.armed, P.MANUAL),
    Row("1", _of(P.LAND), "the autopilot neither lands nor follows our commands",
        lambda f, s: f.armed and not f.mode_ours and not f.mode_land, P.MANUAL),
    Row("2", _of(P.MANUAL), "the operator resumes, and the pilot has selected our mode",
        lambda f, s: f.resume and f.mode_ours and f.armed and f.healthy and f.streamed_for >= s.stream, P.HOLD),
    Row("3", _of(P.MANUAL), "disarmed on the ground", lambda f, s: not f.armed, P.DONE),
    Row("4", FLY | {P.LAND, P.ARMING}, "the operator confirms a kill", lambda f, s: f.killed, P.DONE),
    Row("5b", FLY, "no position for too long", lambda f, s: f.position_bad_for > s.stale_land, P.LAND),
    Row("5", FLY - {P.HOLD}, "no valid position", lambda f, s: f.position_bad_for > 0.0, P.HOLD),
    Row("6b", FLY, "bad navigation for too long", lambda f, s: f.gnss_bad_for > s.gnss_land, P.LAND),
    Row("6", FLY - {P.HOLD}, "bad navigation", lambda f, s: f.gnss_bad_for > 0.0, P.HOLD),
    Row("7", FLY, "the battery is critical", lambda f, s: f.battery_critical, P.LAND),
    Row("8", FLY - {P.RETURN}, "the battery is just enough for the way home",
        lambda f, s: f.battery_home and f.navigates, P.RETURN),
    Row("9b", FLY, "beyond the fence for too long", lambda f, s: f.outside_for > s.outside_land, P.LAND),
    Row("9", FLY - {P.RETURN}, "beyond the fence", lambda f, s: f.outside_for > 0.0 and f.navigates, P.RETURN),
    Row("10", FLY, "the limiter turns the velocity along the fence", lambda f, s: f.near_fence, None),
    Row("11b", FLOCKING | {P.HOLD}, "nobody has been heard for too long",
        lambda f, s: f.deaf_for > s.deaf_return and f.navigates, P.RETURN),
    Row("11", FLOCKING | {P.RETURN}, "a lost neighbour could be near: velocity 0", lambda f, s: f.lost_near, None),
    Row("12b", _of(P.HOLD), "too few neighbours for too long",
        lambda f, s: f.few_for > s.peers_return and f.navigates, P.RETURN),
    Row("12", FLOCKING | {P.GATHER}, "too few neighbours", lambda f, s: f.few_for > s.peers_hold, P.HOLD),
    Row("13b", _of(P.HOLD), "a suspicious clock for too long",
        lambda f, s: f.clock_bad_for > s.clock_return and f.navigates, P.RETURN),
    Row("13", BEFORE_RETURN, "a suspicious clock", lambda f, s: f.clock_bad_for > 0.0, P.HOLD),
    Row("14b", FLY - {P.RETURN}, "the operator is lost, and the card says return",
        lambda f, s: f.operator_lost and s.operator_lost == "return" and f.navigates, P.RETURN),
    Row("14", BEFORE_RETURN, "the operator is lost, and the card says hold",
        lambda f, s: f.operator_lost and s.operator_lost == "hold", P.HOLD),
    Row("15b", FLY - {P.RETURN}, "overloaded too often",
        lambda f, s: f.overloads >= s.overloads and not f.overload and f.navigates, P.RETURN),
    Row("15", FLY - {P.HOLD}, "overloaded, or the law failed", lambda f, s: f.overload, P.HOLD),
    Row("28", _of(P.BOOT), "started in the air", lambda f, s: f.present and f.armed and not f.landed, P.MANUAL),
    Row("16b", _of(P.BOOT, P.READY, P.CLEARED), "something can never fit", lambda f, s: bool(f.fault), P.FAULT),
    Row("16", _of(P.BOOT), "card, key and autopilot are there",
        lambda f, s: f.present and (not f.armed or f.landed), P.READY),
    Row("17", _of(P.READY), "nothing is missing", lambda f, s: not f.misses and not f.armed, P.CLEARED),
    Row("17b", _of(P.CLEARED), "something is missing", lambda f, s: bool(f.misses) or f.armed, P.READY),
    Row("18", _of(P.CLEARED), "the operator's start is due", lambda f, s: f.due, P.ARMING),
    Row("19c", _of(P.ARMING), "the start is called off", lambda f, s: f.order in CALL_OFF, P.READY),
    Row("19", _of(P.ARMING), "armed in our mode", lambda f, s: f.armed and f.mode_ours and f.streamed_for >= s.stream,
        P.TAKEOFF),
    Row("19b", _of(P.ARMING), "not armed in time", lambda f, s: f.phase_for > s.arm_time, P.READY),
    Row("20", _of(P.TAKEOFF), "on the own layer", lambda f, s: f.at_layer, P.GATHER),
    Row("21b", _of(P.TAKEOFF), "does not climb", lambda f, s: f.phase_for > s.climb_time and not f.climbing, P.LAND),
    Row("21", _of(P.TAKEOFF), "a neighbour is near", lambda f, s: f.neighbour_near, P.HOLD),
    Row("22", _of(P.GATHER), "all are gathered, or the operator says go",
        lambda f, s: f.gathered or f.order == Do.GO, P.FLOCK),
    Row("23", FLY, "ordered to land", lambda f, s: f.order == Do.LAND, P.LAND),
    Row("23", FLY - {P.RETURN}, "ordered to return, or the time is up",
        lambda f, s: (f.order == Do.RETURN or f.time_over) and f.navigates, P.RETURN),
    Row("23", FLY - {P.HOLD}, "ordered to hold", lambda f, s: f.order == Do.HOLD, P.HOLD),
    Row("23", FLOCKING | {P.HOLD}, "ordered to a point", lambda f, s: f.order == Do.GOTO and f.healthy, P.GOTO),
    Row("23", _of(P.GOTO), "ordered to flock on", lambda f, s: f.order == Do.RESUME, P.FLOCK),
    Row("24", FLOCKING, "a member joins", lambda f, s: f.joined, None),
    Row("25", _of(P.HOLD), "all is well again", lambda f, s: f.calm_for >= s.calm and not f.held, None),
    Row("26", _of(P.RETURN), "above home", lambda f, s: f.at_home, P.LAND),
    Row("27", _of(P.LAND), "landed", lambda f, s: f.landed or not f.armed, P.DONE),
)  # fmt: skip
CALMED = next(row for row in TABLE if row.number == "25")
ROWS = {phase: tuple(row for row in TABLE if phase in row.phases) for phase in Phase}


def look(phase: Phase, facts: Facts, safety: Safety) -> Step:
    """The first row of the table that fires in a phase, and all rows that change what is flown meanwhile."""
    effects: set[str] = set()
    for row in ROWS[phase]:
        if not row.holds(facts, safety):
            continue
        if row is CALMED:
            return Step(row, facts.before, frozenset(effects))
        if row.to is not None:
            return Step(row, row.to, frozenset(effects))
        effects.add(row.number)
    return Step(None, phase, frozenset(effects))
