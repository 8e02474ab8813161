"""What a node asks its autopilot before it flies, and what it tells its neighbours."""

from airflock.core import State
from airflock.drones.mavlink.autopilots import Autopilot, AutopilotCommands
from airflock.drones.mavlink.status import DroneStatus
from airflock.drones.onboard.card import FlightCard
from airflock.drones.onboard.mission import MissionPhase
from airflock.drones.onboard.wire import AutopilotLink

ORIGIN_MESSAGE = 49
UNKNOWN_CLOCK_ERROR = 2.5  # s; error of a clock that nobody has compared yet, as large as a packet can tell


def requests(commands: AutopilotCommands, autopilot: Autopilot, link: AutopilotLink) -> list[bytes]:
    """What is still to be asked of the autopilot: parameters, origin, streams."""
    asked = [
        commands.request_parameter(guard.name)
        for guard in autopilot.parameter_checks
        if guard.name not in link.parameters
    ]
    if link.origin is None:
        asked.append(commands.request_message(ORIGIN_MESSAGE))
    if link.state is None or link.is_landed is None or not link.clock_offsets:
        asked += commands.request_streams()
    return asked


def own_status(
    card: FlightCard, link: AutopilotLink, own: State, time: int, phase: MissionPhase, *, peers: int
) -> DroneStatus:
    """The own status at a time (µs of Unix time), with how many peers are heard."""
    offset = link.clock_offset()
    return DroneStatus(
        time=time,
        position=own[:3],
        velocity=own[3:],
        accuracy=min(link.horizontal_accuracy, 65.0),
        phase=int(phase),
        is_airborne=link.is_landed is False,
        mission=card.mission,
        card=bytes.fromhex(card.hash)[:4],
        battery=round(link.battery or 0.0),
        clock_error=UNKNOWN_CLOCK_ERROR if offset is None else abs(offset),
        peers=peers,
    )
