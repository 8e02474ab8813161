"""All pairs of a phase of a mission and an event, with the phase that follows: a person has judged each of them.

A pair that is not listed changes nothing. Read the whole table after a change of the rows: an event that nobody thought
of in a phase is where a drone does something strange.
"""

from airflock.drones.mavlink.orders import OrderKind
from airflock.drones.onboard.card import SafetyLimits
from airflock.drones.onboard.mission import MissionFacts, MissionPhase, next_step

P = MissionPhase
STANDS = {"armed": False, "is_landed": True, "is_airborne": False, "is_high": False, "has_flown": False}
SPINS = STANDS | {"armed": True}  # stands with turning motors
# facts of a drone that is where a phase expects it
USUAL = {
    P.BOOT: STANDS | {"present": False, "in_guided_mode": False},
    P.READY: STANDS | {"missing": ("drone 2 is not heard",), "in_guided_mode": False},
    P.CLEARED: STANDS | {"in_guided_mode": False},
    P.ARMING: STANDS | {"setpoints_for": 2.0},
    P.TAKEOFF: SPINS,
    P.LAND: {"in_guided_mode": False, "in_land_mode": True},
    P.MANUAL: {"in_guided_mode": False},
    P.DONE: {"armed": False, "is_landed": True, "is_airborne": False, "is_high": False, "in_guided_mode": False},
    P.FAULT: STANDS | {"fault": "another kind", "in_guided_mode": False},
}
AIR = {"is_landed": False, "is_airborne": True, "is_high": True}
LOW = AIR | {"is_high": False}
# events that change these facts; `before` is the phase before HOLD
EVENTS = {
    "the autopilot is heard": {"present": True},
    "it is armed by somebody else, on the ground": SPINS,
    "it flies by hand": AIR | {"armed": True, "in_guided_mode": False, "in_land_mode": False},
    "it flies low in our mode": LOW | {"armed": True, "in_guided_mode": True, "in_land_mode": False, "has_flown": True},
    "it reports that it stands, armed": {**SPINS, "landed_for": 2.0},
    "it reports that it stands, though it is high": {"is_landed": True, "is_airborne": False, "landed_for": 2.0},
    "it reports neither ground nor air": {"is_landed": False, "is_airborne": False},
    "it is disarmed": {"armed": False},
    "it is disarmed on the ground": STANDS | {"has_flown": True},
    "the pilot takes over": {"in_guided_mode": False, "in_land_mode": False},
    "the pilot lets it land": {"in_guided_mode": False, "in_land_mode": True},
    "a failsafe lets it land": {"in_guided_mode": False, "in_land_mode": True, "in_failsafe": True},
    "resume, in our mode": {"resume_ordered": True, "in_guided_mode": True, "setpoints_for": 2.0},
    "resume, in our mode, on the ground": SPINS
    | {"resume_ordered": True, "in_guided_mode": True, "setpoints_for": 2.0},
    "resume, in our mode, below the fence": LOW
    | {"armed": True, "resume_ordered": True, "in_guided_mode": True, "setpoints_for": 2.0},
    "resume, by hand": {"resume_ordered": True, "in_guided_mode": False, "setpoints_for": 2.0},
    "nothing is missing": {"missing": ()},
    "something is missing": {"missing": ("battery",), "calm_for": 0.0},
    "the start is due": {"due": True},
    "the start is due, nothing missing": {"due": True, "missing": ()},
    "no position": {"position_bad_for": 0.1, "has_good_navigation": False, "calm_for": 0.0},
    "no position for long": {"position_bad_for": 9.0, "has_good_navigation": False, "calm_for": 0.0},
    "bad navigation": {"gnss_bad_for": 0.1, "has_good_navigation": False, "calm_for": 0.0},
    "bad navigation for long": {"gnss_bad_for": 11.0, "has_good_navigation": False, "calm_for": 0.0},
    "slow streams": {"bad_streams": ("own position at 4 Hz",), "calm_for": 0.0},
    "a stream silent for long": {"bad_streams": ("SYS_STATUS",), "silent_streams_for": 11.0, "calm_for": 0.0},
    "battery critical": {"battery_critical": True, "battery_needed_home": True},
    "battery for the way home": {"battery_needed_home": True},
    "beyond the fence": {"outside_for": 0.1},
    "beyond the fence for long": {"outside_for": 11.0},
    "few neighbours": {"few_heard_for": 11.0, "calm_for": 0.0},
    "few neighbours for long": {"few_heard_for": 31.0, "calm_for": 0.0},
    "nobody heard for long": {"nobody_heard_for": 21.0},
    "bad clock": {"clock_bad_for": 0.1, "calm_for": 0.0},
    "bad clock for long": {"clock_bad_for": 11.0, "calm_for": 0.0},
    "overload": {"is_overloaded": True, "overload_count": 1, "calm_for": 0.0},
    "overloaded too often": {"overload_count": 3},
    "a neighbour near": {"neighbour_near": True, "calm_for": 0.0},
    "armed in our mode": {"armed": True, "in_guided_mode": True},
    "time to arm is over": {"phase_for": 11.0},
    "on the own layer": AIR | {"at_layer": True},
    "does not climb": {"phase_for": 6.0, "is_climbing": False},
    "all gathered": {"have_gathered": True},
    "time over": {"time_over": True},
    "calm, before FLOCK": {"calm_for": 3.0},
    "calm, before TAKEOFF": {"calm_for": 3.0, "phase_before_hold": P.TAKEOFF},
    "calm, before RETURN": {"calm_for": 3.0, "phase_before_hold": P.RETURN},
    "calm, but hold was ordered": {"calm_for": 3.0, "held": True},
    "above home": {"at_home": True},
    "kill": {"kill_confirmed": True},
    "can never fit": {"fault": "another kind"},
    **{f"order {kind.name}": {"order": kind} for kind in OrderKind},
    "order GOTO, after a jump": {"order": OrderKind.GOTO, "held": True, "needs_resume": True},
    "order GOTO, before TAKEOFF": {"order": OrderKind.GOTO, "phase_before_hold": P.TAKEOFF},
    "order GO, on the ground": SPINS | {"order": OrderKind.GO},
    "order HOLD, on the ground": SPINS | {"order": OrderKind.HOLD},
}


def take():
    """Return {event: {phase: "the next one (number of the row)"}} of all pairs that change the phase."""
    table = {}
    for event, facts in EVENTS.items():
        steps = {p: next_step(p, MissionFacts()._replace(**USUAL.get(p, {}) | facts), SafetyLimits()) for p in P}
        table[event] = {p.name: f"{s.next_phase.name} ({s.row.number})" for p, s in steps.items() if s.row is not None}
    return table
