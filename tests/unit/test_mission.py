"""The mission table: every row fires, and gives way to a higher one; the limiter lets nothing dangerous through."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings, strategies as st

from airflock.core.contract import State
from airflock.core.maths import braking_curve
from airflock.drones.mavlink.orders import OrderKind
from airflock.drones.onboard.card import SafetyLimits
from airflock.drones.onboard.mission import (
    AIRBORNE_PHASES,
    FLYING_PHASES,
    MISSION_TABLE,
    MissionFacts,
    MissionPhase,
    next_step,
)
from airflock.drones.onboard.node import own_status
from airflock.drones.onboard.steering import limit_velocity
from mission_events import EVENTS, fly

WELL, SAFE = MissionFacts(), SafetyLimits()
P = MissionPhase
PILOT = {"in_guided_mode": False}
FAILSAFE_LANDING = {"in_guided_mode": False, "in_land_mode": True, "in_failsafe": True}
# number, phase, facts that fire it, next phase; facts of a higher row and where that leads
ROWS = [
    ("1", P.FLOCK, PILOT, P.MANUAL, FAILSAFE_LANDING, P.LAND),
    ("1b", P.HOLD, FAILSAFE_LANDING, P.LAND, None, None),
    ("1", P.LAND, {"in_guided_mode": False, "in_land_mode": False}, P.MANUAL, None, None),
    ("2", P.MANUAL, {"resume_ordered": True, "setpoints_for": 2.0}, P.HOLD, None, None),
    ("3", P.MANUAL, {"armed": False}, P.DONE, None, None),
    ("3b", P.MANUAL, {"armed": False, "has_flown": False}, P.READY, None, None),
    ("4", P.FLOCK, {"kill_confirmed": True}, P.DONE, PILOT, P.MANUAL),
    ("5", P.FLOCK, {"position_bad_for": 0.1}, P.HOLD, PILOT, P.MANUAL),
    ("5b", P.HOLD, {"position_bad_for": 5.1}, P.LAND, PILOT, P.MANUAL),
    ("6", P.GOTO, {"gnss_bad_for": 0.1}, P.HOLD, {"position_bad_for": 9.0}, P.LAND),
    ("6b", P.HOLD, {"gnss_bad_for": 10.1}, P.LAND, {"kill_confirmed": True}, P.DONE),
    ("7", P.FLOCK, {"battery_critical": True}, P.LAND, {"gnss_bad_for": 1.0}, P.HOLD),
    ("8", P.FLOCK, {"battery_needed_home": True}, P.RETURN, {"battery_critical": True}, P.LAND),
    ("9", P.FLOCK, {"outside_for": 0.1}, P.RETURN, {"battery_critical": True}, P.LAND),
    ("9b", P.RETURN, {"outside_for": 10.1}, P.LAND, PILOT, P.MANUAL),
    ("10", P.FLOCK, {"is_at_fence": True}, None, {"outside_for": 1.0}, P.RETURN),
    ("11", P.FLOCK, {"lost_near": True}, None, {"outside_for": 1.0}, P.RETURN),
    ("11b", P.FLOCK, {"nobody_heard_for": 20.1}, P.RETURN, {"battery_critical": True}, P.LAND),
    ("12", P.FLOCK, {"few_heard_for": 10.1}, P.HOLD, {"nobody_heard_for": 20.1}, P.RETURN),
    ("12b", P.HOLD, {"few_heard_for": 30.1}, P.RETURN, {"position_bad_for": 6.0}, P.LAND),
    ("13", P.FLOCK, {"clock_bad_for": 0.1}, P.HOLD, {"battery_needed_home": True}, P.RETURN),
    ("13b", P.HOLD, {"clock_bad_for": 10.1}, P.RETURN, {"outside_for": 11.0}, P.LAND),
    ("14", P.FLOCK, {"operator_lost": True, "says": "hold"}, P.HOLD, {"battery_needed_home": True}, P.RETURN),
    ("14b", P.FLOCK, {"operator_lost": True, "says": "return"}, P.RETURN, {"clock_bad_for": 1.0}, P.HOLD),
    ("15", P.FLOCK, {"is_overloaded": True}, P.HOLD, {"nobody_heard_for": 21.0}, P.RETURN),
    ("15b", P.HOLD, {"overload_count": 3}, P.RETURN, {"battery_critical": True}, P.LAND),
    ("16", P.BOOT, {"armed": False, "is_landed": True}, P.READY, {"fault": "another kind"}, P.FAULT),
    ("16b", P.READY, {"fault": "another system", "armed": False}, P.FAULT, None, None),
    ("17", P.READY, {"armed": False}, P.CLEARED, {"fault": "another kind"}, P.FAULT),
    ("17b", P.CLEARED, {"armed": False, "missing": ("no position",)}, P.READY, {"fault": "x"}, P.FAULT),
    ("18", P.CLEARED, {"armed": False, "due": True}, P.ARMING, {"missing": ("battery",)}, P.READY),
    ("19", P.ARMING, {"setpoints_for": 2.0}, P.TAKEOFF, {"kill_confirmed": True}, P.DONE),
    ("19c", P.ARMING, {"order": OrderKind.LAND}, P.READY, {"kill_confirmed": True}, P.DONE),
    ("19c", P.ARMING, {"armed": False, "order": OrderKind.HOLD}, P.READY, None, None),
    ("19d", P.ARMING, {"armed": False, "calm_for": 0.0}, P.READY, {"kill_confirmed": True}, P.DONE),
    ("19b", P.ARMING, {"armed": False, "phase_for": 11.0}, P.READY, {"kill_confirmed": True}, P.DONE),
    ("20", P.TAKEOFF, {"at_layer": True}, P.GATHER, {"gnss_bad_for": 1.0}, P.HOLD),
    ("21", P.TAKEOFF, {"neighbour_near": True}, P.HOLD, {"at_layer": True}, P.GATHER),
    ("21b", P.TAKEOFF, {"is_climbing": False, "phase_for": 6.0}, P.LAND, PILOT, P.MANUAL),
    ("22", P.GATHER, {"have_gathered": True}, P.FLOCK, {"few_heard_for": 11.0}, P.HOLD),
    ("22", P.GATHER, {"order": OrderKind.GO}, P.FLOCK, {"clock_bad_for": 1.0}, P.HOLD),
    ("23", P.FLOCK, {"order": OrderKind.LAND}, P.LAND, {"battery_needed_home": True}, P.RETURN),
    ("23", P.GOTO, {"order": OrderKind.RETURN}, P.RETURN, {"position_bad_for": 1.0}, P.HOLD),
    ("23", P.FLOCK, {"time_over": True}, P.RETURN, PILOT, P.MANUAL),
    ("23", P.FLOCK, {"order": OrderKind.HOLD}, P.HOLD, {"outside_for": 1.0}, P.RETURN),
    ("23", P.FLOCK, {"order": OrderKind.GOTO}, P.GOTO, {"battery_needed_home": True}, P.RETURN),
    ("23", P.GOTO, {"order": OrderKind.RESUME}, P.FLOCK, {"is_overloaded": True}, P.HOLD),
    ("24", P.FLOCK, {"member_joined": True}, None, {"order": OrderKind.HOLD}, P.HOLD),
    ("25", P.HOLD, {"calm_for": 3.0, "phase_before_hold": P.GOTO}, P.GOTO, {"order": OrderKind.LAND}, P.LAND),
    ("26", P.RETURN, {"at_home": True}, P.LAND, {"position_bad_for": 1.0}, P.HOLD),
    (
        "27",
        P.LAND,
        {"landed_for": 1.1, "in_land_mode": True, "is_high": False},
        P.DONE,
        {"kill_confirmed": True},
        P.DONE,
    ),
    ("27b", P.LAND, {"armed": False, "has_flown": False}, P.READY, {"kill_confirmed": True}, P.DONE),
    ("28", P.BOOT, {"is_landed": False}, P.MANUAL, None, None),
    ("28b", P.DONE, {"in_guided_mode": False}, P.MANUAL, None, None),
    ("28b", P.ARMING, {"in_guided_mode": False}, P.MANUAL, {"kill_confirmed": True}, P.DONE),
    ("29", P.HOLD, {"is_landed": True, "landed_for": 5.1}, P.LAND, {"kill_confirmed": True}, P.DONE),
    ("29", P.GOTO, {"is_landed": True, "landed_for": 1.1, "is_high": False}, P.LAND, PILOT, P.MANUAL),
    ("30", P.FLOCK, {"bad_streams": ("own position at 4.2 Hz",)}, P.HOLD, {"position_bad_for": 9.0}, P.LAND),
    ("30b", P.HOLD, {"silent_streams_for": 10.1}, P.RETURN, {"gnss_bad_for": 11.0}, P.LAND),
]


def at(phase, given):
    safety = replace(SAFE, operator_lost=given.get("says", "ignore"))
    return next_step(phase, WELL._replace(**{k: v for k, v in given.items() if k != "says"}), safety)


@pytest.mark.parametrize(("number", "phase", "given", "to", "higher", "then"), ROWS)
def test_every_row_fires_and_gives_way_to_a_higher_one(number, phase, given, to, higher, then):
    step = at(phase, given)
    if to is None:
        assert step.row is None and step.next_phase == phase and number in step.effects
    else:
        assert (step.row.number, step.next_phase) == (number, to)
    if higher is not None:
        above = at(phase, given | higher)
        assert above.next_phase == then and above.row.number != number
        order = [row.number for row in MISSION_TABLE]
        assert order.index(above.row.number) < len(order) - order[::-1].index(number)


def test_all_30_rows_of_the_table_are_here():
    whole = {number.rstrip("bcd") for number, *_ in ROWS}
    assert whole == {row.number.rstrip("bcd") for row in MISSION_TABLE} == {str(k) for k in range(1, 31)}
    assert {number for number, *_ in ROWS} == {row.number for row in MISSION_TABLE}


@pytest.mark.parametrize("phase", sorted(FLYING_PHASES - {P.TAKEOFF, P.GATHER}))
def test_a_drone_that_flies_well_flies_on(phase):
    assert at(phase, {}).row is None and at(phase, {}).next_phase == phase


@given(st.sampled_from(sorted(MissionPhase)), st.data())
def test_whatever_goes_wrong_the_pilot_comes_first_and_nothing_on_the_ground_flies_by_itself(phase, data):
    names = [name for name, kind in MissionFacts.__annotations__.items() if kind is bool]
    odd = {name: data.draw(st.booleans(), label=name) for name in names}
    odd |= {
        n: data.draw(st.sampled_from([0.0, 1.0, 99.0])) for n, k in MissionFacts.__annotations__.items() if k is float
    }
    odd["order"] = data.draw(st.sampled_from([None, *OrderKind]))
    step = at(phase, odd)
    if phase in FLYING_PHASES and not odd["in_guided_mode"]:
        lands_itself = odd["armed"] and odd["in_land_mode"] and odd["in_failsafe"]
        assert step.next_phase == (P.LAND if lands_itself else P.MANUAL)
    if phase in (P.BOOT, P.READY, P.CLEARED, P.DONE, P.FAULT):
        assert step.next_phase not in FLYING_PHASES
        assert step.next_phase != P.ARMING or (phase == P.CLEARED and odd["due"])
    if phase == P.FAULT or (phase == P.DONE and not (odd["armed"] and odd["is_airborne"])):
        assert step.next_phase == phase
    if phase == P.MANUAL and step.next_phase == P.HOLD:
        assert odd["in_guided_mode"] and odd["resume_ordered"] and odd["has_good_navigation"]
        assert odd["armed"] and odd["is_airborne"] and odd["is_high"]
    if step.next_phase in (P.GATHER, P.FLOCK, P.GOTO) and step.next_phase != phase:
        assert not odd["is_landed"]
    if odd["is_landed"] and odd["landed_for"] > 1.0 and phase in FLYING_PHASES - {P.TAKEOFF}:
        assert step.next_phase in (P.LAND, P.MANUAL, P.DONE)


# ------------------------------------------------------------------------------------------------- random events

READY = ("neighbour is heard", 10)
STARTS = [[READY, (OrderKind.START, ticks)] for ticks in (2, 20, 45, 65)]  # is arming, takes off, gathers, flocks
BY_HAND = [("pilot arms", 1), ("pilot climbs", 5)]
sequences = st.tuples(
    st.sampled_from(["px4", "ardupilot"]),
    st.sampled_from([[], [READY], BY_HAND, [READY, *BY_HAND], *STARTS, [*STARTS[-1], ("pilot takes over", 5)]]),
    st.lists(st.tuples(st.sampled_from(EVENTS), st.sampled_from([1, 2, 5, 10, 20])), max_size=12),
)


@pytest.mark.parametrize(
    "count", [300, *(pytest.param(50_000, marks=pytest.mark.nightly, id=f"nightly-{part}") for part in (1, 2))]
)
def test_nobody_flocks_on_the_ground_arms_unseen_or_climbs_without_an_order(count):
    """Whatever happens in whatever order; a failure prints its sequence and all that happened."""

    @settings(max_examples=count)
    @given(sequences)
    def holds(sequence):
        kind, begun, events = sequence
        fly(kind, [*begun, *events])

    holds()


@pytest.mark.parametrize("kind", ["px4", "ardupilot"])
def test_take_off_that_was_held_in_the_air_goes_on_to_its_layer(kind):
    """ArduPilot takes off by a command that it refuses in the air: setpoints lift it there. No point is flown to."""
    flight = fly(kind, [*STARTS[1], (OrderKind.HOLD, 20)])
    assert flight.node.phase == P.HOLD and 1.0 < flight.z < 8.0
    flight.log.clear()
    for event, ticks in ((OrderKind.GOTO, 5), (OrderKind.RESUME, 60)):
        flight.apply(event)
        for _ in range(ticks):
            flight.step()
    changes = [text.partition(":")[0] for _, text in flight.log if "→" in text]
    assert changes == ["HOLD → TAKEOFF", "TAKEOFF → GATHER", "GATHER → FLOCK"], flight.log
    assert flight.z > 9.4


def test_drone_that_is_called_home_without_a_position_never_flocks_on():
    """It cannot fly home then; it holds, says so, and follows the next order to return."""
    flight = fly("ardupilot", [*STARTS[3], ("bad navigation", 3), (OrderKind.RETURN, 3), ("good navigation", 40)])
    assert flight.node.phase == P.HOLD and flight.node.operator.held
    flight.apply(OrderKind.RETURN)
    flight.step()
    assert flight.node.phase == P.RETURN


@pytest.mark.parametrize("ticks", [1, 5, 20, 30])
def test_drone_whose_autopilot_reports_the_ground_in_the_air_is_seen_by_the_others(ticks):
    """They do not avoid whom they take to stand; no tick of it is unseen, and it lands after 5 s, no sooner."""
    flight = fly("ardupilot", STARTS[3])
    link, report = flight.node.autopilot_link, flight._report

    def report_the_ground():
        report()
        link.is_landed = True

    flight._report = report_the_ground
    for _ in range(ticks):
        flight.step()
        status = own_status(flight.card, link, link.state, 0, flight.node.phase, peers=1)
        assert flight.z > 10.0 and status.is_airborne and flight.node.phase in AIRBORNE_PHASES, flight.log[-3:]
    assert (flight.node.phase == P.LAND) == (ticks == 30)


@pytest.mark.parametrize("order", [kind for kind in OrderKind if kind not in (OrderKind.RESUME, OrderKind.PING)])
def test_no_order_but_resume_lets_a_drone_whose_position_jumped_flock_on(order):
    flight = fly("px4", [*STARTS[3], ("jumps aside", 10), (order, 60)])
    assert flight.node.phase not in (P.GATHER, P.FLOCK, P.GOTO), flight.log
    flight = fly("px4", [*STARTS[3], ("jumps aside", 10), (OrderKind.HOLD, 2), (OrderKind.RESUME, 20)])
    assert flight.node.phase == P.FLOCK, "its position holds, and somebody has looked"


# -------------------------------------------------------------------------------------------------------- limiter

numbers = st.one_of(st.floats(-50, 50), st.floats())
states = st.builds(State, *[st.floats(-200, 200)] * 2, st.floats(-5, 200), *[st.floats(-8, 8)] * 2, st.floats(-3, 3))


def square(own, half=100.0):
    return [(half - n * p, -a * n, -b * n, 0.0) for a, b, p in ((1, 0, own.x), (0, 1, own.y)) for n in (1.0, -1.0)]


@given(st.tuples(numbers, numbers, numbers), states)
def test_whatever_is_wished_stays_within_all_limits(wish, own):
    (vx, vy, vz), _ = limit_velocity(wish, own, square(own), (2.0, 60.0), SAFE)
    assert all(map(math.isfinite, (vx, vy, vz)))
    assert math.hypot(vx, vy) <= SAFE.speed_max * (1 + 1e-9) and abs(vz) <= SAFE.climb_max
    for distance, nx, ny, _ in square(own):
        outward = -(vx * nx + vy * ny)
        assert outward <= braking_curve(distance, SAFE.brake, SAFE.brake_gain) + 1e-6
    assert vz <= braking_curve(60.0 - own.z, SAFE.brake, SAFE.brake_gain) + 1e-9
    assert -vz <= braking_curve(own.z - 2.0, SAFE.brake, SAFE.brake_gain) + 1e-9


@given(st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(-1, 1)))
def test_what_is_harmless_passes_unchanged(wish):
    own = State(0.0, 0.0, 30.0, 0.0, 0.0, 0.0)
    made = limit_velocity(wish, own, square(own), (2.0, 60.0), SAFE)
    assert made.velocity == pytest.approx(wish, abs=1e-12) and not made.is_fenced


@given(st.floats(0, 2 * math.pi), st.floats(-90, 90), st.floats(-90, 90))
def test_a_drone_at_full_speed_stops_before_the_fence(direction, x, y):
    """Wherever it comes from, a drone that follows the limiter with its own inertia never crosses the fence."""
    own, dt = State(x, y, 20.0, 0.0, 0.0, 0.0), 0.05
    wish = (6.0 * math.cos(direction), 6.0 * math.sin(direction), 0.0)
    for _ in range(1200):
        v = limit_velocity(wish, own, square(own), (2.0, 60.0), SAFE).velocity
        ax, ay = (v[0] - own.vx) / SAFE.response, (v[1] - own.vy) / SAFE.response
        k = min(1.0, SAFE.accel / max(math.hypot(ax, ay), 1e-9))
        vx, vy = own.vx + k * ax * dt, own.vy + k * ay * dt
        own = State(own.x + own.vx * dt, own.y + own.vy * dt, 20.0, vx, vy, 0.0)
        assert max(abs(own.x), abs(own.y)) < 100.0
