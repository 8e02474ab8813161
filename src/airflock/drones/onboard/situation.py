"""The situation: facts for the mission table, from autopilot, peers and operator, at one tick."""

from collections.abc import Iterable

from airflock.core import State, norm
from airflock.drones.mavlink.autopilots import STREAM_RATES
from airflock.drones.mavlink.frames import common_dialect
from airflock.drones.onboard.card import FlightCard
from airflock.drones.onboard.mission import FLOCKING_PHASES, FLYING_PHASES, MissionFacts, MissionPhase
from airflock.drones.onboard.peers import (
    AGE_COUNT,
    HEARD_WITHIN,
    MOVING_SPEED,
    STREAM_SILENCE,
    AutopilotLink,
    OperatorOrders,
    Peer,
    Peers,
)

STANDING_SPEED = 0.5  # m/s; faster than this a drone does not stand, nor begin to land
MAX_HEARTBEAT_AGE = 3.0  # s; an autopilot that says nothing for longer is not there
# Some requests, one a second, may be lost before the flight has to do without a stream.
MAX_STREAM_AGE = 5.0  # s
POSITION_RATE = 10.0  # 1/s; needed at most: half of what is requested
LANDED_MESSAGE = 245
LAYER_TOLERANCE = 0.5  # m
NO_HEARTBEAT_TEXT = (
    "no heartbeat from the autopilot: is it on, its port and baud rate right, and does it speak MAVLink 2?"
)
# s; largest offset of an autopilot's clock that other drones can explain: in software in the loop it
# was up to 1.1 s; a computer that is farther off would obey no order soon.
MAX_EXPLAINED = 2.5
GATHERED_PHASES = (MissionPhase.GATHER, MissionPhase.FLOCK, MissionPhase.GOTO, MissionPhase.HOLD)
LANDED_PHASES = FLYING_PHASES - {MissionPhase.TAKEOFF} | {MissionPhase.LAND}  # those in which it counts
LEAVING_PHASES = frozenset({MissionPhase.RETURN, MissionPhase.LAND, MissionPhase.DONE})


class ConditionTimers:
    """Times since conditions began to hold, s; 0 where they do not hold."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}

    def __call__(self, name: str, holds: bool, now: float) -> float:
        """Return the time since the condition began to hold; just above 0 at first."""
        if not holds:
            self._since.pop(name, None)
            return 0.0
        return max(now - self._since.setdefault(name, now), 1e-9)


def silent_streams(link: AutopilotLink, now: float) -> tuple[str, ...]:
    """Return the streams of the autopilot that have ended, one line each; not those never heard."""
    return tuple(
        f"{common_dialect().mavlink_map[number].msgname}: the autopilot has sent none for {MAX_STREAM_AGE:g} s"
        for number in STREAM_RATES
        if now - link.arrivals.get(number, now) > MAX_STREAM_AGE
    )


def slow_streams(card: FlightCard, link: AutopilotLink, now: float) -> tuple[str, ...]:
    """Return one line if the own position comes too seldom, or none."""
    # A state for each tick and each packet; a faster one is not needed.
    needed = min(POSITION_RATE, 1.0 / max(card.safety.tick, card.safety.status_period))
    rate = link.low_rate(needed, now)
    if rate is None:
        return ()
    return (
        f"own position at {rate:.1f} Hz, {needed:g} needed: is MAVProxy between? Start it with --streamrate=-1; "
        "other ground stations and the SRn_ (Copter 4.7: MAVn_) parameters set such rates, too",
    )


def missing_before_start(
    card: FlightCard, member: int, link: AutopilotLink, peers: Peers, utc: int, now: float
) -> tuple[str, ...]:
    """Return the reasons for which a drone may not arm, one line each."""
    missing = []
    if utc >= card.expires * 1_000_000:
        missing.append(f"the card expired at Unix time {card.expires} s; the clock says {utc // 1_000_000} s")
    if not card.operator:
        missing.append("operator: the card names no key, so nobody could start or stop the drone")
    if link.armed:
        missing.append("the autopilot is armed already; disarm it")
    missing += (
        _missing_parameters(card, member, link) + _missing_state(card, link, now) + _missing_clock(card, link, peers)
    )
    streams = silent_streams(link, now) + slow_streams(card, link, now)
    return (*missing, *streams, *_missing_peers(card, link, peers, now))


def _missing_parameters(card: FlightCard, member: int, wire: AutopilotLink) -> list[str]:
    """Return the parameters of the autopilot that are unknown or unsafe."""
    missing = []
    for check in card.parameter_checks:
        value, guard = check.value(wire.parameters), check.as_reported(wire.parameters)
        if value is None:
            missing.append(f"{' or '.join(check.names)}: the autopilot has not reported it")
            continue
        if not guard.safe(value, member):
            why = guard.reason(card.safety.speed_max, card.safety.response + card.safety.delay)
            missing.append(f"{guard.name} = {value:g} is not {guard.safe_values(member)}: {why}")
    return missing


def _missing_state(card: FlightCard, wire: AutopilotLink, now: float) -> list[str]:
    """Return the defects of the own position, battery or stand."""
    s, missing, own = card.safety, [], wire.state
    far = (
        wire.far if wire.fix_type >= 3 else 0.0
    )  # without satellites it may say that it is at 0 degrees north and east
    if far:
        missing.append(
            f"the drone is {far * 1e-3:.0f} km away from the card's site: is the site right? It is latitude, "
            "longitude in degrees, altitude above mean sea level in m"
        )
    elif own is None or now - wire.state_at > s.stale:
        missing.append("no own position from the autopilot")
    elif card.outside(*own[:3]) > 0.0:
        missing.append(f"the drone is {card.outside(*own[:3]):.0f} m outside the fence: is the card's site right?")
    elif abs(own.z) > s.uneven:
        missing.append(
            f"the drone stands {abs(own.z):.1f} m {'above' if own.z > 0.0 else 'below'} the card's site, from which "
            f"all heights count; at most {s.uneven:g} m (safety.uneven): is the site's altitude above mean sea level?"
        )
    elif wire.position_disagreement(now) > s.jump:
        missing.append(f"local and global position of the autopilot differ by {wire.position_disagreement(now):.0f} m")
    # The local position alone cannot contradict itself.
    elif wire.global_state is None:
        missing.append("GLOBAL_POSITION_INT: the autopilot has not sent it, so its local position cannot be compared")
    # Its streams may go on without it, through a router; a start would then end at once.
    if now - wire.heartbeat_at > MAX_HEARTBEAT_AGE:
        missing.append(NO_HEARTBEAT_TEXT)
    if wire.origin is None and not far:
        missing.append("GPS_GLOBAL_ORIGIN: the autopilot has not reported it")
    if wire.fix_type < 3 or wire.horizontal_accuracy > s.h_acc:
        accuracy = f"accuracy {min(wire.horizontal_accuracy, 999.0):.1f} m"
        missing.append(f"navigation: fix {wire.fix_type}, {accuracy}; needs a 3-D fix and {s.h_acc:g} m")
    if wire.battery is None or wire.battery <= s.battery_low:
        charge = "unknown" if wire.battery is None else f"{wire.battery:.0f} %"
        missing.append(f"battery: {charge}; needs more than {s.battery_low:g} %")
    if wire.battery_warning:
        missing.append(wire.battery_warning)
    if wire.prearm_fails:
        missing.append("the autopilot's own checks before arming fail; it names the reason twice a minute")
    if wire.is_landed is not True:
        missing.append("the autopilot does not report that it is on the ground")
    return missing


def _missing_clock(card: FlightCard, wire: AutopilotLink, peers: Peers) -> list[str]:
    """Return why the own clock is unknown or wrong."""
    offset = wire.unexplained_offset
    if offset is None:
        return ["SYSTEM_TIME: the autopilot has not reported the time"]
    if abs(offset) > card.safety.clock_error:
        return [
            f"clock: {offset:+.2f} s off the autopilot's; at most {card.safety.clock_error:g} s, or {MAX_EXPLAINED:g} "
            "s while the clocks of all other drones agree with this computer's; set this computer's clock, then "
            "restart the node"
        ]
    return ["clock: it differs from the clocks of all others"] if peers.is_own_clock_suspect() else []


def _missing_peers(card: FlightCard, wire: AutopilotLink, peers: Peers, now: float) -> list[str]:
    """Return the members that are not heard, have another card, or stand too near."""
    missing = []
    for who, peer in peers.all.items():
        if peer.has_other_card:
            missing.append(f"drone {who} has another card")
        elif now - peer.heard_at > HEARD_WITHIN:
            missing.append(f"drone {who} is not heard")
        elif len(peer.packet_ages) == AGE_COUNT and min(peer.packet_ages) < -card.safety.clock_error:
            ahead = -min(peer.packet_ages)
            missing.append(f"clock: drone {who} sends from {ahead:.2f} s in the future; one of the two clocks is wrong")
        elif wire.state is not None and peer.state is not None and peer.status is not None:
            distance = state_distance(wire.state, peer.state)
            # They may stand nearer than they report, and climb by positions that are off by as much.
            errors = wire.horizontal_accuracy + peer.status.accuracy
            if distance < card.safety.start_apart + errors:
                missing.append(
                    f"drone {who} stands {distance:.1f} m away; needs {card.safety.start_apart:g} m and the accuracy "
                    f"of both positions, {errors:.1f} m"
                )
    return missing


def state_distance(a: State, b: State) -> float:
    """Return the distance of two states, m."""
    return float(norm(a.x - b.x, a.y - b.y, a.z - b.z))


def permanent_error(card: FlightCard, member: int, link: AutopilotLink, has_twin: bool, silent_for: float) -> str:
    """Return the error that no waiting can mend; empty if there is none.

    silent_for : time for which the own autopilot has not been heard since the node began, s
    """
    if link.kind is not None and link.kind != card.autopilot.number:
        return f"the autopilot is of kind {link.kind}; the card is for {card.autopilot.name} ({card.autopilot.number})"
    # Another vehicle on this wire may just be heard first, such as an antenna tracker.
    if link.kind is None and link.other_systems and silent_for > MAX_HEARTBEAT_AGE:
        systems = ", ".join(map(str, sorted(link.other_systems)))
        return f"the autopilot calls itself system {systems}; this drone is member {member}"
    return f"another sender signs as member {member}: two drones with one number?" if has_twin else ""


def mission_facts(
    card: FlightCard,
    member: int,
    link: AutopilotLink,
    peers: Peers,
    operator: OperatorOrders,
    timers: ConditionTimers,
    known: MissionFacts,
    *,
    now: float,
    utc: int,
    phase: MissionPhase,
    home: tuple[float, float, float] | None,
    has_twin: bool,
) -> MissionFacts:
    """Return all facts that the mission table uses, at one tick; only the timers remember something of it.

    known    : those that only the node itself knows
    now, utc : own clock, s, and Unix time, µs
    home     : position where it armed, in its own layer, m; None before
    has_twin : another sender signs as this member
    """
    s, own = card.safety, link.state
    alive = now - link.heartbeat_at <= MAX_HEARTBEAT_AGE
    flying = peers.flying()
    fresh = {who: peer for who, peer in flying.items() if now - peer.heard_at <= HEARD_WITHIN}
    # Members that return or land are not waited for, or the last one would hold for ever.
    expected = min(s.peers_least, len([peer for peer in flying.values() if peer.phase not in LEAVING_PHASES]))
    position_bad = timers("position", not now - link.state_at <= s.stale or not alive, now)
    is_gnss_bad = link.fix_type < 3 or link.horizontal_accuracy > s.h_acc or link.is_position_doubtful(now)
    gnss_bad = timers("gnss", is_gnss_bad, now)
    few = timers("few", peers.heard(now) < expected, now)
    # It differs from the autopilot's, or from those of all peers.
    is_clock_bad = abs(link.unexplained_offset or 0.0) > s.clock_error or peers.is_own_clock_suspect()
    clock_bad = timers("clock", is_clock_bad, now)
    out = own is not None and phase in FLYING_PHASES and card.outside(*own[:3]) > 0.0
    near = own is not None and _is_anybody_near(own, fresh.values(), s.near)
    operator_lost = s.operator_lost != "ignore" and now - operator.heard_at > s.operator_time
    # Hysteresis: HOLD ends only after all reasons have been absent for a while (row 25).
    silent = silent_streams(link, now)
    streams = silent + slow_streams(card, link, now)
    reasons_to_hold = {
        "no valid position": position_bad,
        "bad navigation": gnss_bad,
        "too few neighbours": few,
        "a suspicious clock": clock_bad,
        # The law parts those that hold beside each other; holding on would never.
        "a neighbour is near": near and not (phase == MissionPhase.HOLD and known.phase_before_hold in FLOCKING_PHASES),
        "overloaded": known.is_overloaded,
        "the operator is lost": operator_lost and s.operator_lost == "hold",
        # The way home can be flown by slow streams: standing until the battery ends is worse.
        "slow or silent streams": streams and known.phase_before_hold != MissionPhase.RETURN,
    }
    calm = not any(reasons_to_hold.values())
    # What was reported of the ground before its stream ended need not hold.
    landed = link.is_landed if now - link.arrivals.get(LANDED_MESSAGE, now) <= STREAM_SILENCE else None
    is_high = own is None or own.z > card.low - LAYER_TOLERANCE
    # Land detectors err, as in a descent: one that moves does not stand, and one that is high hardly.
    is_moving = own is not None and position_bad == 0.0 and norm(*own[3:]) > MOVING_SPEED
    stands = landed is True and not is_moving and phase in LANDED_PHASES
    landed = landed and not (is_high and position_bad == 0.0)
    missing = (
        missing_before_start(card, member, link, peers, utc, now)
        if phase in (MissionPhase.READY, MissionPhase.CLEARED)
        else ()
    )
    silent_for = timers("silent", phase == MissionPhase.BOOT and not alive, now)
    if silent_for > MAX_HEARTBEAT_AGE:
        missing = (NO_HEARTBEAT_TEXT,)
    # An unknown battery keeps a drone on the ground; in the air it must not land everybody at once.
    battery = 100.0 if link.battery is None else link.battery
    # The reserve grows with the way home.
    way = 0.0 if own is None or home is None else state_distance(own, State(*home, 0.0, 0.0, 0.0))
    layer = card.layer(member)
    return known._replace(
        in_guided_mode=link.mode == card.autopilot.ours,
        in_land_mode=link.mode == card.autopilot.land,
        in_failsafe=link.in_failsafe,
        armed=bool(link.armed),
        is_landed=landed is True,
        is_airborne=landed is False,
        is_high=is_high,
        has_good_navigation=not (position_bad or gnss_bad),
        kill_confirmed=operator.kill_confirmed,
        resume_ordered=operator.resume_ordered,
        held=operator.held,
        needs_resume=operator.needs_resume,
        position_bad_for=position_bad,
        gnss_bad_for=gnss_bad,
        landed_for=timers("landed", stands, now),
        bad_streams=streams,
        silent_streams_for=timers("streams", bool(silent), now),
        battery_critical=battery < s.battery_critical,
        battery_needed_home=bool(link.battery_warning) or battery < s.battery_low + s.battery_way * way * 1e-3,
        outside_for=timers("outside", out, now),
        nobody_heard_for=timers("deaf", bool(flying) and not fresh, now),
        few_heard_for=few,
        clock_bad_for=clock_bad,
        operator_lost=operator_lost,
        present=alive and link.kind == card.autopilot.number and link.armed is not None,
        fault=permanent_error(card, member, link, has_twin, silent_for),
        missing=missing,
        due=operator.due(utc, card.turn(member)),
        at_layer=own is not None and abs(own.z - layer) < LAYER_TOLERANCE,
        is_climbing=own is not None and own.vz > 0.2,
        neighbour_near=near,
        have_gathered=phase == MissionPhase.GATHER and _have_gathered(card, own, peers, now),
        member_joined=peers.member_joined,
        calm_for=timers("calm", calm, now),
        reasons_to_hold=tuple(reason for reason, holds in reasons_to_hold.items() if holds),
        at_home=own is not None and home is not None and _is_at_home(card, own, home, layer),
    )


def explain_clock_offset(card: FlightCard, link: AutopilotLink, peers: Peers, now: float) -> None:
    """Take the autopilot's present offset as explained while the clocks of the other drones confirm the own one."""
    # Stamps are of this computer's clock, and other drones read them: what counts is that the
    # computers agree. The autopilot's clock is a second witness, and no better one: ArduPilot sets
    # it once and drifts (50 ppm are 0.2 s after 67 min), in the loop it begins up to 1.1 s off. So
    # the packets of all others overrule it, but in the air only as it drifts: a step there is a
    # fault of either clock.
    offset, limit = link.clock_offset(), card.safety.clock_error
    if offset is None or abs(offset) > MAX_EXPLAINED or abs(offset - link.explained_offset) < 0.5 * limit:
        return
    is_step = abs(offset - link.explained_offset) > limit
    if not (is_step and link.armed) and peers.confirm_clock(now):
        link.explained_offset = offset
        if is_step:
            link.report(
                f"the autopilot's clock is {offset:+.2f} s off this computer's, which stamps: no other drone's differs"
            )


def _is_anybody_near(own: State, peers: Iterable[Peer], distance: float) -> bool:
    """Return True if one of these peers is nearer than a distance, m."""
    return any(
        abs(peer.state.x - own.x) < distance and state_distance(own, peer.state) < distance
        # The first comparison spares most square roots: this runs for each pair at each tick.
        for peer in peers
        if peer.state is not None
    )


def _have_gathered(card: FlightCard, own: State | None, peers: Peers, now: float) -> bool:
    """Return True if all members have gathered around the own position."""
    return own is not None and all(
        now - peer.heard_at <= HEARD_WITHIN
        and peer.phase in GATHERED_PHASES
        and peer.state is not None
        and state_distance(own, peer.state) < card.safety.gather
        for peer in peers.all.values()
    )


def _is_at_home(card: FlightCard, own: State, home: tuple[float, float, float], layer: float) -> bool:
    """Return True if the drone hovers above its home in its own layer."""
    over = norm(own.x - home[0], own.y - home[1], 0.0) < card.safety.home_radius and abs(own.z - layer) < 1.0
    return over and norm(own.vx, own.vy, 0.0) < STANDING_SPEED
