"""What a node asks its autopilot before it flies, and what it tells its neighbours."""

from airflock.core.agent import State
from airflock.drones.mavlink.autopilots import Autopilot, Speaker
from airflock.drones.mavlink.status import Status
from airflock.drones.onboard.card import Card
from airflock.drones.onboard.mission import Phase
from airflock.drones.onboard.wire import Wire

GPS_GLOBAL_ORIGIN = 49
UNKNOWN = 2.5  # s; error of a clock that nobody has compared yet, as large as a packet can tell


def questions(say: Speaker, autopilot: Autopilot, wire: Wire) -> list[bytes]:
    """What is still to be asked of the autopilot: parameters, origin, streams."""
    asked = [say.request_parameter(guard.name) for guard in autopilot.guards if guard.name not in wire.parameters]
    if wire.origin is None:
        asked.append(say.request_message(GPS_GLOBAL_ORIGIN))
    if wire.state is None or wire.landed is None or not wire.clocks:
        asked += say.request_streams()
    return asked


def own_status(card: Card, wire: Wire, own: State, time: int, phase: Phase, *, peers: int) -> Status:
    """The own status at a time (µs of Unix time), with how many peers are heard."""
    offset = wire.clock_offset()
    return Status(
        time=time, position=own[:3], velocity=own[3:], accuracy=min(wire.h_acc, 65.0), phase=int(phase),
        airborne=wire.landed is False, mission=card.mission, card=bytes.fromhex(card.hash)[:4],
        battery=round(wire.battery or 0.0), clock_error=UNKNOWN if offset is None else abs(offset), peers=peers,
    )  # fmt: skip
