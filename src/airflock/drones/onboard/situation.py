"""The situation: facts for the mission table from what wire, peers and operator know at one tick."""

from collections.abc import Iterable
from typing import NamedTuple

from airflock.core.agent import State
from airflock.core.maths import norm
from airflock.drones.mavlink.orders import Do
from airflock.drones.onboard.card import Card
from airflock.drones.onboard.mission import FLY, Facts, Phase
from airflock.drones.onboard.operator import Operator
from airflock.drones.onboard.peers import FRESH, Peer, Peers
from airflock.drones.onboard.wire import Wire

SLOW = 0.5  # m/s; faster than this a drone does not stand, nor begin to land
ALIVE = 3.0  # s; an autopilot that says nothing for longer is not there
SILENT = "no heartbeat from the autopilot: is it on, its port and baud rate right, and does it speak MAVLink 2?"
GATHERED = (Phase.GATHER, Phase.FLOCK, Phase.GOTO, Phase.HOLD)
BY_MODE = frozenset({Phase.RETURN, Phase.LAND, Phase.DONE})


class Tick(NamedTuple):
    """What only the node itself knows at one tick; what has no line here is as in `Facts`.

    now, utc : the own clock, s, and Unix time, µs
    home     : where it armed, in its own layer, m; None before
    twin     : whether another sender signs as this member
    """

    now: float
    utc: int
    phase: Phase
    before: Phase
    home: tuple[float, float, float] | None
    twin: bool
    order: Do | None
    overload: bool
    overloads: int
    near_fence: bool
    lost_near: bool
    streamed_for: float
    phase_for: float
    time_over: bool


class Timers:
    """For how long each of some conditions has held, s; 0 where it does not hold."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}

    def __call__(self, name: str, holds: bool, now: float) -> float:
        """Time since the condition began to hold; just above 0 at first."""
        if not holds:
            self._since.pop(name, None)
            return 0.0
        return max(now - self._since.setdefault(name, now), 1e-9)


def misses(card: Card, member: int, wire: Wire, peers: Peers, utc: int, now: float) -> tuple[str, ...]:
    """What keeps a drone from arming, one line each."""
    found = []
    if utc >= card.expires * 1_000_000:
        found.append(f"the card expired at Unix time {card.expires} s; the clock says {utc // 1_000_000} s")
    if not card.operator:
        found.append("operator: the card names no key, so nobody could start or stop the drone")
    if wire.armed:
        found.append("the autopilot is armed already; disarm it")
    found += _parameter_misses(card, member, wire) + _own_misses(card, wire, now) + _clock_misses(card, wire, peers)
    return (*found, *_peer_misses(card, wire, peers, now))


def _parameter_misses(card: Card, member: int, wire: Wire) -> list[str]:
    """Parameters of the autopilot that are not told or not safe."""
    found = []
    for guard in card.autopilot.guards:
        value = wire.parameters.get(guard.name)
        if value is None:
            found.append(f"{guard.name}: the autopilot has not reported it")
            continue
        if not guard.safe(value, member):
            why = guard.reason(card.safety.speed_max, card.safety.response)
            found.append(f"{guard.name} = {value:g} is not {guard.told(member)}: {why}")
    return found


def _own_misses(card: Card, wire: Wire, now: float) -> list[str]:
    """What is wrong with the own position, battery or stand."""
    s, found, own = card.safety, [], wire.state
    far = wire.far if wire.fix >= 3 else 0.0  # without satellites it may say that it is at 0 degrees north and east
    if far:
        found.append(
            f"the drone is {far * 1e-3:.0f} km away from the card's site: is the site right? It is latitude, "
            "longitude in degrees, altitude above mean sea level in m"
        )
    elif own is None or now - wire.state_at > s.stale:
        found.append("no own position from the autopilot")
    elif card.outside(*own[:3]) > 0.0:
        found.append(f"the drone is {card.outside(*own[:3]):.0f} m outside the fence: is the card's site right?")
    elif abs(own.z) > s.uneven:
        found.append(
            f"the drone stands {abs(own.z):.1f} m {'above' if own.z > 0.0 else 'below'} the card's site, by which all "
            f"heights are told; at most {s.uneven:g} m (safety.uneven): is the site's altitude above mean sea level?"
        )
    elif wire.disagreement(now) > s.jump:
        found.append(f"local and global position of the autopilot differ by {wire.disagreement(now):.0f} m")
    if wire.origin is None and not far:
        found.append("GPS_GLOBAL_ORIGIN: the autopilot has not reported it")
    if wire.fix < 3 or wire.h_acc > s.h_acc:
        accuracy = f"accuracy {min(wire.h_acc, 999.0):.1f} m"
        found.append(f"navigation: fix {wire.fix}, {accuracy}; needs a 3-D fix and {s.h_acc:g} m")
    if wire.battery is None or wire.battery <= s.battery_low:
        told = "not told" if wire.battery is None else f"{wire.battery:.0f} %"
        found.append(f"battery: {told}; needs more than {s.battery_low:g} %")
    if wire.landed is not True:
        found.append("the autopilot does not report that it is on the ground")
    return found


def _clock_misses(card: Card, wire: Wire, peers: Peers) -> list[str]:
    """Whether the own clock is known and right."""
    offset = wire.clock_offset()
    if offset is None:
        return ["SYSTEM_TIME: the autopilot has not reported the time"]
    if abs(offset) > card.safety.clock_error:
        return [
            f"clock: {offset:+.2f} s off the autopilot's; at most {card.safety.clock_error:g} s; set this computer's "
            "clock, then start the node anew"
        ]
    return ["clock: it differs from the clocks of all others"] if peers.clocks_suspect() else []


def _peer_misses(card: Card, wire: Wire, peers: Peers, now: float) -> list[str]:
    """Who is not heard, has another card, or stands too near."""
    found = []
    for who, peer in peers.all.items():
        if peer.other_card:
            found.append(f"drone {who} has another card")
        elif now - peer.heard_at > FRESH:
            found.append(f"drone {who} is not heard")
        elif wire.state is not None and peer.state is not None:
            distance = apart(wire.state, peer.state)
            if distance < card.safety.start_apart:
                found.append(f"drone {who} stands {distance:.1f} m away; needs {card.safety.start_apart:g} m")
    return found


def apart(a: State, b: State) -> float:
    """Distance of two states, m."""
    return float(norm(a.x - b.x, a.y - b.y, a.z - b.z))


def boot_fault(card: Card, member: int, wire: Wire, twin: bool) -> str:
    """What can never fit; empty if nothing is wrong."""
    if wire.kind is not None and wire.kind != card.autopilot.number:
        return f"the autopilot is of kind {wire.kind}; the card is for {card.autopilot.name} ({card.autopilot.number})"
    if wire.kind is None and wire.strangers:
        told = ", ".join(map(str, sorted(wire.strangers)))
        return f"the autopilot calls itself system {told}; this drone is member {member}"
    return f"another sender signs as member {member}: two drones with one number?" if twin else ""


def facts(card: Card, member: int, wire: Wire, peers: Peers, operator: Operator, timers: Timers, tick: Tick) -> Facts:
    """Everything that the mission table asks for, at one tick."""
    s, own, now, phase = card.safety, wire.state, tick.now, tick.phase
    alive = now - wire.heartbeat_at <= ALIVE
    flying = peers.flying()
    fresh = {who: peer for who, peer in flying.items() if now - peer.heard_at <= FRESH}
    expected = min(s.peers_least, len([peer for peer in flying.values() if peer.phase not in BY_MODE]))
    position_bad = timers("position", not now - wire.state_at <= s.stale or not alive, now)
    gnss_bad = timers("gnss", _gnss_bad(card, wire, now), now)
    few = timers("few", peers.heard(now) < expected, now)
    clock_bad = timers("clock", _clock_bad(card, wire, peers), now)
    out = own is not None and phase in FLY and card.outside(*own[:3]) > 0.0
    near = own is not None and _anybody_near(own, fresh.values(), s.near)
    operator_lost = s.operator_lost != "ignore" and now - operator.heard_at > s.operator_time
    calm = not (position_bad or gnss_bad or few or clock_bad or near or tick.overload)
    calm = calm and not (operator_lost and s.operator_lost == "hold")
    missing = misses(card, member, wire, peers, tick.utc, now) if phase in (Phase.READY, Phase.CLEARED) else ()
    if timers("silent", phase == Phase.BOOT and not alive, now) > ALIVE:
        missing = (SILENT,)
    battery = 100.0 if wire.battery is None else wire.battery
    way = 0.0 if own is None or tick.home is None else apart(own, State(*tick.home, 0.0, 0.0, 0.0))
    layer = card.layer(member)
    return Facts(
        mode_ours=wire.mode == card.autopilot.ours, mode_land=wire.mode == card.autopilot.land,
        armed=bool(wire.armed), landed=bool(wire.landed), healthy=not (position_bad or gnss_bad),
        order=tick.order, killed=operator.killed, resume=operator.resume, held=operator.held,
        position_bad_for=position_bad, gnss_bad_for=gnss_bad, battery_critical=battery < s.battery_critical,
        battery_home=battery < s.battery_low + s.battery_way * way * 1e-3,
        outside_for=timers("outside", out, now), near_fence=tick.near_fence, lost_near=tick.lost_near,
        deaf_for=timers("deaf", bool(flying) and not fresh, now), few_for=few, clock_bad_for=clock_bad,
        operator_lost=operator_lost, overload=tick.overload, overloads=tick.overloads,
        present=alive and wire.kind == card.autopilot.number and wire.armed is not None,
        fault=boot_fault(card, member, wire, tick.twin), misses=missing,
        due=operator.due(tick.utc, card.turn(member)),
        streamed_for=tick.streamed_for, phase_for=tick.phase_for,
        at_layer=own is not None and abs(own.z - layer) < 0.5, climbing=own is not None and own.vz > 0.2,
        neighbour_near=near, gathered=phase == Phase.GATHER and _gathered(card, own, peers, now),
        time_over=tick.time_over, joined=peers.joined, calm_for=timers("calm", calm, now),
        at_home=own is not None and tick.home is not None and _at_home(card, own, tick.home, layer),
        before=tick.before,
    )  # fmt: skip


def _gnss_bad(card: Card, wire: Wire, now: float) -> bool:
    """Whether the own position cannot be trusted: no fix, too inaccurate, it jumped, or two sources disagree."""
    s = card.safety
    return wire.fix < 3 or wire.h_acc > s.h_acc or now - wire.jumped_at < 1.0 or wire.disagreement(now) > s.jump


def _clock_bad(card: Card, wire: Wire, peers: Peers) -> bool:
    """Whether the own clock is off the autopilot's or all peers'."""
    offset = wire.clock_offset()
    return (offset is not None and abs(offset) > card.safety.clock_error) or peers.clocks_suspect()


def _anybody_near(own: State, peers: Iterable[Peer], distance: float) -> bool:
    """Whether one of these peers is nearer than a distance, m."""
    return any(
        abs(peer.state.x - own.x) < distance and apart(own, peer.state) < distance  # the first spares most roots
        for peer in peers
        if peer.state is not None
    )


def _gathered(card: Card, own: State | None, peers: Peers, now: float) -> bool:
    """Whether all members have gathered around the own position."""
    return own is not None and all(
        now - peer.heard_at <= FRESH
        and peer.phase in GATHERED
        and peer.state is not None
        and apart(own, peer.state) < card.safety.gather
        for peer in peers.all.values()
    )


def _at_home(card: Card, own: State, home: tuple[float, float, float], layer: float) -> bool:
    """Whether the drone hovers above its home in its own layer."""
    over = norm(own.x - home[0], own.y - home[1], 0.0) < card.safety.home_radius and abs(own.z - layer) < 1.0
    return over and norm(own.vx, own.vy, 0.0) < SLOW
