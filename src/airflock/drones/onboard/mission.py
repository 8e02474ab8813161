"""The mission: phases of a flight, and the table of transitions between them. Pure: facts in, a row out.

Rows are tried in the order of the table; the first transition whose event holds wins. Rows without
a target change the commanded velocity, not the phase, and hide nothing below them. The pilot and
the autopilot outrank everything (row 1).
"""

from collections.abc import Callable, Set
from enum import IntEnum
from typing import NamedTuple

from airflock.drones.mavlink.orders import CALL_OFF_ORDERS, OrderKind
from airflock.drones.onboard.card import SafetyLimits


class MissionPhase(IntEnum):
    """Phases of a mission; their numbers travel in packets and logs."""

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


def _phases(*phases: MissionPhase) -> frozenset[MissionPhase]:
    return frozenset(phases)


_P = MissionPhase
PREFLIGHT_PHASES = _phases(_P.BOOT, _P.READY, _P.CLEARED)
STANDING_PHASES = PREFLIGHT_PHASES | {_P.ARMING, _P.DONE}
FLOCKING_PHASES = _phases(_P.FLOCK, _P.GOTO)
FLOWN_AFTER_TAKEOFF = FLOCKING_PHASES | {_P.GATHER}
PHASES_BEFORE_RETURN = FLOWN_AFTER_TAKEOFF | {_P.TAKEOFF}
FLYING_PHASES = PHASES_BEFORE_RETURN | {_P.HOLD, _P.RETURN}
AIRBORNE_PHASES = FLYING_PHASES | {_P.LAND, _P.MANUAL}
# A lost neighbour that said so stands, so its reach grows half as fast: four of forty fleets with
# one wrong clock came below 3 m at full speed, none so.
NOT_FLOCKING_PHASES = _phases(_P.HOLD, _P.RETURN, _P.MANUAL)  # they do not fly with the flock


class MissionFacts(NamedTuple):
    """Facts of one tick. The defaults are those of a drone that flies well, without an order.

    *_for : how long a condition has held, s
    order : order of the operator, taken at this tick
    """

    in_guided_mode: bool = True  # the autopilot obeys our setpoints
    in_land_mode: bool = False  # it lands by itself
    in_failsafe: bool = False  # it reports that a failsafe of its own acts
    armed: bool = True
    is_landed: bool = False
    is_airborne: bool = True  # neither this nor is_landed: the autopilot does not report it
    is_high: bool = True  # not below the lowest height of the fence
    has_flown: bool = True  # in the air in a phase in which this node flies it
    has_good_navigation: bool = True
    order: OrderKind | None = None
    kill_confirmed: bool = False  # the operator confirmed a kill
    resume_ordered: bool = False  # RESUME was ordered and not yet followed
    held: bool = False  # HOLD was ordered: only an order ends it
    needs_resume: bool = False  # the position jumped: the operator has to look first
    position_bad_for: float = 0.0
    gnss_bad_for: float = 0.0
    landed_for: float = 0.0  # without moving, in a phase in which it should fly or land
    bad_streams: tuple[str, ...] = ()  # streams of the autopilot that are too slow or silent, a line each
    silent_streams_for: float = 0.0
    battery_critical: bool = False
    battery_needed_home: bool = False  # just enough is left for the way home
    outside_for: float = 0.0
    is_at_fence: bool = False
    lost_near: bool = False
    nobody_heard_for: float = 0.0
    few_heard_for: float = 0.0
    clock_bad_for: float = 0.0
    operator_lost: bool = False
    is_overloaded: bool = False
    overload_count: int = 0
    present: bool = True  # card, key and autopilot are there and fit
    fault: str = ""  # what can never fit
    missing: tuple[str, ...] = ()
    due: bool = False  # START was ordered, and the own turn has come
    setpoints_for: float = 0.0
    phase_for: float = 0.0
    at_layer: bool = False
    is_climbing: bool = True
    neighbour_near: bool = False
    have_gathered: bool = False
    time_over: bool = False
    member_joined: bool = False
    calm_for: float = 1.0  # since no reason to hold is left; 0: there is one
    reasons_to_hold: tuple[str, ...] = ()  # in words
    at_home: bool = False
    phase_before_hold: MissionPhase = MissionPhase.FLOCK  # where HOLD came from

    @property
    def has_navigation(self) -> bool:
        """Return True if the drone knows its position."""
        return self.position_bad_for == 0.0 and self.gnss_bad_for == 0.0


class Row(NamedTuple):
    """One row: its number, its phases, the event in words, its condition, and the target.

    next_phase : None: the phase stays, and the commanded velocity changes as `event` says
    """

    number: str
    phases: Set[MissionPhase]
    event: str
    holds: Callable[[MissionFacts, SafetyLimits], bool]
    next_phase: MissionPhase | None


class MissionStep(NamedTuple):
    """Result of the table: the row that fires, the next phase, and the numbers of rows that change the velocity."""

    row: Row | None
    next_phase: MissionPhase
    effects: frozenset[str]


LANDED_TIME = 1.0  # s; a drone that is on the ground for longer does not fly, whatever its phase says
HIGH_LANDED_TIME = 5.0  # s; our choice: the same where its height says that it flies; it may stand on a roof
SILENT_RETURN_TIME = 10.0  # s; our choice: without SYS_STATUS nobody knows how long it can still fly

# The first row that holds wins, so the order is the priority; each row can be fired alone in a test
# and read by a safety officer.
MISSION_TABLE: tuple[Row, ...] = (
    # Measured with ArduCopter 4.6.0-dev: 8 s after GPS was lost it lands by itself, before row 6b.
    # To the other drones it is not one that a pilot has and may fly anywhere.
    Row(
        "1b",
        FLYING_PHASES,
        "the autopilot lands by a failsafe of its own",
        lambda f, s: f.armed and f.in_land_mode and f.in_failsafe,
        _P.LAND,
    ),
    Row(
        "1",
        FLYING_PHASES,
        "the autopilot's mode is not ours, or it is disarmed",
        lambda f, s: not f.in_guided_mode or not f.armed,
        _P.MANUAL,
    ),
    Row(
        "1",
        {_P.LAND},
        "the autopilot neither lands nor follows our commands",
        lambda f, s: f.armed and not f.in_guided_mode and not f.in_land_mode,
        _P.MANUAL,
    ),
    Row(
        "2",
        {_P.MANUAL},
        "the operator resumes, and the pilot has selected our mode",
        lambda f, s: (
            f.resume_ordered
            and f.in_guided_mode
            and f.armed
            and f.is_airborne
            and f.is_high
            and f.has_good_navigation
            and f.setpoints_for >= s.stream
        ),
        _P.HOLD,
    ),
    Row("3", {_P.MANUAL}, "disarmed on the ground", lambda f, s: not f.armed and f.has_flown, _P.DONE),
    Row("3b", {_P.MANUAL}, "disarmed before its mission", lambda f, s: not f.armed, _P.READY),
    Row(
        "4",
        FLYING_PHASES | {_P.LAND, _P.ARMING},
        "the operator confirms a kill",
        lambda f, s: f.kill_confirmed,
        _P.DONE,
    ),
    # Whatever led here, such as a HOLD before it took off: commands must not move what stands.
    Row(
        "29",
        FLYING_PHASES - {_P.TAKEOFF},
        "stands on the ground",
        lambda f, s: f.landed_for > (HIGH_LANDED_TIME if f.is_high and f.position_bad_for == 0.0 else LANDED_TIME),
        _P.LAND,
    ),
    Row("5b", FLYING_PHASES, "no position for too long", lambda f, s: f.position_bad_for > s.stale_land, _P.LAND),
    Row("5", FLYING_PHASES - {_P.HOLD}, "no valid position", lambda f, s: f.position_bad_for > 0.0, _P.HOLD),
    Row("6b", FLYING_PHASES, "bad navigation for too long", lambda f, s: f.gnss_bad_for > s.gnss_land, _P.LAND),
    Row("6", FLYING_PHASES - {_P.HOLD}, "bad navigation", lambda f, s: f.gnss_bad_for > 0.0, _P.HOLD),
    Row(
        "30",
        PHASES_BEFORE_RETURN,
        "streams of the autopilot are too slow or silent",
        lambda f, s: bool(f.bad_streams),
        _P.HOLD,
    ),
    Row(
        "30b",
        {_P.HOLD},
        "a stream of the autopilot is silent for too long",
        lambda f, s: f.silent_streams_for > SILENT_RETURN_TIME,
        _P.RETURN,
    ),
    Row("7", FLYING_PHASES, "the battery is critical", lambda f, s: f.battery_critical, _P.LAND),
    Row(
        "8",
        FLYING_PHASES - {_P.RETURN},
        "the battery is just enough for the way home",
        lambda f, s: f.battery_needed_home,
        _P.RETURN,
    ),
    Row("9b", FLYING_PHASES, "beyond the fence for too long", lambda f, s: f.outside_for > s.outside_land, _P.LAND),
    Row("9", FLYING_PHASES - {_P.RETURN}, "beyond the fence", lambda f, s: f.outside_for > 0.0, _P.RETURN),
    Row("10", FLYING_PHASES, "the limiter turns the velocity along the fence", lambda f, s: f.is_at_fence, None),
    Row(
        "11b",
        FLOCKING_PHASES | {_P.HOLD},
        "nobody has been heard for too long",
        lambda f, s: f.nobody_heard_for > s.deaf_return,
        _P.RETURN,
    ),
    Row(
        "11",
        FLOCKING_PHASES | {_P.RETURN},
        "a lost neighbour could be near: velocity 0",
        lambda f, s: f.lost_near,
        None,
    ),
    Row("12b", {_P.HOLD}, "too few neighbours for too long", lambda f, s: f.few_heard_for > s.peers_return, _P.RETURN),
    Row(
        "12", FLOCKING_PHASES | {_P.GATHER}, "too few neighbours", lambda f, s: f.few_heard_for > s.peers_hold, _P.HOLD
    ),
    Row("13b", {_P.HOLD}, "a suspicious clock for too long", lambda f, s: f.clock_bad_for > s.clock_return, _P.RETURN),
    Row("13", PHASES_BEFORE_RETURN, "a suspicious clock", lambda f, s: f.clock_bad_for > 0.0, _P.HOLD),
    Row(
        "14b",
        FLYING_PHASES - {_P.RETURN},
        "the operator is lost, and the card says return",
        lambda f, s: f.operator_lost and s.operator_lost == "return",
        _P.RETURN,
    ),
    Row(
        "14",
        PHASES_BEFORE_RETURN,
        "the operator is lost, and the card says hold",
        lambda f, s: f.operator_lost and s.operator_lost == "hold",
        _P.HOLD,
    ),
    Row(
        "15b",
        FLYING_PHASES - {_P.RETURN},
        "overloaded too often",
        lambda f, s: f.overload_count >= s.overloads and not f.is_overloaded,
        _P.RETURN,
    ),
    Row("15", FLYING_PHASES - {_P.HOLD}, "overloaded, or the law failed", lambda f, s: f.is_overloaded, _P.HOLD),
    Row("28", {_P.BOOT}, "started in the air", lambda f, s: f.present and f.armed and not f.is_landed, _P.MANUAL),
    # A phase of the ground would hide it from the others.
    Row(
        "28b",
        {_P.READY, _P.CLEARED, _P.DONE},
        "somebody else flies it",
        lambda f, s: f.armed and f.is_airborne and not f.kill_confirmed,
        _P.MANUAL,
    ),
    Row(
        "28b",
        {_P.ARMING},
        "somebody else flies it",
        lambda f, s: f.armed and f.is_airborne and not f.in_guided_mode,
        _P.MANUAL,
    ),
    Row("16b", {_P.BOOT, _P.READY, _P.CLEARED}, "something can never fit", lambda f, s: bool(f.fault), _P.FAULT),
    Row(
        "16",
        {_P.BOOT},
        "card, key and autopilot are there",
        lambda f, s: f.present and (not f.armed or f.is_landed),
        _P.READY,
    ),
    Row("17", {_P.READY}, "nothing is missing", lambda f, s: not f.missing and not f.armed, _P.CLEARED),
    Row("17b", {_P.CLEARED}, "something is missing", lambda f, s: bool(f.missing) or f.armed, _P.READY),
    Row("18", {_P.CLEARED}, "the operator's start is due", lambda f, s: f.due, _P.ARMING),
    Row("19d", {_P.ARMING}, "a reason to hold, before it took off", lambda f, s: f.calm_for == 0.0, _P.READY),
    Row("19c", {_P.ARMING}, "the start is called off", lambda f, s: f.order in CALL_OFF_ORDERS, _P.READY),
    Row(
        "19",
        {_P.ARMING},
        "armed in our mode",
        lambda f, s: f.armed and f.in_guided_mode and f.setpoints_for >= s.stream,
        _P.TAKEOFF,
    ),
    Row("19b", {_P.ARMING}, "not armed in time", lambda f, s: f.phase_for > s.arm_time, _P.READY),
    Row("20", {_P.TAKEOFF}, "on the own layer", lambda f, s: f.at_layer, _P.GATHER),
    Row("21b", {_P.TAKEOFF}, "does not climb", lambda f, s: f.phase_for > s.climb_time and not f.is_climbing, _P.LAND),
    Row("21", {_P.TAKEOFF}, "a neighbour is near", lambda f, s: f.neighbour_near, _P.HOLD),
    Row(
        "22",
        {_P.GATHER},
        "all are gathered, or the operator says go",
        lambda f, s: (f.have_gathered or f.order == OrderKind.GO) and f.is_high,
        _P.FLOCK,
    ),
    Row("23", FLYING_PHASES, "ordered to land", lambda f, s: f.order == OrderKind.LAND, _P.LAND),
    Row(
        "23",
        FLYING_PHASES - {_P.RETURN},
        "ordered to return, or the time is up",
        lambda f, s: f.order == OrderKind.RETURN or f.time_over,
        _P.RETURN,
    ),
    Row("23", FLYING_PHASES - {_P.HOLD}, "ordered to hold", lambda f, s: f.order == OrderKind.HOLD, _P.HOLD),
    Row(
        "23",
        FLOCKING_PHASES | {_P.HOLD},
        "ordered to a point",
        lambda f, s: (
            f.order == OrderKind.GOTO
            and not f.needs_resume
            and f.has_good_navigation
            and f.is_high
            and f.phase_before_hold != _P.TAKEOFF
        ),
        _P.GOTO,
    ),
    Row("23", {_P.GOTO}, "ordered to flock on", lambda f, s: f.order == OrderKind.RESUME, _P.FLOCK),
    Row("24", FLOCKING_PHASES, "a member joins", lambda f, s: f.member_joined, None),
    Row(
        "25", {_P.HOLD}, "all is well again", lambda f, s: f.calm_for >= s.calm and not f.held and not f.is_landed, None
    ),
    Row("26", {_P.RETURN}, "above home", lambda f, s: f.at_home, _P.LAND),
    Row("27b", {_P.LAND}, "it never left the ground", lambda f, s: not (f.armed or f.has_flown), _P.READY),
    Row(
        "27",
        {_P.LAND},
        "landed",
        lambda f, s: not f.armed or (f.landed_for > LANDED_TIME and f.in_land_mode and f.has_flown and not f.is_high),
        _P.DONE,
    ),
)
CALM_ROW = next(row for row in MISSION_TABLE if row.number == "25")
ROWS_OF_PHASE = {phase: tuple(row for row in MISSION_TABLE if phase in row.phases) for phase in MissionPhase}


def next_step(phase: MissionPhase, facts: MissionFacts, safety: SafetyLimits) -> MissionStep:
    """Return the first row of the table that fires in a phase, and all rows that change the velocity meanwhile."""
    effects: set[str] = set()
    for row in ROWS_OF_PHASE[phase]:
        if not row.holds(facts, safety):
            continue
        to = facts.phase_before_hold if row is CALM_ROW else row.next_phase
        if to is None:
            effects.add(row.number)
        # Nobody flies home without knowing its place, nor goes on to flock while it stands on the ground.
        elif facts.has_navigation if to == _P.RETURN else not (facts.is_landed and to in FLOWN_AFTER_TAKEOFF):
            return MissionStep(row, to, frozenset(effects))
    return MissionStep(None, phase, frozenset(effects))
