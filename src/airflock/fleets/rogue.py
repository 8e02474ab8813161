"""False packets: what somebody sends who hears the drones, without their key or with it; what a drone itself does."""

import struct
from collections.abc import Callable

from airflock.core import State
from airflock.drones import (
    HEADER_LENGTH,
    SIGNING_EPOCH,
    STATUS_MESSAGE,
    DroneStatus,
    PacketSigner,
    dialect,
    parse_status,
    status_message,
)
from airflock.fleets.starting import SOFTWARE_KEY
from airflock.support import FlightSite

WRONG_KEY = bytes(32)  # a key that no fleet has
NEWER_BY = 1000  # µs; by which a false state is newer than the true one: of one age, the first counts
STAMP_FORMAT = struct.Struct("<Q")


def forge_packet(genuine: bytes, site: FlightSite, *, east: float, with_key: bool) -> bytes:
    """A packet that says that the sender of a genuine one is elsewhere.

    east : how far east of where it is, m; with_key: signed as its sender would, one stamp later
    """
    told, stamp = _status_and_stamp(genuine, site)
    x, y, z = told.position
    sign = PacketSigner(SOFTWARE_KEY if with_key else WRONG_KEY, genuine[5], last=stamp)
    false = told._replace(position=(x + east, y, z), time=told.time + NEWER_BY)
    return sign(status_message(false, site), SIGNING_EPOCH + 10 * stamp)


def falsify_packet(genuine: bytes, site: FlightSite, tell: Callable[[State], State]) -> bytes:
    """What a drone sends in place of a genuine packet of its own: another state of the same time, signed as that is."""
    told, stamp = _status_and_stamp(genuine, site)
    false = tell(State(*told.position, *told.velocity))
    if false == (*told.position, *told.velocity):
        return genuine
    sign = PacketSigner(SOFTWARE_KEY, genuine[5], last=stamp - 1)
    return sign(status_message(told._replace(position=false[:3], velocity=false[3:]), site), SIGNING_EPOCH + 10 * stamp)


def _status_and_stamp(genuine: bytes, site: FlightSite) -> tuple[DroneStatus, int]:
    """What a packet of a node of this fleet says, and its stamp."""
    told = parse_status(
        dialect.message_fields(STATUS_MESSAGE, genuine[HEADER_LENGTH : HEADER_LENGTH + genuine[1]]), site
    )
    assert told is not None, "what a node of this fleet sent"
    return told, STAMP_FORMAT.unpack(genuine[-12:-6] + b"\0\0")[0]
